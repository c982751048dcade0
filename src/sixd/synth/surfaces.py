"""Closed triangle surfaces from few parameters: revolved, swept, boxes with round holes.

Every function returns triangles that turn counter-clockwise seen from outside, so that joined and
welded parts make a solid whose edges each belong to exactly two triangles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int32]

CIRCLE_POINTS = 32
"""Corners of a round hole or stud; a multiple of four, so that it meets its square's sides."""

_WELD_MM = 1e-4


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles ``faces (F, 3)`` over ``vertices_mm (V, 3)``."""

    vertices_mm: Floats
    faces: Ints


@dataclass(frozen=True)
class Stud:
    """A round post on a face of a `lattice`: on the ``side`` (+1, -1) of ``axis``, at a centre."""

    axis: int
    side: int
    centre_mm: tuple[float, float]
    """On the two other axes, in cyclic order after ``axis``."""
    radius_mm: float
    height_mm: float


@dataclass(frozen=True)
class Bore:
    """A round hole through a `lattice` along ``axis``; must fit inside one cell's face."""

    axis: int
    centre_mm: tuple[float, float]
    radius_mm: float


def join(parts: Sequence[Surface]) -> Surface:
    """Put surfaces side by side, without welding."""
    starts = np.cumsum([0, *(len(part.vertices_mm) for part in parts)])
    faces = [part.faces + start for part, start in zip(parts, starts[:-1], strict=True)]
    return Surface(
        np.concatenate([part.vertices_mm for part in parts]),
        np.concatenate(faces).astype(np.int32),
    )


def weld(surface: Surface) -> Surface:
    """Unite vertices at one place; drop triangles that vanish by it, and unused vertices."""
    keys = np.round(surface.vertices_mm / _WELD_MM).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    faces = first[inverse.reshape(-1)][surface.faces]
    a, b, c = faces.T
    used, renumbered = np.unique(
        faces[(a != b) & (b != c) & (c != a)].reshape(-1), return_inverse=True
    )
    return Surface(surface.vertices_mm[used], renumbered.reshape(-1, 3).astype(np.int32))


def sheet(rings_mm: Floats, *, closed: bool = False, without: Bools | None = None) -> Surface:
    """Skin over rings ``(K, N, 3)`` that turn counter-clockwise about the way they advance.

    ``closed`` joins the last ring to the first; ``without (K-1, N)`` leaves out cells.
    """
    n_rings, n_points, _ = rings_mm.shape
    index = np.arange(n_rings * n_points).reshape(n_rings, n_points)
    lower, upper = (index, np.roll(index, -1, axis=0)) if closed else (index[:-1], index[1:])
    a, b = lower, np.roll(lower, -1, axis=1)
    d, c = upper, np.roll(upper, -1, axis=1)
    quads = np.stack([a, b, c, d], axis=-1)
    kept = quads.reshape(-1, 4) if without is None else quads[~without]
    return Surface(rings_mm.reshape(-1, 3), _split_quads(kept))


def circle(radius_mm: float | Floats, z_mm: float | Floats, angles: Floats) -> Floats:
    """Ring ``(N, 3)`` about the z axis; radius and height may vary with the angle."""
    ring = np.zeros((len(angles), 3))
    ring[:, 0] = radius_mm * np.cos(angles)
    ring[:, 1] = radius_mm * np.sin(angles)
    ring[:, 2] = z_mm
    return ring


def turn(sectors: int) -> Floats:
    """Angles of one turn, the last not repeating the first, in radians."""
    angles: Floats = np.linspace(0.0, 2 * np.pi, sectors, endpoint=False)
    return angles


def profile_rings(profile_mm: Floats, sectors: int) -> Floats:
    """Rings ``(K, N, 3)`` of a profile ``(K, 2)`` of (radius, z) turned about the z axis."""
    angles = turn(sectors)
    return np.stack([circle(radius, z, angles) for radius, z in profile_mm])


def revolved(profile_mm: Floats, sectors: int) -> Surface:
    """Solid of revolution about z; the profile runs on the outside from bottom to top axis."""
    return weld(sheet(profile_rings(profile_mm, sectors)))


def lattice(
    cuts_mm: Sequence[Sequence[float] | Floats],
    filled: Bools,
    studs: Sequence[Stud] = (),
    bores: Sequence[Bore] = (),
) -> Surface:
    """Solid of the filled cells between ascending cuts along x, y and z.

    Args:
        cuts_mm: three lists of coordinates, one longer than ``filled`` along that axis.
        filled: ``(X, Y, Z)`` which cells are material.
        studs: round posts; each replaces the part of its cell's outer face that it stands on.
        bores: round holes, through all material along their axis.
    """
    cuts = [np.asarray(c, dtype=np.float64) for c in cuts_mm]
    parts = []
    for axis in range(3):
        for side in (-1, 1):
            parts += _outer_faces(cuts, filled, axis, side, studs, bores)
        parts += [
            wall for bore in bores if bore.axis == axis for wall in _walls(cuts, filled, bore)
        ]
    return weld(join(parts))


def _split_quads(quads: NDArray[np.intp]) -> Ints:
    a, b, c, d = quads.reshape(-1, 4).T
    triangles = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=1)
    return triangles.reshape(-1, 3).astype(np.int32)


