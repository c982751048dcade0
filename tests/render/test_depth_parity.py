"""The fast rasteriser against its definition."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from sixd.geometry import Mesh, Pose, read_mesh
from sixd.render import RenderMesh, reference, render_crop, render_depth
from tests.render.shapes import FRONT, SIZE_PX, K, blob, shifted, soup
from tests.strategies import random_poses, seeds

TOLERANCE_MM = 1e-3
TIE_PX = 1e-6
"""A pixel whose value changes when the image moves by this lies on an edge: either is right."""


def assert_same_depth(fast: np.ndarray, mesh: Mesh, pose: Pose, K: np.ndarray = K) -> None:
    def defined(du: int, dv: int) -> np.ndarray:
        moved_K = shifted(K, du * TIE_PX, dv * TIE_PX)
        return reference.render_depth(mesh, pose, moved_K, fast.shape[::-1])

    expected = defined(0, 0)
    wrong = (np.abs(fast - expected) > TOLERANCE_MM) | ((fast > 0) != (expected > 0))
    if wrong.any():
        moved = [defined(du, dv) for du in (-1, 1) for dv in (-1, 1)]
        tie = np.ptp([expected, *moved], axis=0) > TOLERANCE_MM
        assert not (wrong & ~tie).any()


@given(seed=seeds)
def test_any_triangles_look_as_defined(seed):
    mesh = soup(np.random.default_rng(seed))
    assert_same_depth(render_depth(mesh, FRONT, K, SIZE_PX), mesh, FRONT)


@settings(max_examples=20)
@given(seed=seeds)
def test_objects_look_as_defined_inside_and_beyond_the_image(seed):
    rng = np.random.default_rng(seed)
    mesh, pose = blob(rng), random_poses(rng, 1, spread_mm=400)[0]
    assert_same_depth(render_depth(mesh, pose, K, SIZE_PX), mesh, pose)


@settings(max_examples=20)
@given(seed=seeds)
def test_a_camera_inside_an_object_sees_it_from_inside(seed):
    rng = np.random.default_rng(seed)
    mesh, pose = blob(rng), Pose(random_poses(rng, 1).R[0], rng.uniform(-70, 70, 3))
    assert_same_depth(render_depth(mesh, pose, K, SIZE_PX), mesh, pose)


def test_a_skewed_camera_looks_as_defined():
    skewed = shifted(K, 0, 0, skew=5.0)
    rng = np.random.default_rng(0)
    for _ in range(10):
        mesh, pose = blob(rng), random_poses(rng, 1, spread_mm=200)[0]
        assert_same_depth(render_depth(mesh, pose, skewed, SIZE_PX), mesh, pose, skewed)


@pytest.mark.slow
def test_scans_look_as_defined(shared_data):
    """Tens of thousands of triangles, most of them smaller than a pixel, sorted for the cache."""
    folder = shared_data / "peer_synth/dataset/lmo/models_eval"
    camera = np.array([[572.4114, 0, 325.2611], [0, 573.57043, 242.04899], [0, 0, 1]])
    rng = np.random.default_rng(1)
    for obj_id in (1, 6):
        mesh = read_mesh(folder / f"obj_{obj_id:06d}.ply")
        pose = random_poses(rng, 1, spread_mm=150)[0]
        assert_same_depth(render_depth(mesh, pose, camera, (640, 480)), mesh, pose, camera)


@given(seed=seeds)
def test_a_crop_is_the_covered_part_of_the_image(seed):
    rng = np.random.default_rng(seed)
    mesh, pose = RenderMesh.build(blob(rng)), random_poses(rng, 1, spread_mm=500)[0]
    crop, image = render_crop(mesh, pose, K, SIZE_PX), render_depth(mesh, pose, K, SIZE_PX)
    rows, columns = np.nonzero(image)
    height, width = crop.depth_mm.shape
    assert np.array_equal(
        crop.depth_mm, image[crop.y0 : crop.y0 + height, crop.x0 : crop.x0 + width]
    )
    assert np.count_nonzero(crop.depth_mm) == len(rows)
    if len(rows):
        # A vertex can reach a row or column without its surface covering a centre there.
        slack = (rows.min() - crop.y0, columns.min() - crop.x0)
        slack += (crop.y0 + height - 1 - rows.max(), crop.x0 + width - 1 - columns.max())
        assert min(slack) >= 0
        assert max(slack) <= 4
