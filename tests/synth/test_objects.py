from __future__ import annotations

import numpy as np
import pytest

from sixd.geometry import Symmetries, read_mesh, write_ply
from sixd.metrics.reference import mssd
from sixd.synth.objects import builtin_objects, turn_matrix

OBJECTS = builtin_objects()
ids = pytest.mark.parametrize("item", OBJECTS.values(), ids=lambda item: item.name)


def centre_of_mass_mm(vertices_mm, faces) -> np.ndarray:
    a, b, c = np.moveaxis(vertices_mm[faces], 1, 0)
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c))
    return ((a + b + c) / 4 * volumes[:, None]).sum(axis=0) / volumes.sum()


@ids
def test_the_diameter_is_the_largest_distance_of_two_vertices(item):
    v = item.mesh.vertices_mm
    gaps = [np.linalg.norm(v - v[i], axis=1).max() for i in range(len(v))]
    assert item.diameter_mm == pytest.approx(max(gaps), abs=1e-9)


@ids
def test_the_origin_is_the_centre_of_the_bounding_box(item):
    v = item.mesh.vertices_mm
    np.testing.assert_allclose(v.min(axis=0) + v.max(axis=0), 0, atol=1e-4)


@ids
def test_a_ply_file_holds_exactly_the_mesh_in_memory(item, tmp_path):
    write_ply(tmp_path / "o.ply", item.mesh)
    read = read_mesh(tmp_path / "o.ply")
    assert np.array_equal(read.vertices_mm, item.mesh.vertices_mm)
    assert np.array_equal(read.faces, item.mesh.faces)
    assert np.array_equal(read.colors, item.mesh.colors)


def test_every_kind_of_symmetry_is_among_the_objects():
    kinds = {(len(o.symmetries.discrete) > 0, len(o.symmetries.axes)) for o in OBJECTS.values()}
    assert kinds == {(False, 0), (True, 0), (False, 1)}
    assert sorted(len(o.symmetries.discrete) for o in OBJECTS.values()) == [0, 0, 0, 0, 1, 5]


@ids
def test_a_declared_symmetry_maps_vertices_and_colours_onto_themselves(item):
    v, colours = item.mesh.vertices_mm, item.mesh.colors.astype(int)
    for k in range(len(item.symmetries.discrete)):
        turned = item.symmetries.discrete[k].apply(v)
        gaps = np.linalg.norm(turned[:, None] - v, axis=-1)
        assert gaps.min(axis=1).max() < 1e-4
        assert np.array_equal(colours[gaps.argmin(axis=1)], colours)


def test_the_bottle_is_a_surface_of_revolution():
    bottle = next(o for o in OBJECTS.values() if o.symmetries.axes)
    x, y, z = bottle.mesh.vertices_mm.T
    radius = np.hypot(x, y)
    rings = np.stack([radius, z], axis=1).round(3)
    for ring in np.unique(rings[radius > 1e-6], axis=0):
        here = (rings == ring).all(axis=1)
        angles = np.sort(np.arctan2(y[here], x[here]))
        assert len(angles) == 64
        np.testing.assert_allclose(np.diff(angles), 2 * np.pi / 64, atol=1e-5)
        assert len(np.unique(bottle.mesh.colors[here], axis=0)) == 1


@ids
def test_a_symmetric_copy_has_no_error(item):
    turns = item.symmetries.transforms()
    identity = turns[:1]
    for k in range(0, len(turns), max(1, len(turns) // 8)):
        error = mssd(turns[k : k + 1], identity, item.mesh.vertices_mm, turns)
        # PLY's float32 coordinates are 4e-6 mm apart here.
        assert error[0] < 1e-4


@pytest.mark.parametrize("name", ["tea carton", "mug", "angle bracket"])
def test_an_object_without_symmetry_looks_different_after_every_half_turn(name):
    item = next(o for o in OBJECTS.values() if o.name == name)
    v, colours = item.mesh.vertices_mm, item.mesh.colors.astype(int)
    for axis in "xyz":
        turned = v @ turn_matrix(axis, 180.0).T
        gaps = np.linalg.norm(turned[:, None] - v, axis=-1)
        moved = gaps.min(axis=1).max() > 2.0
        recoloured = (np.abs(colours[gaps.argmin(axis=1)] - colours).max(axis=1) > 60).mean() > 0.05
        assert moved or recoloured


@ids
def test_models_info_describes_the_mesh(item):
    info = item.models_info()
    v = item.mesh.vertices_mm
    for k, axis in enumerate("xyz"):
        assert info[f"min_{axis}"] == v[:, k].min()
        assert info[f"min_{axis}"] + info[f"size_{axis}"] == pytest.approx(v[:, k].max())
    symmetries = Symmetries.from_models_info(info)
    assert len(symmetries.transforms()) == len(item.symmetries.transforms())


@ids
def test_every_way_to_rest_stands_on_three_points_that_hold_it(item):
    for rest in item.rests:
        v = item.mesh.vertices_mm @ rest.T
        assert np.linalg.det(rest) == pytest.approx(1)
        on_table = v[v[:, 2] < v[:, 2].min() + 0.05, :2]
        centre = centre_of_mass_mm(v, item.mesh.faces)[:2]
        angles = np.deg2rad(np.arange(0, 360, 5))
        directions = np.stack([np.cos(angles), np.sin(angles)])
        reach = (on_table @ directions).max(axis=0)
        # A bottle on its side touches the table along a line: it may roll, not fall.
        assert (centre @ directions <= reach + 1.0).all()


@pytest.mark.parametrize("axis", "xyz")
def test_quarter_turns_are_exact(axis):
    assert np.array_equal(np.linalg.matrix_power(turn_matrix(axis, 90.0), 4), np.eye(3))
    np.testing.assert_allclose(
        turn_matrix(axis, 30.0) @ turn_matrix(axis, 60.0), turn_matrix(axis, 90.0), atol=1e-15
    )
