"""Scenes of several objects: what each pixel sees, and pictures of it."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given

from sixd.errors import MissingDataError
from sixd.geometry import Mesh, Pose
from sixd.render import (
    Light,
    SceneObject,
    rasterise_scene,
    reference,
    render_depth,
    render_scene,
)
from tests.render.shapes import FRONT, SIZE_PX, K, blob, soup, sphere
from tests.strategies import random_poses, seeds

FLAT = Light(ambient=1.0, highlight=0.0, shadows=False)


def facing(corners: list[list[float]], z_mm: float, **attributes) -> Mesh:
    """A rectangle parallel to the image, given by its lower left and upper right pixel corner."""
    (u0, v1), (u1, v0) = corners
    pixels = np.array([[u0, v1, 1], [u1, v1, 1], [u1, v0, 1], [u0, v0, 1]], float)
    vertices = z_mm * pixels @ np.linalg.inv(K).T
    return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]]), **attributes)


@given(seed=seeds)
def test_one_object_is_seen_as_defined(seed):
    mesh = soup(np.random.default_rng(seed))
    expected = reference.rasterise(mesh, FRONT, K, SIZE_PX)
    raster = rasterise_scene([SceneObject(mesh, FRONT)], K, SIZE_PX)
    same = raster.face_id == expected.face
    assert same.mean() > 0.999  # ties at edges
    seen = same & (expected.face >= 0)
    np.testing.assert_allclose(raster.depth_mm[seen], expected.depth_mm[seen], rtol=1e-9)
    weights, expected_weights = raster.barycentric[seen], expected.barycentric[seen]
    np.testing.assert_allclose(weights, expected_weights, atol=1e-6)


@given(seed=seeds)
def test_weights_of_the_corners_give_back_the_point(seed):
    rng = np.random.default_rng(seed)
    mesh, pose = blob(rng), random_poses(rng, 1, spread_mm=200)[0]
    raster = rasterise_scene([SceneObject(mesh, pose)], K, SIZE_PX)
    seen = raster.instance_id == 0
    corners = pose.apply(mesh.vertices_mm)[mesh.faces[raster.face_id[seen]]]
    points = np.einsum("nk,nkc->nc", raster.barycentric[seen], corners)
    rays = reference.pixel_rays(K, SIZE_PX)[seen]
    np.testing.assert_allclose(points, rays * raster.depth_mm[seen][:, None], atol=1e-6)


@given(seed=seeds)
def test_the_nearest_object_hides_the_others(seed):
    rng = np.random.default_rng(seed)
    objects = [SceneObject(blob(rng), pose) for pose in random_poses(rng, 4, spread_mm=150)]
    raster = rasterise_scene(objects, K, SIZE_PX)
    depths = np.array([render_depth(o.mesh, o.pose_c_m, K, SIZE_PX) for o in objects])
    depths[depths == 0] = np.inf
    nearest = depths.argmin(axis=0)
    nearest[np.isinf(depths.min(axis=0))] = -1
    assert np.array_equal(raster.instance_id, nearest)


def test_the_truth_of_a_picture_does_not_depend_on_how_it_is_coloured():
    rng = np.random.default_rng(5)
    objects = [SceneObject(blob(rng), pose) for pose in random_poses(rng, 3, spread_mm=150)]
    plain = render_scene(objects, K, SIZE_PX, light=FLAT, supersample=1)
    fine = render_scene(objects, K, SIZE_PX, supersample=3)
    assert np.array_equal(plain.depth_mm, fine.depth_mm)
    assert np.array_equal(plain.instance_id, fine.instance_id)
    assert (fine.rgb.dtype, fine.rgb.shape) == (np.uint8, (36, 48, 3))


def test_under_even_light_each_object_has_its_colour():
    red = SceneObject(facing([[5, 30], [20, 5]], 400), FRONT, color=(250, 10, 20))
    painted = facing([[25, 30], [40, 5]], 500, colors=np.full((4, 3), [7, 90, 200], np.uint8))
    picture = render_scene(
        [red, SceneObject(painted, FRONT)], K, SIZE_PX, light=FLAT, background=(1, 2, 3)
    )
    assert np.abs(picture.rgb[10, 10].astype(int) - [250, 10, 20]).max() <= 16
    assert np.abs(picture.rgb[10, 30].astype(int) - [7, 90, 200]).max() <= 16
    assert picture.rgb[0, 0].tolist() == [1, 2, 3]
    assert picture.instance_id[10, [10, 30, 45]].tolist() == [0, 1, -1]


def test_a_photo_can_be_the_background():
    photo = np.random.default_rng(0).integers(0, 256, (36, 48, 3), np.uint8)
    ball = SceneObject(sphere(50, rings=8), Pose(np.eye(3), np.array([0, 0, 600.0])))
    picture = render_scene([ball], K, SIZE_PX, background=photo)
    border = np.s_[:, :5]
    assert np.array_equal(picture.rgb[border], photo[border])


def test_a_texture_lies_the_right_way_up(tmp_path):
    """uv (0, 0) is the lower left corner of the image."""
    import cv2

    file = tmp_path / "four.png"
    quarters = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    cv2.imwrite(str(file), quarters.repeat(32, 0).repeat(32, 1)[..., ::-1])
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    mesh = facing([[8, 34], [40, 2]], 300, uv=uv, texture_file=file)
    picture = render_scene([SceneObject(mesh, FRONT)], K, SIZE_PX, light=FLAT)
    seen = picture.rgb[[8, 8, 28, 28], [14, 34, 14, 34]].reshape(2, 2, 3).astype(int)
    # Light that is all ambient still comes a little more from its own side.
    assert np.abs(seen - quarters).max() < 20


def test_a_missing_texture_is_named(tmp_path):
    uv = np.zeros((4, 2))
    mesh = facing([[8, 34], [40, 2]], 300, uv=uv, texture_file=tmp_path / "gone.png")
    with pytest.raises(MissingDataError, match=r"gone\.png"):
        render_scene([SceneObject(mesh, FRONT)], K, SIZE_PX)
    assert render_scene([SceneObject(mesh, FRONT, color=(9, 9, 9))], K, SIZE_PX).rgb.any()


def test_an_object_between_wall_and_light_throws_a_shadow():
    wall = SceneObject(facing([[-40, 80], [90, -40]], 900), FRONT)
    ball = SceneObject(sphere(60, rings=12), Pose(np.eye(3), np.array([0, 0, 700.0])))
    light = Light(to_light_c=(-1.0, 0, -1.0), highlight=0)
    bare = render_scene([wall], K, SIZE_PX, light=light).rgb.astype(int)
    shaded = render_scene([wall, ball], K, SIZE_PX, light=light)
    on_wall = shaded.instance_id == 0
    darker = on_wall & ((bare - shaded.rgb).min(axis=-1) > 40)
    assert darker.sum() > 20
    # It falls on the side away from the light.
    assert np.nonzero(darker)[1].min() > K[0, 2]
    unshaded = on_wall & (np.arange(48) < 15)
    assert np.abs(bare - shaded.rgb)[unshaded].max() <= 2


def test_both_sides_of_a_surface_are_lit_alike():
    mesh = sphere(80, rings=16)
    pose = Pose(np.eye(3), np.array([0, 0, 500.0]))
    inside_out = Mesh(mesh.vertices_mm, mesh.faces[:, ::-1])
    first, second = (render_scene([SceneObject(m, pose)], K, SIZE_PX) for m in (mesh, inside_out))
    assert np.abs(first.rgb.astype(int) - second.rgb).max() <= 3


def test_importing_the_renderer_does_not_import_the_compiler():
    code = (
        "import sys, sixd.render, sixd.metrics.vsd; "
        "assert not {'numba', 'cv2', 'scipy', 'trimesh'} & sys.modules.keys()"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
