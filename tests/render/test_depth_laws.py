"""What must hold for every rendering, whatever the code."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sixd.errors import SixdError
from sixd.geometry import Mesh, Pose
from sixd.render import RenderMesh, raster, render_crop, render_depth
from tests.render.shapes import FRONT, SIZE_PX, K, blob, sheet, shifted, soup, sphere
from tests.strategies import random_poses, seeds

CENTRES = np.stack(np.meshgrid(np.arange(48) + 0.5, np.arange(36) + 0.5), axis=-1)
RAYS = np.concatenate([CENTRES, np.ones((36, 48, 1))], axis=-1) @ np.linalg.inv(K).T


@given(seed=seeds)
def test_the_order_of_the_triangles_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    mesh = soup(rng)
    shuffled = Mesh(mesh.vertices_mm, rng.permutation(mesh.faces))
    first, second = (render_depth(m, FRONT, K, SIZE_PX) for m in (mesh, shuffled))
    assert np.array_equal(first, second)


def test_the_order_of_large_meshes_does_not_matter_either(monkeypatch):
    """They are sorted for the cache."""
    rng = np.random.default_rng(2)
    ball = sphere(100, rings=70)
    order = rng.permutation(len(ball.vertices_mm))
    rank = np.argsort(order)
    mixed = Mesh(ball.vertices_mm[order], rank[ball.faces])
    pose = random_poses(rng, 1, spread_mm=100)[0]
    assert len(order) > raster.CACHED_VERTICES
    in_order = render_depth(mixed, pose, K, SIZE_PX)
    monkeypatch.setattr(raster, "CACHED_VERTICES", len(order))
    assert np.array_equal(render_depth(mixed, pose, K, SIZE_PX), in_order)


@given(seed=seeds)
def test_both_sides_of_a_triangle_are_seen(seed):
    mesh = soup(np.random.default_rng(seed))
    turned = Mesh(mesh.vertices_mm, mesh.faces[:, ::-1])
    first, second = (render_depth(m, FRONT, K, SIZE_PX) for m in (mesh, turned))
    assert ((first > 0) == (second > 0)).mean() > 0.999
    both = (first > 0) & (second > 0)
    np.testing.assert_allclose(first[both], second[both], atol=1e-3)


@given(seed=seeds, power=st.integers(-3, 3))
def test_a_scaled_scene_has_scaled_depth(seed, power):
    """By powers of two, which round nothing."""
    rng = np.random.default_rng(seed)
    mesh, pose, scale = blob(rng), random_poses(rng, 1, spread_mm=300)[0], 2.0**power
    scaled = Mesh(mesh.vertices_mm * scale, mesh.faces)
    expected = scale * render_depth(mesh, pose, K, SIZE_PX)
    moved = Pose(pose.R, pose.t_mm * scale)
    assert np.array_equal(render_depth(scaled, moved, K, SIZE_PX), expected)


@given(seed=seeds)
def test_a_larger_canvas_shows_the_same_image_in_its_middle(seed):
    rng = np.random.default_rng(seed)
    mesh, pose = blob(rng), random_poses(rng, 1, spread_mm=400)[0]
    width, height = SIZE_PX
    canvas = render_depth(mesh, pose, shifted(K, width, height), (3 * width, 3 * height))
    part = canvas[height : 2 * height, width : 2 * width]
    np.testing.assert_allclose(part, render_depth(mesh, pose, K, SIZE_PX), atol=1e-6)


@given(seed=seeds)
def test_two_objects_in_one_mesh_show_the_nearer(seed):
    rng = np.random.default_rng(seed)
    a, b = soup(rng), soup(rng)
    joined = Mesh(
        np.concatenate([a.vertices_mm, b.vertices_mm]),
        np.concatenate([a.faces, b.faces + len(a.vertices_mm)]),
    )
    nearest = np.full(SIZE_PX[::-1], np.inf)
    for mesh in (a, b):
        depth = render_depth(mesh, FRONT, K, SIZE_PX)
        nearest = np.minimum(nearest, np.where(depth > 0, depth, np.inf))
    nearest[np.isinf(nearest)] = 0
    np.testing.assert_allclose(render_depth(joined, FRONT, K, SIZE_PX), nearest, atol=1e-9)


@given(seed=seeds)
def test_a_sheet_of_triangles_has_its_planes_depth_and_no_holes(seed):
    """Pixel i samples u = i + 0.5; at any other place of the pixel the depth is another."""
    rng = np.random.default_rng(seed)
    slope = rng.uniform(-0.5, 0.5, 2)
    base_mm, half_mm = rng.uniform(300, 2000), 3000.0
    across, along = np.array([1.0, 0, slope[0]]), np.array([0, 1.0, slope[1]])
    corner = np.array([0, 0, base_mm]) - half_mm * (across + along)
    mesh = sheet(corner, 2 * half_mm * across, 2 * half_mm * along, rng)
    expected = base_mm / (1 - RAYS[..., :2] @ slope)
    np.testing.assert_allclose(render_depth(mesh, FRONT, K, SIZE_PX), expected, rtol=1e-9)


@pytest.mark.parametrize("tilt", [0.0, 0.2])
def test_the_ground_under_the_camera_is_seen_up_to_the_horizon(tilt):
    """It reaches below and behind the camera: cut at the near plane, not dropped."""
    y_mm, far = 150.0, 1e6
    corners = [[-far, y_mm, -far], [far, y_mm, -far], [far, y_mm, far], [-far, y_mm, far]]
    mesh = Mesh(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))
    cos, sin = np.cos(tilt), np.sin(tilt)
    R = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    depth = render_depth(mesh, Pose(R, np.zeros(3)), K, SIZE_PX)
    downward = (RAYS @ R)[..., 1]
    with np.errstate(divide="ignore"):
        expected = np.where(downward > y_mm / 1e5, y_mm / downward, 0)
    sure = (expected > 0) | (downward < 0)
    np.testing.assert_allclose(depth[sure], expected[sure], rtol=1e-7)


def test_a_ball_has_the_depth_of_a_ball():
    radius_mm, middle = 100.0, np.array([20.0, -10, 500])
    depth = render_depth(sphere(radius_mm), Pose(np.eye(3), middle), K, SIZE_PX)
    # |z ray - middle| = radius, the nearer root
    a, b = (RAYS**2).sum(axis=-1), RAYS @ middle
    root = b**2 - a * (middle @ middle - radius_mm**2)
    expected = np.where(root > 0, (b - np.sqrt(np.maximum(root, 0))) / a, 0)
    inner = root > 0.05 * root.max()
    np.testing.assert_allclose(depth[inner], expected[inner], atol=0.5)
    assert np.count_nonzero((depth > 0) & (root <= 0)) == 0


def test_a_tiny_triangle_covers_exactly_the_centre_it_contains():
    for u, v in ((7.5, 9.5), (0.5, 0.5), (47.5, 35.5)):
        around = np.array([[-1e-3, -1e-3], [2e-3, 0], [0, 2e-3]])
        pixels = np.concatenate([around + np.array([u, v]), np.ones((3, 1))], axis=-1)
        mesh = Mesh(500 * pixels @ np.linalg.inv(K).T, np.array([[0, 1, 2]]))
        depth = render_depth(mesh, FRONT, K, SIZE_PX)
        assert np.argwhere(depth).tolist() == [[int(v), int(u)]]
        moved = render_depth(mesh, FRONT, shifted(K, 0.4, 0), SIZE_PX)
        assert not moved.any()


@pytest.mark.parametrize(
    "z_mm", [-500.0, 0.0, 0.5], ids=["behind", "in the camera plane", "nearer than the near plane"]
)
def test_what_is_not_in_front_of_the_camera_is_not_seen(z_mm):
    flat = np.array([[-50, -50, 0], [50, -50, 0], [0, 50, 0.0]])
    mesh = Mesh(flat, np.array([[0, 1, 2]]))
    crop = render_crop(mesh, Pose(np.eye(3), np.array([0, 0, z_mm])), K, SIZE_PX)
    assert crop.depth_mm.shape == (0, 0)


@pytest.mark.parametrize(
    "mesh",
    [
        Mesh(np.zeros((0, 3)), np.zeros((0, 3), int)),
        Mesh(np.array([[0, 0, 500.0]]), np.zeros((0, 3), int)),
        Mesh(np.array([[0, 0, 500.0]]), np.array([[0, 0, 0]])),
        Mesh(np.array([[0, 0, 500.0], [9, 9, 500]]), np.array([[0, 1, 1], [0, 0, 1]])),
    ],
    ids=["nothing", "a point cloud", "a point", "a line"],
)
def test_a_mesh_without_area_shows_nothing(mesh):
    assert not render_depth(mesh, FRONT, K, SIZE_PX).any()


BALL = RenderMesh.build(sphere(50, rings=6))
NAN_POSE = Pose(np.eye(3), np.array([0, np.nan, 500]))


@pytest.mark.parametrize(
    ("pose", "camera", "size_px", "message"),
    [
        (NAN_POSE, K, SIZE_PX, "finite"),
        (FRONT, K + np.inf, SIZE_PX, "finite"),
        (FRONT, K.T, SIZE_PX, "0 0 1"),
        (FRONT, K[:2], SIZE_PX, "shape"),
        (Pose.identity(2), K, SIZE_PX, "one pose"),
        (FRONT, K, (0, 36), "sides"),
        (FRONT, K, (40000, 36), "sides"),
    ],
)
def test_bad_input_is_refused_with_a_reason(pose, camera, size_px, message):
    with np.errstate(invalid="ignore"), pytest.raises(SixdError, match=message):
        render_depth(BALL, pose, camera, size_px)


def test_numbers_that_overflow_do_not_write_outside_the_image():
    huge = Pose(np.eye(3), np.array([1e300, -1e300, 2.0]))
    assert not render_depth(BALL, huge, K * [[1e5], [1e5], [1]], SIZE_PX).any()
