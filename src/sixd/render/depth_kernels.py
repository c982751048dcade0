"""Compiled depth rasteriser. Imports numba: import this module only inside functions.

`rasterise` first maps the vertices to pixels, then keeps, at every pixel centre, the largest 1/z of
the triangles over it (1/z is linear in the image, z is not).

Most triangles of a scanned mesh are about as small as a pixel, so the time goes into throwing them
away and into boxes of up to 2 x 2 pixels. Both are straight-line code without a branch that could
be mispredicted. Drawing what faces the camera first and testing the rest against it was measured
and saves nothing. Nothing is assumed of the mesh: it may be open, inconsistently oriented or
self-intersecting, where culling by orientation would change depths.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np
from numba import njit, uint64

from sixd.render.reference import EDGE_SLACK

NO_AREA = 1e-12
"""Square pixels; a triangle of less, or of NaN, covers no pixel centre its neighbours do not."""
ROW_LOOP_COLUMNS = 6
"""Up to here testing each pixel of a row is faster than solving for the row's ends."""

_compile = njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract"})
_part = njit(nogil=True, error_model="numpy", fastmath={"contract"})


@_part
def _project_vertices(vertices, P, near, width, height, projected, cells):
    """Fill ``projected`` (4V: u - 0.5, v - 0.5, 1/z, unused) and ``cells`` (V) of all vertices.

    A cell packs the first pixel column and row whose centre is not left of or above the vertex,
    clipped to the image: ``row << 16 | column``. A box of cells so contains the pixel centres from
    its lowest cell up to, not including, its highest: no centre if all columns or rows are equal.

    Returns:
        As `rasterise`; if a vertex is too near nothing else is to be used.
    """
    x, y, z = vertices[0], vertices[1], vertices[2]
    x0, y0, x1, y1 = np.int32(width), np.int32(height), np.int32(0), np.int32(0)
    behind = np.int32(0)
    for i in range(x.shape[0]):
        depth = P[2, 0] * x[i] + P[2, 1] * y[i] + P[2, 2] * z[i] + P[2, 3]
        inverse = 1.0 / depth
        u = (P[0, 0] * x[i] + P[0, 1] * y[i] + P[0, 2] * z[i] + P[0, 3]) * inverse - 0.5
        v = (P[1, 0] * x[i] + P[1, 1] * y[i] + P[1, 2] * z[i] + P[1, 3]) * inverse - 0.5
        behind |= np.int32(not (depth >= near))
        projected[4 * i] = u
        projected[4 * i + 1] = v
        projected[4 * i + 2] = inverse
        column, row = np.ceil(u), np.ceil(v)
        # In this order NaN becomes 0, so that no index can leave the image.
        column = column if column > 0.0 else 0.0
        column = np.int32(column if column < width else float(width))
        row = row if row > 0.0 else 0.0
        row = np.int32(row if row < height else float(height))
        cells[i] = row * np.int32(65536) + column
        x0, x1 = min(x0, column), max(x1, column)
        y0, y1 = min(y0, row), max(y1, row)
    return x0, y0, x1, y1, behind != 0


@_part
def _keep_nearest(inverse_z, at, b1, b2, w):
    """Raise the pixel to ``w`` if it is inside the triangle and nearer; without a branch."""
    old = inverse_z[at]
    inside = min(min(b1, b2), 1.0 - b1 - b2) >= -EDGE_SLACK
    new = w if inside else 0.0
    inverse_z[at] = new if new > old else old


@_part
def _narrow_to_edge(b, step, low, high):
    """Part of [low, high] where ``b + x * step >= -EDGE_SLACK``."""
    if step == 0.0:
        return low, high if b >= -EDGE_SLACK else -1.0
    end = -(b + EDGE_SLACK) / step
    if step > 0.0:
        return max(low, end), high
    return low, min(high, end)


@_part
def _draw_box(inverse_z, stride, at, columns, rows, start, by_x, by_y):
    """A triangle whose box is larger than 2 x 2; tuples hold b1, b2, 1/z at the first pixel."""
    b1, b2, w = start
    b1x, b2x, wx = by_x
    for _ in range(rows):
        if columns <= ROW_LOOP_COLUMNS:
            q, e1, e2, value = at, b1, b2, w
            for _ in range(columns):
                _keep_nearest(inverse_z, q, e1, e2, value)
                q, e1, e2, value = q + uint64(1), e1 + b1x, e2 + b2x, value + wx
        else:
            low, high = _narrow_to_edge(b1, b1x, 0.0, columns - 1.0)
            low, high = _narrow_to_edge(b2, b2x, low, high)
            low, high = _narrow_to_edge(1.0 - b1 - b2, -b1x - b2x, low, high)
            if low <= high:
                first = np.int64(np.ceil(low))
                value = w + first * wx
                for x in range(first, np.int64(high) + 1):
                    q = at + uint64(x)
                    old = inverse_z[q]
                    inverse_z[q] = value if value > old else old
                    value += wx
        at += uint64(stride)
        b1, b2, w = b1 + by_y[0], b2 + by_y[1], w + by_y[2]


