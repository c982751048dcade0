import numpy as np
import pytest
from hypothesis import given

from sixd.errors import ShapeError
from sixd.geometry import Pose
from tests.strategies import points, poses


@given(pose=poses(3))
def test_a_pose_after_its_inverse_moves_nothing(pose):
    back = pose @ pose.inverse()
    np.testing.assert_allclose(back.R, Pose.identity(3).R, atol=1e-12)
    np.testing.assert_allclose(back.t_mm, 0, atol=1e-9)


@given(a=poses(2), b=poses(2), p=points())
def test_applying_a_product_is_applying_one_after_the_other(a, b, p):
    one_by_one = np.stack([a[i].apply(b[i].apply(p)) for i in range(2)])
    np.testing.assert_allclose((a @ b).apply(p), one_by_one, atol=1e-9)


@given(pose=poses(1), p=points(2))
def test_distances_between_points_are_kept(pose, p):
    moved = pose.apply(p)[0]
    np.testing.assert_allclose(
        np.linalg.norm(moved[1:] - moved[:-1], axis=1),
        np.linalg.norm(p[1:] - p[:-1], axis=1),
        atol=1e-9,
    )


def test_a_column_vector_as_translation_is_refused_with_both_shapes():
    with pytest.raises(ShapeError, match=r"t_mm must have shape \(\.\.\., 3\), got \(3, 1\)"):
        Pose(np.eye(3), np.zeros((3, 1)))
