"""Compiled shading of pixels. Imports numba: import this module only inside functions."""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np
from numba import njit

CREASE_COSINE = 0.5
"""A smoothed normal this far (60 degrees) from the triangle's own belongs to a sharp edge."""
SHININESS = 40

_compile = njit(nogil=True, cache=True, error_model="numpy")
_part = njit(nogil=True, error_model="numpy")


@_part
def _unit(x, y, z):
    length = np.sqrt(x * x + y * y + z * z)
    length = length if length > 0 else 1.0
    return x / length, y / length, z / length


@_part
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@_part
def _mix(values, a, b, c, weights):
    """Mean of three rows, weighted."""
    wa, wb, wc = weights[0], weights[1], weights[2]
    return (
        values[a, 0] * wa + values[b, 0] * wb + values[c, 0] * wc,
        values[a, 1] * wa + values[b, 1] * wb + values[c, 1] * wc,
        values[a, 2] * wa + values[b, 2] * wb + values[c, 2] * wc,
    )


@_part
def _normal(flat, mixed, view):
    """Unit normal towards the camera: smooth where the mesh is, flat at sharp edges."""
    smooth = _unit(mixed[0], mixed[1], mixed[2])
    normal = smooth if abs(_dot(smooth, flat)) >= CREASE_COSINE else flat
    # A smooth normal follows its triangle to the side of the camera.
    turn = -1.0 if (_dot(flat, view) > 0) != (_dot(normal, flat) < 0) else 1.0
    return normal[0] * turn, normal[1] * turn, normal[2] * turn


@_part
def _texel(texture, u, v):
    """Bilinear sample; the image repeats itself, v points up."""
    height, width = texture.shape[:2]
    x = (u - np.floor(u)) * width - 0.5
    y = (1 - (v - np.floor(v))) * height - 0.5
    left, top = int(np.floor(x)), int(np.floor(y))
    fx, fy = x - left, y - top
    row0, row1 = texture[top % height], texture[(top + 1) % height]
    left, right = left % width, (left + 1) % width
    upper = _mix(row0, left, right, right, ((1 - fx) * (1 - fy), fx * (1 - fy), 0.0))
    lower = _mix(row1, left, right, right, ((1 - fx) * fy, fx * fy, 0.0))
    return upper[0] + lower[0], upper[1] + lower[1], upper[2] + lower[2]


@_part
def _lit_fraction(point, normal, nearest, P, texel_mm):
    """Share of 3 x 3 texels of the light's depth image that are not nearer to it: soft borders."""
    # Half a texel is as far as a surface can seem to shade itself; step off it by more.
    step = 2.5 * texel_mm
    x, y, z = point[0] + step * normal[0], point[1] + step * normal[1], point[2] + step * normal[2]
    depth = P[2, 0] * x + P[2, 1] * y + P[2, 2] * z + P[2, 3]
    column = int((P[0, 0] * x + P[0, 1] * y + P[0, 2] * z + P[0, 3]) / depth)
    row = int((P[1, 0] * x + P[1, 1] * y + P[1, 2] * z + P[1, 3]) / depth)
    height, width = nearest.shape
    if not (0 < column < width - 1 and 0 < row < height - 1):
        return 1.0
    lit = 0
    for j in range(row - 1, row + 2):
        for i in range(column - 1, column + 2):
            lit += depth - texel_mm <= nearest[j, i]
    return lit / 9.0


@_compile
def shade_object(instance, raster, K_inverse, shape, paint, light, shadow, rgb):
    """Colour the pixels of one object.

    Args:
        instance: number of the object.
        raster: instance_id, face_id, depth_mm ``(H, W)`` and barycentric ``(H, W, 3)``.
        K_inverse: ``(3, 3)``, upper triangular with a last row of 0 0 1.
        shape: faces ``(F, 3)``, their normals and those of the vertices, in the camera frame.
        paint: vertex colours ``(V, 3)``, texture ``(h, w, 3)`` or empty, corner_uv ``(F, 3, 2)``.
        light: unit vector to the light (a tuple), ambient share, strength of the highlight.
        shadow: depth image of the light, ``(3, 4)`` matrix to its pixels, size of one on a surface.
        rgb: ``(H, W, 3)`` float32, 0 to 255, the result.
    """
    instance_id, face_id, depth_mm, barycentric = raster
    faces, face_normals, vertex_normals = shape
    colors, texture, corner_uv = paint
    to_light, ambient, highlight = light
    nearest, P, texel_mm = shadow
    for row in range(instance_id.shape[0]):
        for column in range(instance_id.shape[1]):
            if instance_id[row, column] != instance:
                continue
            f, z = face_id[row, column], depth_mm[row, column]
            a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
            at = barycentric[row, column]
            weights = (at[0], at[1], at[2])
            x, y = (column + 0.5) * z, (row + 0.5) * z
            point = (
                K_inverse[0, 0] * x + K_inverse[0, 1] * y + K_inverse[0, 2] * z,
                K_inverse[1, 1] * y + K_inverse[1, 2] * z,
                z,
            )
            view = _unit(point[0], point[1], point[2])
            flat = (face_normals[f, 0], face_normals[f, 1], face_normals[f, 2])
            normal = _normal(flat, _mix(vertex_normals, a, b, c, weights), view)
            towards = _dot(normal, to_light)
            lit, shine = 0.0, 0.0
            if towards > 0:
                lit = towards * _lit_fraction(point, normal, nearest, P, texel_mm)
                halfway = _unit(to_light[0] - view[0], to_light[1] - view[1], to_light[2] - view[2])
                shine = highlight * 255.0 * max(0.0, _dot(normal, halfway)) ** SHININESS * lit
            # Ambient light comes a little more from the light's side: no shadow is quite flat.
            brightness = ambient * (0.85 + 0.15 * towards) + (1.0 - ambient) * lit
            if texture.shape[0]:
                uv = corner_uv[f]
                u = uv[0, 0] * weights[0] + uv[1, 0] * weights[1] + uv[2, 0] * weights[2]
                v = uv[0, 1] * weights[0] + uv[1, 1] * weights[1] + uv[2, 1] * weights[2]
                albedo = _texel(texture, u, v)
            else:
                albedo = _mix(colors, a, b, c, weights)
            for k in range(3):
                rgb[row, column, k] = albedo[k] * brightness + shine
