import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sixd.errors import FormatError, UsageError
from sixd.geometry import Pose, Symmetries, SymmetryAxis
from tests.strategies import points, rotation, symmetries

Z_AXIS = SymmetryAxis(np.array([0, 0, 1.0]), np.zeros(3))
X_AXIS = SymmetryAxis(np.array([2.0, 0, 0]), np.array([0, 5.0, 0]))
HALF_TURN = Pose(np.diag([-1.0, -1, 1])[None], np.array([[1.0, 2, 3]]))


def one_by_one(group: Symmetries) -> list[np.ndarray]:
    """BOP rules, section 4, written as the loops it is told in; 4x4 matrices."""

    def matrix(R, t_mm):
        return np.block([[R, t_mm[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])

    listed = [np.eye(4)] + [
        matrix(R, t) for R, t in zip(group.discrete.R, group.discrete.t_mm, strict=True)
    ]
    turns = []
    for axis in group.axes:
        for i in range(315):
            R = rotation(axis.axis, np.array(i * 2 * np.pi / 315))
            turns.append(matrix(R, axis.offset_mm - R @ axis.offset_mm))
    return [turn @ d for d in listed for turn in turns] if turns else listed


@given(group=symmetries())
def test_the_discretised_set_has_the_order_and_values_of_the_bop_rules(group):
    found = group.transforms()
    expected = np.array(one_by_one(group))
    np.testing.assert_allclose(found.R, expected[:, :3, :3], atol=1e-12)
    np.testing.assert_allclose(found.t_mm, expected[:, :3, 3], atol=1e-9)


@given(group=symmetries())
def test_the_identity_comes_first(group):
    first = group.transforms()[0]
    np.testing.assert_array_equal(first.R, np.eye(3))
    np.testing.assert_allclose(first.t_mm, 0, atol=1e-12)


@pytest.mark.parametrize(
    ("group", "count"),
    [
        (Symmetries(), 1),
        (Symmetries(HALF_TURN), 2),
        (Symmetries(axes=(Z_AXIS,)), 315),
        (Symmetries(axes=(Z_AXIS, X_AXIS)), 630),
        (Symmetries(HALF_TURN, (Z_AXIS, X_AXIS)), 1260),
    ],
)
def test_axes_are_concatenated_and_discrete_ones_multiply(group, count):
    assert len(group.transforms()) == count


@given(p=points(), count=st.integers(1, 40))
def test_turns_about_an_axis_keep_the_distance_to_it(p, count):
    turned = X_AXIS.rotations(count).apply(p) - X_AXIS.offset_mm
    away = np.linalg.norm((p - X_AXIS.offset_mm)[:, 1:], axis=1)
    shape = (count, len(p))
    np.testing.assert_allclose(
        np.linalg.norm(turned[..., 1:], axis=-1), np.broadcast_to(away, shape)
    )


@given(p=points(), max_step=st.floats(0.005, 0.5))
def test_no_vertex_moves_further_than_the_step_allows(p, max_step):
    """The promise behind max_sym_disc_step: a share of the diameter of the turned body."""
    turned = Symmetries(axes=(Z_AXIS,)).transforms(max_step).apply(p)
    way = np.linalg.norm(turned - np.roll(turned, 1, axis=0), axis=-1).max()
    diameter_mm = 2 * np.linalg.norm(p[:, :2], axis=1).max()
    assert way <= max_step * diameter_mm + 1e-9


@given(group=symmetries())
def test_models_info_keeps_every_bit(group):
    again = Symmetries.from_models_info(group.to_models_info())
    np.testing.assert_array_equal(again.transforms().R, group.transforms().R)
    np.testing.assert_array_equal(again.transforms().t_mm, group.transforms().t_mm)


def test_every_bad_symmetry_is_reported_with_its_place():
    entry = {
        "symmetries_discrete": [[1, 2], np.diag([1, 1, -1, 1]).ravel().tolist(), "x"],
        "symmetries_continuous": [{"axis": [0, 0, 0], "offset": [0, 0, 0]}, {"axis": [0, 0, 1]}],
    }
    with pytest.raises(FormatError) as caught:
        Symmetries.from_models_info(entry, file="models_info.json")
    fields = [p.field for p in caught.value.problems]
    assert fields == [
        "symmetries_discrete[0]",
        "symmetries_discrete[1]",
        "symmetries_discrete[2]",
        "symmetries_continuous[0]",
        "symmetries_continuous[1]",
    ]
    assert {p.file for p in caught.value.problems} == {"models_info.json"}


@pytest.mark.parametrize("value", [None, 3, {"axis": [0, 0, 1]}, "no"])
@pytest.mark.parametrize("key", ["symmetries_discrete", "symmetries_continuous"])
def test_a_symmetry_key_that_is_no_list_is_a_format_error(key, value):
    with pytest.raises(FormatError, match="not a list"):
        Symmetries.from_models_info({key: value})


@pytest.mark.parametrize("step", [0.0, -1.0, np.nan, 7.0])
def test_a_senseless_step_is_refused(step):
    with pytest.raises(UsageError):
        Symmetries().transforms(step)
