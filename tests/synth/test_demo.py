from __future__ import annotations

import hashlib
import json
from collections import Counter

import numpy as np
import pytest

from sixd.datasets import open_dataset
from sixd.datasets.annotate.rle import decode_rle
from sixd.datasets.images import read_image
from sixd.datasets.preflight import find_missing
from sixd.datasets.truth import coco_truth_path, read_truth
from sixd.errors import UsageError
from sixd.geometry import Pose
from sixd.render.raster import render_depth
from sixd.synth import demo_dataset
from sixd.synth.demo_dataset import make_demo_dataset


def digests(folder):
    return {
        p.relative_to(folder).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    }


def load(path):
    return json.loads(path.read_text())


@pytest.fixture(scope="module")
def dataset(tiny):
    return open_dataset(tiny)


def small(path, **changes):
    options = {"scenes": 1, "images_per_scene": 1, "size_px": (64, 48)} | changes
    return make_demo_dataset(path, **options)


def test_the_same_seed_gives_the_same_bytes(tmp_path):
    first, second = small(tmp_path / "a"), small(tmp_path / "b")
    other = small(tmp_path / "c", seed=1)
    assert digests(first) == digests(second)
    changed = {k for k, v in digests(other).items() if digests(first).get(k) != v}
    assert "test/000001/scene_gt.json" in changed
    assert "models_eval/models_info.json" not in changed


def test_the_number_of_workers_changes_nothing(tmp_path):
    many, one = {"images_per_scene": 4, "workers": 3}, {"images_per_scene": 4, "workers": 1}
    assert digests(small(tmp_path / "a", **many)) == digests(small(tmp_path / "b", **one))


def test_more_scenes_leave_the_first_as_it_is(tmp_path):
    one, two = small(tmp_path / "a"), small(tmp_path / "b", scenes=2)
    assert digests(one / "test" / "000001") == digests(two / "test" / "000001")


@pytest.mark.parametrize("n_written", [0, 3, 20, 33])
def test_an_interrupted_run_leaves_nothing(tmp_path, monkeypatch, n_written):
    calls = Counter()

    def failing(path, image):
        calls["images"] += 1
        if calls["images"] > n_written:
            raise KeyboardInterrupt
        demo_write_image(path, image)

    from sixd.datasets import writing

    demo_write_image = writing.write_image
    monkeypatch.setattr(writing, "write_image", failing)
    monkeypatch.setattr(demo_dataset, "write_image", failing)
    with pytest.raises(KeyboardInterrupt):
        small(tmp_path / "x", scenes=2)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_folder_is_refused_before_any_work(tmp_path):
    (tmp_path / "x").mkdir()
    with pytest.raises(UsageError, match="exists already"):
        small(tmp_path / "x")
    assert list((tmp_path / "x").iterdir()) == []


@pytest.mark.parametrize("bad", [{"scenes": 0}, {"images_per_scene": 0}, {"size_px": (0, 48)}])
def test_empty_datasets_are_refused(tmp_path, bad):
    with pytest.raises(UsageError, match="positive"):
        small(tmp_path / "x", **bad)


def test_the_reader_finds_everything(dataset):
    assert dataset.name == demo_dataset.DEMO_NAME
    assert dataset.scene_ids == (1, 2)
    assert dataset.object_ids == (1, 2, 3, 4, 5, 6)
    assert dataset.image_size_px == (160, 120)
    assert dataset.has_depth
    assert dataset.spec.vsd_delta_mm == 15.0
    targets = dataset.targets("test_targets_bop24.json")
    needs = ("camera", "truth", "gt_info", "depth", "models_info", "models")
    assert find_missing(dataset, targets.scene_id, targets.im_id, dataset.object_ids, needs) == []
    assert len(dataset.model(2).symmetries.transforms()) == 2
    assert len(dataset.model(3).symmetries.transforms()) == 6
    assert len(dataset.model(4).symmetries.transforms()) == 315


def test_progress_tells_of_every_image(tmp_path):
    told = []
    small(tmp_path / "x", images_per_scene=2, progress=lambda *what: told.append(what))
    assert told == [("demo images", 1, 2), ("demo images", 2, 2)]


def test_every_scene_lacks_one_object_and_shows_another_twice(dataset):
    truth = read_truth(dataset)
    for scene_id in dataset.scene_ids:
        ids = Counter(truth.obj_id[(truth.scene_id == scene_id) & (truth.im_id == 0)].tolist())
        assert len(ids) == 5
        assert max(ids.values()) == 2


def test_objects_hide_one_another(dataset):
    visible = read_truth(dataset).visib_fract
    assert (visible > 0.95).sum() > 5
    assert ((visible > 0.1) & (visible < 0.8)).sum() > 5


