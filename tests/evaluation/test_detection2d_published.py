"""2D scores that others published: COCO's own example, and the BOP toolkit's on one input."""

from __future__ import annotations

import gzip
import hashlib
import json
from pathlib import Path

import msgspec
import numpy as np
import pytest

from sixd.datasets.opening import open_dataset
from sixd.datasets.targets import Targets
from sixd.errors import MissingDataError
from sixd.evaluation.coco_truth import (
    CocoTruth,
    read_coco_files,
    read_coco_truth,
)
from sixd.evaluation.detection2d import coco_scores
from sixd.evaluation.inputs import read_inputs
from sixd.evaluation.protocol import get_protocol
from sixd.results.tables import Detections, Rle

SCENE = 0

# What COCO's code prints for its own example results on 100 images of val2014 (3 digits, in
# pycocoEvalDemo), and what pycocotools 2.0.11 computes.
COCO_EXAMPLE = {
    "bbox": (
        (0.505, 0.697, 0.573, 0.586, 0.519, 0.501, 0.387, 0.594, 0.595, 0.640, 0.566, 0.564),
        (0.5045806987249628, 0.6969727247299577, 0.5729816669904824, 0.5856257209410443,
         0.5193996948036719, 0.5013978986347466, 0.38681277964578054, 0.5936795762842003,
         0.595352982877607, 0.6398109626113442, 0.5664205978994309, 0.5642905982905982),
    ),
    "segm": (
        (0.320, 0.562, 0.299, 0.387, 0.310, 0.327, 0.268, 0.415, 0.417, 0.469, 0.377, 0.381),
        (0.3195452758576433, 0.5622883972521636, 0.29892653412086784, 0.3873740315997837,
         0.31018272403369485, 0.3269339071005138, 0.2682297225711534, 0.41544868114906375,
         0.4168394992198818, 0.4694498622754236, 0.37675922666197265, 0.3814715099715099),
    ),
}  # fmt: skip
# Published in faster-coco-eval's tests for its own two small sets.
SMALL_WITH_IGNORED = (0.7099009900990099, 1.0, 0.8415841584158416, -1.0, 0.7099009900990099, -1.0,
                      0.0, 0.45384615384615384, 0.7153846153846154, -1.0, 0.7153846153846154,
                      -1.0)  # fmt: skip
SMALL_POLYGONS = (0.6947194719471946, 0.6947194719471946, 0.6947194719471946, -1.0,
                  0.7367986798679867, 0.0, 0.6666666666666666, 0.75, 0.75, -1.0,
                  0.7916666666666666, 0.0)  # fmt: skip


def plain_coco_truth(path: Path, tmp_path: Path) -> CocoTruth:
    """A COCO file as the truth of one scene; ids that are text become numbers."""
    file = json.loads(path.read_text())
    for record in file["images"]:
        record["id"] = int(record["id"])
    for record in file["annotations"]:
        record["image_id"] = int(record["image_id"])
        record.setdefault("segmentation", [])
    mended = tmp_path / path.name
    mended.write_text(json.dumps(file))
    im_ids = np.array([i["id"] for i in file["images"]])
    return read_coco_files({SCENE: mended}, np.full(len(im_ids), SCENE), im_ids)


def to_detections(rows: list[dict]) -> Detections:
    masks = [r.get("segmentation") for r in rows]
    return Detections.from_arrays(
        scene_id=[r.get("scene_id", SCENE) for r in rows],
        im_id=[r["image_id"] for r in rows],
        obj_id=[r["category_id"] for r in rows],
        score=[r["score"] for r in rows],
        bbox_xywh_px=[r.get("bbox", (np.nan,) * 4) for r in rows],
        segmentation=[None if m is None else msgspec.convert(m, Rle) for m in masks],
        time_s=[r.get("time", -1) for r in rows],
    )


