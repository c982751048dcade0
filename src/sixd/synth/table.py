"""The table that the objects stand on: planks of wood, top at z = 0."""

from __future__ import annotations

import numpy as np

from sixd.geometry.mesh import Mesh
from sixd.synth.surfaces import lattice

LENGTH_MM, WIDTH_MM, THICKNESS_MM = 1000.0, 720.0, 28.0
_PLANK_MM, _CELL_MM = 90.0, 20.0


def table_mesh(rng: np.random.Generator) -> Mesh:
    """A wooden board about the origin, its grain and the shades of its planks drawn anew."""
    xs = np.arange(-LENGTH_MM / 2, LENGTH_MM / 2 + 1, _CELL_MM)
    gaps = np.arange(-WIDTH_MM / 2, WIDTH_MM / 2 + 1, _PLANK_MM)
    # Two close cuts on both sides of each gap give it dark, sharp borders.
    ys = np.unique(
        [gap + shift for gap in gaps for shift in (-1.2, -0.6, 0.6, 1.2, 18, 36, 54, 72)]
    )
    ys = ys[(ys >= gaps[0] - 2) & (ys <= gaps[-1] + 2)]
    board = lattice((xs, ys, [-THICKNESS_MM, 0.0]), np.ones((len(xs) - 1, len(ys) - 1, 1), bool))
    x, y, _ = board.vertices_mm.T
    plank = np.floor((y - gaps[0]) / _PLANK_MM).astype(int)
    shade = rng.normal(0.0, 0.05, plank.max() + 3)[plank]
    phase = rng.uniform(0.0, 2 * np.pi, plank.max() + 3)[plank]
    grain = 0.04 * np.sin(0.21 * y + phase + 1.5 * np.sin(0.008 * x + phase))
    brightness = 1.0 + shade + grain + rng.normal(0.0, 0.015, len(x))
    in_gap = np.abs(y - gaps[np.abs(y[:, None] - gaps).argmin(axis=1)]) < 0.9
    brightness[in_gap] *= 0.55
    colours = np.clip(np.array([176.0, 132.0, 88.0]) * brightness[:, None], 0, 255)
    return Mesh(board.vertices_mm, board.faces, colors=colours.astype(np.uint8))
