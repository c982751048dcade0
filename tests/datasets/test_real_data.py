"""Official files: the counts their publishers state must come out."""

from __future__ import annotations

import pytest

from sixd.datasets import open_dataset
from sixd.datasets.preflight import find_missing
from sixd.datasets.targets import read_targets
from sixd.datasets.truth import coco_truth_path, read_truth


def test_the_official_lmo_files_hold_what_the_paper_counts(shared_data):
    dataset = open_dataset(shared_data / "lmo")
    truth = read_truth(dataset)
    targets = dataset.targets("test_targets_bop19.json")
    assert (len(truth), len(truth.images), len(dataset.cameras(2))) == (1517, 200, 200)
    assert (len(targets), int(targets.inst_count.sum()), len(targets.images)) == (1445, 1445, 200)
    assert len(dataset.targets("test_targets_bop24.json")) == 200
    assert dataset.object_ids == (1, 5, 6, 8, 9, 10, 11, 12)
    assert dataset.model(1).diameter_mm == 102.099
    assert dataset.image_size_px == (640, 480)
    frame = dataset.frame(2, 3, targets)
    assert frame.rgb.shape == (480, 640, 3)
    assert frame.depth_mm.shape == (480, 640)
    assert len(frame.targets) == 8
    truth.require_images(targets.scene_id, targets.im_id)


def test_a_known_dataset_with_only_depth_images_is_whole_enough(shared_data):
    dataset = open_dataset(shared_data / "peer_synth" / "dataset" / "lmo")
    truth = read_truth(dataset)
    targets = dataset.targets("test_targets_bop19.json")
    assert (len(truth), int((truth.visib_fract >= 0.1).sum()), len(targets)) == (1512, 1491, 1379)
    assert dataset.image_size_px == (640, 480)
    assert coco_truth_path(dataset, 2).is_file()
    needs = ("camera", "truth", "gt_info", "models_info", "meshes", "depth")
    images = truth.images
    assert find_missing(dataset, images[:, 0], images[:, 1], dataset.object_ids, needs) == []
    assert dataset.frame(2, 0).rgb is None
    assert dataset.depth_mm(2, 0).max() > 500
    assert len(dataset.model(10).symmetries.axes) == 1


@pytest.mark.parametrize(
    ("file", "entries", "instances"), [("test_targets_bop19.json", 4904, 6423)]
)
def test_the_official_tless_targets_are_counted(shared_data, file, entries, instances):
    targets = read_targets(shared_data / "tless" / file)
    assert (len(targets), int(targets.inst_count.sum()), len(targets.images)) == (
        entries, instances, 1000)  # fmt: skip
