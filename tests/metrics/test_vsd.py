"""VSD: the fast backend against its definition, and the laws of the error."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings

from sixd.errors import SixdError
from sixd.geometry import Pose
from sixd.metrics import reference_rendered
from sixd.metrics.vsd import vsd_pairs
from sixd.render.visibility import distance_image_mm
from tests.metrics.vsd_scenes import DELTA_MM, TAUS, SmallScene, small_scene
from tests.render.shapes import K
from tests.strategies import seeds


def fast(scene: SmallScene, pairs: np.ndarray | None = None, taus=TAUS, **options) -> np.ndarray:
    pairs = scene.pairs if pairs is None else pairs
    diameters_mm = scene.diameters_mm[scene.mesh_index[pairs[:, 0]]]
    inputs = (scene.depth_mm, K, scene.prepared, scene.poses, scene.mesh_index)
    return vsd_pairs(*inputs, pairs, diameters_mm, DELTA_MM, taus, **options)


@settings(max_examples=10)  # for each way to measure; the definition is slow
@given(seed=seeds)
@pytest.mark.parametrize(
    "options", [{}, {"sphere_check": False}, {"tau_in_mm": True}, {"missing_hides": True}]
)
def test_the_fast_error_is_the_defined_error(seed, options):
    scene = small_scene(np.random.default_rng(seed))
    taus = 150 * TAUS if options.get("tau_in_mm") else TAUS
    for (est, gt), diameter_mm, errors in zip(
        scene.pairs, scene.pair_diameters_mm, fast(scene, taus=taus, **options), strict=True
    ):
        expected = reference_rendered.vsd(
            scene.poses[est],
            scene.poses[gt],
            scene.meshes[scene.mesh_index[est]],
            scene.depth_mm,
            K,
            diameter_mm,
            DELTA_MM,
            taus,
            **options,
        )
        np.testing.assert_allclose(errors, expected, rtol=0, atol=1e-12)


@given(seed=seeds)
def test_the_truth_itself_has_no_error(seed):
    scene = small_scene(np.random.default_rng(seed))
    scene.poses.R[:3], scene.poses.t_mm[:3] = (x[scene.pairs[:, 1]] for x in _parts(scene.poses))
    assert (fast(scene) == 0).all()
    true = np.repeat(scene.pairs[:, 1:], 2, axis=1)
    assert (fast(scene, true) == 0).all()


@given(seed=seeds)
def test_errors_are_fractions_that_fall_as_the_tolerance_grows(seed):
    errors = fast(small_scene(np.random.default_rng(seed)))
    assert ((errors >= 0) & (errors <= 1)).all()
    assert (np.diff(errors, axis=1) <= 0).all()


@given(seed=seeds)
def test_pairs_do_not_influence_one_another(seed):
    rng = np.random.default_rng(seed)
    scene = small_scene(rng, n_estimates=5)
    order, errors = rng.permutation(5), fast(scene)
    assert np.array_equal(fast(scene, scene.pairs[order]), errors[order])
    for row in range(5):
        assert np.array_equal(fast(scene, scene.pairs[row : row + 1]), errors[row : row + 1])


def test_threads_do_not_influence_one_another():
    scenes = [small_scene(np.random.default_rng(seed), n_estimates=8) for seed in range(24)]
    expected = [fast(scene) for scene in scenes]
    with ThreadPoolExecutor(4) as pool:
        assert np.array_equal(list(pool.map(fast, scenes)), expected)


@given(seed=seeds)
def test_tolerances_may_come_in_any_order(seed):
    rng = np.random.default_rng(seed)
    scene, order = small_scene(rng), rng.permutation(len(TAUS))
    assert np.array_equal(fast(scene, taus=TAUS[order]), fast(scene)[:, order])


@given(seed=seeds)
def test_without_depth_readings_nothing_is_hidden(seed):
    """No reading counts as visible, so an empty depth image and a far wall agree."""
    scene = small_scene(np.random.default_rng(seed))
    scene.depth_mm[:] = 0
    blind = fast(scene)
    scene.depth_mm[:] = 5000
    assert np.array_equal(fast(scene), blind)


@given(seed=seeds)
def test_an_object_that_nothing_shows_of_is_wrong(seed):
    """A wall before everything: no pixel is visible in either, and the error is 1, not 0."""
    scene = small_scene(np.random.default_rng(seed))
    scene.depth_mm[:] = 100
    assert (fast(scene) == 1).all()


def test_a_surface_off_by_exactly_the_tolerance_is_wrong():
    """The comparison is >=, of the quotient by the diameter."""
    gt, est = np.full((2, 2), 300.0), np.array([[315.0, 314.999], [300, 360]])
    errors = reference_rendered.vsd_of_distances(
        est, gt, np.zeros((2, 2)), DELTA_MM, [0.1, 0.1001, 0.4, 0.41], 150.0
    )
    assert errors.tolist() == [0.5, 0.25, 0.25, 0.0]


def test_distances_use_integer_pixel_coordinates():
    """Although renderings sample pixel centres: the numbers of the benchmark were made so."""
    distances = distance_image_mm(np.full((36, 48), 100.0), K)
    expected = 100 * np.sqrt(1 + ((40 - K[0, 2]) / K[0, 0]) ** 2 + ((3 - K[1, 2]) / K[1, 1]) ** 2)
    assert distances[3, 40] == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(
    ("a_mm", "b_mm", "overlap"),
    [
        ([0, 0, 500.0], [90, 0, 500.0], True),
        ([0, 0, 500.0], [100, 0, 500.0], False),  # they touch
        ([0, 0, 500.0], [0, 0, 9000.0], True),
        ([0, 0, 500.0], [0, 0, 0.0], False),
        ([0, 0, 500.0], [0, 0, -600.0], True),  # the signed formula of the rules
        ([0, 0, 500.0], [0, 0, -400.0], False),
    ],
)
def test_spheres_of_100_mm_overlap_as_the_rules_say(a_mm, b_mm, overlap):
    spheres = np.array(a_mm), np.array(b_mm)
    assert reference_rendered.spheres_overlap(*spheres, 100.0) == overlap


def test_far_estimates_are_wrong_without_being_rendered():
    scene = small_scene(np.random.default_rng(0), n_estimates=1)
    scene.poses.t_mm[0] = scene.poses.t_mm[scene.pairs[0, 1]] + [4000, 0, 0]
    assert (fast(scene) == 1).all()
    assert (fast(scene, sphere_check=False) == 1).all()


def test_no_pairs_give_no_errors():
    scene = small_scene(np.random.default_rng(0))
    assert fast(scene, np.zeros((0, 2), int)).shape == (0, len(TAUS))


@pytest.mark.parametrize("broken", ["pose", "pairs", "mesh_index", "depth"])
def test_bad_input_is_refused_with_a_reason(broken):
    scene = small_scene(np.random.default_rng(0))
    if broken == "pose":
        scene.poses.t_mm[1, 2] = np.nan
    elif broken == "pairs":
        scene.pairs = scene.pairs[:, :1]
    elif broken == "mesh_index":
        scene.mesh_index = np.append(scene.mesh_index, 0)
    else:
        scene.depth_mm = scene.depth_mm[None]
    with pytest.raises(SixdError):
        fast(scene)


def _parts(poses: Pose) -> tuple[np.ndarray, np.ndarray]:
    return poses.R.copy(), poses.t_mm.copy()
