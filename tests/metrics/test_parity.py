"""The compiled errors are the reference's, to rounding."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sixd.errors import ShapeError, UsageError
from sixd.geometry import (
    Fisheye624Camera,
    KannalaBrandtCamera,
    PinholeCamera,
    Pose,
    Symmetries,
    SymmetryAxis,
)
from sixd.metrics import fast, reference
from tests.strategies import (
    CUBE_MM,
    IDENTITY,
    fisheye_cameras,
    near_poses,
    pinhole_cameras,
    points,
    poses,
    random_poses,
    seeds,
    symmetries,
    symmetry_groups,
)

# Both round to float64 at coordinates of some metres: 1e-12 mm; pixels behind a near vertex, more.
CLOSE = {"rtol": 1e-9, "atol": 1e-9}
Z_AXIS = SymmetryAxis(np.array([0, 0, 1.0]), np.array([3.0, 0, 0]))
X_AXIS = SymmetryAxis(np.array([1.0, 0, 0]), np.zeros(3))
CAMERA = PinholeCamera(np.array([[1075.0, 0.5, 360], [0, 1073, 270], [0, 0, 1]]))


def both(name, est, gt, p, syms, camera):
    """The same error by reference and compiled."""
    cells = fast.VertexCells.build(p)
    if name == "adi":
        return reference.adi(est, gt, p), fast.adi(est, gt, cells)
    if name == "add":
        return reference.add(est, gt, p), fast.add(est, gt, cells)
    if name == "mssd":
        return reference.mssd(est, gt, p, syms), fast.mssd(est, gt, cells, syms)
    if name == "projection":
        found = fast.projection(est, gt, cells, camera.K)
        return reference.projection(est, gt, p, camera), found
    found = fast.mspd_cameras(est, gt, cells, syms, camera)
    return reference.mspd(est, gt, p, syms, camera), found


NAMES = ["mssd", "mspd", "add", "adi", "projection"]


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=25)
@given(est=poses(3), gt=poses(3), p=points(), syms=symmetry_groups(), camera=pinhole_cameras())
def test_few_vertices_of_any_kind(name, est, gt, p, syms, camera):
    expected, found = both(name, est, gt, p, syms, camera)
    np.testing.assert_allclose(found, expected, **CLOSE)


@settings(max_examples=15)
@given(est=poses(2), gt=poses(2), p=points(), group=symmetries(), camera=pinhole_cameras())
def test_discretised_symmetry_sets(est, gt, p, group, camera):
    """Discrete, continuous, several axes, and all of them combined: up to thousands."""
    for name in ("mssd", "mspd"):
        expected, found = both(name, est, gt, p, group.transforms(), camera)
        np.testing.assert_allclose(found, expected, **CLOSE)


@settings(max_examples=12)
@given(seed=seeds, n_vertices=st.integers(90, 1500), degrees=st.floats(0, 180))
def test_meshes_of_several_levels_of_cells(seed, n_vertices, degrees):
    """Surfaces, where the bounds of cells prune most; errors from tiny to large."""
    rng = np.random.default_rng(seed)
    p = rng.normal(size=(n_vertices, 3))
    p *= rng.uniform(10, 80, 3) / np.linalg.norm(p, axis=1, keepdims=True)
    gt = random_poses(rng, 12)
    est = near_poses(rng, gt, degrees, degrees)
    syms = Z_AXIS.rotations(int(rng.choice([1, 2, 5])))
    for name in NAMES:
        expected, found = both(name, est, gt, p, syms, CAMERA)
        np.testing.assert_allclose(found, expected, **CLOSE)


@settings(max_examples=20)
@given(seed=seeds, size=st.sampled_from([1e-3, 1.0, 1e3]))
def test_the_margin_of_the_bounds_holds_at_any_size(seed, size):
    rng = np.random.default_rng(seed)
    p = rng.normal(size=(400, 3)) * [50, 30, 1] * size
    gt = random_poses(rng, 8)
    gt = Pose(gt.R, gt.t_mm * size)
    est = near_poses(rng, gt, 1e-4, 1e-6)
    for name in ("mssd", "mspd", "adi"):
        expected, found = both(name, est, gt, p, IDENTITY, CAMERA)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * max(size, 1))


@settings(max_examples=20)
@given(seed=seeds)
def test_objects_around_and_behind_the_camera(seed):
    """Cells that reach the camera's plane have no bound; pixels there are huge, not wrong."""
    rng = np.random.default_rng(seed)
    p = rng.normal(size=(500, 3)) * 60
    gt = random_poses(rng, 10)
    near = np.linspace(-300, 300, 10)[:, None] * [0, 0, 1]
    est = Pose(near_poses(rng, gt, 30, 0).R, near)
    expected, found = both("mspd", est, gt, p, Z_AXIS.rotations(3), CAMERA)
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    expected, found = both("mspd", est, Pose(gt.R, -gt.t_mm), p, IDENTITY, CAMERA)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@settings(max_examples=20)
@given(seed=seeds)
def test_matrices_that_are_no_rotations(seed):
    """A results file may hold anything: scaled, sheared, mirrored, all zero."""
    rng = np.random.default_rng(seed)
    p = rng.normal(size=(300, 3)) * [60, 40, 20]
    gt = random_poses(rng, 8)
    R = gt.R.copy()
    R[0] *= 1.3
    R[1, 0] *= -1
    R[2] += rng.normal(size=(3, 3)) * 1e-3
    R[3] += rng.normal(size=(3, 3))
    R[4] = 0
    R[5] = R[5].round(3)
    for est, truth in ((Pose(R, gt.t_mm + 1), gt), (gt, Pose(R, gt.t_mm + 1))):
        for name in NAMES:
            expected, found = both(name, est, truth, p, Z_AXIS.rotations(2), CAMERA)
            np.testing.assert_allclose(found, expected, **CLOSE)


