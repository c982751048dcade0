from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import sixd
from sixd.evaluation.bop_files import write_bop_files
from sixd.evaluation.protocol import PROTOCOLS
from sixd.results.pose_csv import write_pose_csv

KIND = {
    "bop22-detection2d": "detection2d",
    "bop22-segmentation2d": "segmentation2d",
    "bop24-detection": "detection",
    "bop24-detection-strict": "detection",
    "bop25-detection": "detection",
}


@pytest.fixture(scope="module")
def dataset(tiny: Path) -> sixd.Dataset:
    return sixd.open_dataset(tiny)


@pytest.fixture(scope="module")
def truth(dataset: sixd.Dataset) -> sixd.PoseEstimates:
    table = sixd.results_from_truth(dataset, "localization")
    assert isinstance(table, sixd.PoseEstimates)
    return table


def shifted(table: sixd.PoseEstimates, mm: float, seed: int = 0) -> sixd.PoseEstimates:
    rng = np.random.default_rng(seed)
    moved = table.t_mm + rng.normal(0, mm, table.t_mm.shape)
    return replace(table, t_mm=moved, score=rng.uniform(size=len(table)))


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_the_truth_scores_exactly_one(
    dataset: sixd.Dataset, protocol: str, tmp_path: Path, tiny: Path
) -> None:
    targets = None
    if protocol == "bop18-siso":  # its list is like bop19's
        targets = "test_targets_bop19.json"
    results = sixd.results_from_truth(dataset, KIND.get(protocol, "localization"))
    evaluation = sixd.evaluate(results, dataset, protocol, targets=targets)
    defined = {k: v for k, v in evaluation.scores.items() if v != -1}
    if protocol.startswith("bop22"):
        # With one detection per image and category, recall stops at that of one instance each.
        defined = {k: v for k, v in defined.items() if k not in ("AR1", "AR10")}
    assert len(defined) >= 1
    assert set(defined.values()) == {1.0}
    assert evaluation.n_targets > 0
    assert evaluation.n_without_estimate == 0


def test_a_missing_estimate_is_a_miss(dataset: sixd.Dataset, truth: sixd.PoseEstimates) -> None:
    fewer = truth.where(np.arange(len(truth)) != 3)
    evaluation = sixd.evaluate(fewer, dataset)
    assert evaluation.n_without_estimate == 1
    expected = (evaluation.n_targets - 1) / evaluation.n_targets
    for key in ("AR", "AR_vsd", "AR_mssd", "AR_mspd"):
        assert evaluation.scores[key] == pytest.approx(expected, abs=1e-12)


def test_estimates_of_absent_objects_cost_precision_only_in_the_strict_protocol(
    dataset: sixd.Dataset,
) -> None:
    found = sixd.results_from_truth(dataset, "detection")
    assert isinstance(found, sixd.PoseEstimates)
    present = set(
        zip(found.scene_id.tolist(), found.im_id.tolist(), found.obj_id.tolist(), strict=True)
    )
    images = sorted({k[:2] for k in present})
    absent = [(s, i, o) for s, i in images for o in dataset.object_ids if (s, i, o) not in present]
    assert absent
    ids = np.array(absent)
    ghosts = sixd.PoseEstimates.from_arrays(
        scene_id=ids[:, 0], im_id=ids[:, 1], obj_id=ids[:, 2], score=2.0,
        R=np.tile(np.eye(3), (len(ids), 1, 1)), t_mm=np.tile([0, 0, 900.0], (len(ids), 1)),
    )  # fmt: skip
    both = sixd.PoseEstimates.concatenate([ghosts, found])
    lenient = sixd.evaluate(both, dataset, "bop24-detection")
    strict = sixd.evaluate(both, dataset, "bop24-detection-strict")
    assert set(lenient.scores.values()) == {1.0}
    assert lenient.ignored["object_absent_from_image"] == len(ids)
    assert strict.scores["AP"] < 1.0


def test_batches_give_the_same_as_the_whole(
    dataset: sixd.Dataset, truth: sixd.PoseEstimates
) -> None:
    estimates = shifted(truth, 4.0)
    whole = sixd.evaluate(estimates, dataset)
    evaluator = sixd.Evaluator(dataset)
    for rows in np.array_split(np.arange(len(estimates)), 4):
        evaluator.add(estimates.where(rows))
    assert evaluator.compute().scores == whole.scores
    evaluator.reset()
    evaluator.add(truth)
    assert evaluator.compute().scores["AR"] == 1.0


def test_workers_change_nothing(
    dataset: sixd.Dataset, truth: sixd.PoseEstimates, tmp_path: Path
) -> None:
    estimates = shifted(truth, 8.0)
    files = [
        sixd.evaluate(estimates, dataset, workers=n).save(tmp_path / str(n)) for n in (1, 2, 5)
    ]
    assert len({f.read_bytes() for f in files}) == 1


