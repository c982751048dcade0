from __future__ import annotations

import numpy as np
import pytest

from sixd.datasets import open_dataset
from sixd.datasets.preflight import find_missing
from tests.datasets.folders import write_classic, write_image

EVERYTHING = ("camera", "truth", "gt_info", "models_info", "meshes", "depth")


def keys(*pairs):
    return (np.array([s for s, _ in pairs]), np.array([i for _, i in pairs]))


@pytest.fixture
def dataset(tmp_path):
    return open_dataset(write_classic(tmp_path / "bins", scenes=(1, 2)))


def test_nothing_is_missing_from_a_whole_dataset(dataset):
    assert find_missing(dataset, *keys((1, 0), (1, 0), (2, 3)), [1, 2], EVERYTHING) == []


def test_everything_that_is_missing_is_named_at_once(dataset):
    dataset.annotation_path("gt", 1).unlink()
    dataset.annotation_path("gt_info", 2).unlink()
    (dataset.scene_dir(2) / "depth" / "000000.png").unlink()
    (dataset.models_dir / "obj_000002.ply").unlink()
    images = keys((1, 0), (2, 0), (2, 3), (2, 77), (9, 0))
    problems = find_missing(dataset, *images, [1, 2, 3], EVERYTHING)
    found = {(p.code, p.file.removeprefix(f"{dataset.path}/"), p.field) for p in problems}
    assert found == {
        ("missing-file", "test/000001/scene_gt.json", ""),
        ("missing-file", "test/000002/scene_gt_info.json", ""),
        ("missing-image", "test/000002/scene_camera.json", '$["77"]'),
        ("missing-file", "test/000002/depth/000000.png", ""),
        ("missing-file", "test/000002/depth/000077.png", ""),
        ("missing-file", "test/000009", ""),
        ("missing-object", "models_eval/models_info.json", '$["3"]'),
        ("missing-file", "models_eval/obj_000002.ply", ""),
        ("missing-file", "models_eval/obj_000003.ply", ""),
    }
    assert len(problems) == len(found)
    assert all(p.fix for p in problems)


def test_what_is_not_needed_is_not_asked_for(dataset):
    dataset.annotation_path("gt_info", 1).unlink()
    dataset.models_info_path.unlink()
    assert find_missing(dataset, *keys((1, 0)), [1], ("truth", "depth")) == []
    (problem,) = find_missing(dataset, *keys((1, 0)), [1], ("models_info",))
    assert problem.file == str(dataset.models_info_path)


def test_a_broken_camera_or_models_file_is_a_problem_not_a_crash(dataset):
    dataset.annotation_path("camera", 1).write_text("{")
    dataset.models_info_path.write_text("[]")
    problems = find_missing(dataset, *keys((1, 0)), [1], ("camera", "models_info"))
    assert [p.code for p in problems] == ["bad-json", "bad-json-entry"]


def test_a_dataset_without_depth_says_so(tmp_path):
    dataset = open_dataset(write_classic(tmp_path / "bins"))
    for file in (dataset.scene_dir(1) / "depth").iterdir():
        file.unlink()
    (dataset.scene_dir(1) / "depth").rmdir()
    fresh = open_dataset(dataset.path)
    assert not fresh.has_depth
    (problem,) = find_missing(fresh, *keys((1, 0)), (), ("depth",))
    assert "no depth images" in problem.what


def test_an_image_with_another_extension_is_not_missing(dataset):
    dataset.image_path(1, 0, "depth").unlink()
    write_image(dataset.scene_dir(1) / "depth" / "000000.tif", 4, "depth")
    assert find_missing(open_dataset(dataset.path), *keys((1, 0)), (), ("depth",)) == []
