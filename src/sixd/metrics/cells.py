"""The vertices of a mesh in a tree of compact cells, so that maxima need few of them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sixd.errors import ShapeError, UsageError, check_shape
from sixd.geometry.pose import Floats

_LARGEST_MM = 1e100
"""Squares of what is larger have no number."""
_FANOUT = 8
_LEAF_SIZE = 96
"""Vertices of a leaf, at most."""


@dataclass(frozen=True, eq=False)
class VertexCells:
    """A complete tree of vertex sets: node i has the children 8 i + 1 to 8 i + 8.

    A node stands for its vertices by one of them, the centre c, and by a flat disc that holds
    all: ``|v - c| <= radius`` and ``|n (v - c)| <= thickness``. Surfaces are flat in the small, so
    the error at the centre and its gradient bound the largest error of the cell closely.
    """

    groups: Floats
    """``(G, 8, 8)``: of each inner node, its children's centre xyz, radius, unit normal n xyz and
    thickness, mm; the child is the last axis. G = 0 where the root is a leaf."""
    leaves_mm: Floats
    """``(L, 3, M)``: every vertex, coordinates apart; some twice, to make leaves equally long."""
    points_mm: Floats
    """``(V, 3)``: every vertex once, in the order of the leaves."""

    @classmethod
    def build(cls, points_mm: Floats) -> VertexCells:
        """Sort vertices ``(V, 3)`` into cells by halving along the widest extent."""
        check_shape("points_mm", points_mm, (3,))
        if points_mm.ndim != 2 or not len(points_mm):
            raise ShapeError(f"points_mm must have shape (V, 3), V > 0, got {points_mm.shape}")
        if not (np.abs(points_mm) < _LARGEST_MM).all():  # NaN too
            raise UsageError(f"points_mm must be finite and below {_LARGEST_MM:g}")
        points_mm = np.ascontiguousarray(points_mm, np.float64)
        count = len(points_mm)
        depth = 0
        while count > _LEAF_SIZE * _FANOUT**depth:
            depth += 1
        size = math.ceil(count / _FANOUT**depth)
        # Spread the repeats over the whole index range, so that no leaf holds only repeats.
        order = np.linspace(0, count - 1, size * _FANOUT**depth).round().astype(np.intp)[None]
        columns = np.ascontiguousarray(points_mm.T)
        groups = [np.zeros((0, 8, _FANOUT))]
        for _ in range(depth):
            for _ in range(3):
                order = _halved(order, columns)
            discs = _discs(columns.take(order, axis=1))
            groups.append(discs.reshape(-1, _FANOUT, 8).transpose(0, 2, 1))
        leaves_mm = np.ascontiguousarray(columns.take(order, axis=1).transpose(1, 0, 2))
        flat = order.ravel()
        first = np.zeros(count, np.intp)
        first[flat[::-1]] = np.arange(len(flat))[::-1]
        once = np.zeros(len(flat), bool)
        once[first] = True
        return cls(np.concatenate(groups), leaves_mm, points_mm[flat[once]])


def _halved(order: NDArray[np.intp], columns: Floats) -> NDArray[np.intp]:
    """Cells ``(C, 2 n)`` of vertex indices -> ``(2 C, n)``, cut across their widest extent."""
    cells = columns.take(order, axis=1)
    widest = (cells.max(axis=-1) - cells.min(axis=-1)).argmax(axis=0)
    keys = cells[widest, np.arange(len(order))]
    halves = np.argpartition(keys, keys.shape[1] // 2, axis=1)
    return np.take_along_axis(order, halves, axis=1).reshape(2 * len(order), -1)


def _discs(cells: Floats) -> Floats:
    """Nodes ``(C, 8)`` of vertex sets ``(3, C, n)``."""
    middles = (cells.min(axis=-1) + cells.max(axis=-1)) / 2
    nearest = ((cells - middles[..., None]) ** 2).sum(axis=0).argmin(axis=1)
    center = np.take_along_axis(cells, nearest[None, :, None], axis=-1)
    gaps = cells - center
    radius2 = (gaps * gaps).sum(axis=0).max(axis=-1)
    by_cell = np.ascontiguousarray(gaps.transpose(1, 0, 2))
    normal = np.linalg.eigh(by_cell @ by_cell.transpose(0, 2, 1))[1][..., 0]
    thickness = np.abs((normal[:, None] @ by_cell)[:, 0]).max(axis=-1)
    # Rounded up: bounds must hold for the rounded numbers.
    sizes = np.stack([np.sqrt(radius2), thickness], axis=1) * (1 + 1e-9)
    return np.concatenate([center[..., 0].T, sizes[:, :1], normal, sizes[:, 1:]], axis=1)
