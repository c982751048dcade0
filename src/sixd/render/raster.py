"""Depth of a mesh at a pose under a pinhole camera: the fast rasteriser."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sixd.errors import ShapeError, UsageError, check_shape
from sixd.geometry.mesh import Mesh
from sixd.geometry.pose import Floats, Pose
from sixd.render.clipping import NEAR_MM, clip_at_near_plane

MAX_SIDE_PX = 32767
"""Pixel columns and rows are packed into 16 bits each, one of them signed."""
CACHED_VERTICES = 8192
"""More do not fit the cache: then sorting pays for meshes in random order, as scans are."""


@dataclass(frozen=True, eq=False)
class RenderMesh:
    """A mesh laid out for the rasteriser; build it once per object."""

    vertices_mm: Floats
    """``(3, V)``: all x, all y, all z."""
    faces: NDArray[np.uint32]
    """``(F, 3)``."""

    @classmethod
    def build(cls, mesh: Mesh) -> RenderMesh:
        """Take over the vertices and faces of a mesh, in an order that is kind to the cache."""
        vertices_mm, faces = mesh.vertices_mm, mesh.faces.astype(np.uint32)
        if len(vertices_mm) > CACHED_VERTICES:
            order = _morton_order(vertices_mm)
            rank = np.zeros(len(order), np.uint32)
            rank[order] = np.arange(len(order))
            vertices_mm, faces = vertices_mm[order], rank[faces]
            faces = faces[np.argsort(faces.min(axis=1))]
        return cls(np.ascontiguousarray(vertices_mm.T), faces)


@dataclass(frozen=True, eq=False)
class Crop:
    """The part of an image that an object covers, clipped to the image."""

    x0: int
    """Image column of the first pixel."""
    y0: int
    """Image row of the first pixel."""
    depth_mm: Floats
    """``(h, w)`` along the optical axis, 0 = background; ``(0, 0)`` if nothing is in the image."""


class Window(NamedTuple):
    """A rendering in the scratch memory of this thread, until its next rendering."""

    x0: int
    y0: int
    width: int
    height: int
    inverse_z: Floats
    """``(height + 1, width + 1)`` 1/mm, 0 = background; the last column and row mean nothing."""


def projection_matrices(pose_c_m: Pose, K: Floats) -> Floats:
    """``K [R | t]``, ``(..., 3, 4)``: model points, mm, to ``(u z, v z, z)``.

    Raises:
        UsageError: K or a pose is not finite, or K is no pinhole matrix.
    """
    check_shape("K", K, (3, 3))
    matrices: Floats = K @ np.concatenate([pose_c_m.R, pose_c_m.t_mm[..., None]], axis=-1)
    if not np.isfinite(matrices).all():
        raise UsageError("poses and K must be finite")
    if np.any(K[2] != (0, 0, 1)) or K[0, 0] == 0 or K[1, 1] == 0:
        raise UsageError(f"K must be a pinhole matrix with last row 0 0 1, got {K.tolist()}")
    return matrices


def render_crop(
    mesh: Mesh | RenderMesh, pose_c_m: Pose, K: Floats, size_px: tuple[int, int]
) -> Crop:
    """Depth of the object, only where it can be: the box of its projected vertices.

    Pixel i samples u = i + 0.5; no culling; the nearest surface wins; what is nearer to the camera
    plane than `NEAR_MM` is cut away (BOP rules; definition: `sixd.render.reference`).

    Args:
        mesh: build a `RenderMesh` once if it is rendered often.
        pose_c_m: one pose.
        K: ``(3, 3)``, px.
        size_px: ``(width, height)`` of the image.

    Raises:
        UsageError: a number is not finite, or K is no pinhole matrix.
        ShapeError: more than one pose, or an image without pixels or with too many.
    """
    if pose_c_m.batch_shape:
        raise ShapeError(f"one pose is rendered at a time, got a batch {pose_c_m.batch_shape}")
    prepared = mesh if isinstance(mesh, RenderMesh) else RenderMesh.build(mesh)
    window = draw(prepared, projection_matrices(pose_c_m, K), size_px)
    inverse_z = window.inverse_z[:-1, :-1]
    depth_mm = np.zeros(inverse_z.shape)
    np.divide(1.0, inverse_z, out=depth_mm, where=inverse_z > 0)
    return Crop(window.x0, window.y0, depth_mm)


def render_depth(
    mesh: Mesh | RenderMesh, pose_c_m: Pose, K: Floats, size_px: tuple[int, int]
) -> Floats:
    """Depth image ``(H, W)`` of the object, mm, 0 = background; otherwise as `render_crop`."""
    crop = render_crop(mesh, pose_c_m, K, size_px)
    depth_mm = np.zeros((size_px[1], size_px[0]))
    height, width = crop.depth_mm.shape
    depth_mm[crop.y0 : crop.y0 + height, crop.x0 : crop.x0 + width] = crop.depth_mm
    return depth_mm


def draw(mesh: RenderMesh, P: Floats, size_px: tuple[int, int]) -> Window:
    """Rasterise into scratch memory; for callers that make something else than a `Crop` of it.

    Args:
        mesh: the object.
        P: ``(3, 4)``, one of `projection_matrices`.
        size_px: ``(width, height)``.
    """
    if not 0 < min(size_px) <= max(size_px) <= MAX_SIDE_PX:
        raise ShapeError(f"images must have sides of 1 to {MAX_SIDE_PX} px, got {size_px}")
    window = _draw(mesh.vertices_mm, mesh.faces, P, size_px)
    if window is None:
        points, faces = clip_at_near_plane(mesh.vertices_mm.T @ P[:, :3].T + P[:, 3], mesh.faces)
        window = _draw(np.ascontiguousarray(points.T), faces, np.eye(3, 4), size_px)
        assert window is not None
    return window


def _draw(
    vertices: Floats, faces: NDArray[np.uint32], P: Floats, size_px: tuple[int, int]
) -> Window | None:
    """`draw` without clipping: None if a vertex is too near."""
    from sixd.render.depth_kernels import rasterise

    if len(_scratch.cells) < vertices.shape[1]:
        n = vertices.shape[1]
        _scratch.projected, _scratch.cells = np.zeros(4 * n), np.zeros(n, np.int32)
    while True:
        x0, y0, x1, y1, behind = rasterise(
            vertices,
            faces,
            P,
            NEAR_MM,
            *size_px,
            _scratch.projected,
            _scratch.cells,
            _scratch.inverse_z,
        )
        if behind:
            return None
        if x1 <= x0 or y1 <= y0:
            return _NOTHING
        width, height = x1 - x0, y1 - y0
        n_values = (width + 1) * (height + 1)
        if n_values <= len(_scratch.inverse_z):
            inverse_z = _scratch.inverse_z[:n_values].reshape(height + 1, width + 1)
            return Window(x0, y0, width, height, inverse_z)
        _scratch.inverse_z = np.zeros(n_values)


def _morton_order(points: Floats) -> NDArray[np.int64]:
    """Order along a curve that keeps neighbours in space together: interleaved bits of x, y, z."""
    low = points.min(axis=0)
    span = (points.max(axis=0) - low).max()
    grid = ((points - low) * (1023 / span if span else 0)).astype(np.uint32)
    for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):
        grid = (grid | grid << np.uint32(shift)) & np.uint32(mask)
    order: NDArray[np.int64] = np.argsort(grid[:, 0] | grid[:, 1] << 1 | grid[:, 2] << 2)
    return order


class _Scratch(threading.local):
    """Buffers that each thread keeps, so that a rendering allocates nothing."""

    def __init__(self) -> None:
        self.projected = np.zeros(0)
        self.cells = np.zeros(0, np.int32)
        self.inverse_z = np.zeros(1 << 16)


_scratch = _Scratch()
_NOTHING = Window(0, 0, 0, 0, np.zeros((1, 1)))
