"""The errors of `sixd.metrics.reference` for many pairs of one object, compiled.

The same definitions to rounding, in microseconds a pair: see `sixd.metrics.kernels` for how, and
``benchmarks/metrics.py`` for how fast. The first call compiles; the code is kept on disk. Every
function runs on one core and releases the GIL meanwhile: threads are the caller's business.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from sixd.errors import ShapeError, UsageError
from sixd.geometry.camera import Camera, Fisheye624Camera, KannalaBrandtCamera, PinholeCamera
from sixd.geometry.pose import Floats, Pose
from sixd.metrics import kernels
from sixd.metrics.cells import VertexCells

_N_PROBES = 5
"""Vertices looked at under every symmetry, before any symmetry is looked at wholly."""


def mssd(est: Pose, gt: Pose, cells: VertexCells, symmetries: Pose) -> Floats:
    """`reference.mssd`, mm.

    Args:
        est: model-to-camera poses, batch shape ``(N,)``.
        gt: as ``est``; row i is compared with row i.
        cells: the model's vertices.
        symmetries: batch shape ``(S,)``, identity included.

    Returns:
        ``(N,)``; infinite for a pose that is not finite.
    """
    return _symmetric_max(est, gt, cells, symmetries, None)


def mspd(est: Pose, gt: Pose, cells: VertexCells, symmetries: Pose, K: Floats) -> Floats:
    """`reference.mspd` for pinhole cameras, px.

    Args:
        est: model-to-camera poses, batch shape ``(N,)``.
        gt: as ``est``; row i is compared with row i.
        cells: the model's vertices.
        symmetries: batch shape ``(S,)``, identity included.
        K: intrinsic matrices, ``(N, 3, 3)`` or one ``(3, 3)``.

    Returns:
        ``(N,)``; infinite for a pose that is not finite or a vertex without projection.
    """
    return _symmetric_max(est, gt, cells, symmetries, _of_pairs("K", K, est, (3, 3)))


def mspd_fisheye624(
    est: Pose, gt: Pose, cells: VertexCells, symmetries: Pose, params: Floats
) -> Floats:
    """`reference.mspd` for FISHEYE624 cameras, px.

    Args:
        est: model-to-camera poses, batch shape ``(N,)``.
        gt: as ``est``; row i is compared with row i.
        cells: the model's vertices.
        symmetries: batch shape ``(S,)``, identity included.
        params: of each pair, ``(N, 16)``, or one ``(16,)``; see `Fisheye624Camera.params`.

    Returns:
        ``(N,)``; infinite for a pose that is not finite.
    """
    from sixd.metrics.fisheye import mspd_fisheye_pairs

    params = np.ascontiguousarray(_of_pairs("params", params, est, (16,)))
    probes = _probes(cells, symmetries)
    points = np.concatenate([probes, cells.points_mm])
    sym = _matrices(symmetries)

    def kernel(est: Floats, gt: Floats, rows: NDArray[np.intp], out: Floats) -> None:
        work = np.zeros(len(sym)), np.zeros((len(points), 2))
        mspd_fisheye_pairs(est, gt, sym, params[rows], points, len(probes), *work, out)

    return _run(kernel, est, gt)


def mspd_cameras(
    est: Pose,
    gt: Pose,
    cells: VertexCells,
    symmetries: Pose,
    cameras: Sequence[Camera] | Camera,
) -> Floats:
    """`reference.mspd`: `mspd` or `mspd_fisheye624`, as each pair's camera asks.

    Raises:
        UsageError: a camera of another kind.
    """
    of_pair = [cameras] * len(est) if isinstance(cameras, Camera) else list(cameras)
    if len(of_pair) != len(est):
        raise ShapeError(f"cameras must be one or {len(est)}, as many as pairs, got {len(of_pair)}")
    errors = np.zeros(len(est))
    pinhole = np.array([isinstance(c, PinholeCamera) for c in of_pair], bool)
    if pinhole.any():
        K = np.array([c.K for c in of_pair if isinstance(c, PinholeCamera)])
        errors[pinhole] = mspd(est[pinhole], gt[pinhole], cells, symmetries, K)
    if not pinhole.all():
        fish = ~pinhole
        params = np.array([_fisheye_params(of_pair[i]) for i in np.flatnonzero(fish)])
        errors[fish] = mspd_fisheye624(est[fish], gt[fish], cells, symmetries, params)
    return errors


def add(est: Pose, gt: Pose, cells: VertexCells) -> Floats:
    """`reference.add`, mm: ``(N,)``."""
    return _mean(est, gt, cells, None)


def projection(est: Pose, gt: Pose, cells: VertexCells, K: Floats) -> Floats:
    """`reference.projection` for pinhole cameras, K ``(N, 3, 3)`` or ``(3, 3)``; px: ``(N,)``."""
    return _mean(est, gt, cells, _of_pairs("K", K, est, (3, 3)))


def adi(est: Pose, gt: Pose, cells: VertexCells) -> Floats:
    """`reference.adi`, mm: ``(N,)``."""
    from sixd.metrics.mean_kernels import adi_pairs

    points = np.ascontiguousarray(cells.points_mm.T)

    def kernel(est: Floats, gt: Floats, rows: NDArray[np.intp], out: Floats) -> None:
        work = points.copy(), cells.groups.copy(), cells.leaves_mm.copy(), *_scratch(cells)
        reach = _stretch(est)
        adi_pairs(est, gt, points, cells.groups, cells.leaves_mm, reach, *work, out)

    return _run(kernel, est, gt)


def _symmetric_max(
    est: Pose, gt: Pose, cells: VertexCells, symmetries: Pose, K: Floats | None
) -> Floats:
    sym = _matrices(symmetries)
    probes = _probes(cells, symmetries)
    moved = np.ascontiguousarray(symmetries.apply(probes).transpose(1, 2, 0))
    tree = cells.groups, cells.leaves_mm

    def kernel(est: Floats, gt: Floats, rows: NDArray[np.intp], out: Floats) -> None:
        if K is not None:
            est, gt = _times(K[rows], est), _times(K[rows], gt)
        work = np.zeros(len(sym)), *_scratch(cells)
        kernels.symmetric_max_pairs(est, gt, sym, probes, moved, *tree, K is not None, *work, out)

    return _run(kernel, est, gt)


def _mean(est: Pose, gt: Pose, cells: VertexCells, K: Floats | None) -> Floats:
    from sixd.metrics.mean_kernels import mean_pairs

    points = np.ascontiguousarray(cells.points_mm.T)

    def kernel(est: Floats, gt: Floats, rows: NDArray[np.intp], out: Floats) -> None:
        if K is not None:
            est, gt = _times(K[rows], est), _times(K[rows], gt)
        work = points.copy(), points.copy()
        mean_pairs(est, gt, points, K is not None, *work, out)

    return _run(kernel, est, gt)


_Kernel = Callable[[Floats, Floats, NDArray[np.intp], Floats], None]


def _run(kernel: _Kernel, est: Pose, gt: Pose) -> Floats:
    """The kernel on finite pairs: it gets their matrices, their rows and room for their errors."""
    if len(est.batch_shape) != 1 or est.batch_shape != gt.batch_shape:
        raise ShapeError(
            f"est and gt must have one batch shape (N,), got {est.batch_shape} and {gt.batch_shape}"
        )
    est_rows, gt_rows = _matrices(est), _matrices(gt)
    finite = np.isfinite(est_rows).all(axis=1) & np.isfinite(gt_rows).all(axis=1)
    rows = np.flatnonzero(finite)
    found = np.zeros(len(rows))
    kernel(est_rows[rows], gt_rows[rows], rows, found)
    errors = np.full(len(est), np.inf)
    errors[rows] = found
    return errors


def _of_pairs(name: str, values: Floats, est: Pose, tail: tuple[int, ...]) -> Floats:
    """One array for all pairs, or one for each: as one for each."""
    values = np.asarray(values, np.float64)
    shape = (*est.batch_shape, *tail)
    if values.shape not in (tail, shape):
        raise ShapeError(f"{name} must have shape {shape} or {tail}, got {values.shape}")
    return np.broadcast_to(values, shape)


def _matrices(poses: Pose) -> Floats:
    """``(N, 12)`` float64: [R | t], row by row."""
    stacked = np.concatenate([poses.R, poses.t_mm[..., None]], axis=-1)
    return np.ascontiguousarray(stacked.reshape(-1, 12), np.float64)


def _times(K: Floats, rows: Floats) -> Floats:
    """K [R | t], ``(N, 12)``."""
    return (K @ rows.reshape(-1, 3, 4)).reshape(-1, 12)


def _stretch(rows: Floats) -> Floats:
    """At least how much each pose stretches any length, ``(N,)``: 1 to rounding for rotations."""
    R = rows.reshape(-1, 3, 4)[..., :3]
    # |R v|^2 = v R^T R v, and the Frobenius norm of R^T R - 1 bounds what that has beyond v v.
    defect = np.linalg.norm(R.swapaxes(1, 2) @ R - np.eye(3), axis=(1, 2))
    stretch: Floats = np.sqrt(1 + defect)
    return stretch


def _scratch(cells: VertexCells) -> tuple[Floats, NDArray[np.int64]]:
    return np.zeros((5, max(128, cells.leaves_mm.shape[2]))), np.zeros(128, np.int64)


def _probes(cells: VertexCells, symmetries: Pose) -> Floats:
    """Vertices ``(P, 3)`` that the symmetries move far, far from each other; P = 0 for one."""
    if len(symmetries.batch_shape) != 1 or not len(symmetries):
        got = symmetries.batch_shape
        raise ShapeError(f"symmetries must have batch shape (S,), S > 0, got {got}")
    candidates = cells.points_mm[:: max(1, len(cells.points_mm) // 512)]
    if len(symmetries) == 1:
        return candidates[:0]
    some = symmetries[:: max(1, len(symmetries) // 16)]
    way = np.linalg.norm(some.apply(candidates) - candidates, axis=-1).max(axis=0)
    chosen = [int(way.argmax())]
    apart = np.full(len(candidates), np.inf)
    for _ in range(_N_PROBES - 1):
        gaps = np.linalg.norm(candidates - candidates[chosen[-1]], axis=1)
        apart = np.minimum(apart, gaps)
        chosen.append(int((apart * (way + 1e-9)).argmax()))
    return np.ascontiguousarray(candidates[chosen])


def _fisheye_params(camera: Camera) -> Floats:
    if isinstance(camera, KannalaBrandtCamera):
        camera = camera.as_fisheye624()
    if not isinstance(camera, Fisheye624Camera):
        raise UsageError(f"no compiled projection for {type(camera).__name__}: use the reference")
    return camera.params