def test_errors_grow_and_scores_fall(dataset: sixd.Dataset, truth: sixd.PoseEstimates) -> None:
    scores = [
        sixd.evaluate(shifted(truth, mm), dataset).scores["AR"] for mm in (0.0, 3.0, 15.0, 80.0)
    ]
    assert scores == sorted(scores, reverse=True)
    assert scores[0] > scores[-1]


def test_a_saved_evaluation_comes_back_whole(
    dataset: sixd.Dataset, truth: sixd.PoseEstimates, tmp_path: Path
) -> None:
    evaluation = sixd.evaluate(shifted(truth, 5.0), dataset)
    back = sixd.load_evaluation(evaluation.save(tmp_path / "a.sixd"))
    assert back.summary() == evaluation.summary()
    assert list(back.breakdowns) == list(evaluation.breakdowns)
    for by, breakdown in evaluation.breakdowns.items():
        assert list(back.by(by).columns) == list(breakdown.columns)
        for name, values in breakdown.columns.items():
            np.testing.assert_array_equal(back.by(by).columns[name], values)
    assert back.table is not None
    assert evaluation.table is not None
    for name, column in evaluation.table.to_columns().items():
        np.testing.assert_array_equal(back.table.to_columns()[name], column)


def test_a_saved_evaluation_can_be_scored_again(
    dataset: sixd.Dataset, truth: sixd.PoseEstimates, tmp_path: Path
) -> None:
    from sixd.evaluation.scores import score

    evaluation = sixd.evaluate(shifted(truth, 5.0), dataset)
    back = sixd.load_evaluation(evaluation.save(tmp_path / "a.sixd"))
    assert back.table is not None
    assert score(back.table, PROTOCOLS["bop19-localization"]).values == evaluation.scores


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_every_error_can_be_exported(
    dataset: sixd.Dataset, truth: sixd.PoseEstimates, tmp_path: Path, ending: str
) -> None:
    import polars

    evaluation = sixd.evaluate(shifted(truth, 5.0), dataset, errors=["mssd", "mspd"])
    path = evaluation.export_errors(tmp_path / f"errors{ending}")
    frame = polars.read_csv(path) if ending == ".csv" else polars.read_parquet(path)
    assert evaluation.table is not None
    np.testing.assert_array_equal(frame["mssd_mm"], evaluation.table.errors["mssd_mm"])


def test_a_file_that_is_no_evaluation_is_named(tmp_path: Path) -> None:
    path = tmp_path / "x.sixd"
    path.write_bytes(b"PK\x03\x04 not really")
    with pytest.raises(sixd.SixdError, match=r"x\.sixd"):
        sixd.load_evaluation(path)
    with pytest.raises(sixd.SixdError, match=r"missing\.sixd"):
        sixd.load_evaluation(tmp_path / "missing.sixd")


def test_an_unknown_protocol_names_the_nearest(
    dataset: sixd.Dataset, truth: sixd.PoseEstimates
) -> None:
    with pytest.raises(sixd.SixdError, match="bop19-localization"):
        sixd.evaluate(truth, dataset, "bop19-localisation")


def test_results_of_another_kind_are_refused(
    dataset: sixd.Dataset, truth: sixd.PoseEstimates
) -> None:
    boxes = sixd.results_from_truth(dataset, "detection2d")
    with pytest.raises(sixd.SixdError, match="scores 6D poses"):
        sixd.evaluate(boxes, dataset, "bop19-localization")
    with pytest.raises(sixd.SixdError, match="scores 2D detections"):
        sixd.evaluate(truth, dataset, "bop22-detection2d")


def test_broken_rows_are_refused_all_at_once(
    dataset: sixd.Dataset, truth: sixd.PoseEstimates, tmp_path: Path
) -> None:
    R = truth.R.copy()
    R[2] *= 1.5
    R[4, 0] *= -1
    path = tmp_path / "broken.csv"
    write_pose_csv(path, replace(truth, R=R))
    with pytest.raises(sixd.SixdError) as caught:
        sixd.evaluate(path, dataset)
    assert "broken.csv:4" in str(caught.value)
    assert "broken.csv:6" in str(caught.value)


def test_everything_missing_is_named_before_anything_is_computed(
    tiny: Path, tmp_path: Path
) -> None:
    broken = tmp_path / "sixdemo"
    shutil.copytree(tiny, broken)
    (broken / "test/000001/depth/000001.png").unlink()
    (broken / "test/000002/depth/000002.png").unlink()
    (broken / "models_eval/obj_000002.ply").unlink()
    with pytest.raises(sixd.SixdError) as caught:
        sixd.Evaluator(broken)
    text = str(caught.value)
    assert "000001/depth/000001.png" in text
    assert "000002/depth/000002.png" in text
    assert "obj_000002.ply" in text


