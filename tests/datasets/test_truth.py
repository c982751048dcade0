from __future__ import annotations

import json
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from sixd.datasets import open_dataset
from sixd.datasets.truth import coco_truth_path, dataset_hash, read_truth
from sixd.errors import FormatError, MissingDataError
from tests.datasets.folders import instance, write_classic, write_json, write_scene


@pytest.fixture
def dataset(tmp_path):
    return open_dataset(write_classic(tmp_path / "bins", scenes=(1, 2)))


def test_rows_come_by_scene_image_and_place_in_the_list(dataset):
    path = dataset.annotation_path("gt", 2)
    write_json(path, {str(i): [instance(5, (i, 0, 1)), instance(4)] for i in (10, 9)})
    shutil.copy(path, dataset.annotation_path("camera", 2))
    dataset.annotation_path("gt_info", 2).unlink()
    truth = read_truth(dataset)
    assert truth.scene_id.tolist() == [1] * 6 + [2] * 4
    assert truth.im_id.tolist() == [0, 0, 0, 3, 3, 3, 9, 9, 10, 10]
    assert truth.gt_id.tolist() == [0, 1, 2, 0, 1, 2, 0, 1, 0, 1]
    assert truth.obj_id.tolist() == [1, 2, 1, 1, 2, 1, 5, 4, 5, 4]
    assert truth.t_mm[-2].tolist() == [10, 0, 1]
    assert truth.R[0].tolist() == [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    np.testing.assert_array_equal(truth.visib_fract[:7], [1, 1 / 2, 1 / 3, 1, 1 / 2, 1 / 3, np.nan])
    assert truth.images.tolist() == [[1, 0], [1, 3], [2, 9], [2, 10]]
    assert len(truth.pose_c_m) == len(truth) == 10


def test_only_the_asked_scenes_are_read(dataset):
    shutil.rmtree(dataset.scene_dir(2))
    assert set(read_truth(dataset, [1]).scene_id.tolist()) == {1}
    assert len(read_truth(dataset, [])) == 0


def test_placeholders_and_empty_images_are_kept(dataset):
    write_json(dataset.annotation_path("gt", 1), {"0": [instance(1, (-1, -1, -1))], "8": []})
    write_json(dataset.annotation_path("gt_info", 1), {"0": [{"visib_fract": 0}], "8": []})
    truth = read_truth(dataset, [1])
    assert truth.t_mm.tolist() == [[-1, -1, -1]]
    assert truth.images.tolist() == [[1, 0], [1, 8]]
    truth.require_images(np.array([1, 1]), np.array([0, 8]))
    with pytest.raises(MissingDataError, match=r"1 of 2 .*: 1/7"):
        truth.require_images(np.array([1, 1]), np.array([0, 7]))


def test_floats_are_bit_exact(dataset):
    t_mm = [0.1 + 0.2, 1e-310, 123456.78901234567]
    write_json(dataset.annotation_path("gt", 1), {"0": [instance(1, t_mm)]})
    dataset.annotation_path("gt_info", 1).unlink()
    assert read_truth(dataset, [1]).t_mm.tolist() == [t_mm]


def test_every_missing_file_is_named(dataset):
    dataset.annotation_path("gt", 1).unlink()
    dataset.annotation_path("gt", 2).unlink()
    with pytest.raises(MissingDataError) as caught:
        read_truth(dataset, [1, 2, 7])
    for words in ("000001/scene_gt.json", "000002/scene_gt.json", "000007"):
        assert words in str(caught.value)


def test_private_truth_is_called_private(tmp_path):
    scene = tmp_path / "itodd" / "test" / "000001"
    write_scene(scene, images={"gray": ".tif", "depth": ".tif"}, size_px=(1280, 960), im_ids=(0,))
    (scene / "scene_gt.json").unlink()
    with pytest.raises(MissingDataError, match="truth of ITODD test is private"):
        read_truth(open_dataset(tmp_path / "itodd"))


def test_gt_info_must_describe_the_same_instances(dataset):
    write_json(dataset.annotation_path("gt_info", 1), {"0": [{"visib_fract": 1}]})
    with pytest.raises(FormatError) as caught:
        read_truth(dataset)
    assert [p.field for p in caught.value.problems] == ['$["0"]', '$["3"]']
    assert [p.got for p in caught.value.problems] == ["1", "no such image"]


def test_the_problems_of_all_scenes_come_together(dataset):
    for scene in (1, 2):
        dataset.annotation_path("gt", scene).write_text("{")
    with pytest.raises(FormatError) as caught:
        read_truth(dataset)
    assert len(caught.value.problems) == 2


def test_coco_truth_lies_beside_the_truth(dataset):
    assert coco_truth_path(dataset, 1).name == "scene_gt_coco.json"
    assert coco_truth_path(dataset, 1, modal=True).name == "scene_gt_coco_modal.json"


def test_the_hash_changes_with_every_file_a_score_depends_on(dataset):
    def digest(**options):
        return dataset_hash(open_dataset(dataset.path), [1, 2], **options)

    seen = {digest()}
    files = [dataset.annotation_path(k, 2) for k in ("camera", "gt", "gt_info")]
    files += [dataset.models_info_path, dataset.models_dir / "obj_000002.ply"]
    for file in files:
        file.write_text(file.read_text() + "\n")
        assert digest() not in seen, file
        seen.add(digest())
    (dataset.path / "dataset.toml").write_text("vsd_delta_mm = 3.0")
    seen.add(digest())
    seen.add(digest(targets="test_targets_bop19.json"))
    seen.add(digest(obj_ids=[1]))
    assert len(seen) == len(files) + 4
    assert digest() == digest()


def test_the_hash_does_not_depend_on_where_the_dataset_lies(dataset, tmp_path):
    moved = shutil.copytree(dataset.path, tmp_path / "elsewhere" / "bins")
    assert dataset_hash(dataset, [1]) == dataset_hash(open_dataset(moved), [1])


def test_the_hash_tells_two_target_lists_apart_and_not_their_files(dataset):
    targets = dataset.targets("test_targets_bop19.json")
    some = [
        None,
        targets,
        replace(targets, inst_count=targets.inst_count + 1),
        replace(targets, obj_id=None, inst_count=None),
        replace(targets, obj_id=targets.inst_count, inst_count=targets.obj_id),
        replace(targets, sensor=("top", "left") * 2),
        replace(targets, sensor=("top", "top") * 2),
    ]
    digests = [dataset_hash(dataset, [1], targets=t) for t in some]
    assert len(set(digests)) == len(some)
    assert dataset_hash(dataset, [1], targets=replace(targets, file="x")) == digests[1]


def test_a_repeated_scene_key_in_other_order_is_the_same_truth(dataset):
    path = dataset.annotation_path("gt", 1)
    before = read_truth(dataset, [1])
    path.write_text(json.dumps(dict(reversed(json.loads(path.read_text()).items())), indent=1))
    after = read_truth(dataset, [1])
    assert (before.t_mm == after.t_mm).all()


def test_frames_never_reach_the_truth():
    code = "import sys, sixd.datasets.frames; print('sixd.datasets.truth' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_importing_datasets_imports_nothing_heavy():
    code = "import sys, sixd.datasets; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {"cv2", "numba", "scipy", "trimesh", "hotcoco", "polars"}
    assert not heavy & set(done.stdout.split())
