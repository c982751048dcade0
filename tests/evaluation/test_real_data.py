"""Published numbers, from files on disk to scores."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

import sixd

pytestmark = pytest.mark.oracle
LMO = "cnos-fastsammegapose_lmo-test_16ab01bd-f020-4194-9750-d42fc7f875d2.csv"


@pytest.fixture(scope="module")
def peer(shared_data: Path) -> Path:
    return shared_data / "peer_synth"


def test_lmo_localization_is_what_the_bop_server_published(shared_data: Path) -> None:
    evaluation = sixd.evaluate(
        shared_data / "submissions" / LMO, shared_data / "lmo", errors=["mssd", "mspd"]
    )
    assert evaluation.scores["AR_mssd"] == pytest.approx(0.49411764705882344, abs=1e-12)
    assert evaluation.scores["AR_mspd"] == pytest.approx(0.6067128027681661, abs=1e-12)
    assert evaluation.n_targets == 1445
    assert "AR" not in evaluation.scores
    assert any("vsd" in note for note in evaluation.notes)


def test_lmo_detection_is_what_the_bop_server_published(shared_data: Path) -> None:
    evaluation = sixd.evaluate(
        shared_data / "submissions" / LMO,
        shared_data / "lmo",
        "bop24-detection",
        targets="test_targets_bop19.json",
    )
    assert evaluation.scores["AP_mssd"] == pytest.approx(0.44000810549674874, abs=1e-12)
    assert evaluation.scores["AP_mspd"] == pytest.approx(0.5685263874253823, abs=1e-12)
    assert evaluation.scores["AP"] == pytest.approx(0.5042672464610656, abs=1e-12)


def test_localization_scores_are_the_toolkits(peer: Path) -> None:
    theirs = json.loads((peer / "peer/scores_bop19.json").read_text())
    ours = sixd.evaluate(peer / "results/synthloc_lmo-test.csv", peer / "dataset/lmo")
    for error in ("mssd", "mspd"):
        published = theirs[f"bop19_average_recall_{error}"]
        assert ours.scores[f"AR_{error}"] == pytest.approx(published, abs=1e-9)
    # The toolkit's depth buffer has 16 bits; pixels on the tolerance fall to either side.
    assert ours.scores["AR_vsd"] == pytest.approx(theirs["bop19_average_recall_vsd"], abs=1e-3)
    published = theirs["bop19_average_time_per_image"]
    assert ours.average_time_per_image == pytest.approx(published, abs=1e-9)
    assert_errors_agree(peer, ours, "localization")


def test_detection_scores_are_the_toolkits(peer: Path) -> None:
    theirs = json.loads((peer / "peer/scores_bop24.json").read_text())
    results, dataset = peer / "results/synthdet_lmo-test.csv", peer / "dataset/lmo"
    ours = sixd.evaluate(results, dataset, "bop24-detection")
    for key in ("AP", "AP_mssd", "AP_mspd", "AP_mssd_mm"):
        published = theirs[f"bop24_m{key}"]
        assert ours.scores[key] == pytest.approx(published, abs=1e-9), key
    assert ours.ignored["object_absent_from_image"] == 498
    assert_errors_agree(peer, ours, "detection")
    newer = sixd.evaluate(results, dataset, "bop25-detection")
    assert newer.scores["AP"] == pytest.approx(theirs["bop25_mAP"], abs=1e-9)
    assert newer.scores["AP_mssd_mm"] == pytest.approx(theirs["bop25_mAP_mm"], abs=1e-9)
    # RULES 10.1 measured what the hidden hallucinations would have cost.
    strict = sixd.evaluate(results, dataset, "bop24-detection-strict")
    assert strict.scores["AP_mssd"] == pytest.approx(0.66688, abs=5e-6)


def assert_errors_agree(peer: Path, ours: sixd.Evaluation, task: str) -> None:
    """Every MSSD and MSPD error, infinities included, to 1e-6 (mm, px)."""
    assert ours.table is not None
    rows = ours.table.to_rows()
    for error, column in (("mssd", "mssd_mm"), ("mspd", "mspd_px")):
        with gzip.open(peer / f"peer/errors/{task}_{error}.json.gz") as file:
            entries = json.load(file)
        theirs = sorted(
            (e["scene_id"], e["im_id"], e["obj_id"], e["score"], int(gt), err[0])
            for e in entries
            for gt, err in e["errors"].items()
        )
        ids = zip(*(rows[c].tolist() for c in ("scene_id", "im_id", "obj_id", "score", "gt_id")),
                  rows[column].tolist(), strict=True)  # fmt: skip
        mine = sorted(ids)
        assert len(mine) == len(theirs)
        np.testing.assert_array_equal([m[:5] for m in mine], [t[:5] for t in theirs])
        np.testing.assert_allclose([m[5] for m in mine], [t[5] for t in theirs], rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("protocol", "results", "published"),
    [
        ("bop22-detection2d", "synthbox_lmo-test.json", "scores_bop22_coco_bbox.json"),
        ("bop22-segmentation2d", "synthseg_lmo-test.json.gz", "scores_bop22_coco_segm.json"),
    ],
)
def test_coco_scores_are_the_toolkits(
    peer: Path, protocol: str, results: str, published: str
) -> None:
    theirs = json.loads((peer / "peer" / published).read_text())
    ours = sixd.evaluate(peer / "results" / results, peer / "dataset/lmo", protocol)
    time_s = theirs.pop("average_time_per_image")
    assert set(ours.scores) == set(theirs)
    for key, value in theirs.items():
        assert ours.scores[key] == pytest.approx(value, abs=1e-9), key
    assert ours.average_time_per_image == pytest.approx(time_s, abs=1e-9)


def test_the_truth_of_lmo_scores_exactly_one(shared_data: Path) -> None:
    dataset = sixd.open_dataset(shared_data / "lmo")
    truth = sixd.results_from_truth(dataset, "localization")
    local = sixd.evaluate(truth, dataset, errors=["mssd", "mspd"])
    assert local.scores == {"AR_mssd": 1.0, "AR_mspd": 1.0}
    found = sixd.results_from_truth(dataset, "detection")
    for protocol in ("bop24-detection", "bop24-detection-strict", "bop25-detection"):
        scores = sixd.evaluate(found, dataset, protocol).scores
        assert set(scores.values()) == {1.0}, protocol
    add = sixd.evaluate(truth, dataset, "linemod-add").scores
    assert set(add.values()) == {1.0}


@pytest.mark.parametrize("name", ["tless", "ycbv", "tudl", "icbin"])
def test_results_for_another_dataset_are_refused(
    shared_data: Path, name: str, tmp_path: Path
) -> None:
    (results,) = (shared_data / "submissions").glob(f"cnos-*_{name}-test_*.csv")
    with pytest.raises(sixd.SixdError, match=f"named as results for {name}"):
        sixd.evaluate(results, shared_data / "lmo", errors=["mssd"])
    renamed = tmp_path / "results.csv"
    renamed.write_bytes(results.read_bytes())
    with pytest.raises(sixd.SixdError, match="another dataset"):
        sixd.evaluate(renamed, shared_data / "lmo", errors=["mssd"])