def _lift(flat_mm: Floats, axis: int, height_mm: float | Floats) -> Floats:
    """Points ``(..., 2)`` of the plane across ``axis``, in cyclic order, to ``(..., 3)``."""
    points = np.zeros((*flat_mm.shape[:-1], 3))
    points[..., (axis + 1) % 3] = flat_mm[..., 0]
    points[..., (axis + 2) % 3] = flat_mm[..., 1]
    points[..., axis] = height_mm
    return points


def _outer_faces(
    cuts: Sequence[Floats],
    filled: Bools,
    axis: int,
    side: int,
    studs: Sequence[Stud],
    bores: Sequence[Bore],
) -> list[Surface]:
    """Faces of filled cells that look along ``side`` of ``axis`` into empty cells."""
    grid = np.moveaxis(filled, [axis, (axis + 1) % 3, (axis + 2) % 3], [0, 1, 2])
    padded = np.pad(grid, ((1, 1), (0, 0), (0, 0)))
    beyond = padded[2:] if side > 0 else padded[:-2]
    cells = np.argwhere(grid & ~beyond)
    us, vs = cuts[(axis + 1) % 3], cuts[(axis + 2) % 3]
    heights = cuts[axis][cells[:, 0] + (side > 0)]
    rounds: list[Stud | Bore] = [s for s in studs if (s.axis, s.side) == (axis, side)]
    rounds += [b for b in bores if b.axis == axis]
    plain = np.ones(len(cells), dtype=bool)
    parts = []
    for item in rounds:
        u, v = _cell_of(us, item.centre_mm[0]), _cell_of(vs, item.centre_mm[1])
        for row in np.flatnonzero((cells[:, 1] == u) & (cells[:, 2] == v)):
            plain[row] = False
            rim = _rim(item)
            box = np.array([[us[u], vs[v]], [us[u + 1], vs[v + 1]]])
            parts.append(_pierced(box, rim, axis, side, heights[row]))
            if isinstance(item, Stud):
                parts.append(_post(item, heights[row]))
    u, v = cells[plain, 1], cells[plain, 2]
    square = np.stack(
        [
            np.stack([us[u], vs[v]], -1),
            np.stack([us[u + 1], vs[v]], -1),
            np.stack([us[u + 1], vs[v + 1]], -1),
            np.stack([us[u], vs[v + 1]], -1),
        ],
        axis=1,
    )[:, ::side]
    corners = _lift(square, axis, heights[plain, None]).reshape(-1, 3)
    parts.append(Surface(corners, _split_quads(np.arange(len(corners)).reshape(-1, 4))))
    return parts


def _cell_of(cuts: Floats, place_mm: float) -> int:
    return int(np.searchsorted(cuts, place_mm)) - 1


def _rim(item: Stud | Bore, radius_mm: float | None = None) -> Floats:
    ring = circle(radius_mm or item.radius_mm, 0.0, turn(CIRCLE_POINTS))[:, :2]
    rim: Floats = ring + np.asarray(item.centre_mm)
    return rim


def _pierced(box_mm: Floats, rim_mm: Floats, axis: int, side: int, height_mm: float) -> Surface:
    """A rectangle with a round hole, only the four corners on its border."""
    (u0, v0), (u1, v1) = box_mm
    corners = np.array([[u1, v1], [u0, v1], [u0, v0], [u1, v0]])
    n = len(rim_mm)
    k = np.arange(n)
    corner = n + (k * 4) // n
    fans = np.stack([k, corner, (k + 1) % n], axis=-1)
    q = np.arange(4)
    sides = np.stack([n + q, n + (q + 1) % 4, ((q + 1) * n // 4) % n], axis=-1)
    faces = np.concatenate([fans, sides])[:, ::side]
    points = _lift(np.concatenate([rim_mm, corners]), axis, height_mm)
    return Surface(points, faces.astype(np.int32))


def _post(stud: Stud, base_mm: float) -> Surface:
    """Wall, bevel and lid of a stud."""
    bevel_mm = min(0.5, stud.height_mm / 3, stud.radius_mm / 3)
    steps = (
        (stud.radius_mm, 0.0),
        (stud.radius_mm, stud.height_mm - bevel_mm),
        (stud.radius_mm - bevel_mm, stud.height_mm),
        (1e-9, stud.height_mm),
    )
    rings = [
        _lift(_rim(stud, radius), stud.axis, base_mm + stud.side * height)
        for radius, height in steps
    ]
    return sheet(np.stack(rings)[:, :: stud.side])


def _walls(cuts: Sequence[Floats], filled: Bools, bore: Bore) -> list[Surface]:
    """Inner walls of a bore, one for each run of material it goes through."""
    axis = bore.axis
    u = _cell_of(cuts[(axis + 1) % 3], bore.centre_mm[0])
    v = _cell_of(cuts[(axis + 2) % 3], bore.centre_mm[1])
    column = np.moveaxis(filled, [axis, (axis + 1) % 3, (axis + 2) % 3], [0, 1, 2])[:, u, v]
    edges = np.flatnonzero(np.diff(np.pad(column.astype(np.int8), 1)))
    rim = _rim(bore)
    return [
        sheet(np.stack([_lift(rim, axis, cuts[axis][at]) for at in (high, low)]))
        for low, high in edges.reshape(-1, 2)
    ]
