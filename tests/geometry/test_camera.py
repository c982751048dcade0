import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sixd.errors import FormatError, ShapeError
from sixd.geometry import (
    Camera,
    Fisheye624Camera,
    KannalaBrandtCamera,
    PinholeCamera,
    camera_from_bop,
)
from tests.strategies import fisheye_cameras, pinhole_cameras, seeds

K = np.array([[572.4, 0, 325.3], [0, 573.6, 242.0], [0, 0, 1]])


def rays_within(rng: np.random.Generator, degrees: float, n: int = 50) -> np.ndarray:
    """Unit rays up to an angle from the optical axis."""
    angle, turn = np.radians(rng.uniform(0, degrees, n)), rng.uniform(0, 2 * np.pi, n)
    xy = np.sin(angle)[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return np.concatenate([xy, np.cos(angle)[:, None]], axis=1)


@given(camera=pinhole_cameras(), seed=seeds)
def test_a_pinhole_ray_goes_through_its_pixel_and_back(camera, seed):
    rays = rays_within(np.random.default_rng(seed), 80)
    np.testing.assert_allclose(camera.unproject(camera.project(rays)), rays, atol=1e-9)


@given(seed=seeds, shrink=st.floats(0, 1))
def test_a_fisheye_ray_goes_through_its_pixel_and_back(seed, shrink):
    """Coefficients of the size HOT3D's Aria camera has: the model is one to one in its image."""
    rng = np.random.default_rng(seed)
    k = np.array([0.4, -0.5, 0.2, 0.3, -0.3, 0.07]) * shrink * rng.uniform(0.5, 1, 6)
    rest = rng.uniform(-1, 1, 6) * shrink * [5e-4, 5e-4, 1e-3, 1e-4, 1e-3, 1e-4]
    camera = Fisheye624Camera(np.concatenate([[610.0, 715, 716], k, rest]))
    rays = rays_within(rng, 55)
    np.testing.assert_allclose(camera.unproject(camera.project(rays)), rays, atol=1e-9)


@given(camera=fisheye_cameras(), seed=seeds)
def test_an_unprojected_pixel_projects_to_itself_or_is_said_to_have_no_ray(camera, seed):
    pixels = np.random.default_rng(seed).uniform(0, 1408, (60, 2))
    rays = camera.unproject(pixels)
    found = np.isfinite(rays).all(axis=1)
    np.testing.assert_allclose(np.linalg.norm(rays[found], axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(camera.project(rays)[found], pixels[found], atol=1e-6)
    assert np.isnan(rays[~found]).all()


@given(camera=st.one_of(pinhole_cameras(), fisheye_cameras()), seed=seeds, far=st.floats(0.1, 1e4))
def test_a_pixel_does_not_depend_on_the_distance(camera, seed, far):
    rays = rays_within(np.random.default_rng(seed), 80)
    np.testing.assert_allclose(camera.project(far * rays), camera.project(rays), rtol=1e-9)


@given(seed=seeds)
def test_a_fisheye_without_distortion_is_equidistant(seed):
    """Pixel distance from the centre is f times the angle, also beyond 90 degrees."""
    rays = rays_within(np.random.default_rng(seed), 170)
    camera = Fisheye624Camera(np.concatenate([[500.0, 100, 200], np.zeros(12)]))
    from_centre = np.linalg.norm(camera.project(rays) - [100, 200], axis=1)
    angle = np.arccos(np.clip(rays[:, 2], -1, 1))
    np.testing.assert_allclose(from_centre, 500 * angle, atol=1e-4)


def test_fisheye624_follows_the_published_equations_at_one_point():
    """Worked through by hand from the BOP rules: p on the x axis, so y' has only tilt terms."""
    f, k1, p1, p2, s1, s3 = 100.0, 0.1, 0.01, 0.02, 0.003, 0.004
    camera = Fisheye624Camera(np.array([f, 0, 0, k1, 0, 0, 0, 0, 0, p1, p2, s1, 0, s3, 0]))
    q = np.pi / 4 * (1 + k1 * (np.pi / 4) ** 2)
    expected = [q + p1 * 3 * q**2 + s1 * q**2, p2 * q**2 + s3 * q**2]
    np.testing.assert_allclose(camera.project(np.array([7.0, 0, 7])), np.multiply(f, expected))


@given(seed=seeds)
def test_kannala_brandt_equals_the_fisheye_of_opencv(seed):
    cv2 = pytest.importorskip("cv2")
    rng = np.random.default_rng(seed)
    k = rng.uniform(-0.1, 0.1, 4)
    camera = KannalaBrandtCamera(np.array([500, 510, 320, 240, *k]))
    rays = rays_within(rng, 45)  # where any such k is one to one
    matrix = np.array([[500.0, 0, 320], [0, 510, 240], [0, 0, 1]])
    expected, _ = cv2.fisheye.projectPoints(rays[:, None], np.zeros(3), np.zeros(3), matrix, k)
    np.testing.assert_allclose(camera.project(rays), expected[:, 0], atol=1e-8)
    np.testing.assert_allclose(camera.unproject(camera.project(rays)), rays, atol=1e-8)


def test_points_behind_a_pinhole_are_mirrored_as_the_bop_rules_have_it():
    camera = PinholeCamera(K)
    point = np.array([30.0, -20, 500])
    np.testing.assert_array_equal(camera.project(-point), camera.project(point))


def test_a_point_in_the_cameras_plane_has_no_finite_pixel_and_makes_no_noise():
    with np.errstate(all="raise"):
        assert not np.isfinite(PinholeCamera(K).project(np.array([1.0, 0, 0]))).all()


def test_all_cameras_speak_the_protocol():
    cameras = PinholeCamera(K), Fisheye624Camera(np.ones(15)), KannalaBrandtCamera(np.ones(8))
    assert all(isinstance(camera, Camera) for camera in cameras)


def test_cam_k_gives_a_pinhole():
    camera = camera_from_bop({"cam_K": K.ravel().tolist(), "depth_scale": 0.1})
    np.testing.assert_array_equal(camera.K, K)


@pytest.mark.parametrize("name", ["PinholePlane", "CameraModelType.LINEAR"])
def test_a_pinhole_cam_model_gives_its_matrix(name):
    """The reference toolkit never finds K there (BOP rules, oddity 14)."""
    model = {"projection_model_type": name, "projection_params": [572.4, 573.6, 325.3, 242.0]}
    camera = camera_from_bop({"cam_model": model})
    np.testing.assert_array_equal(camera.K, K)


@pytest.mark.parametrize("focal", [[610.0], [610.0, 611.0]])
def test_hot3d_cam_models_have_one_focal_length_or_two(focal):
    params = [*focal, 714.0, 713.0, *np.linspace(-0.1, 0.1, 12)]
    model = {
        "image_width": 1408,
        "image_height": 1408,
        "projection_model_type": "CameraModelType.FISHEYE624",
        "projection_params": params,
    }
    camera = camera_from_bop({"cam_model": model})
    assert camera.params[:4].tolist() == [610.0, focal[-1], 714.0, 713.0]
    np.testing.assert_array_equal(camera.params[4:], params[-12:])


BAD_ENTRIES = [
    {},
    {"cam_K": K.ravel().tolist(), "cam_model": {}},
    {"cam_K": [1, 2, 3]},
    {"cam_K": "none"},
    {"cam_K": [*K.ravel()[:8], np.nan]},
    {"cam_K": np.zeros(9).tolist()},
    {"cam_K": K.T.ravel().tolist()},
    {"cam_model": []},
    {"cam_model": {"projection_model_type": "Telepathy", "projection_params": [1]}},
    {"cam_model": {"projection_model_type": ["PinholePlane"], "projection_params": [1]}},
    {"cam_model": {"projection_model_type": "PinholePlane", "projection_params": [1, 2, 3]}},
    {"cam_model": {"projection_model_type": "PinholePlane"}},
    {"cam_model": {"projection_model_type": "PinholePlane", "projection_params": [0, 1, 1, 1]}},
]


@pytest.mark.parametrize("entry", BAD_ENTRIES, ids=str)
def test_a_bad_camera_entry_says_what_was_expected_and_where(entry):
    with pytest.raises(FormatError) as caught:
        camera_from_bop(entry, file="scene_camera.json")
    (problem,) = caught.value.problems
    assert problem.file == "scene_camera.json"
    assert problem.expected
    assert problem.got


def test_a_fisheye_with_other_counts_of_parameters_is_refused():
    with pytest.raises(ShapeError, match=r"\(16,\) or \(15,\), got \(14,\)"):
        Fisheye624Camera(np.ones(14))
