"""Compiled rasteriser of scenes. Imports numba: import this module only inside functions.

Follows `reference.intersect`: a pixel's ray is solved for the corners' weights. That needs no
projected vertices, so triangles that reach behind the camera need no cutting.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np
from numba import njit

from sixd.render.reference import EDGE_SLACK

_compile = njit(nogil=True, cache=True, error_model="numpy")
_part = njit(nogil=True, error_model="numpy")


@_part
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@_part
def _pixels_around(a, b, c, size):
    """First pixel and end along one image axis; a, b, c are the corners' projections."""
    low, high = min(a, min(b, c)) - 0.5, max(a, max(b, c)) - 0.5
    low = low if low > 0.0 else 0.0
    low = low if low < size else float(size)
    high = high if high > -1.0 else -1.0
    high = high if high < size - 1 else size - 1.0
    return int(np.ceil(low)), int(np.floor(high)) + 1


@_compile
def draw_object(points, faces, near, instance, inverse_z, instance_id, face_id, weights):
    """Draw one object into the images of a scene, where it is nearer than what is there.

    Args:
        points: ``(V, 3)``: ``K`` times the vertices in the camera frame, (u z, v z, z).
        faces: ``(F, 3)`` int32.
        near: what has a smaller z is cut away.
        instance: number of the object.
        inverse_z: ``(H, W)``, 0 = background.
        instance_id: ``(H, W)`` int32.
        face_id: ``(H, W)`` int32.
        weights: ``(H, W, 2)`` of the first and second corner, in space.
    """
    height, width = inverse_z.shape
    for f in range(faces.shape[0]):
        a, b, c = points[faces[f, 0]], points[faces[f, 1]], points[faces[f, 2]]
        x0, x1, y0, y1 = 0, width, 0, height
        if a[2] >= near and b[2] >= near and c[2] >= near:
            x0, x1 = _pixels_around(a[0] / a[2], b[0] / b[2], c[0] / c[2], width)
            y0, y1 = _pixels_around(a[1] / a[2], b[1] / b[2], c[1] / c[2], height)
        elif a[2] < near and b[2] < near and c[2] < near:
            continue
        bc, ca = _cross(b, c), _cross(c, a)
        ab = _cross(a, b)
        volume = a[0] * bc[0] + a[1] * bc[1] + a[2] * bc[2]
        if volume == 0.0:
            continue
        for y in range(y0, y1):
            v = y + 0.5
            for x in range(x0, x1):
                u = x + 0.5
                wa = (bc[0] * u + bc[1] * v + bc[2]) / volume
                wb = (ca[0] * u + ca[1] * v + ca[2]) / volume
                wc = (ab[0] * u + ab[1] * v + ab[2]) / volume
                w = wa + wb + wc  # 1/z
                inside = min(wa, min(wb, wc)) >= -EDGE_SLACK * w
                if inside and w > inverse_z[y, x] and w * near <= 1.0:
                    inverse_z[y, x] = w
                    instance_id[y, x] = instance
                    face_id[y, x] = f
                    weights[y, x, 0], weights[y, x, 1] = wa / w, wb / w
