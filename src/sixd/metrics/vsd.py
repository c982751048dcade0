"""VSD and CUS of many pairs in one image: each pose is rendered once, crops only.

Definition: `sixd.metrics.reference_rendered`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sixd.errors import ShapeError, check_shape
from sixd.geometry.pose import Floats, Pose
from sixd.metrics.reference_rendered import spheres_overlap
from sixd.render.raster import RenderMesh, Window, draw, projection_matrices

Ints = NDArray[np.integer]
Made = TypeVar("Made")


def vsd_pairs(
    depth_mm: NDArray[np.float32],
    K: Floats,
    meshes: Sequence[RenderMesh],
    poses: Pose,
    mesh_index: Ints,
    pairs: Ints,
    diameters_mm: Floats,
    delta_mm: float,
    taus: ArrayLike,
    *,
    tau_in_mm: bool = False,
    sphere_check: bool = True,
    missing_hides: bool = False,
) -> Floats:
    """Visible Surface Discrepancy of pairs of poses in one image (BOP rules 5 and 6).

    Args:
        depth_mm: ``(H, W)`` depth image, float32, 0 = no reading.
        K: ``(3, 3)``, px.
        meshes: the objects.
        poses: ``(Q,)`` estimated and true poses, camera from model.
        mesh_index: ``(Q,)`` which mesh each pose places.
        pairs: ``(P, 2)`` rows of ``poses``: estimate, ground truth.
        diameters_mm: ``(P,)`` of the pair's object.
        delta_mm: tolerance of the visibility test.
        taus: ``(T,)`` tolerances of misalignment, in diameters.
        tau_in_mm: taus are millimetres instead.
        sphere_check: the error is 1 if the bounding spheres do not overlap in the image.
        missing_hides: a pixel without a reading hides the model, as in 2018.

    Returns:
        ``(P, T)`` errors in [0, 1].

    Raises:
        UsageError: a pose or K is not finite.
        ShapeError: the arrays do not go together.
    """
    from sixd.metrics import vsd_kernels

    _check_pairs(poses, mesh_index, pairs, diameters_mm)
    measured_mm = np.ascontiguousarray(depth_mm, np.float32)
    if measured_mm.ndim != 2:
        raise ShapeError(f"depth_mm must have shape (H, W), got {measured_mm.shape}")
    size_px = (measured_mm.shape[1], measured_mm.shape[0])
    intrinsics = (float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2]))
    delta = np.float32(delta_mm)

    def seen(window: Window) -> _Seen:
        distances = np.zeros((window.height, window.width))
        n_visible = vsd_kernels.signed_distances(
            window.inverse_z, window.x0, window.y0, measured_mm, intrinsics, delta, missing_hides,
            distances,
        )  # fmt: skip
        return _Seen((window.x0, window.y0), distances, n_visible)

    taus = np.asarray(taus, np.float64)
    order = np.argsort(taus)
    ascending = taus[order]
    errors = np.ones((len(pairs), len(taus)))
    renderer = _Renderer(meshes, mesh_index, projection_matrices(poses, K), size_px, seen)
    for row, est, gt in renderer.pairs(_worth_rendering(poses, pairs, diameters_mm, sphere_check)):
        n_at_least = np.zeros(len(taus), np.int64)
        unit_mm = 1.0 if tau_in_mm else float(diameters_mm[row])
        n_both, n_hidden = vsd_kernels.compare(
            est.distances_mm, est.at, gt.distances_mm, gt.at, unit_mm, ascending, n_at_least
        )
        n_either = gt.n_visible + est.n_visible + n_hidden - n_both
        if n_either:
            errors[row] = (n_at_least + n_either - n_both) / n_either
    return errors[:, np.argsort(order)]


def cus_pairs(
    K: Floats,
    size_px: tuple[int, int],
    meshes: Sequence[RenderMesh],
    poses: Pose,
    mesh_index: Ints,
    pairs: Ints,
    diameters_mm: Floats,
    *,
    sphere_check: bool = True,
) -> Floats:
    """Complement over Union of Silhouettes, 1 - IoU, of pairs of poses in one image (BOP rules 5).

    Args and errors: as `vsd_pairs`; ``size_px`` is ``(width, height)``.

    Returns:
        ``(P,)`` errors in [0, 1].
    """
    _check_pairs(poses, mesh_index, pairs, diameters_mm)
    errors = np.ones(len(pairs))
    renderer = _Renderer(meshes, mesh_index, projection_matrices(poses, K), size_px, _silhouette)
    for row, est, gt in renderer.pairs(_worth_rendering(poses, pairs, diameters_mm, sphere_check)):
        n_both = np.count_nonzero(np.logical_and(*_overlap(est, gt)))
        n_either = est.n_pixels + gt.n_pixels - n_both
        if n_either:
            errors[row] = 1.0 - n_both / n_either
    return errors


class _Seen(NamedTuple):
    """One pose against the depth image."""

    at: tuple[int, int]
    distances_mm: Floats
    """``(h, w)``: negative where hidden, 0 = background."""
    n_visible: int


class _Silhouette(NamedTuple):
    at: tuple[int, int]
    mask: NDArray[np.bool_]
    n_pixels: int


def _silhouette(window: Window) -> _Silhouette:
    mask = window.inverse_z[:-1, :-1] > 0
    return _Silhouette((window.x0, window.y0), mask, int(np.count_nonzero(mask)))


def _overlap(a: _Silhouette, b: _Silhouette) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """The parts of both masks that lie in both crops."""
    low = np.maximum(a.at, b.at)
    high = np.minimum(*(np.add(s.at, s.mask.shape[::-1]) for s in (a, b)))
    x, y = (slice(lo, max(lo, hi)) for lo, hi in zip(low, high, strict=True))

    def part(s: _Silhouette) -> NDArray[np.bool_]:
        return s.mask[y.start - s.at[1] : y.stop - s.at[1], x.start - s.at[0] : x.stop - s.at[0]]

    return part(a), part(b)


def _check_pairs(poses: Pose, mesh_index: Ints, pairs: Ints, diameters_mm: Floats) -> None:
    check_shape("pairs", pairs, (2,))
    if (len(poses),) != np.shape(mesh_index) or (len(pairs),) != np.shape(diameters_mm):
        raise ShapeError(
            f"mesh_index must have shape ({len(poses)},) and diameters_mm ({len(pairs)},), "
            f"got {np.shape(mesh_index)} and {np.shape(diameters_mm)}"
        )


def _worth_rendering(
    poses: Pose, pairs: Ints, diameters_mm: Floats, sphere_check: bool
) -> list[tuple[int, int, int]]:
    """``(row, estimate, ground truth)`` of the pairs to render, those of an estimate together."""
    rows = np.argsort(pairs[:, 0], kind="stable")
    if sphere_check:
        est_mm, gt_mm = poses.t_mm[pairs[rows, 0]], poses.t_mm[pairs[rows, 1]]
        rows = rows[spheres_overlap(est_mm, gt_mm, np.asarray(diameters_mm)[rows])]
    return [(int(row), int(pairs[row, 0]), int(pairs[row, 1])) for row in rows]


class _Renderer(Generic[Made]):
    """Renders the poses of pairs when they are first needed, and forgets estimates after use.

    True poses stay: few, and needed again; so memory does not grow with the number of estimates.
    """

    def __init__(
        self,
        meshes: Sequence[RenderMesh],
        mesh_index: Ints,
        matrices: Floats,
        size_px: tuple[int, int],
        make: Callable[[Window], Made],
    ) -> None:
        self.meshes, self.mesh_index, self.matrices = meshes, mesh_index, matrices
        self.size_px, self.make = size_px, make

    def render(self, q: int) -> Made:
        return self.make(draw(self.meshes[self.mesh_index[q]], self.matrices[q], self.size_px))

    def pairs(self, rows: list[tuple[int, int, int]]) -> Iterator[tuple[int, Made, Made]]:
        kept: dict[int, Made] = {}
        last: tuple[int, Made] | None = None
        for row, est, gt in rows:
            if gt not in kept:
                kept[gt] = self.render(gt)
            if est in kept:
                rendered = kept[est]
            elif last is not None and last[0] == est:
                rendered = last[1]
            else:
                rendered = self.render(est)
                last = (est, rendered)
            yield row, rendered, kept[gt]
