"""MSPD through FISHEYE624 cameras, compiled. Call it through `sixd.metrics.fast`."""

# mypy: allow-untyped-defs
from __future__ import annotations

import math

import numpy as np

from sixd.metrics.kernels import compiled, inner


@inner
def _pose(P, point):
    x, y, z = point
    return (
        P[0] * x + P[1] * y + P[2] * z + P[3],
        P[4] * x + P[5] * y + P[6] * z + P[7],
        P[8] * x + P[9] * y + P[10] * z + P[11],
    )


@inner
def _project(point_mm, c):
    """Pixel of a point; c ``(16,)``, the equations of `sixd.geometry.Fisheye624Camera`."""
    X, Y, Z = point_mm
    radius = math.sqrt(X * X + Y * Y)
    angle = math.atan2(radius, Z)
    t = min(angle * angle, math.pi * math.pi)
    k = c[4] + t * (c[5] + t * (c[6] + t * (c[7] + t * (c[8] + t * c[9]))))
    gain = (1.0 + t * k) * angle / max(radius, 2.0**-128)
    a, b = X * gain, Y * gain
    p1, p2, r2 = c[10], c[11], a * a + b * b
    u = a + 2.0 * p2 * a * b + p1 * (r2 + 2.0 * a * a) + r2 * (c[12] + c[13] * r2)
    v = b + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * b * b) + r2 * (c[14] + c[15] * r2)
    return c[0] * u + c[2], c[1] * v + c[3]


@inner
def _gap2(points, k, pixels, gt, sym, camera):
    """Squared error of vertex k, whose pixel under the estimate is known."""
    moved = _pose(gt, _pose(sym, (points[k, 0], points[k, 1], points[k, 2])))
    u, v = _project(moved, camera)
    du, dv = pixels[k, 0] - u, pixels[k, 1] - v
    gap2 = du * du + dv * dv
    return gap2 if gap2 >= 0.0 else np.inf


@compiled
def mspd_fisheye_pairs(est, gt, sym, params, points, n_probes, bounds2, pixels, out):
    """MSPD of each pair, px.

    est, gt ``(N, 12)``; sym ``(S, 12)``; params ``(N, 16)``; points ``(V, 3)``, the first
    ``n_probes`` being looked at under every symmetry, to begin with the likeliest; out ``(N,)``.
    Working memory: bounds2 ``(S,)``, pixels ``(V, 2)``.
    """
    witness = 0
    for i in range(len(out)):
        camera = params[i]
        for k in range(len(points)):
            posed = _pose(est[i], (points[k, 0], points[k, 1], points[k, 2]))
            pixels[k, 0], pixels[k, 1] = _project(posed, camera)
        start = 0
        for s in range(len(sym)):
            bounds2[s] = 0.0
            for k in range(n_probes):
                bounds2[s] = max(bounds2[s], _gap2(points, k, pixels, gt[i], sym[s], camera))
            if bounds2[s] < bounds2[start]:
                start = s
        best2 = np.inf
        for j in range(len(sym)):
            s = start if j == 0 else (j - 1 if j <= start else j)
            largest2 = bounds2[s]
            if largest2 >= best2:
                continue
            for n in range(-1, len(points)):
                # The vertex that decided last time often decides again.
                k = witness if n < 0 else n
                gap2 = _gap2(points, k, pixels, gt[i], sym[s], camera)
                if gap2 > largest2:
                    largest2, witness = gap2, k
                    if largest2 >= best2:
                        break
            best2 = min(best2, largest2)
        out[i] = math.sqrt(best2)
