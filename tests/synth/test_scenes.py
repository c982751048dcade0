from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sixd.errors import UsageError
from sixd.geometry import Pose
from sixd.synth.objects import builtin_objects, turn_matrix
from sixd.synth.scenes import (
    Placement,
    Scene,
    View,
    apart,
    check_in_front,
    footprint_reach_mm,
    kinect_like_camera,
    look_at,
    make_scene,
    place,
)
from sixd.synth.sensor import DEPTH_SCALE, sense_depth_mm

OBJECTS = builtin_objects()


def scene_of(seed: int, **changes) -> Scene:
    options = {"n_instances": 9, "n_views": 3, "size_px": (160, 120)} | changes
    return make_scene(OBJECTS, np.random.default_rng(seed), **options)


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000))
def test_objects_stand_on_the_table_and_do_not_touch(seed):
    placed = place(OBJECTS, [1, 2, 3, 4, 5, 6, 5, 4], np.random.default_rng(seed))
    worlds = [p.pose_w_m.apply(OBJECTS[p.obj_id].mesh.vertices_mm) for p in placed]
    for i, points in enumerate(worlds):
        assert points[:, 2].min() == pytest.approx(0, abs=1e-9)
        for other in worlds[:i]:
            assert apart(footprint_reach_mm(points), footprint_reach_mm(other), 1.99)


@given(x=st.floats(-50, 50), y=st.floats(-50, 50))
def test_things_that_are_apart_have_no_point_in_common(x, y):
    rng = np.random.default_rng(0)
    disc = rng.normal(size=(200, 3))
    disc /= np.linalg.norm(disc[:, :2], axis=1, keepdims=True) / 20
    moved = footprint_reach_mm(disc + np.array([x, y, 0]))
    reach = footprint_reach_mm(disc)
    if apart(reach, moved):
        assert np.hypot(x, y) > 38
    if np.hypot(x, y) > 41:
        assert apart(reach, moved)
    assert apart(reach, moved) == apart(moved, reach)


def test_the_same_seed_gives_the_same_scene_and_another_gives_another():
    a, b, c = scene_of(5), scene_of(5), scene_of(6)
    for p, q in zip(a.placements, b.placements, strict=True):
        assert np.array_equal(p.pose_w_m.R, q.pose_w_m.R)
        assert np.array_equal(p.pose_w_m.t_mm, q.pose_w_m.t_mm)
    assert not np.array_equal(a.views[0].pose_c_w.R, c.views[0].pose_c_w.R)


def test_an_absent_object_is_absent_and_some_others_are_there_twice():
    ids = [p.obj_id for p in scene_of(0, absent=3).placements]
    assert set(ids) == {1, 2, 4, 5, 6}
    assert len(ids) == 9


@given(azimuth=st.floats(0, 360), elevation=st.floats(1, 89), distance=st.floats(200, 900))
def test_a_camera_looks_at_its_target_and_stands_upright(azimuth, elevation, distance):
    target = np.array([10.0, -20.0, 30.0])
    pose_c_w = look_at(target, distance, azimuth, elevation)
    np.testing.assert_allclose(pose_c_w.R @ pose_c_w.R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(pose_c_w.R) == pytest.approx(1)
    np.testing.assert_allclose(pose_c_w.apply(target[None])[0], [0, 0, distance], atol=1e-9)
    above = pose_c_w.apply((target + np.array([0, 0, 10]))[None])[0]
    assert above[0] == pytest.approx(0, abs=1e-9)
    assert above[1] < 0


def test_an_object_behind_the_camera_is_refused():
    pose_c_w = look_at(np.zeros(3), 500.0, 0.0, 30.0)
    view = View(kinect_like_camera((160, 120)), (160, 120), pose_c_w)
    camera_mm = pose_c_w.inverse().t_mm
    behind = Placement(1, Pose(np.eye(3), 1.5 * camera_mm))
    inside = Placement(1, Pose(np.eye(3), 0.9 * camera_mm))
    for placement in (behind, inside):
        with pytest.raises(UsageError, match=r"object 1 reaches to z = .* of view 0"):
            check_in_front(OBJECTS, Scene((placement,), (view,)))


def test_a_full_table_says_so():
    with pytest.raises(UsageError, match=r"no room on the table for .* beside \d+ others"):
        scene_of(0, n_instances=80)


def test_a_turned_carton_keeps_its_reach_in_every_direction():
    v = OBJECTS[1].mesh.vertices_mm
    reach = footprint_reach_mm(v)
    quarter = footprint_reach_mm(v @ turn_matrix("z", 90.0).T)
    np.testing.assert_allclose(np.roll(reach, 12), quarter, atol=1e-3)


def test_sensed_depth_is_near_the_truth_or_missing():
    true_mm = np.full((120, 160), 700.0)
    true_mm[:, 80:] = 0.0
    true_mm[:60, :40] = 500.0
    sensed = sense_depth_mm(true_mm, np.random.default_rng(1))
    seen = sensed > 0
    assert not seen[:, 80:].any()
    assert 0.9 < seen[:, :80].mean() < 1.0
    assert np.abs(sensed - true_mm)[seen].max() < 8.0
    assert np.abs((sensed - true_mm)[seen].mean()) < 0.1
    stored = np.rint(sensed / DEPTH_SCALE)
    assert np.array_equal(stored.astype(np.float32) * np.float32(DEPTH_SCALE), sensed)
    assert not np.array_equal(sensed, sense_depth_mm(true_mm, np.random.default_rng(2)))
