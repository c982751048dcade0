"""Compiled inner loops of VSD. Imports numba: import this module only inside functions."""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np
from numba import njit

_compile = njit(nogil=True, cache=True, error_model="numpy")


@_compile
def signed_distances(
    inverse_z, x0, y0, measured_mm, intrinsics, delta_mm, missing_hides, distance_mm
):
    """Distance from the camera of each rendered pixel, negative where the sensor hides it.

    Pixel coordinates are integer indices here, although the rendering sampled their centres, and
    distances are compared as float32 (BOP rules, VSD steps 2 and 3).

    Args:
        inverse_z: ``(h + 1, w + 1)``, a `Window`, 0 = background.
        x0: its first column in the image.
        y0: its first row.
        measured_mm: ``(H, W)`` float32 depth of the sensor, 0 = no reading.
        intrinsics: fx, fy, cx, cy.
        delta_mm: float32; what is farther behind the measurement is hidden.
        missing_hides: what no reading does.
        distance_mm: ``(h, w)``, the result; 0 = background.

    Returns:
        Number of visible pixels.
    """
    fx, fy, cx, cy = intrinsics
    per_fx = 1.0 / fx
    n_visible = 0
    for row in range(distance_mm.shape[0]):
        beside_x = ((y0 + row - cy) / fy) ** 2 + 1.0
        for column in range(distance_mm.shape[1]):
            w = inverse_z[row, column]
            if w == 0.0:
                distance_mm[row, column] = 0.0
                continue
            ray = np.sqrt(((x0 + column - cx) * per_fx) ** 2 + beside_x)
            model = ray / w
            depth = measured_mm[y0 + row, x0 + column]
            behind = np.float32(model) - np.float32(depth * ray)
            near = behind <= delta_mm
            visible = near & (depth != 0) if missing_hides else near | (depth == 0)
            n_visible += visible
            distance_mm[row, column] = model if visible else -model
    return n_visible


@_compile
def compare(est, est_at, gt, gt_at, unit_mm, taus, n_at_least):
    """Compare two results of `signed_distances` where their crops overlap.

    Args:
        est: ``(h, w)`` of the estimate.
        est_at: x0, y0 of it.
        gt: ``(h', w')`` of the ground truth.
        gt_at: x0, y0 of it.
        unit_mm: what differences are divided by.
        taus: ``(T,)`` ascending.
        n_at_least: ``(T,)`` zeros; receives how many pixels differ by at least each tau.

    Returns:
        Number of pixels visible in the ground truth and covered by the estimate (these count as
        visible in both), and how many of them are hidden in the estimate taken alone.
    """
    left, right = max(est_at[0], gt_at[0]), min(est_at[0] + est.shape[1], gt_at[0] + gt.shape[1])
    top, bottom = max(est_at[1], gt_at[1]), min(est_at[1] + est.shape[0], gt_at[1] + gt.shape[0])
    n_taus = taus.shape[0]
    n_both, n_hidden, reached = 0, 0, 0
    for y in range(top, bottom):
        for x in range(left, right):
            g = gt[y - gt_at[1], x - gt_at[0]]
            e = est[y - est_at[1], x - est_at[0]]
            if g <= 0.0 or e == 0.0:
                continue
            n_both += 1
            n_hidden += e < 0.0
            difference = abs(g - abs(e)) / unit_mm
            # Neighbouring pixels mostly differ by about the same: begin where the last one ended.
            while reached < n_taus and difference >= taus[reached]:
                reached += 1
            while reached > 0 and difference < taus[reached - 1]:
                reached -= 1
            if reached > 0:
                n_at_least[reached - 1] += 1
    for k in range(n_taus - 2, -1, -1):
        n_at_least[k] += n_at_least[k + 1]
    return n_both, n_hidden
