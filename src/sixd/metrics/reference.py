"""Pose errors as the papers define them, in plain NumPy: the definition every backend is held to.

Poses map model to camera (``pose_c_m``), batch shape ``(N,)``: row i of ``est`` is compared with
row i of ``gt``. Errors come back as ``(N,)``, infinite where a pose is not finite. Thresholds and
normalisation belong to a protocol.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from sixd.errors import ShapeError, UsageError, check_shape
from sixd.geometry.camera import Camera
from sixd.geometry.pose import Floats, Pose


def mssd(est: Pose, gt: Pose, points_mm: Floats, symmetries: Pose) -> Floats:
    """Maximum Symmetry-aware Surface Distance (Hodan et al., BOP Challenge 2020, section 2.2).

    Args:
        est: model-to-camera poses, batch shape ``(N,)``.
        gt: as ``est``; row i is compared with row i.
        points_mm: model vertices, ``(V, 3)``.
        symmetries: model symmetries, batch shape ``(S,)``, identity included.

    Returns:
        ``(N,)`` mm.
    """
    errors = np.zeros(_pair_count(est, gt))
    for i, est_mm, gt_mm in _posed(est, gt, points_mm, symmetries):
        errors[i] = np.linalg.norm(est_mm - gt_mm, axis=-1).max(axis=-1).min()
    return _nan_to_inf(errors)


def mspd(
    est: Pose, gt: Pose, points_mm: Floats, symmetries: Pose, cameras: Sequence[Camera] | Camera
) -> Floats:
    """Maximum Symmetry-aware Projection Distance (Hodan et al., BOP Challenge 2020, section 2.2).

    Points behind the camera are projected like others (BOP rules). Where a projection is not a
    number (z = 0), the distance counts as infinite, so that no estimate gains by it.

    Args:
        est: model-to-camera poses, batch shape ``(N,)``.
        gt: as ``est``; row i is compared with row i.
        points_mm: model vertices, ``(V, 3)``.
        symmetries: model symmetries, batch shape ``(S,)``, identity included.
        cameras: one for all pairs, or N.

    Returns:
        ``(N,)`` px of the image as it is; the factor 640 / width is the caller's.
    """
    of_pair = _per_pair(cameras, _pair_count(est, gt))
    errors = np.zeros(len(of_pair))
    for i, est_mm, gt_mm in _posed(est, gt, points_mm, symmetries):
        errors[i] = _pixel_distances(of_pair[i], est_mm, gt_mm).max(axis=-1).min()
    return errors


def add(est: Pose, gt: Pose, points_mm: Floats) -> Floats:
    """Average Distance of Distinguishable model points (Hinterstoisser et al., ACCV 2012).

    Args:
        est: model-to-camera poses, batch shape ``(N,)``.
        gt: as ``est``; row i is compared with row i.
        points_mm: model vertices, ``(V, 3)``.

    Returns:
        ``(N,)`` mm.
    """
    errors = np.zeros(_pair_count(est, gt))
    for i, est_mm, gt_mm in _posed(est, gt, points_mm, Pose.identity(1)):
        errors[i] = np.linalg.norm(est_mm - gt_mm[0], axis=-1).mean()
    return _nan_to_inf(errors)


def adi(est: Pose, gt: Pose, points_mm: Floats) -> Floats:
    """Average Distance of Indistinguishable model points (Hinterstoisser et al., ACCV 2012).

    For each vertex posed by ``gt``, the distance to the nearest vertex posed by ``est``; their
    mean. Known as ADD-S or ADI.

    Returns:
        ``(N,)`` mm.
    """
    errors = np.zeros(_pair_count(est, gt))
    for i, est_mm, gt_mm in _posed(est, gt, points_mm, Pose.identity(1)):
        total = 0.0
        rows = max(1, 2_000_000 // len(points_mm))
        for start in range(0, len(points_mm), rows):
            gaps = gt_mm[0, start : start + rows, None] - est_mm[None]
            total += float(np.linalg.norm(gaps, axis=-1).min(axis=1).sum())
        errors[i] = total / len(points_mm)
    return _nan_to_inf(errors)


def projection(
    est: Pose, gt: Pose, points_mm: Floats, cameras: Sequence[Camera] | Camera
) -> Floats:
    """Average distance of projected vertices (Brachmann et al., CVPR 2016).

    Args:
        est: model-to-camera poses, batch shape ``(N,)``.
        gt: as ``est``; row i is compared with row i.
        points_mm: model vertices, ``(V, 3)``.
        cameras: one for all pairs, or N.

    Returns:
        ``(N,)`` px; infinite where a vertex has no projection.
    """
    of_pair = _per_pair(cameras, _pair_count(est, gt))
    errors = np.zeros(len(of_pair))
    for i, est_mm, gt_mm in _posed(est, gt, points_mm, Pose.identity(1)):
        errors[i] = _pixel_distances(of_pair[i], est_mm, gt_mm[0]).mean()
    return errors


def rotation_error_deg(est: Pose, gt: Pose, symmetries: Pose | None = None) -> Floats:
    """Angle of the rotation between the poses (Hodan et al., ECCV Workshops 2016, eq. 5).

    Args:
        est: model-to-camera poses, batch shape ``(N,)``.
        gt: as ``est``; row i is compared with row i.
        symmetries: batch shape ``(S,)``; the smallest angle over them. None: identity alone.

    Returns:
        ``(N,)`` degrees, 0 to 180.
    """
    _pair_count(est, gt)
    R_gt = gt.R[:, None] if symmetries is None else gt.R[:, None] @ symmetries.R
    # trace(R_est R_gt^-1), with the true inverse as the BOP rules have it.
    with np.errstate(invalid="ignore"):
        trace = np.einsum("nij,nsji->ns", est.R, np.linalg.inv(R_gt))
    # Only finite traces are clipped: an infinite one is no half or whole turn.
    cosine = np.where(np.isfinite(trace), np.clip((trace - 1) / 2, -1, 1), np.nan)
    return _nan_to_inf(np.degrees(np.arccos(cosine)).min(axis=1))


def translation_error_mm(est: Pose, gt: Pose, symmetries: Pose | None = None) -> Floats:
    """Distance of the model origins (Hodan et al., ECCV Workshops 2016, eq. 6).

    Args:
        est: model-to-camera poses, batch shape ``(N,)``.
        gt: as ``est``; row i is compared with row i.
        symmetries: batch shape ``(S,)``; the smallest distance over them. None: identity alone.

    Returns:
        ``(N,)`` mm.
    """
    _pair_count(est, gt)
    moved = gt[:, None] @ (Pose.identity(1) if symmetries is None else symmetries)[None]
    return _nan_to_inf(np.linalg.norm(est.t_mm[:, None] - moved.t_mm, axis=-1).min(axis=1))


def within_reach(est: Pose, gt: Pose, diameter_mm: float | Floats) -> NDArray[np.bool_]:
    """Whether the origins are less than a diameter apart: ``(N,)``; False for NaN.

    Where they are not, the BOP protocols set MSSD, ADD and ADI to infinity without computing them,
    no symmetry considered (BOP rules, section 5). Not part of the errors' definition.
    """
    near: NDArray[np.bool_] = translation_error_mm(est, gt) < diameter_mm
    return near


def auc(errors_mm: Floats, max_mm: float = 100.0) -> float:
    """Area under the accuracy-threshold curve, as for ADD and ADD-S in YCB-Video papers.

    The accuracy at a threshold is the share of errors up to it. As in the YCB-Video toolbox (Xiang
    et al., PoseCNN, RSS 2018), each interval between two errors counts with the accuracy at its
    upper end, so the curve leads by one error; the last accuracy holds up to ``max_mm``.

    Args:
        errors_mm: ``(N,)``, one per target; infinity for a target without estimate.
        max_mm: largest threshold; 100 mm in that paper.

    Returns:
        0 to 1; NaN without targets.

    Raises:
        UsageError: ``max_mm`` is not above zero.
    """
    if not max_mm > 0:
        raise UsageError(f"max_mm must be above 0, got {max_mm}")
    n_targets = len(errors_mm)
    if not n_targets:
        return float("nan")
    counted = np.sort(errors_mm[errors_mm <= max_mm])  # neither infinite nor NaN
    accuracy = np.append(np.arange(1, len(counted) + 1), len(counted)) / n_targets
    widths = np.diff(np.concatenate([[0.0], counted, [max_mm]]))
    return float(accuracy @ widths) / max_mm


def _pair_count(est: Pose, gt: Pose) -> int:
    if len(est.batch_shape) != 1 or est.batch_shape != gt.batch_shape:
        raise ShapeError(
            f"est and gt must have one batch shape (N,), got {est.batch_shape} and {gt.batch_shape}"
        )
    return len(est)


def _posed(
    est: Pose, gt: Pose, points_mm: Floats, symmetries: Pose
) -> Iterator[tuple[int, Floats, Floats]]:
    """Pair by pair: vertices under the estimate ``(V, 3)``, under every truth ``(S, V, 3)``."""
    check_shape("points_mm", points_mm, (3,))
    if points_mm.ndim != 2 or not len(points_mm):
        raise ShapeError(f"points_mm must have shape (V, 3) with V > 0, got {points_mm.shape}")
    if len(symmetries.batch_shape) != 1 or not len(symmetries):
        got = symmetries.batch_shape
        raise ShapeError(f"symmetries must have batch shape (S,), S > 0, got {got}")
    for i in range(len(est)):
        with np.errstate(invalid="ignore"):  # poses that are not finite
            posed = est[i].apply(points_mm), (gt[i] @ symmetries).apply(points_mm)
        yield i, *posed


def _per_pair(cameras: Sequence[Camera] | Camera, count: int) -> Sequence[Camera]:
    if isinstance(cameras, Camera):
        return [cameras] * count
    if len(cameras) != count:
        raise ShapeError(f"cameras must be one or {count}, as many as pairs, got {len(cameras)}")
    return cameras


def _pixel_distances(camera: Camera, est_mm: Floats, gt_mm: Floats) -> Floats:
    with np.errstate(invalid="ignore"):  # inf - inf, for points in the camera's plane
        distances = np.linalg.norm(camera.project(est_mm) - camera.project(gt_mm), axis=-1)
    return _nan_to_inf(distances)


def _nan_to_inf(errors: Floats) -> Floats:
    """An error that cannot be computed must never pass for a small one."""
    return np.where(np.isnan(errors), np.inf, errors)