@settings(max_examples=15)
@given(est=poses(2), gt=poses(2), p=points(), syms=symmetry_groups(), camera=fisheye_cameras())
def test_mspd_of_fisheye_cameras(est, gt, p, syms, camera):
    expected, found = both("mspd", est, gt, p, syms, camera)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-8)


def test_a_continuous_symmetry_through_a_fisheye():
    rng = np.random.default_rng(3)
    p = rng.normal(size=(200, 3)) * [20, 20, 60]
    gt = random_poses(rng, 6)
    est = near_poses(rng, gt, 20, 10)
    camera = Fisheye624Camera(np.array([600.0, 700, 700, 0.3, -0.2, *[1e-3] * 10]))
    syms = Symmetries(axes=(Z_AXIS, X_AXIS)).transforms()
    assert len(syms) == 630
    expected, found = both("mspd", est, gt, p, syms, camera)
    np.testing.assert_allclose(found, expected, **CLOSE)


@pytest.mark.parametrize("name", NAMES)
def test_an_error_does_not_hang_on_its_neighbours(name):
    """Search begins where the last pair's ended; to the last bit that changes nothing."""
    rng = np.random.default_rng(1)
    p = rng.normal(size=(300, 3)) * [20, 20, 60]
    gt = random_poses(rng, 40)
    est = near_poses(rng, gt, 40, 30)
    forth = both(name, est, gt, p, Z_AXIS.rotations(7), CAMERA)[1]
    back = both(name, est[::-1], gt[::-1], p, Z_AXIS.rotations(7), CAMERA)[1]
    np.testing.assert_array_equal(forth, back[::-1])


@pytest.mark.parametrize("name", NAMES)
def test_poses_that_are_not_finite_have_infinite_error_and_disturb_no_other(name):
    rng = np.random.default_rng(2)
    gt = random_poses(rng, 6)
    est = near_poses(rng, gt, 40, 30)
    est.t_mm[1], est.R[3, 0, 0], gt.t_mm[5] = np.nan, np.inf, -np.inf
    expected, found = both(name, est, gt, CUBE_MM, IDENTITY, CAMERA)
    assert np.isinf(found).tolist() == [False, True, False, True, False, True]
    np.testing.assert_allclose(found, expected, **CLOSE)


