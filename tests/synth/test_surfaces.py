from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sixd.synth import shapes
from sixd.synth.surfaces import Bore, Stud, Surface, lattice, revolved

SHAPES = [
    shapes.carton,
    shapes.brick,
    shapes.nut,
    shapes.bottle,
    shapes.mug,
    shapes.bracket,
]


def directed_edges(surface: Surface) -> np.ndarray:
    f = surface.faces.astype(np.int64)
    edges = np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]])
    return edges[:, 0] * len(surface.vertices_mm) + edges[:, 1]


def reversed_edges(surface: Surface) -> np.ndarray:
    return directed_edges(Surface(surface.vertices_mm, surface.faces[:, ::-1]))


def volume_mm3(surface: Surface) -> float:
    a, b, c = np.moveaxis(surface.vertices_mm[surface.faces], 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def handles(surface: Surface) -> int:
    n_edges = len(surface.faces) * 3 // 2
    return (2 - (len(surface.vertices_mm) - n_edges + len(surface.faces))) // 2


def assert_closed_and_outward(surface: Surface) -> None:
    edges = directed_edges(surface)
    assert len(np.unique(edges)) == len(edges), "an edge is walked twice in one direction"
    assert set(edges) == set(reversed_edges(surface)), "an edge has no neighbour"
    assert volume_mm3(surface) > 0
    assert len(np.unique(surface.faces)) == len(surface.vertices_mm), "unused vertices"
    a, b, c = np.moveaxis(surface.vertices_mm[surface.faces], 1, 0)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 1e-3, "an empty triangle"


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.__name__)
def test_a_built_in_shape_is_closed_and_turned_outward(shape):
    surface, colours = shape()
    assert_closed_and_outward(surface)
    assert colours.shape == surface.vertices_mm.shape
    assert len(surface.faces) <= 6000


@pytest.mark.parametrize(
    ("shape", "n_handles"),
    list(zip(SHAPES, [0, 0, 1, 0, 1, 4], strict=True)),
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_a_built_in_shape_has_as_many_holes_as_the_thing(shape, n_handles):
    assert handles(shape()[0]) == n_handles


cells = st.lists(st.booleans(), min_size=8, max_size=8)


@given(cells=cells, pitch=st.floats(1.0, 9.0))
def test_the_volume_of_a_lattice_is_that_of_its_cells(cells, pitch):
    filled = np.array([*cells, True]).reshape(3, 3, 1)
    cuts = [np.arange(4) * pitch, np.arange(4) * 2.0, [0.0, 3.0]]
    surface = lattice(cuts, filled)
    assert volume_mm3(surface) == pytest.approx(filled.sum() * pitch * 2.0 * 3.0)


@given(
    axis=st.integers(0, 2),
    side=st.sampled_from([-1, 1]),
    radius=st.floats(0.5, 3.9),
    shift=st.floats(-0.1, 0.1),
)
def test_studs_and_bores_keep_a_box_closed(axis, side, radius, shift):
    cuts = [[-5.0, 4.0]] * 3
    filled = np.ones((1, 1, 1), dtype=bool)
    stud = Stud(axis, side, (-0.5 + shift, -0.5), radius, 2.0)
    bore = Bore((axis + 1) % 3, (-0.5, -0.5 + shift), radius)
    studded = lattice(cuts, filled, [stud])
    assert_closed_and_outward(studded)
    assert volume_mm3(studded) > 9.0**3
    bored = lattice(cuts, filled, bores=[bore])
    assert_closed_and_outward(bored)
    assert volume_mm3(bored) < 9.0**3
    assert handles(bored) == 1


@given(radius=st.floats(1.0, 50.0), height=st.floats(1.0, 50.0))
def test_a_revolved_rectangle_is_nearly_a_cylinder(radius, height):
    surface = revolved(np.array([[0, 0], [radius, 0], [radius, height], [0, height]]), 256)
    assert_closed_and_outward(surface)
    assert volume_mm3(surface) == pytest.approx(np.pi * radius**2 * height, rel=1e-3)