def test_targets_count_what_is_visible_enough(dataset):
    truth = read_truth(dataset)
    seen = truth.visib_fract >= 0.1
    expected = Counter(
        zip(truth.scene_id[seen].tolist(), truth.im_id[seen].tolist(), truth.obj_id[seen].tolist(),
            strict=True)
    )  # fmt: skip
    targets = dataset.targets("test_targets_bop19.json")
    listed = zip(
        targets.scene_id.tolist(), targets.im_id.tolist(), targets.obj_id.tolist(), strict=True
    )
    assert dict(zip(listed, targets.inst_count.tolist(), strict=True)) == dict(expected)
    images = dataset.targets("test_targets_bop24.json").images.tolist()
    assert images == truth.images.tolist()


def test_masks_counts_and_annotations_tell_the_same(dataset):
    for scene_id in dataset.scene_ids:
        scene = dataset.scene_dir(scene_id)
        info, gt = load(scene / "scene_gt_info.json"), load(scene / "scene_gt.json")
        coco = load(coco_truth_path(dataset, scene_id))
        annotations = {}
        for a in coco["annotations"]:
            annotations.setdefault(a["image_id"], []).append(a)
        assert [a["id"] for a in coco["annotations"]] == list(
            range(1, len(coco["annotations"]) + 1)
        )
        for im_id, rows in info.items():
            depth_mm = dataset.depth_mm(scene_id, int(im_id))
            of_image = iter(annotations[int(im_id)])
            for gt_id, row in enumerate(rows):
                name = f"{int(im_id):06d}_{gt_id:06d}.png"
                mask = read_image(scene / "mask" / name)
                visible = read_image(scene / "mask_visib" / name)
                assert set(np.unique(mask)) | set(np.unique(visible)) <= {0, 255}
                assert row["px_count_visib"] == np.count_nonzero(visible)
                assert row["px_count_valid"] == np.count_nonzero((mask > 0) & (depth_mm > 0))
                assert row["px_count_all"] >= np.count_nonzero(mask)
                assert not ((visible > 0) & (mask == 0)).any()
                if not visible.any():
                    continue
                a = next(of_image)
                assert a["category_id"] == gt[im_id][gt_id]["obj_id"]
                assert a["area"] == row["px_count_visib"]
                assert a["ignore"] == (row["visib_fract"] < 0.1)
                assert np.array_equal(decode_rle(a["segmentation"]), visible > 0)
            assert next(of_image, None) is None


def test_measured_depth_is_that_of_the_nearest_thing(dataset):
    truth = read_truth(dataset)
    for scene_id, im_id in truth.images.tolist():
        here = np.flatnonzero((truth.scene_id == scene_id) & (truth.im_id == im_id))
        K, measured = dataset.cameras(scene_id)[im_id].K, dataset.depth_mm(scene_id, im_id)
        drawn = np.stack(
            [
                render_depth(
                    dataset.model(int(truth.obj_id[row])).mesh,
                    Pose(truth.R[row], truth.t_mm[row]),
                    K,
                    (160, 120),
                )
                for row in here
            ]
        )
        drawn[drawn == 0] = np.inf
        nearest = drawn.min(axis=0)
        objects = np.isfinite(nearest) & (measured > 0)
        # A little of an object can be under the horizon of the table, nothing is in front of it.
        assert np.abs(measured - nearest)[objects].max() < 8.0
        assert (measured > 0).mean() > 0.4


def test_poses_agree_with_the_world_poses_of_the_cameras(dataset):
    scene = dataset.scene_dir(1)
    cameras, gt = load(scene / "scene_camera.json"), load(scene / "scene_gt.json")
    worlds = []
    for im_id, camera in cameras.items():
        pose_c_w = Pose(np.reshape(camera["cam_R_w2c"], (3, 3)), np.array(camera["cam_t_w2c"]))
        row = gt[im_id][2]
        pose_c_m = Pose(np.reshape(row["cam_R_m2c"], (3, 3)), np.array(row["cam_t_m2c"]))
        worlds.append((pose_c_w.inverse() @ pose_c_m).t_mm)
    np.testing.assert_allclose(worlds, [worlds[0]] * len(worlds), atol=1e-9)


def test_the_colour_image_shows_what_the_masks_say(dataset):
    scene = dataset.scene_dir(1)
    rgb = dataset.rgb(1, 0).astype(float)
    assert rgb.shape == (120, 160, 3)
    assert rgb.std() > 20, "an image with nothing in it"
    gt = load(scene / "scene_gt.json")["0"]
    red = [i for i, row in enumerate(gt) if row["obj_id"] == 2]
    visible = np.zeros((120, 160), dtype=bool)
    for gt_id in red:
        visible |= read_image(scene / "mask_visib" / f"000000_{gt_id:06d}.png") > 0
    brick = rgb[visible].mean(axis=0)
    assert brick[0] > 2 * max(brick[1], brick[2]), "the brick is red"


def test_a_dataset_is_small(tiny):
    n_bytes = sum(p.stat().st_size for p in tiny.rglob("*") if p.is_file())
    assert n_bytes < 3_000_000