def test_a_vertex_in_the_cameras_plane_is_infinite_also_among_many():
    p = np.concatenate([np.random.default_rng(0).uniform(1, 50, (500, 3)), np.zeros((1, 3))])
    gt = Pose(np.eye(3)[None], np.zeros((1, 3)))
    for est in (gt, Pose(gt.R, gt.t_mm + [0, 0, 100.0])):
        for name in ("mspd", "projection"):
            expected, found = both(name, est, gt, p, IDENTITY, CAMERA)
            assert expected.tolist() == found.tolist() == [np.inf]


def test_each_pair_has_its_own_camera_of_any_kind():
    rng = np.random.default_rng(4)
    gt = random_poses(rng, 6)
    est = near_poses(rng, gt, 10, 10)
    cameras = [
        CAMERA,
        Fisheye624Camera(np.array([600.0, 700, 700, 0.3, -0.2, *[1e-3] * 10])),
        KannalaBrandtCamera(np.array([500.0, 510, 320, 240, 0.1, 0.01, 0, 0])),
        PinholeCamera(np.diag([300.0, 300, 1])),
        CAMERA,
        Fisheye624Camera(np.array([250.0, 251, 320, 240, *[1e-3] * 12])),
    ]
    expected, found = both("mspd", est, gt, CUBE_MM, Z_AXIS.rotations(4), cameras)
    np.testing.assert_allclose(found, expected, **CLOSE)


def test_no_pairs_give_no_errors():
    none = Pose.identity(0)
    for name in NAMES:
        assert both(name, none, none, CUBE_MM, IDENTITY, CAMERA)[1].shape == (0,)


def test_arguments_that_do_not_fit_are_refused():
    cells, two = fast.VertexCells.build(CUBE_MM), Pose.identity(2)
    with pytest.raises(ShapeError, match="one batch shape"):
        fast.mssd(two, Pose.identity(3), cells, IDENTITY)
    with pytest.raises(ShapeError, match="symmetries"):
        fast.mssd(two, two, cells, Pose.identity())
    with pytest.raises(ShapeError, match="cameras must be one or 2"):
        fast.mspd_cameras(two, two, cells, IDENTITY, [CAMERA])
    with pytest.raises(ShapeError, match=r"K must have shape \(2, 3, 3\) or \(3, 3\), got \(3,\)"):
        fast.mspd(two, two, cells, IDENTITY, np.ones(3))
    with pytest.raises(ShapeError, match="params must have shape"):
        fast.mspd_fisheye624(two, two, cells, IDENTITY, np.ones(15))
    with pytest.raises(ShapeError, match="V > 0"):
        fast.VertexCells.build(np.zeros((0, 3)))
    for bad in (np.nan, np.inf, 1e200):
        with pytest.raises(UsageError, match="finite"):
            fast.VertexCells.build(np.full((3, 3), bad))

    class Other:
        def project(self, points_mm):
            return points_mm[..., :2]

        def unproject(self, pixels_px):
            return pixels_px

    with pytest.raises(UsageError, match="Other"):
        fast.mspd_cameras(two, two, cells, IDENTITY, Other())


@settings(max_examples=20)
@given(seed=seeds, n_vertices=st.integers(1, 3000))
def test_cells_hold_every_vertex_within_their_bounds(seed, n_vertices):
    p = np.random.default_rng(seed).normal(size=(n_vertices, 3)) * [50, 30, 1]
    cells = fast.VertexCells.build(p)
    flat = cells.leaves_mm.transpose(0, 2, 1)
    assert {tuple(v) for v in flat.reshape(-1, 3)} == {tuple(v) for v in p}
    np.testing.assert_array_equal(np.unique(cells.points_mm, axis=0), np.unique(p, axis=0))
    assert len(cells.points_mm) == n_vertices
    below = list(flat)  # vertices of each node, leaves last, gathered upwards
    for group in cells.groups[::-1]:
        children, below = below[-8:], below[:-8]
        below.insert(0, np.concatenate(children))
        for child, vertices in zip(group.T, children, strict=True):
            gaps = vertices - child[:3]
            assert (np.linalg.norm(gaps, axis=1) <= child[3]).all()
            assert (np.abs(gaps @ child[4:7]) <= child[7] + 1e-12).all()
            assert (vertices == child[:3]).all(axis=1).any()