@_part
def _draw_triangles(faces, projected, cells, x0, y0, stride, inverse_z):
    """Draw all triangles; the first value is pixel (x0, y0), rows have ``stride`` values."""
    origin = y0 * stride + x0
    for f in range(faces.shape[0]):
        i0, i1, i2 = faces[f, 0], faces[f, 1], faces[f, 2]
        k0, k1, k2 = cells[i0], cells[i1], cells[i2]
        differ = (k0 ^ k1) | (k0 ^ k2)
        if (((differ & 0xFFFF) - 1) | ((differ >> 16) - 1)) < 0:
            continue  # no pixel centre inside the box
        first, last = min(k0, min(k1, k2)) >> 16, max(k0, max(k1, k2)) >> 16
        rows = last - first
        left = min(k0 & 0xFFFF, min(k1 & 0xFFFF, k2 & 0xFFFF))
        columns = max(k0 & 0xFFFF, max(k1 & 0xFFFF, k2 & 0xFFFF)) - left
        u0, v0, w0 = projected[4 * i0], projected[4 * i0 + 1], projected[4 * i0 + 2]
        u1, v1, w1 = projected[4 * i1] - u0, projected[4 * i1 + 1] - v0, projected[4 * i1 + 2] - w0
        u2, v2, w2 = projected[4 * i2] - u0, projected[4 * i2 + 1] - v0, projected[4 * i2 + 2] - w0
        area = u1 * v2 - v1 * u2
        if not abs(area) > NO_AREA:
            continue
        scale = 1.0 / area
        b1x, b1y, b2x, b2y = v2 * scale, -u2 * scale, -v1 * scale, u1 * scale
        b1 = (left - u0) * b1x + (first - v0) * b1y
        b2 = (left - u0) * b2x + (first - v0) * b2y
        wx, wy = b1x * w1 + b2x * w2, b1y * w1 + b2y * w2
        w = w0 + b1 * w1 + b2 * w2
        at = uint64(first * stride + left - origin)
        if ((columns - 1) | (rows - 1)) <= 1:
            _keep_nearest(inverse_z, at, b1, b2, w)
            _keep_nearest(inverse_z, at + uint64(1), b1 + b1x, b2 + b2x, w + wx)
            at += uint64(stride)
            b1, b2, w = b1 + b1y, b2 + b2y, w + wy
            _keep_nearest(inverse_z, at, b1, b2, w)
            _keep_nearest(inverse_z, at + uint64(1), b1 + b1x, b2 + b2x, w + wx)
        else:
            start, by_x, by_y = (b1, b2, w), (b1x, b2x, wx), (b1y, b2y, wy)
            _draw_box(inverse_z, stride, at, columns, rows, start, by_x, by_y)


@_compile
def rasterise(vertices, faces, P, near, width, height, projected, cells, inverse_z):
    """Draw a mesh into the first values of ``inverse_z``: rows of ``x1 - x0 + 1``, 0 = background.

    There is one row and one column more than pixels; they may be written to and mean nothing.

    Args:
        vertices: ``(3, V)``.
        faces: ``(F, 3)`` uint32.
        P: ``(3, 4)``, ``K [R | t]``.
        near: nothing is drawn if a vertex is nearer.
        width: of the image.
        height: of the image.
        projected: ``(4 V)`` or more, scratch.
        cells: ``(V)`` or more int32, scratch.
        inverse_z: flat; if it is too small nothing is drawn.

    Returns:
        x0, y0, x1, y1 of the pixels that can be covered, and whether a vertex is too near.
    """
    x0, y0, x1, y1, behind = _project_vertices(vertices, P, near, width, height, projected, cells)
    n_values = (y1 - y0 + 1) * (x1 - x0 + 1)
    if x1 > x0 and y1 > y0 and not behind and n_values <= inverse_z.shape[0]:
        inverse_z[:n_values] = 0.0
        _draw_triangles(faces, projected, cells, x0, y0, x1 - x0 + 1, inverse_z)
    return x0, y0, x1, y1, behind
