"""What the definitions must satisfy whatever the poses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sixd.errors import ShapeError
from sixd.geometry import PinholeCamera, Pose
from sixd.metrics.reference import (
    add,
    adi,
    mspd,
    mssd,
    projection,
    rotation_error_deg,
    translation_error_mm,
    within_reach,
)
from tests.strategies import (
    CUBE_MM,
    IDENTITY,
    near_poses,
    pinhole_cameras,
    points,
    poses,
    random_poses,
    rotation,
    seeds,
    symmetry_groups,
)

CAMERA = PinholeCamera(np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]]))
MAXIMA = {
    "mssd": lambda est, gt, p, syms: mssd(est, gt, p, syms),
    "mspd": lambda est, gt, p, syms: mspd(est, gt, p, syms, CAMERA),
}
SYMMETRIC = {
    **MAXIMA,
    "rotation": lambda est, gt, p, syms: rotation_error_deg(est, gt, syms),
    "translation": lambda est, gt, p, syms: translation_error_mm(est, gt, syms),
}
ALL = {
    **SYMMETRIC,
    "add": lambda est, gt, p, syms: add(est, gt, p),
    "projection": lambda est, gt, p, syms: projection(est, gt, p, CAMERA),
    "adi": lambda est, gt, p, syms: adi(est, gt, p),
}
IN_SPACE = {k: v for k, v in ALL.items() if k not in ("mspd", "projection")}


@pytest.mark.parametrize("error", ALL.values(), ids=ALL)
@given(gt=poses(2), p=points(), syms=symmetry_groups())
def test_the_truth_has_no_error(error, gt, p, syms):
    np.testing.assert_allclose(error(gt, gt, p, syms), 0, atol=2e-5)  # arccos near 1


@pytest.mark.parametrize("error", SYMMETRIC.values(), ids=SYMMETRIC)
@given(gt=poses(1), p=points(), syms=symmetry_groups())
def test_a_symmetric_copy_has_no_error(error, gt, p, syms):
    copies = gt @ syms
    all_gt = gt[np.zeros(len(syms), int)]
    np.testing.assert_allclose(error(copies, all_gt, p, syms), 0, atol=2e-5)


@pytest.mark.parametrize("error", IN_SPACE.values(), ids=IN_SPACE)
@given(est=poses(3), gt=poses(3), camera=poses(1), p=points(), syms=symmetry_groups())
def test_the_error_does_not_depend_on_the_camera(error, est, gt, camera, p, syms):
    moved = error(camera @ est, camera @ gt, p, syms)
    np.testing.assert_allclose(moved, error(est, gt, p, syms), atol=1e-5)


@pytest.mark.parametrize("error", MAXIMA.values(), ids=MAXIMA)
@given(est=poses(3), gt=poses(3), p=points(), syms=symmetry_groups())
def test_more_symmetries_never_raise_the_error(error, est, gt, p, syms):
    assert (error(est, gt, p, syms) <= error(est, gt, p, IDENTITY) + 1e-9).all()


@pytest.mark.parametrize("error", MAXIMA.values(), ids=MAXIMA)
@given(est=poses(3), gt=poses(3), p=points(), syms=symmetry_groups())
def test_estimate_and_truth_may_change_places_when_the_symmetries_are_a_group(
    error, est, gt, p, syms
):
    p = syms.apply(p).reshape(-1, 3)  # vertices that the group maps to each other
    np.testing.assert_allclose(error(est, gt, p, syms), error(gt, est, p, syms), atol=1e-6)


@given(est=poses(3), gt=poses(3), p=points(2), syms=symmetry_groups())
def test_a_maximum_grows_with_the_vertices_and_exceeds_the_mean(est, gt, p, syms):
    assert (mssd(est, gt, p[:1], syms) <= mssd(est, gt, p, syms) + 1e-9).all()
    assert (add(est, gt, p) <= mssd(est, gt, p, IDENTITY) + 1e-9).all()
    assert (projection(est, gt, p, CAMERA) <= mspd(est, gt, p, IDENTITY, CAMERA) + 1e-9).all()


@given(est=poses(3), gt=poses(3), p=points())
def test_the_nearest_vertex_is_never_farther_than_the_own(est, gt, p):
    assert (adi(est, gt, p) <= add(est, gt, p) + 1e-9).all()


@given(gt=poses(1), p=points(), shift=st.tuples(*[st.floats(-90, 90)] * 3).map(np.array))
def test_a_pure_shift_has_its_length_as_error(gt, p, shift):
    est = Pose(gt.R, gt.t_mm + shift)
    length = pytest.approx(np.linalg.norm(shift), abs=1e-9)
    assert mssd(est, gt, p, IDENTITY)[0] == length
    assert add(est, gt, p)[0] == length
    assert translation_error_mm(est, gt)[0] == length
    assert rotation_error_deg(est, gt)[0] == pytest.approx(0, abs=2e-6)


@given(gt=poses(1), seed=seeds, degrees=st.floats(0.01, 179.9))
def test_a_pure_turn_has_its_angle_as_error(gt, seed, degrees):
    axis = np.random.default_rng(seed).normal(size=3)
    est = Pose(rotation(axis, np.radians(degrees)) @ gt.R, gt.t_mm)
    assert rotation_error_deg(est, gt)[0] == pytest.approx(degrees, abs=1e-5)
    assert translation_error_mm(est, gt)[0] == 0


@given(est=poses(2), gt=poses(2), camera=pinhole_cameras(), p=points())
def test_pixel_errors_scale_with_the_focal_length(est, gt, camera, p):
    twice = PinholeCamera(np.diag([2.0, 2, 1]) @ camera.K)
    error = mspd(est, gt, p, IDENTITY, camera)
    np.testing.assert_allclose(mspd(est, gt, p, IDENTITY, twice), 2 * error, rtol=1e-9, atol=1e-9)


def test_a_shift_by_one_millimetre_at_one_metre_is_f_over_1000_pixels():
    """Worked by hand: 600 px * 1 mm / 1000 mm, at the vertex nearest to the camera."""
    gt = Pose(np.eye(3)[None], np.array([[0, 0, 1050.0]]))
    est = Pose(gt.R, gt.t_mm + [1.0, 0, 0])
    assert mspd(est, gt, CUBE_MM, IDENTITY, CAMERA)[0] == pytest.approx(0.6)
    assert projection(est, gt, CUBE_MM, CAMERA)[0] == pytest.approx((0.6 + 600 / 1100) / 2)


def test_a_quarter_turn_of_a_cube_about_z():
    """Each corner moves by its distance from the axis times sqrt 2; a 4-fold symmetry undoes it."""
    gt = Pose(np.eye(3)[None], np.array([[0, 0, 1000.0]]))
    est = Pose(rotation(np.array([0, 0, 1.0]), np.pi / 2)[None], gt.t_mm)
    assert mssd(est, gt, CUBE_MM, IDENTITY)[0] == pytest.approx(100)
    assert adi(est, gt, CUBE_MM)[0] == pytest.approx(0, abs=1e-9)
    turns = np.stack([rotation(np.array([0, 0, 1.0]), k * np.pi / 2) for k in range(4)])
    assert mssd(est, gt, CUBE_MM, Pose(turns, np.zeros((4, 3))))[0] == pytest.approx(0, abs=1e-9)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("error", ALL.values(), ids=ALL)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("place", ["R", "t_mm"])
def test_a_pose_that_is_not_finite_has_infinite_error_and_makes_no_noise(error, value, place):
    gt = random_poses(np.random.default_rng(0), 2)
    est = Pose(gt.R.copy(), gt.t_mm.copy())
    getattr(est, place)[0].flat[0] = value
    found = error(est, gt, CUBE_MM, IDENTITY)
    unaffected = {"t_mm": ALL["rotation"], "R": ALL["translation"]}[place]
    assert found[0] < 1e-3 if error is unaffected else found[0] == np.inf
    assert found[1] < 1e-3


@pytest.mark.filterwarnings("error")
def test_a_vertex_in_the_cameras_plane_gives_an_infinite_pixel_error():
    """The BOP rules divide by z with no test: no estimate may gain by it."""
    flat = np.array([[0, 0, 0], [10, 0, 0], [0, 0, 5.0]])
    gt = Pose(np.eye(3)[None], np.zeros((1, 3)))
    for est in (gt, Pose(gt.R, gt.t_mm + [0, 0, 100.0])):
        assert mspd(est, gt, flat, IDENTITY, CAMERA)[0] == np.inf


@given(seed=seeds)
def test_origins_a_diameter_apart_are_out_of_reach_whatever_the_symmetries(seed):
    rng = np.random.default_rng(seed)
    gt = random_poses(rng, 20)
    est = near_poses(rng, gt, 180, 100)
    apart = np.linalg.norm(est.t_mm - gt.t_mm, axis=1)
    np.testing.assert_array_equal(within_reach(est, gt, 80.0), apart < 80)
    np.testing.assert_array_equal(within_reach(est, gt, apart), np.zeros(20, bool))
    est.t_mm[3] = np.nan
    assert not within_reach(est, gt, 1e9)[3]


def test_batches_that_do_not_fit_are_refused():
    two, three = Pose.identity(2), Pose.identity(3)
    for error in ALL.values():
        with pytest.raises(ShapeError, match="one batch shape"):
            error(two, three, CUBE_MM, IDENTITY)
        with pytest.raises(ShapeError, match="one batch shape"):
            error(Pose.identity(), Pose.identity(), CUBE_MM, IDENTITY)
    with pytest.raises(ShapeError, match="symmetries"):
        mssd(two, two, CUBE_MM, IDENTITY[:0])
    with pytest.raises(ShapeError, match="points_mm"):
        mssd(two, two, CUBE_MM[:0], IDENTITY)
    with pytest.raises(ShapeError, match="cameras must be one or 2"):
        mspd(two, two, CUBE_MM, IDENTITY, [CAMERA] * 3)
