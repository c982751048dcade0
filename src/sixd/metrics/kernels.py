"""Compiled MSSD and MSPD of pairs of poses. Call through `sixd.metrics.fast`: importing costs.

Poses are the 12 entries of [R | t], row by row, or of K [R | t] where errors are in pixels. The
largest error over the vertices is searched in the tree of `VertexCells`, branch and bound: a cell
whose upper bound is below the largest error seen is left out. The smallest over the symmetries
likewise: one that exceeds the best at any vertex is left out. What comes out is the exact maximum
and minimum of the rounded errors.

All in one module: numba's cache does not notice when a function imported from another one changes.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

compiled = njit(nogil=True, cache=True, error_model="numpy")
# Called from compiled code alone: without entry points from Python and C they compile faster.
_NO_ENTRY: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
inner = njit(nogil=True, error_model="numpy", **_NO_ENTRY)

_UP = 1 + 1e-9
"""Bounds are widened by this, so that rounding never prunes the largest vertex."""


@inner
def _entries(P):
    """The 12 entries of a pose as a tuple: cheap to compile, and LLVM keeps it in registers."""
    return P[0], P[1], P[2], P[3], P[4], P[5], P[6], P[7], P[8], P[9], P[10], P[11]


@inner
def _defect(P):
    """Frobenius norm of R^T R - 1, which bounds the way to the nearest rotation.

    Infinite for mirrored poses: their nearest orthogonal matrix is no rotation.
    """
    a, b, c, _, d, e, f, _, g, h, i, _ = _entries(P)
    if a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) <= 0.0:
        return np.inf
    total = 0.0
    for j in range(3):
        for k in range(3):
            gap = P[j] * P[k] + P[4 + j] * P[4 + k] + P[8 + j] * P[8 + k]
            if j == k:
                gap -= 1.0
            total += gap * gap
    return math.sqrt(total)


@inner
def _norm2(P, Q, defect):
    """A bound on |R_p - R_q|^2, the rotations being ``defect`` from true ones."""
    total = 0.0
    for k in range(12):
        if k % 4 != 3:
            total += (P[k] - Q[k]) * (P[k] - Q[k])
    if not defect < 0.01:
        return total
    # A difference of two rotations has two equal singular values and a zero.
    norm = math.sqrt(0.5 * total) + 3.0 * defect
    return min(total, norm * norm)


@inner
def _compose(P, Q, out):
    """Write P Q to out, as if all were 4x4 with last row 0 0 0 1."""
    for r in range(0, 12, 4):
        for c in range(4):
            out[r + c] = P[r] * Q[c] + P[r + 1] * Q[4 + c] + P[r + 2] * Q[8 + c]
        out[r + 3] += P[r + 3]


@inner
def _gap2(E, G, x, y, z, in_pixels):
    """Squared error of one vertex, infinite if it has no projection.

    To the last bit as `_leaf_gaps` has it: the result must not hang on who finds the vertex.
    """
    e00, e01, e02, e03, e10, e11, e12, e13, e20, e21, e22, e23 = E
    g00, g01, g02, g03, g10, g11, g12, g13, g20, g21, g22, g23 = G
    if in_pixels:
        ez = e20 * x + e21 * y + e22 * z + e23
        gz = g20 * x + g21 * y + g22 * z + g23
        inverse = 1.0 / (ez * gz)
        ex = e00 * x + e01 * y + e02 * z + e03
        gx = g00 * x + g01 * y + g02 * z + g03
        dx = (ex * gz - gx * ez) * inverse
        ey = e10 * x + e11 * y + e12 * z + e13
        gy = g10 * x + g11 * y + g12 * z + g13
        dy = (ey * gz - gy * ez) * inverse
        gap2 = dx * dx + dy * dy
    else:
        dx = (e00 - g00) * x + (e01 - g01) * y + (e02 - g02) * z + (e03 - g03)
        dy = (e10 - g10) * x + (e11 - g11) * y + (e12 - g12) * z + (e13 - g13)
        dz = (e20 - g20) * x + (e21 - g21) * y + (e22 - g22) * z + (e23 - g23)
        gap2 = dx * dx + dy * dy + dz * dz
    return gap2 if gap2 >= 0.0 else np.inf


@inner
def _probe(E, G, probe, moved, in_pixels, bounds2):
    """Raise each symmetry's lower bound to the squared error of one vertex.

    moved ``(3, S)``: the vertex under every symmetry.
    """
    e00, e01, e02, e03, e10, e11, e12, e13, e20, e21, e22, e23 = E
    g00, g01, g02, g03, g10, g11, g12, g13, g20, g21, g22, g23 = G
    x, y, z = probe[0], probe[1], probe[2]
    ex = e00 * x + e01 * y + e02 * z + e03
    ey = e10 * x + e11 * y + e12 * z + e13
    ez = e20 * x + e21 * y + e22 * z + e23
    xs, ys, zs = moved[0], moved[1], moved[2]
    if in_pixels:
        u, v = ex / ez, ey / ez
        for s in range(len(bounds2)):
            inverse = 1.0 / (g20 * xs[s] + g21 * ys[s] + g22 * zs[s] + g23)
            dx = u - (g00 * xs[s] + g01 * ys[s] + g02 * zs[s] + g03) * inverse
            dy = v - (g10 * xs[s] + g11 * ys[s] + g12 * zs[s] + g13) * inverse
            # A comparison with NaN is false: the bound stays.
            d2 = (dx * dx + dy * dy) * (2.0 - _UP)
            bounds2[s] = d2 if d2 > bounds2[s] else bounds2[s]
    else:
        for s in range(len(bounds2)):
            dx = ex - (g00 * xs[s] + g01 * ys[s] + g02 * zs[s] + g03)
            dy = ey - (g10 * xs[s] + g11 * ys[s] + g12 * zs[s] + g13)
            dz = ez - (g20 * xs[s] + g21 * ys[s] + g22 * zs[s] + g23)
            d2 = (dx * dx + dy * dy + dz * dz) * (2.0 - _UP)
            bounds2[s] = d2 if d2 > bounds2[s] else bounds2[s]


@inner
def _cell_bounds_mm(E, G, norm2, group, distance2, bound2):
    """Squared error at the centre of 8 cells, and the most it can be within each."""
    e00, e01, e02, e03, e10, e11, e12, e13, e20, e21, e22, e23 = E
    g00, g01, g02, g03, g10, g11, g12, g13, g20, g21, g22, g23 = G
    a00, a01, a02, b0 = e00 - g00, e01 - g01, e02 - g02, e03 - g03
    a10, a11, a12, b1 = e10 - g10, e11 - g11, e12 - g12, e13 - g13
    a20, a21, a22, b2 = e20 - g20, e21 - g21, e22 - g22, e23 - g23
    xs, ys, zs, radius = group[0], group[1], group[2], group[3]
    nx, ny, nz, thickness = group[4], group[5], group[6], group[7]
    for k in range(len(xs)):  # eight; a constant would keep LLVM from vectorising
        dx = a00 * xs[k] + a01 * ys[k] + a02 * zs[k] + b0
        dy = a10 * xs[k] + a11 * ys[k] + a12 * zs[k] + b1
        dz = a20 * xs[k] + a21 * ys[k] + a22 * zs[k] + b2
        d2 = dx * dx + dy * dy + dz * dz
        # Half the gradient of d2, along the disc's normal and across it.
        gx = a00 * dx + a10 * dy + a20 * dz
        gy = a01 * dx + a11 * dy + a21 * dz
        gz = a02 * dx + a12 * dy + a22 * dz
        normal = gx * nx[k] + gy * ny[k] + gz * nz[k]
        tangent = math.sqrt(abs(gx * gx + gy * gy + gz * gz - normal * normal))
        rise = 2.0 * (tangent * radius[k] + abs(normal) * thickness[k])
        distance2[k] = d2
        bound2[k] = (d2 + rise + norm2 * radius[k] * radius[k]) * _UP


@inner
def _cell_bounds_px(E, G, group, distance2, bound2):
    """As `_cell_bounds_mm` for projections, whose first-order change is M = d(u, v) / d vertex.

    With p the third row over the depth, u(c + d) - u(c) = M d / (1 + p d), exactly. So the
    difference of two projections changes by B d, B = M_e - M_g, and a rest of at most
    |B| r q / (1 - q) + |M_g| r |p_e - p_g| r / (1 - q)^2, q the larger |p| r; all of it vanishes
    as the poses approach each other. A cell that reaches the camera's plane (q >= 1) has no bound.

    Long, but one formula: its parts share nearly all terms, and the loop is vectorised whole.
    """
    e00, e01, e02, e03, e10, e11, e12, e13, e20, e21, e22, e23 = E
    g00, g01, g02, g03, g10, g11, g12, g13, g20, g21, g22, g23 = G
    reach_e = math.sqrt(e20 * e20 + e21 * e21 + e22 * e22)
    reach_g = math.sqrt(g20 * g20 + g21 * g21 + g22 * g22)
    xs, ys, zs, radius = group[0], group[1], group[2], group[3]
    nx, ny, nz, thickness = group[4], group[5], group[6], group[7]
    for k in range(len(xs)):  # eight; a constant would keep LLVM from vectorising
        x, y, z, r = xs[k], ys[k], zs[k], radius[k]
        ez = e20 * x + e21 * y + e22 * z + e23
        gz = g20 * x + g21 * y + g22 * z + g23
        inverse = 1.0 / (ez * gz)
        ex = e00 * x + e01 * y + e02 * z + e03
        gx = g00 * x + g01 * y + g02 * z + g03
        du = (ex * gz - gx * ez) * inverse
        ey = e10 * x + e11 * y + e12 * z + e13
        gy = g10 * x + g11 * y + g12 * z + g13
        dv = (ey * gz - gy * ez) * inverse
        he, hg = gz * inverse, ez * inverse
        ue, ve, ug, vg = ex * he, ey * he, gx * hg, gy * hg
        m0, n0 = (e00 - ue * e20) * he, (g00 - ug * g20) * hg
        m1, n1 = (e01 - ue * e21) * he, (g01 - ug * g21) * hg
        m2, n2 = (e02 - ue * e22) * he, (g02 - ug * g22) * hg
        m3, n3 = (e10 - ve * e20) * he, (g10 - vg * g20) * hg
        m4, n4 = (e11 - ve * e21) * he, (g11 - vg * g21) * hg
        m5, n5 = (e12 - ve * e22) * he, (g12 - vg * g22) * hg
        size = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2 + n3 * n3 + n4 * n4 + n5 * n5)
        m0, m1, m2, m3, m4, m5 = m0 - n0, m1 - n1, m2 - n2, m3 - n3, m4 - n4, m5 - n5
        norm2 = m0 * m0 + m1 * m1 + m2 * m2 + m3 * m3 + m4 * m4 + m5 * m5
        rx, ry, rz = m0 * du + m3 * dv, m1 * du + m4 * dv, m2 * du + m5 * dv
        normal = rx * nx[k] + ry * ny[k] + rz * nz[k]
        tangent = math.sqrt(abs(rx * rx + ry * ry + rz * rz - normal * normal))
        d2 = du * du + dv * dv
        rise = 2.0 * (tangent * r + abs(normal) * thickness[k])
        p0, p1, p2 = e20 * he - g20 * hg, e21 * he - g21 * hg, e22 * he - g22 * hg
        apart = math.sqrt(p0 * p0 + p1 * p1 + p2 * p2)
        qe, qg = reach_e * r * abs(he), reach_g * r * abs(hg)
        q = qe if qe > qg else qg
        rest = (math.sqrt(norm2) * q + size * apart * r / (1.0 - q)) * r / (1.0 - q)
        most = math.sqrt(d2 + rise + norm2 * r * r) + rest
        distance2[k] = d2
        bound2[k] = most * most * _UP if qe < 1.0 and qg < 1.0 else np.inf


@inner
def _leaf_gaps(E, G, leaf, in_pixels, distance2):
    """Squared errors of all vertices of a leaf."""
    e00, e01, e02, e03, e10, e11, e12, e13, e20, e21, e22, e23 = E
    g00, g01, g02, g03, g10, g11, g12, g13, g20, g21, g22, g23 = G
    xs, ys, zs = leaf[0], leaf[1], leaf[2]
    if in_pixels:
        for k in range(len(xs)):
            ez = e20 * xs[k] + e21 * ys[k] + e22 * zs[k] + e23
            gz = g20 * xs[k] + g21 * ys[k] + g22 * zs[k] + g23
            inverse = 1.0 / (ez * gz)
            ex = e00 * xs[k] + e01 * ys[k] + e02 * zs[k] + e03
            gx = g00 * xs[k] + g01 * ys[k] + g02 * zs[k] + g03
            dx = (ex * gz - gx * ez) * inverse
            ey = e10 * xs[k] + e11 * ys[k] + e12 * zs[k] + e13
            gy = g10 * xs[k] + g11 * ys[k] + g12 * zs[k] + g13
            dy = (ey * gz - gy * ez) * inverse
            distance2[k] = dx * dx + dy * dy
    else:
        a00, a01, a02, b0 = e00 - g00, e01 - g01, e02 - g02, e03 - g03
        a10, a11, a12, b1 = e10 - g10, e11 - g11, e12 - g12, e13 - g13
        a20, a21, a22, b2 = e20 - g20, e21 - g21, e22 - g22, e23 - g23
        for k in range(len(xs)):
            dx = a00 * xs[k] + a01 * ys[k] + a02 * zs[k] + b0
            dy = a10 * xs[k] + a11 * ys[k] + a12 * zs[k] + b1
            dz = a20 * xs[k] + a21 * ys[k] + a22 * zs[k] + b2
            distance2[k] = dx * dx + dy * dy + dz * dz


@inner
def _push(node, bound2, best2, stack, stack2, top):
    """Put the children that can hold more than ``best2`` on the stack; returns its height."""
    # The highest bound goes on top: visited first, it raises the bar for the others.
    first, highest = -1, best2
    for k in range(8):
        if bound2[k] > highest:
            first, highest = k, bound2[k]
    for k in range(8):
        if bound2[k] > best2 and k != first:
            stack[top], stack2[top] = 8 * node + 1 + k, bound2[k]
            top += 1
    if first >= 0:
        stack[top], stack2[top] = 8 * node + 1 + first, highest
        top += 1
    return top


@inner
def _largest_gap2(E, G, norm2, in_pixels, groups, leaves, stop2, rows, stack, witness):
    """Largest squared error over all vertices; stops early once it is at least ``stop2``.

    witness ``(3,)``: a vertex to begin with; the one found is left there.
    """
    best2 = _gap2(E, G, witness[0], witness[1], witness[2], in_pixels)
    n_groups = len(groups)
    distance2, bound2, stack2 = rows[0], rows[1], rows[2]
    top = 1
    stack[0], stack2[0] = 0, np.inf
    while top > 0 and best2 < stop2:
        top -= 1
        if stack2[top] <= best2:
            continue
        node = stack[top]
        if node < n_groups:
            cells, count = groups[node], 8
            if in_pixels:
                _cell_bounds_px(E, G, cells, distance2, bound2)
            else:
                _cell_bounds_mm(E, G, norm2, cells, distance2, bound2)
        else:
            cells, count = leaves[node - n_groups], leaves.shape[2]
            _leaf_gaps(E, G, cells, in_pixels, distance2)
        at = -1
        for k in range(count):
            if distance2[k] > best2:
                best2, at = distance2[k], k
            elif distance2[k] != distance2[k]:  # NaN
                best2, at = np.inf, k
        if at >= 0:
            witness[0], witness[1], witness[2] = cells[0, at], cells[1, at], cells[2, at]
        if node < n_groups:
            top = _push(node, bound2, best2, stack, stack2, top)
    return best2


@compiled
def symmetric_max_pairs(
    est, gt, sym, probes, moved, groups, leaves, in_pixels, bounds2, rows, stack, out
):
    """MSSD or MSPD of each pair: min over symmetries of max over vertices.

    est, gt ``(N, 12)``; sym ``(S, 12)``; probes ``(P, 3)`` are vertices, moved ``(P, 3, S)`` the
    same under every symmetry; groups and leaves of `VertexCells`; out ``(N,)``. Working memory,
    since allocating here would double the time to compile: bounds2 ``(S,)``, rows
    ``(5, max(128, M))``, stack ``(128,)`` int64.
    """
    n_sym = len(sym)
    witness, moved_gt = rows[3], rows[4]
    for r in range(3):
        witness[r] = leaves[0, r, 0]
    defect_sym = 0.0
    for s in range(n_sym):
        defect_sym = max(defect_sym, _defect(sym[s]))
    for i in range(len(out)):
        E, G = _entries(est[i]), _entries(gt[i])
        for s in range(n_sym):
            bounds2[s] = 0.0
        for p in range(len(probes)):
            _probe(E, G, probes[p], moved[p], in_pixels, bounds2)
        start = 0
        for s in range(n_sym):
            if bounds2[s] < bounds2[start]:
                start = s
        defect = 0.0 if in_pixels else _defect(est[i]) + _defect(gt[i]) + defect_sym
        best2 = np.inf
        # First the likeliest symmetry, then every eighth, to come near the best soon; then all.
        for step in (n_sym, 8, 1):
            for s in range(start if step == n_sym else 0, n_sym, step):
                if bounds2[s] >= best2:
                    continue
                bounds2[s] = np.inf  # done with
                _compose(gt[i], sym[s], moved_gt)
                G = _entries(moved_gt)
                # The vertex that decided last time often decides again.
                if _gap2(E, G, witness[0], witness[1], witness[2], in_pixels) >= best2:
                    continue
                norm2 = 0.0 if in_pixels else _norm2(est[i], moved_gt, defect)
                found2 = _largest_gap2(
                    E, G, norm2, in_pixels, groups, leaves, best2, rows, stack, witness
                )
                best2 = min(best2, found2)
        out[i] = math.sqrt(best2)