@pytest.mark.parametrize("victim", ["test/000001/depth/000001.png", "models_eval/obj_000002.ply",
                                    "test/000001/scene_gt.json"])  # fmt: skip
def test_a_corrupt_file_is_named(
    tiny: Path, truth: sixd.PoseEstimates, tmp_path: Path, victim: str
) -> None:
    broken = tmp_path / "sixdemo"
    shutil.copytree(tiny, broken)
    whole = (broken / victim).read_bytes()
    (broken / victim).write_bytes(whole[: len(whole) // 2])
    with pytest.raises(sixd.SixdError, match=victim):
        sixd.evaluate(truth, broken)


def test_the_toolkits_score_files_are_written(
    dataset: sixd.Dataset, truth: sixd.PoseEstimates, tmp_path: Path
) -> None:
    path = tmp_path / "method_sixdemo-test.csv"
    write_pose_csv(path, truth)
    evaluation = sixd.evaluate(path, dataset)
    written = write_bop_files(evaluation, tmp_path / "eval")
    assert written == tmp_path / "eval/method_sixdemo-test/scores_bop19.json"
    scores = json.loads(written.read_text())
    assert scores["bop19_average_recall"] == 1.0
    assert set(scores) == {
        "bop19_average_recall",
        "bop19_average_recall_vsd",
        "bop19_average_recall_mssd",
        "bop19_average_recall_mspd",
        "bop19_average_time_per_image",
    }
    partial = sixd.evaluate(path, dataset, errors=["mssd"])
    with pytest.raises(sixd.SixdError, match="AR_vsd"):
        write_bop_files(partial, tmp_path)


@given(place=st.floats(0, 1, exclude_max=True), value=st.integers(0, 255))
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_damaged_evaluation_is_told_or_still_whole(
    saved: bytes, tmp_path: Path, place: float, value: int
) -> None:
    damaged = bytearray(saved)
    damaged[int(place * len(saved))] = value
    path = tmp_path / "damaged.sixd"
    path.write_bytes(damaged)
    try:
        evaluation = sixd.load_evaluation(path)
    except sixd.SixdError:
        return
    assert evaluation.table is not None
    evaluation.table.to_rows()


@pytest.fixture(scope="module")
def saved(
    dataset: sixd.Dataset, truth: sixd.PoseEstimates, tmp_path_factory: pytest.TempPathFactory
) -> bytes:
    evaluation = sixd.evaluate(truth, dataset, errors=["mssd"])
    return evaluation.save(tmp_path_factory.mktemp("saved") / "a.sixd").read_bytes()


def test_numbers_in_memory_are_checked_like_those_of_a_file(
    dataset: sixd.Dataset, truth: sixd.PoseEstimates
) -> None:
    score = truth.score.copy()
    score[3] = np.nan
    t_mm = truth.t_mm.copy()
    t_mm[5] = np.inf
    with pytest.raises(sixd.SixdError) as caught:
        sixd.evaluate(replace(truth, score=score, t_mm=t_mm), dataset)
    assert "score: row 3" in str(caught.value)
    assert "t_mm: row 5" in str(caught.value)


def test_what_is_no_table_is_refused(dataset: sixd.Dataset) -> None:
    evaluator = sixd.Evaluator(dataset)
    for thing in (None, {}, "results.csv"):
        with pytest.raises(sixd.SixdError, match="PoseEstimates"):
            evaluator.add(thing)  # type: ignore[arg-type]
    with pytest.raises(sixd.SixdError, match="nothing to score"):
        evaluator.compute()


def test_masks_of_another_size_than_the_image_are_refused(dataset: sixd.Dataset) -> None:
    found = sixd.results_from_truth(dataset, "segmentation2d")
    assert isinstance(found, sixd.Detections)
    turned = tuple(
        None if mask is None else type(mask)((mask.size[1], mask.size[0]), mask.counts)
        for mask in found.segmentation
    )
    with pytest.raises(sixd.SixdError, match="another size than its image"):
        sixd.evaluate(replace(found, segmentation=turned), dataset, "bop22-segmentation2d")


def test_add_s_is_taken_for_symmetric_objects_and_add_for_others(
    dataset: sixd.Dataset, truth: sixd.PoseEstimates
) -> None:
    table = sixd.evaluate(shifted(truth, 6.0), dataset, "ycbv-auc").table
    assert table is not None
    is_symmetric = np.array(
        [dataset.is_symmetric(o) for o in table.groups.obj_id[table.pair_group].tolist()]
    )
    assert 0 < is_symmetric.sum() < len(is_symmetric)
    errors = table.errors
    chosen = np.where(is_symmetric, errors["adi_mm"], errors["add_mm"])
    np.testing.assert_array_equal(errors["ad_mm"], chosen)
    assert (errors["adi_mm"] <= errors["add_mm"] + 1e-9).all()
