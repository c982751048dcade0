"""Readable NumPy definition of the errors that need a rendering: VSD and CUS (BOP rules)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sixd.geometry.mesh import Mesh
from sixd.geometry.pose import Floats, Pose
from sixd.render import reference
from sixd.render.visibility import distance_image_mm, visible

Bools = NDArray[np.bool_]


def vsd(
    est: Pose,
    gt: Pose,
    mesh: Mesh,
    depth_mm: NDArray[np.floating],
    K: Floats,
    diameter_mm: float,
    delta_mm: float,
    taus: ArrayLike,
    *,
    tau_in_mm: bool = False,
    sphere_check: bool = True,
    missing_hides: bool = False,
) -> Floats:
    """Visible Surface Discrepancy of one estimate (Hodan et al., ECCVW 2016; BOP rules 5 and 6).

    Args:
        est: estimated pose, camera from model.
        gt: true pose.
        mesh: model that is rendered.
        depth_mm: ``(H, W)`` depth image of the scene, float32, 0 = no reading.
        K: ``(3, 3)``, px.
        diameter_mm: of the object.
        delta_mm: tolerance of the visibility test.
        taus: ``(T,)`` tolerances of misalignment, in diameters.
        tau_in_mm: taus are millimetres instead.
        sphere_check: the error is 1 if the bounding spheres do not overlap in the image.
        missing_hides: a pixel without a reading hides the model, as in 2018.

    Returns:
        ``(T,)`` errors in [0, 1].
    """
    if sphere_check and not spheres_overlap(est.t_mm, gt.t_mm, diameter_mm):
        return np.ones(np.shape(taus))
    size_px = (depth_mm.shape[1], depth_mm.shape[0])
    est_mm, gt_mm = (
        distance_image_mm(reference.render_depth(mesh, pose, K, size_px), K) for pose in (est, gt)
    )
    unit_mm = 1.0 if tau_in_mm else diameter_mm
    measured_mm = distance_image_mm(depth_mm, K)
    return vsd_of_distances(
        est_mm, gt_mm, measured_mm, delta_mm, taus, unit_mm, missing_hides=missing_hides
    )


def vsd_of_distances(
    est_mm: Floats,
    gt_mm: Floats,
    measured_mm: Floats,
    delta_mm: float,
    taus: ArrayLike,
    unit_mm: float,
    *,
    missing_hides: bool = False,
) -> Floats:
    """VSD from the three distance images ``(H, W)``; ``taus (T,)`` are in units of ``unit_mm``."""
    gt_visible = visible(gt_mm, measured_mm, delta_mm, missing_hides=missing_hides)
    est_visible = visible(est_mm, measured_mm, delta_mm, missing_hides=missing_hides)
    est_visible |= gt_visible & (est_mm > 0)
    both, either = gt_visible & est_visible, gt_visible | est_visible
    if not either.any():
        return np.ones(np.shape(taus))
    differences = np.abs(gt_mm - est_mm)[both] / unit_mm
    n_wrong = (differences >= np.asarray(taus)[..., None]).sum(axis=-1)
    errors: Floats = (n_wrong + either.sum() - both.sum()) / either.sum()
    return errors


def cus(
    est: Pose,
    gt: Pose,
    mesh: Mesh,
    K: Floats,
    size_px: tuple[int, int],
    diameter_mm: float,
    *,
    sphere_check: bool = True,
) -> float:
    """Complement over Union of Silhouettes: 1 - IoU of the rendered masks (BOP rules 5).

    Args:
        est: estimated pose, camera from model.
        gt: true pose.
        mesh: model that is rendered.
        K: ``(3, 3)``, px.
        size_px: ``(width, height)`` of the image.
        diameter_mm: of the object.
        sphere_check: the error is 1 if the bounding spheres do not overlap in the image.
    """
    if sphere_check and not spheres_overlap(est.t_mm, gt.t_mm, diameter_mm):
        return 1.0
    est_mask, gt_mask = (reference.render_depth(mesh, pose, K, size_px) > 0 for pose in (est, gt))
    n_either = np.count_nonzero(est_mask | gt_mask)
    return 1.0 - np.count_nonzero(est_mask & gt_mask) / n_either if n_either else 1.0


def spheres_overlap(a_mm: Floats, b_mm: Floats, diameters_mm: ArrayLike) -> Bools:
    """Whether the discs that two spheres fill in the image overlap, as the BOP rules estimate it.

    The rule takes z with its sign; a centre in the camera plane overlaps nothing.

    Args:
        a_mm: ``(..., 3)`` centres in the camera frame.
        b_mm: ``(..., 3)``.
        diameters_mm: ``(...)``.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        gaps = np.linalg.norm(a_mm / a_mm[..., 2:] - b_mm / b_mm[..., 2:], axis=-1)
        reach = np.asarray(diameters_mm) / 2 * (1 / a_mm[..., 2] + 1 / b_mm[..., 2])
    overlap: Bools = (gaps < reach) & (a_mm[..., 2] != 0) & (b_mm[..., 2] != 0)
    return overlap
