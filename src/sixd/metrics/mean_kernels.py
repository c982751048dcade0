"""Compiled means over vertices of pairs of poses: ADD, projection error, ADI.

Call them through `sixd.metrics.fast`: importing costs. Poses are the 12 entries of [R | t], row by
row, or of K [R | t] where errors are in pixels.

Imports nothing of `sixd.metrics.kernels`: numba's cache does not notice when a function or constant
imported from another module changes.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

_compile = njit(nogil=True, cache=True, error_model="numpy")
# Called from compiled code alone: without entry points from Python and C they compile faster.
_NO_ENTRY: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
_part = njit(nogil=True, error_model="numpy", **_NO_ENTRY)

_DOWN = 1 - 1e-9
"""Bounds are lowered by this, so that rounding never prunes the nearest vertex."""


@_part
def _place(P, rows, out):
    """Write the ``(3, M)`` columns of rows to out, posed."""
    p00, p01, p02, p03 = P[0], P[1], P[2], P[3]
    p10, p11, p12, p13 = P[4], P[5], P[6], P[7]
    p20, p21, p22, p23 = P[8], P[9], P[10], P[11]
    xs, ys, zs = rows[0], rows[1], rows[2]
    for k in range(len(xs)):
        out[0, k] = p00 * xs[k] + p01 * ys[k] + p02 * zs[k] + p03
        out[1, k] = p10 * xs[k] + p11 * ys[k] + p12 * zs[k] + p13
        out[2, k] = p20 * xs[k] + p21 * ys[k] + p22 * zs[k] + p23


@_compile
def mean_pairs(est, gt, points, in_pixels, est_points, gt_points, out):
    """ADD or the projection error of each pair: the mean over vertices.

    est, gt ``(N, 12)``; points ``(3, V)``; out ``(N,)``. Working memory: est_points and gt_points
    ``(3, V)``.
    """
    n_points = points.shape[1]
    for i in range(len(out)):
        _place(est[i], points, est_points)
        _place(gt[i], points, gt_points)
        total = 0.0
        for k in range(n_points):
            ex, ey, ez = est_points[0, k], est_points[1, k], est_points[2, k]
            gx, gy, gz = gt_points[0, k], gt_points[1, k], gt_points[2, k]
            if in_pixels:
                dx, dy, dz = ex / ez - gx / gz, ey / ez - gy / gz, 0.0
            else:
                dx, dy, dz = ex - gx, ey - gy, ez - gz
            total += math.sqrt(dx * dx + dy * dy + dz * dz)
        # NaN: a vertex without projection.
        out[i] = total / n_points if total >= 0.0 else np.inf


@_part
def _nearest_gap2(x, y, z, groups, reach, leaves, rows, stack, near):
    """Squared distance to the nearest posed vertex; ``near`` begins and ends with that vertex.

    groups, leaves: those of `VertexCells`, posed; ``reach``: how much the pose may stretch radii.
    """
    dx, dy, dz = x - near[0], y - near[1], z - near[2]
    best2 = dx * dx + dy * dy + dz * dz
    distance2, bound2, stack2 = rows[0], rows[1], rows[2]
    n_groups = len(groups)
    top = 1
    stack[0], stack2[0] = 0, 0.0
    while top > 0:
        top -= 1
        if stack2[top] >= best2:
            continue
        node = stack[top]
        cells = groups[node] if node < n_groups else leaves[node - n_groups]
        xs, ys, zs = cells[0], cells[1], cells[2]
        for k in range(len(xs)):
            dx, dy, dz = x - xs[k], y - ys[k], z - zs[k]
            distance2[k] = dx * dx + dy * dy + dz * dz
        at = -1
        for k in range(len(xs)):
            if distance2[k] < best2:
                best2, at = distance2[k], k
        if at >= 0:
            near[0], near[1], near[2] = xs[at], ys[at], zs[at]
        if node < n_groups:
            first = 0
            for k in range(8):
                gap = math.sqrt(distance2[k]) - cells[3, k] * reach
                bound2[k] = gap * gap * _DOWN if gap > 0.0 else 0.0
                if distance2[k] < distance2[first]:
                    first = k
            # The cell with the nearest centre goes on top: it lowers the bar for the others.
            for j in range(8):
                k = first if j == 7 else (j + 1 if j >= first else j)
                if bound2[k] < best2:
                    stack[top], stack2[top] = 8 * node + 1 + k, bound2[k]
                    top += 1
    return best2


@_compile
def adi_pairs(
    est,
    gt,
    points,
    groups,
    leaves,
    reach,
    posed_points,
    posed_groups,
    posed_leaves,
    rows,
    stack,
    out,
):
    """ADI of each pair: mean over vertices posed by gt of the way to the nearest posed by est.

    est, gt ``(N, 12)``; points ``(3, V)``; groups and leaves of `VertexCells`; reach ``(N,)``: at
    least how much est stretches any length; out ``(N,)``. Working memory: copies of points, groups
    and leaves; rows ``(4, max(128, M))``, stack ``(128,)`` int64.
    """
    near = rows[3]
    for i in range(len(out)):
        for g in range(len(groups)):
            _place(est[i], groups[g], posed_groups[g])
        for g in range(len(leaves)):
            _place(est[i], leaves[g], posed_leaves[g])
        _place(gt[i], points, posed_points)
        for r in range(3):
            near[r] = posed_leaves[0, r, 0]
        total = 0.0
        for k in range(posed_points.shape[1]):
            x, y, z = posed_points[0, k], posed_points[1, k], posed_points[2, k]
            total += math.sqrt(
                _nearest_gap2(x, y, z, posed_groups, reach[i], posed_leaves, rows, stack, near)
            )
        out[i] = total / posed_points.shape[1]
