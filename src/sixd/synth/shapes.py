"""The built-in shapes: surfaces and vertex colours of things one finds on a table.

Each function gives a closed `Surface` in millimetres, z up, and one RGB colour per vertex. Colours
are the same on all symmetric copies of a vertex where `sixd.synth.objects` declares a symmetry.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sixd.synth.surfaces import (
    Bore,
    Floats,
    Stud,
    Surface,
    circle,
    join,
    lattice,
    profile_rings,
    revolved,
    sheet,
    turn,
    weld,
)

Rgb = tuple[int, int, int]
Colours = NDArray[np.uint8]
Painted = tuple[Surface, Colours]

_EDGE_MM = 0.2
"""Half the width of the band over which neighbouring colours blend."""


def carton() -> Painted:
    """A tea carton, 64 x 40 x 100 mm: lettering in front, bar code behind; no symmetry."""
    columns = _letter_columns()
    x_edges = [-24.0, *columns, 24.0]
    z_edges = [-36.0, -33.0, -29.0, -23.0, -16.0, -4.0, *(4.0 + 4.4 * np.arange(6)), 34.0, 42.0]
    cuts = (_sharp(x_edges, 32.0), _sharp([-1.0, 1.0], 20.0), _sharp(z_edges, 50.0))
    surface = lattice(cuts, np.ones([len(c) - 1 for c in cuts], dtype=bool))
    x, y, z = surface.vertices_mm.T
    colours = _plain(surface, (24, 96, 92))
    cream, red, gold, dark = (242, 232, 208), (178, 40, 36), (214, 170, 66), (18, 40, 44)
    front, back = y == -20.0, y == 20.0
    left, right = x == -32.0, x == 32.0
    _paint(colours, (z > 34) & (z < 42) & (front | back | left | right), gold)
    _paint(colours, front & (abs(x) < 24) & (z > -4) & (z < 34), cream)
    _paint(colours, front & _letters(x, z, columns), red)
    _paint(colours, front & _cup(x, z, columns), gold)
    bars = np.searchsorted(np.asarray(columns), x) % 2 == 1
    _paint(colours, back & (abs(x) < 24) & (z > -36) & (z < -16), cream)
    _paint(colours, back & bars & (z > -33) & (z < -16), dark)
    lines = np.searchsorted(np.asarray(z_edges[6:12]), z) % 2 == 1
    _paint(colours, right & (abs(y) < 19) & (z > -4) & (z < 34), cream)
    _paint(colours, right & (abs(y) < 19) & lines, dark)
    _paint(colours, (z == 50.0) & (abs(y) < 1), dark)
    return surface, colours


def brick() -> Painted:
    """A 2 x 4 toy brick, hollow below, 64 x 32 x 24 mm: half a turn about z maps it to itself."""
    cuts = ([-32.0, -29, -16, 0, 16, 29, 32], [-16.0, -13, 0, 13, 16], [0.0, 16.0, 19.2])
    filled = np.ones((6, 4, 2), dtype=bool)
    filled[1:-1, 1:-1, 0] = False
    studs = [Stud(2, 1, (x, y), 4.7, 4.6) for x in (-24.0, -8, 8, 24) for y in (-8.0, 8)]
    surface = lattice(cuts, filled, studs)
    return surface, _plain(surface, (206, 44, 34))


def nut() -> Painted:
    """A hexagon nut with a flange, 64 mm wide: six turns of 60 degrees map it to itself."""
    angles = turn(72)
    flat_mm, chamfer = 25.0, np.tan(np.deg2rad(30.0))
    hexagon = flat_mm / np.cos((angles % (np.pi / 3)) - np.pi / 6)
    top_mm = 34.0
    corner_mm = top_mm - (hexagon - 0.98 * flat_mm) * chamfer
    outside = [
        circle(15.5, 0.0, angles),
        circle(31.0, 0.0, angles),
        circle(32.0, 1.0, angles),
        circle(32.0, 3.0, angles),
        circle(hexagon, 8.0 - 0.5 * (hexagon - flat_mm), angles),
        circle(hexagon, corner_mm, angles),
        circle(0.98 * flat_mm, top_mm, angles),
        circle(15.5, top_mm, angles),
    ]
    thread = [circle(14.0 + (k % 2), z, angles) for k, z in enumerate(np.arange(32.4, 1.0, -2.0))]
    surface = weld(sheet(np.stack(outside + thread), closed=True))
    colours = _plain(surface, (204, 176, 92))
    radius = np.hypot(*surface.vertices_mm.T[:2])
    _paint(colours, radius < 15.2, (122, 104, 58))
    return surface, colours


def bottle() -> Painted:
    """A sauce bottle with screw cap, 160 mm high, 56 mm wide: turns about z change nothing."""
    glass, label, stripe, cap = (104, 34, 22), (244, 236, 214), (36, 84, 150), (228, 192, 40)
    pieces: list[tuple[Rgb, list[tuple[float, float]]]] = [
        (glass, [(0, 3), (16, 2.4), (20, 0), (25, 0.6), (27.4, 3), (28, 7), (28, 14), (28, 20)]),
        (label, [(28.3, 20.2), (28.3, 28), (28.3, 35.9)]),
        (stripe, [(28.3, 36.1), (28.3, 43.9)]),
        (label, [(28.3, 44.1), (28.3, 54), (28.3, 64), (28.3, 73.9)]),
        (stripe, [(28.3, 74.1), (28.3, 77.9)]),
        (label, [(28.3, 78.1), (28.3, 85.8)]),
        (glass, [(28, 86), (28, 92), (27.4, 97), (25.6, 102), (22.8, 107), (19.4, 112)]),
        (glass, [(16.2, 117), (13.8, 122), (12.4, 127), (12, 132), (12, 135), (13, 135.8)]),
        (cap, [(14.8, 136), (15.4, 137), (15.4, 146), (15, 157), (14, 159.2), (11, 160), (0, 160)]),
    ]
    profile = np.array([point for _, points in pieces for point in points], dtype=np.float64)
    surface = revolved(profile, 64)
    starts = np.array([points[0][1] for _, points in pieces])
    starts[0] = -1.0
    colours = _plain(surface, glass)
    band = np.searchsorted(starts, surface.vertices_mm[:, 2] + 1e-6) - 1
    for k, (colour, _) in enumerate(pieces):
        _paint(colours, band == k, colour)
    return surface, colours


def mug() -> Painted:
    """A mug with a handle, 78 mm wide, 92 mm high; no symmetry."""
    sectors, radius_mm, height_mm = 64, 39.0, 92.0
    walls = [(radius_mm, 5.0 + 3.8 * k) for k in range(23)]
    outside = [(0, 2.5), (26, 2.5), (28, 0), (34, 0), (37, 1.2), (38.6, 3.2), *walls]
    rim = [(38.6, 90.6), (37.2, height_mm), (35.6, 91.4), (35.0, 89.6)]
    inside = [(35.0, z) for z in (74.0, 58, 42, 26, 12)]
    floor = [(34.0, 8.0), (31.0, 6.2), (0, 6.0)]
    rings = profile_rings(np.array([*outside, *rim, *inside, *floor]), sectors)
    first_wall, middle = 6, 11
    upper, lower = first_wall + middle + 5, first_wall + middle - 5
    loops = [_patch_border(ring, sectors, flip) for ring, flip in ((upper, 1), (lower, -1))]
    holes = np.zeros((len(rings) - 1, sectors), dtype=bool)
    for ring in (upper, lower):
        holes[ring - 2 : ring + 2, [-2, -1, 0, 1]] = True
    handle = sheet(_handle_rings([rings[loop] for loop in loops]))
    surface = weld(join([sheet(rings, without=holes), handle]))
    x, y, z = surface.vertices_mm.T
    out_mm = np.hypot(x, y)
    colours = _plain(surface, (238, 234, 224))
    _paint(colours, (out_mm > 38.9) & (z > 3.5), (52, 104, 158))
    _paint(colours, (out_mm > 38.9) & (out_mm < 39.1) & (z > 62) & (z < 74), (238, 234, 224))
    return surface, colours


def bracket() -> Painted:
    """An angle bracket with a gusset and four holes, 60 x 40 x 46 mm; no symmetry."""
    xs = [-30.0, -25, -9, -4, 1, 6, 18, 22, 26, 30]
    ys = [-20.0, -16, -4, 4, 16, 20]
    zs = [0.0, 5, 21, 24, 36, 41, 46]
    filled = np.zeros((9, 5, 6), dtype=bool)
    filled[:, :, 0] = True
    filled[0] = True
    filled[1, 2, 1] = True
    bores = [Bore(2, (12.0, y), 4.2) for y in (-10.0, 10.0)]
    bores += [Bore(0, (y, 30.0), 3.2) for y in (-10.0, 10.0)]
    surface = lattice((xs, ys, zs), filled, bores=bores)
    ridge = np.flatnonzero((surface.vertices_mm[:, [0, 2]] == (-9.0, 21.0)).all(axis=1))
    surface.vertices_mm[ridge, 0], surface.vertices_mm[ridge, 2] = -16.0, 14.0
    return surface, _plain(surface, (146, 152, 158))


def _plain(surface: Surface, colour: Rgb) -> Colours:
    return np.tile(np.array(colour, dtype=np.uint8), (len(surface.vertices_mm), 1))


def _paint(colours: Colours, where: NDArray[np.bool_], colour: Rgb) -> None:
    colours[where] = colour


def _sharp(edges_mm: Sequence[float], half_mm: float) -> list[float]:
    """Cuts from ``-half`` to ``half`` with two close cuts at each edge between colours."""
    inner = [edge + shift for edge in sorted(edges_mm) for shift in (-_EDGE_MM, _EDGE_MM)]
    return [-half_mm, -half_mm + 2 * _EDGE_MM, *inner, half_mm - 2 * _EDGE_MM, half_mm]


def _letter_columns() -> list[float]:
    """Borders of three columns for each of three letters."""
    return [start + 3.6 * k for start in (-18.0, -5.4, 7.2) for k in range(4)]


def _letters(x: Floats, z: Floats, columns: Sequence[float]) -> NDArray[np.bool_]:
    """Where the word TEA is, in letters of 3 x 5 cells."""
    glyphs = ("111010010010010", "111100110100111", "111101111101101")
    row = 4 - np.floor((z - 4.0) / 4.4).astype(int)
    inside = (row >= 0) & (row < 5)
    found = np.zeros(x.shape, dtype=bool)
    for k, glyph in enumerate(glyphs):
        cell = np.floor((x - columns[4 * k]) / 3.6).astype(int)
        here = inside & (cell >= 0) & (cell < 3)
        cells = np.array([bit == "1" for bit in glyph])
        found[here] |= cells[row[here] * 3 + cell[here]]
    return found


def _cup(x: Floats, z: Floats, columns: Sequence[float]) -> NDArray[np.bool_]:
    """Where the pictogram of a cup is: body, handle, saucer."""
    left, right = columns[4], columns[7]
    body = (x > left) & (x < right) & (z > -33) & (z < -16)
    handle = (x > right) & (x < columns[9]) & (z > -29) & (z < -23)
    saucer = (x > columns[2]) & (x < columns[9]) & (z > -36) & (z < -33)
    return body | handle | saucer


def _patch_border(ring: int, sectors: int, flip: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Ring and sector indices around a patch of 4 x 4 cells; ``flip`` -1 mirrors it in z."""
    path = [(-2, k) for k in range(-2, 2)] + [(k, 2) for k in range(-2, 2)]
    path += [(2, -k) for k in range(-2, 2)] + [(-k, -2) for k in range(-2, 2)]
    up, along = np.array(path).T
    return ring + flip * up, along % sectors


def _handle_rings(ends_mm: Sequence[Floats]) -> Floats:
    """Rings of a bent tube from the upper patch of a wall to the lower one, in the xz plane."""
    first, last = ends_mm
    high, low = first[:, 2].mean(), last[:, 2].mean()
    centre_x, middle, half = first[:, 0].mean() + 5.0, (high + low) / 2, (high - low) / 2
    around = np.arctan2(first[:, 2] - high, first[:, 1])
    rings = [first]
    for bend in np.linspace(0.0, np.pi, 25):
        # A superellipse: flatter at the outside, as a finger wants it.
        x = centre_x + 25.0 * np.sin(bend) ** 0.8
        z = middle + half * np.sign(np.cos(bend)) * abs(np.cos(bend)) ** 0.8
        across = np.array([np.sin(bend), 0.0, np.cos(bend)])
        section = np.cos(around)[:, None] * np.array([0.0, 6.6, 0.0])
        section = section + np.sin(around)[:, None] * 4.2 * across
        rings.append(np.array([x, 0.0, z]) + section)
    return np.stack([*rings, last])
