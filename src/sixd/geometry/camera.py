"""Cameras behind one protocol: pinhole, FISHEYE624 (HOT3D), Kannala-Brandt."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NoReturn, Protocol, runtime_checkable

import numpy as np

from sixd.errors import FormatError, Problem, ShapeError, check_shape
from sixd.geometry.pose import Floats


@runtime_checkable
class Camera(Protocol):
    """What a metric or a renderer asks of a camera. Frame: OpenCV (x right, y down, z forward)."""

    def project(self, points_mm: Floats) -> Floats:
        """Points ``(..., 3)`` in the camera frame, mm -> ``(..., 2)`` px; no test for z <= 0."""
        ...

    def unproject(self, pixels_px: Floats) -> Floats:
        """Pixels ``(..., 2)`` -> unit rays ``(..., 3)`` in the camera frame."""
        ...


@dataclass(frozen=True, eq=False)
class PinholeCamera:
    """Perspective camera, skew included.

    Points behind the camera are mirrored, as the BOP rules compute it; z = 0 gives inf or NaN.
    """

    K: Floats
    """``(3, 3)`` intrinsic matrix, px; last row ``0 0 1``."""

    def __post_init__(self) -> None:
        check_shape("PinholeCamera.K", self.K, (3, 3))

    def project(self, points_mm: Floats) -> Floats:
        """Points ``(..., 3)`` mm -> ``(..., 2)`` px."""
        homogeneous = points_mm @ self.K.T
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels: Floats = homogeneous[..., :2] / homogeneous[..., 2:]
        return pixels

    def unproject(self, pixels_px: Floats) -> Floats:
        """Pixels ``(..., 2)`` -> unit rays ``(..., 3)``."""
        ones = np.ones((*np.shape(pixels_px)[:-1], 1))
        rays = np.concatenate([pixels_px, ones], axis=-1) @ np.linalg.inv(self.K).T
        unit: Floats = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        return unit


@dataclass(frozen=True, eq=False)
class Fisheye624Camera:
    """Fisheye with 6 radial, 2 tangential and 4 thin-prism coefficients (Project Aria, HOT3D).

    Equations: hand_tracking_toolkit's ``OVR624CameraModel``; BOP rules for HOT3D.
    """

    params: Floats
    """``(16,)``: fx, fy, cx, cy, k1..k6, p1, p2, s1..s4. ``(15,)`` is taken too: one f for both."""

    def __post_init__(self) -> None:
        params = np.array(self.params, np.float64)
        if params.shape == (15,):
            params = np.concatenate([params[:1], params])
        if params.shape != (16,):
            raise ShapeError(
                f"Fisheye624Camera.params must have shape (16,) or (15,), got {params.shape}"
            )
        object.__setattr__(self, "params", params)

    def project(self, points_mm: Floats) -> Floats:
        """Points ``(..., 3)`` mm -> ``(..., 2)`` px; any direction but straight back is defined."""
        xy, z = points_mm[..., :2], points_mm[..., 2:]
        radius = np.linalg.norm(xy, axis=-1, keepdims=True)
        angle = np.arctan2(radius, z)
        plane = xy * (angle / np.maximum(radius, 2.0**-128))
        pixels: Floats = self._distort(plane)[0] * self.params[:2] + self.params[2:4]
        return pixels

    def unproject(self, pixels_px: Floats) -> Floats:
        """Pixels ``(..., 2)`` -> unit rays ``(..., 3)``; NaN where no ray below 180 deg is found.

        Newton's method on the distortion, started at the undistorted guess.
        """
        wanted = (np.asarray(pixels_px) - self.params[2:4]) / self.params[:2]
        plane = wanted.copy()
        with np.errstate(all="ignore"):
            for _ in range(50):
                value, jacobian = self._distort(plane)
                (a, b), (c, d) = np.moveaxis(jacobian, (-2, -1), (0, 1))
                gap = wanted - value
                step = (
                    np.stack(
                        [d * gap[..., 0] - b * gap[..., 1], a * gap[..., 1] - c * gap[..., 0]],
                        axis=-1,
                    )
                    / (a * d - b * c)[..., None]
                )
                # A step of at most half a radian: far out the polynomial is steep.
                length = np.linalg.norm(step, axis=-1, keepdims=True)
                plane = plane + step * np.minimum(1, 0.5 / np.maximum(length, 1e-300))
                if not (length > 1e-15).any():
                    break
            residual = np.abs(self._distort(plane)[0] - wanted).max(axis=-1, keepdims=True)
            angle = np.linalg.norm(plane, axis=-1, keepdims=True)
        found = (residual < 1e-9) & (angle <= np.pi)
        rays = np.concatenate([plane * np.sinc(angle / np.pi), np.cos(angle)], axis=-1)
        return np.where(found, rays, np.nan)

    def _distort(self, plane: Floats) -> tuple[Floats, Floats]:
        """Distorted coordinates ``(..., 2)`` of an angle plane; Jacobian ``(..., 2, 2)``."""
        k, (p1, p2), (s1, s2, s3, s4) = self.params[4:10], self.params[10:12], self.params[12:]
        angle2 = np.minimum((plane * plane).sum(axis=-1, keepdims=True), np.pi**2)
        gain = 1 + angle2 * np.polyval(k[::-1], angle2)
        slope = np.polyval(k[::-1] * np.arange(6, 0, -1), angle2)  # d gain / d angle2
        q = plane * gain
        x, y = q[..., 0], q[..., 1]
        r2 = x * x + y * y
        distorted = np.stack(
            [
                x + 2 * p2 * x * y + p1 * (r2 + 2 * x * x) + r2 * (s1 + s2 * r2),
                y + 2 * p1 * x * y + p2 * (r2 + 2 * y * y) + r2 * (s3 + s4 * r2),
            ],
            axis=-1,
        )
        prism_x, prism_y = 2 * (s1 + 2 * s2 * r2), 2 * (s3 + 2 * s4 * r2)
        outer = np.stack(
            [
                np.stack(
                    [1 + 2 * p2 * y + (6 * p1 + prism_x) * x, 2 * p2 * x + (2 * p1 + prism_x) * y],
                    -1,
                ),
                np.stack(
                    [2 * p1 * y + (2 * p2 + prism_y) * x, 1 + 2 * p1 * x + (6 * p2 + prism_y) * y],
                    -1,
                ),
            ],
            axis=-2,
        )
        inner = (
            gain[..., None] * np.eye(2)
            + 2 * slope[..., None] * plane[..., :, None] * plane[..., None, :]
        )
        return distorted, outer @ inner


@dataclass(frozen=True, eq=False)
class KannalaBrandtCamera:
    """Equidistant fisheye with four radial coefficients (Kannala & Brandt 2006; OpenCV fisheye)."""

    params: Floats
    """``(8,)``: fx, fy, cx, cy, k1..k4."""

    def __post_init__(self) -> None:
        check_shape("KannalaBrandtCamera.params", self.params, (8,))

    def as_fisheye624(self) -> Fisheye624Camera:
        """The same camera: FISHEYE624 with all other coefficients zero."""
        return Fisheye624Camera(np.concatenate([self.params, np.zeros(8)]))

    def project(self, points_mm: Floats) -> Floats:
        """Points ``(..., 3)`` mm -> ``(..., 2)`` px."""
        return self.as_fisheye624().project(points_mm)

    def unproject(self, pixels_px: Floats) -> Floats:
        """Pixels ``(..., 2)`` -> unit rays ``(..., 3)``; NaN where there is none."""
        return self.as_fisheye624().unproject(pixels_px)


def _pinhole_from_params(params: Floats) -> PinholeCamera:
    fx, fy, cx, cy = params
    return PinholeCamera(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]))


# Names seen in BOP-H3 files, in hand_tracking_toolkit and in projectaria_tools.
_PINHOLE, _FISHEYE, _KANNALA = (
    (_pinhole_from_params, (4,)),
    (Fisheye624Camera, (15, 16)),
    (KannalaBrandtCamera, (8,)),
)
_CAM_MODELS: dict[str, tuple[Any, tuple[int, ...]]] = {
    "PinholePlane": _PINHOLE,
    "PinholePlaneCameraModel": _PINHOLE,
    "CameraModelType.LINEAR": _PINHOLE,
    "CameraModelType.PINHOLE": _PINHOLE,
    "CameraModelType.FISHEYE624": _FISHEYE,
    "OculusVisionFishEye624": _FISHEYE,
    "CameraModelType.KANNALA_BRANDT_K3": _KANNALA,
}


def camera_from_bop(entry: Mapping[str, Any], *, file: str = "") -> Camera:
    """The camera of one entry of a ``scene_camera.json``: ``cam_K`` or ``cam_model`` (BOP-H3).

    Args:
        entry: the decoded JSON object of one image.
        file: where it was read, for messages.

    Raises:
        FormatError: neither or both keys, an unknown model, a wrong number of values, values that
            are not finite, a focal length of zero.
    """
    if ("cam_K" in entry) == ("cam_model" in entry):
        got = "both" if "cam_K" in entry else "keys " + ", ".join(sorted(map(str, entry))) or "none"
        _fail(file, "", "no unambiguous camera", "either cam_K or cam_model", got)
    return _pinhole(entry["cam_K"], file) if "cam_K" in entry else _any(entry["cam_model"], file)


def _pinhole(cam_K: Any, file: str) -> PinholeCamera:
    K = _numbers(cam_K, (9,), file, "cam_K").reshape(3, 3)
    if K[0, 0] == 0 or K[1, 1] == 0 or K[2].tolist() != [0, 0, 1]:
        expected = "fx, fy not 0, last row 0 0 1"
        _fail(file, "cam_K", "not an intrinsic matrix", expected, str(K.tolist()))
    return PinholeCamera(K)


def _any(model: Any, file: str) -> Camera:
    """The camera of a ``cam_model``."""
    if not isinstance(model, Mapping):
        expected = "an object with projection_model_type"
        _fail(file, "cam_model", "not an object", expected, repr(model))
    name, field = model.get("projection_model_type"), "cam_model.projection_model_type"
    if not isinstance(name, str) or name not in _CAM_MODELS:
        known = ", ".join(sorted(_CAM_MODELS))
        _fail(file, field, "unknown camera model", f"one of {known}", repr(name))
    build, counts = _CAM_MODELS[name]
    field = "cam_model.projection_params"
    params = _numbers(model.get("projection_params"), counts, file, field)
    if params[0] == 0 or (len(params) != 15 and params[1] == 0):
        _fail(file, field, "focal length of zero", "a focal length in pixels", "0")
    camera: Camera = build(params)
    return camera


def _numbers(values: Any, counts: tuple[int, ...], file: str, field: str) -> Floats:
    try:
        array = np.asarray(values, np.float64).ravel()
    except (TypeError, ValueError):
        array = np.zeros(0)
    if len(array) not in counts or not np.isfinite(array).all():
        want = " or ".join(map(str, counts)) + " finite numbers"
        _fail(file, field, "wrong camera parameters", want, repr(values)[:200])
    return array


def _fail(file: str, field: str, what: str, expected: str, got: str) -> NoReturn:
    fix = "see the BOP format of scene_camera.json"
    raise FormatError(
        [Problem("bad-camera", what, file=file, field=field, expected=expected, got=got, fix=fix)]
    )
