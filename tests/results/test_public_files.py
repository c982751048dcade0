"""Real submissions, as their authors uploaded them: no false alarm, no bit lost."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sixd.datasets.opening import open_dataset
from sixd.results import (
    CheckRules,
    Detections,
    PoseEstimates,
    check_file,
    check_table,
    read_results,
    write_coco_json,
    write_pose_csv,
)
from tests.results.makers import bits

FILES = {  # rows, images
    "submissions/cnos-fastsammegapose_icbin-test_*.csv": (1905, 150),
    "submissions/cnos-fastsammegapose_lmo-test_*.csv": (1645, 200),
    "submissions/cnos-fastsammegapose_tless-test_*.csv": (7001, 1000),
    "submissions/cnos-fastsammegapose_tudl-test_*.csv": (1158, 600),
    "submissions/cnos-fastsammegapose_ycbv-test_*.csv": (4914, 900),
    "submissions/gdrnppdet-pbrreal_ycbv-test_*.json.gz": (17376, 900),
    "peer_synth/results/synthdet_lmo-test.csv": (11782, 200),
    "peer_synth/results/synthloc_lmo-test.csv": (1448, 200),
    "peer_synth/results/synthbox_lmo-test.json": (5310, 200),
    "peer_synth/results/synthseg_lmo-test.json.gz": (5310, 200),
}


@pytest.fixture(params=sorted(FILES))
def public(request: pytest.FixtureRequest, shared_data: Path) -> tuple[Path, tuple[int, int]]:
    (path,) = shared_data.glob(request.param)
    return path, FILES[request.param]


def test_a_public_file_has_no_problem_at_all(public: tuple[Path, tuple[int, int]]) -> None:
    path, counts = public
    report = check_file(path, strict=True)
    assert report.problems == ()
    assert (report.n_rows, report.n_images) == counts


def test_a_public_file_survives_writing_bit_for_bit(
    public: tuple[Path, tuple[int, int]], tmp_path: Path
) -> None:
    table = read_results(public[0])
    for name in ("x", "x.gz"):
        if isinstance(table, PoseEstimates):
            write_pose_csv(tmp_path / name, table)
        else:
            write_coco_json(tmp_path / name, table)
        assert bits(read_results(tmp_path / name)) == bits(table)


def test_python_reads_the_same_numbers(shared_data: Path) -> None:
    (path,) = shared_data.glob("submissions/cnos-fastsammegapose_tless-test_*.csv")
    table = read_results(path)
    assert isinstance(table, PoseEstimates)
    lines = path.read_text().splitlines()[1:]
    for row in range(0, len(lines), 97):
        scene_id, im_id, obj_id, score, R, t, time = lines[row].split(",")
        assert [table.scene_id[row], table.im_id[row], table.obj_id[row]] == [
            int(scene_id),
            int(im_id),
            int(obj_id),
        ]
        assert table.score[row] == float(score)
        assert table.R[row].reshape(9).tolist() == [float(x) for x in R.split()]
        assert table.t_mm[row].tolist() == [float(x) for x in t.split()]
        assert table.time_s[row] == float(time)


def test_the_facts_told_of_the_synthetic_results_are_found(shared_data: Path) -> None:
    dataset = open_dataset(shared_data / "peer_synth/dataset/lmo")
    results = shared_data / "peer_synth/results"
    detection = check_file(
        results / "synthdet_lmo-test.csv",
        dataset,
        CheckRules("test_targets_bop24.json", "pose", cap=True),
    )
    assert detection.ok
    assert [p.code for p in detection.problems] == ["over-cap"] * 8  # README: 8 images above 100
    localization = check_file(
        results / "synthloc_lmo-test.csv",
        dataset,
        CheckRules("test_targets_bop19.json", "pose", every_target_object=True),
    )
    (missing,) = localization.problems
    assert "1,379 targets" in missing.expected
    masks = check_file(
        results / "synthseg_lmo-test.json.gz",
        dataset,
        CheckRules("test_targets_bop19.json", "segm"),
    )
    assert masks.ok
    assert isinstance(masks.table, Detections)


def test_the_official_truth_is_not_refused(shared_data: Path) -> None:
    truth = json.loads((shared_data / "lmo/test/000002/scene_gt.json").read_text())
    R = [one["cam_R_m2c"] for instances in truth.values() for one in instances]
    table = PoseEstimates.from_arrays(
        scene_id=2,
        im_id=list(range(len(R))),
        obj_id=1,
        score=1,
        R=R,
        t_mm=[[0, 0, 900]] * len(R),
        time_s=1,
    )
    report = check_table(table)
    assert report.ok
    assert {p.code for p in report.problems} == {"inexact-rotation"}
    assert report.counts["warning"] == 348


def test_results_of_another_dataset_are_recognised(shared_data: Path) -> None:
    (path,) = shared_data.glob("submissions/cnos-fastsammegapose_tless-test_*.csv")
    report = check_file(path, open_dataset(shared_data / "lmo"))
    assert not report.ok
    first = report.problems[0]
    assert (first.line, first.code) == (2, "unknown-scene")
    assert "another dataset" in first.fix
