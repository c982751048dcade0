"""CUS: the fast backend against its definition, and the laws of the error."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings

from sixd.metrics import reference_rendered
from sixd.metrics.vsd import cus_pairs
from tests.metrics.vsd_scenes import SmallScene, small_scene
from tests.render.shapes import SIZE_PX, K
from tests.strategies import seeds


def fast(scene: SmallScene, **options) -> np.ndarray:
    inputs = (K, SIZE_PX, scene.prepared, scene.poses, scene.mesh_index, scene.pairs)
    return cus_pairs(*inputs, scene.pair_diameters_mm, **options)


@settings(max_examples=10)
@given(seed=seeds)
def test_the_fast_error_is_the_defined_error(seed):
    scene = small_scene(np.random.default_rng(seed))
    for check in (True, False):
        expected = [
            reference_rendered.cus(
                scene.poses[est],
                scene.poses[gt],
                scene.meshes[scene.mesh_index[est]],
                K,
                SIZE_PX,
                diameter_mm,
                sphere_check=check,
            )
            for (est, gt), diameter_mm in zip(scene.pairs, scene.pair_diameters_mm, strict=True)
        ]
        np.testing.assert_allclose(fast(scene, sphere_check=check), expected, atol=1e-12)


@given(seed=seeds)
def test_estimate_and_truth_can_change_places(seed):
    scene = small_scene(np.random.default_rng(seed))
    errors = fast(scene)
    assert ((errors >= 0) & (errors <= 1)).all()
    scene.pairs = scene.pairs[:, ::-1]
    assert np.array_equal(fast(scene), errors)


@given(seed=seeds)
def test_the_truth_itself_has_no_error(seed):
    scene = small_scene(np.random.default_rng(seed))
    scene.pairs = np.repeat(scene.pairs[:, 1:], 2, axis=1)
    assert (fast(scene) == 0).all()


def test_two_silhouettes_outside_the_image_are_wrong():
    scene = small_scene(np.random.default_rng(0))
    scene.poses.t_mm[:] = [0, 5000, 500]
    assert (fast(scene) == 1).all()
