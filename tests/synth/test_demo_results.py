from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sixd.datasets import open_dataset
from sixd.datasets.truth import read_truth
from sixd.errors import MissingDataError, UsageError
from sixd.evaluation.evaluate import evaluate
from sixd.evaluation.truth_results import results_from_truth
from sixd.geometry.pose import rotations_about
from sixd.metrics.reference import mssd
from sixd.results.coco_json import read_coco_json
from sixd.results.lint import check_file
from sixd.results.pose_csv import read_pose_csv
from sixd.synth.demo_results import TASKS, write_demo_results
from sixd.synth.perturb import STRENGTHS
from sixd.synth.perturb_2d import slide


@pytest.fixture(scope="module")
def dataset(tiny):
    return open_dataset(tiny)


@pytest.fixture(scope="module")
def results(tiny, tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    return write_demo_results(tiny, folder, seed=0)


def named(results, strength, task):
    return next(p for p in results if p.name.startswith(strength) and f"_{task}." in p.name)


def true_errors_mm(dataset, estimates) -> np.ndarray:
    """MSSD of each estimate to the nearest instance of its object; inf if there is none."""
    truth = read_truth(dataset)
    errors = np.full(len(estimates), np.inf)
    for row in range(len(estimates)):
        here = (truth.scene_id == estimates.scene_id[row]) & (truth.im_id == estimates.im_id[row])
        rows = np.flatnonzero(here & (truth.obj_id == estimates.obj_id[row]))
        model = dataset.model(int(estimates.obj_id[row]))
        for other in rows:
            gap = mssd(
                estimates.pose_c_m[row : row + 1],
                truth.pose_c_m[other : other + 1],
                model.vertices_mm[::7],
                model.symmetries.transforms(),
            )[0]
            errors[row] = min(errors[row], gap)
    return errors


def test_every_strength_has_a_file_for_every_task(results, dataset):
    assert len(results) == len(STRENGTHS) * len(TASKS) == 12
    for path in results:
        method, data, task = path.name.partition(".")[0].split("_")
        assert method.startswith("perturbed-")
        assert data == f"{dataset.name}-test"
        assert task in TASKS
        assert path.is_file()


def test_the_same_seed_gives_the_same_results(results, tiny, tmp_path):
    again = write_demo_results(tiny, tmp_path / "a", seed=0)
    other = write_demo_results(tiny, tmp_path / "b", seed=1)
    for mine, same, different in zip(results, again, other, strict=True):
        assert mine.read_bytes() == same.read_bytes()
        assert mine.read_bytes() != different.read_bytes()


def test_times_agree_within_an_image(results):
    for path in results:
        table = read_pose_csv(path) if path.suffix == ".csv" else read_coco_json(path)
        times = {}
        for key in zip(table.scene_id.tolist(), table.im_id.tolist(), strict=True):
            times.setdefault(key, set())
        for s, i, t in zip(table.scene_id, table.im_id, table.time_s, strict=True):
            times[int(s), int(i)].add(float(t))
        assert all(len(seconds) == 1 for seconds in times.values())
        assert np.isfinite(table.time_s).all()


def test_stronger_perturbations_are_farther_from_the_truth(results, dataset):
    medians = []
    for strength in STRENGTHS:
        estimates = read_pose_csv(named(results, strength.name, "localization"))
        errors = true_errors_mm(dataset, estimates)
        assert np.isfinite(errors).all()
        medians.append(np.median(errors))
    assert medians == sorted(medians)
    assert medians[0] < 5 < 15 < medians[-1]


def test_detections_hold_duplicates_and_objects_absent_from_the_image(results, dataset):
    truth = read_truth(dataset)
    present = set(zip(truth.scene_id.tolist(), truth.im_id.tolist(), truth.obj_id.tolist(),
                      strict=True))  # fmt: skip
    for strength in STRENGTHS:
        table = read_pose_csv(named(results, strength.name, "detection"))
        keys = list(zip(table.scene_id.tolist(), table.im_id.tolist(), table.obj_id.tolist(),
                        strict=True))  # fmt: skip
        assert any(key not in present for key in keys)
        assert max(Counter(keys).values()) > 1
        boxes = read_coco_json(named(results, strength.name, "detection2d"))
        assert set(boxes.obj_id.tolist()) == set(dataset.object_ids)


def test_scores_tell_good_from_bad(results, dataset):
    table = read_pose_csv(named(results, "perturbed-moderately", "detection"))
    errors = true_errors_mm(dataset, table)
    good = errors < 20
    assert table.score[good].mean() > table.score[~good].mean() + 0.1


def test_boxes_lie_inside_the_image(results):
    for strength in STRENGTHS:
        x, y, w, h = read_coco_json(named(results, strength.name, "detection2d")).bbox_xywh_px.T
        assert (x >= 0).all()
        assert (y >= 0).all()
        assert (x + w <= 160 + 1e-9).all()
        assert (y + h <= 120 + 1e-9).all()
        assert (w >= 1 - 1e-9).all()
        assert (h >= 1 - 1e-9).all()


def test_the_truth_as_localization_has_one_row_for_each_wanted_instance(dataset):
    estimates = results_from_truth(dataset, "localization")
    targets = dataset.targets("test_targets_bop19.json")
    assert len(estimates) == targets.inst_count.sum()
    assert np.allclose(true_errors_mm(dataset, estimates), 0)


@pytest.mark.parametrize("kind", ["detection", "detection2d", "segmentation2d"])
def test_the_truth_as_detections_has_one_row_for_each_visible_instance(dataset, kind):
    visible = read_truth(dataset).visib_fract >= 0.1
    assert len(results_from_truth(dataset, kind)) == visible.sum()


@pytest.mark.parametrize(
    ("kind", "protocol", "score"),
    [
        ("localization", "bop19-localization", "AR"),
        ("detection", "bop24-detection", "AP"),
        ("detection", "bop24-detection-strict", "AP"),
        ("detection2d", "bop22-detection2d", "AP"),
        ("segmentation2d", "bop22-segmentation2d", "AP"),
    ],
)
def test_the_truth_scores_exactly_one(dataset, kind, protocol, score):
    evaluation = evaluate(results_from_truth(dataset, kind), dataset, protocol)
    assert evaluation.scores[score] == 1.0


def test_scores_fall_with_the_strength_of_the_perturbation(results, dataset):
    for task, protocol in (("detection", "bop24-detection"), ("detection2d", "bop22-detection2d")):
        scores = [
            evaluate(named(results, s.name, task), dataset, protocol).scores["AP"]
            for s in STRENGTHS
        ]
        assert scores == sorted(scores, reverse=True)
        assert scores[0] > 0.6 > scores[-1]


def test_the_checker_finds_no_fault_with_the_files(results, dataset):
    for path in results:
        assert [p for p in check_file(path, dataset).problems if p.severity == "error"] == []


def test_wrong_questions_to_the_truth_are_refused(dataset):
    with pytest.raises(UsageError, match="kind must be one of localization"):
        results_from_truth(dataset, "pose")
    with pytest.raises(MissingDataError, match="images only"):
        results_from_truth(dataset, "localization", "test_targets_bop24.json")


@given(right=st.integers(-9, 9), down=st.integers(-9, 9), x=st.integers(0, 5), y=st.integers(0, 3))
def test_a_slid_mask_moves_each_pixel(right, down, x, y):
    mask = np.zeros((4, 6), dtype=bool)
    mask[y, x] = True
    slid = slide(mask, right, down)
    assert slid.shape == mask.shape
    inside = 0 <= x + right < 6 and 0 <= y + down < 4
    assert np.argwhere(slid).tolist() == ([[y + down, x + right]] if inside else [])


@given(angle=st.floats(-3.1, 3.1), seed=st.integers(0, 99))
def test_rotations_turn_about_their_axis_by_their_angle(angle, seed):
    axis = np.random.default_rng(seed).normal(size=(1, 3))
    R = rotations_about(axis, np.array([angle]))[0]
    np.testing.assert_allclose(R @ axis[0], axis[0], atol=1e-12)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.trace(R) == pytest.approx(1 + 2 * np.cos(angle))
