from __future__ import annotations

import numpy as np
import pytest

from sixd.geometry import Mesh
from sixd.synth.creases import creased
from sixd.synth.objects import builtin_objects
from sixd.synth.surfaces import lattice, revolved

OBJECTS = builtin_objects()


def mesh_of(surface) -> Mesh:
    return Mesh(surface.vertices_mm, surface.faces)


def face_normals(mesh) -> np.ndarray:
    a, b, c = np.moveaxis(mesh.vertices_mm[mesh.faces], 1, 0)
    normals = np.cross(b - a, c - a)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


@pytest.mark.parametrize("item", OBJECTS.values(), ids=lambda item: item.name)
def test_triangles_and_colours_stay_where_they_are(item):
    split = creased(item.mesh)
    before, after = (m.vertices_mm[m.faces] for m in (item.mesh, split))
    assert np.array_equal(before, after)
    assert np.array_equal(item.mesh.colors[item.mesh.faces], split.colors[split.faces])
    np.testing.assert_allclose(np.linalg.norm(split.normals, axis=1), 1)


@pytest.mark.parametrize("item", OBJECTS.values(), ids=lambda item: item.name)
def test_a_corner_normal_is_near_that_of_its_triangle(item):
    split = creased(item.mesh, 40.0)
    cosines = (split.normals[split.faces] * face_normals(split)[:, None]).sum(axis=-1)
    assert cosines.min() > np.cos(np.deg2rad(40.0))


def test_a_box_has_flat_faces_and_a_sphere_none():
    box = creased(mesh_of(lattice([[0.0, 1, 2]] * 3, np.ones((2, 2, 2), bool))))
    assert np.allclose(box.normals[box.faces], face_normals(box)[:, None])
    assert len(box.vertices_mm) == 6 * 9
    polar = np.linspace(0, np.pi, 33)
    ball = mesh_of(revolved(np.stack([10 * np.sin(polar), -10 * np.cos(polar)], axis=1), 64))
    smooth = creased(ball)
    assert len(smooth.vertices_mm) == len(ball.vertices_mm)
    outward = smooth.vertices_mm / np.linalg.norm(smooth.vertices_mm, axis=1, keepdims=True)
    assert (smooth.normals * outward).sum(axis=1).min() > 0.99