@pytest.mark.oracle
@pytest.mark.parametrize("iou_type", ["bbox", "segm"])
def test_the_24_published_numbers_of_coco(shared_data, tmp_path, iou_type):
    folder = shared_data / "coco"
    truth = plain_coco_truth(folder / "instances_val2014_100.json", tmp_path)
    rows = json.loads((folder / f"instances_val2014_fake{iou_type}100_results.json").read_text())
    scores = coco_scores(to_detections(rows), truth, iou_type)
    printed, computed = COCO_EXAMPLE[iou_type]
    assert tuple(round(v, 3) for v in scores.scores.values()) == printed
    np.testing.assert_allclose(list(scores.scores.values()), computed, rtol=0, atol=1e-12)
    assert (len(truth.im_id), int(truth.crowd.sum()), scores.n_detections) == (100, 9, len(rows))


@pytest.mark.oracle
def test_the_published_numbers_of_a_set_with_an_ignored_region(shared_data, tmp_path):
    folder = shared_data / "coco"
    truth = plain_coco_truth(folder / "gt_ignore_test.json", tmp_path)
    rows = json.loads((folder / "dt_ignore_test.json").read_text())
    scores = coco_scores(to_detections(rows), truth)
    np.testing.assert_allclose(list(scores.scores.values()), SMALL_WITH_IGNORED, atol=1e-12)


@pytest.mark.oracle
def test_the_published_numbers_of_a_set_with_polygons(shared_data, tmp_path):
    from hotcoco import mask

    folder = shared_data / "coco"
    truth = plain_coco_truth(folder / "gt_dataset.json", tmp_path)
    size_px = dict(zip(truth.im_id.tolist(), truth.size_px.tolist(), strict=True))
    rows = json.loads((folder / "dt_dataset.json").read_text())
    for row in rows:
        width, height = size_px[row["image_id"]]
        whole = mask.merge(mask.fr_py_objects(row["segmentation"], height, width))
        row["segmentation"] = {"size": whole["size"], "counts": whole["counts"].decode()}
        del row["bbox"]
    scores = coco_scores(to_detections(rows), truth, "segm")
    np.testing.assert_allclose(list(scores.scores.values()), SMALL_POLYGONS, atol=1e-12)


@pytest.fixture(scope="module")
def peer(shared_data: Path) -> Path:
    return shared_data / "peer_synth"


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("iou_type", "results"),
    [("bbox", "synthbox_lmo-test.json"), ("segm", "synthseg_lmo-test.json.gz")],
)
def test_the_numbers_of_the_toolkit_with_the_ignore_flag_honoured(peer, iou_type, results):
    raw = (peer / "results" / results).read_bytes()
    rows = json.loads(gzip.decompress(raw) if results.endswith(".gz") else raw)
    dataset = open_dataset(peer / "dataset" / "lmo")
    targets = dataset.targets("test_targets_bop19.json")
    truth = read_coco_truth(dataset, targets, masks=iou_type == "segm")
    scores = coco_scores(to_detections(rows), truth, iou_type)
    expected = json.loads((peer / f"peer/scores_bop22_coco_{iou_type}.json").read_text())
    assert scores.average_time_per_image_s == pytest.approx(
        expected.pop("average_time_per_image"), rel=1e-12
    )
    assert scores.scores == pytest.approx(expected, rel=0, abs=1e-12)
    assert (scores.n_truths, scores.n_ignored_truths) == (1491, 13)


def test_modal_boxes_are_another_file_and_its_absence_is_told(peer):
    dataset = open_dataset(peer / "dataset" / "lmo")
    with pytest.raises(MissingDataError, match=r"000002/scene_gt_coco_modal\.json"):
        read_coco_truth(dataset, dataset.targets("test_targets_bop19.json"), modal=True)


def test_the_hash_of_the_truth_is_that_of_its_files_and_targets(peer):
    dataset = open_dataset(peer / "dataset" / "lmo")
    targets = Targets(np.array([2, 2]), np.array([3, 5]))
    content = (peer / "dataset/lmo/test/000002/scene_gt_coco.json").read_bytes()
    head = f"test/000002/scene_gt_coco.json\0{len(content)}\0".encode()
    columns = (("scene_id", [2, 2]), ("im_id", [3, 5]))
    rows = b"".join(
        f"targets.{name}\0{16}\0".encode() + np.array(ids, "<i8").tobytes() for name, ids in columns
    )
    digest = hashlib.sha256(head + content + rows).hexdigest()
    assert read_inputs(dataset, get_protocol("bop22-detection2d"), targets).sha256 == digest
