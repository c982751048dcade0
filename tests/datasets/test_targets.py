from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sixd.datasets import open_dataset
from sixd.datasets.targets import read_targets
from sixd.errors import FormatError, MissingDataError, UsageError
from tests.datasets.folders import write_classic, write_json, write_models, write_scene


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3), st.integers(0, 3)),
                min_size=1, unique=True))  # fmt: skip
def test_rows_keep_the_order_of_the_file(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("t") / "targets.json"
    write_json(path, [
        {"scene_id": s, "im_id": i, "obj_id": o, "inst_count": o + 1, "extra": [1]}
        for s, i, o in rows
    ])  # fmt: skip
    targets = read_targets(path)
    columns = (targets.scene_id, targets.im_id, targets.obj_id)
    assert list(zip(*(c.tolist() for c in columns), strict=True)) == rows
    assert (targets.inst_count == targets.obj_id + 1).all()
    assert targets.images.tolist() == [list(p) for p in dict.fromkeys((s, i) for s, i, _ in rows)]
    assert len(targets) == len(rows)


def test_a_list_of_images_has_no_objects(tmp_path):
    write_json(tmp_path / "t.json", [{"scene_id": 4, "im_id": 2}, {"im_id": 1, "scene_id": 4}])
    targets = read_targets(tmp_path / "t.json")
    assert (targets.obj_id, targets.inst_count, targets.im_id.tolist()) == (None, None, [2, 1])
    assert targets.of_image(4, 2) == ()


def test_groups_of_views_become_one_row_a_view(tmp_path):
    write_json(tmp_path / "t.json", [
        {"scene_id": 0, "im_id": [["top", 7], ["left", 8]]},
        {"scene_id": 1, "im_id": [["top", 7]]},
    ])  # fmt: skip
    targets = read_targets(tmp_path / "t.json")
    assert targets.scene_id.tolist() == [0, 0, 1]
    assert targets.im_id.tolist() == [7, 8, 7]
    assert targets.group.tolist() == [0, 0, 1]
    assert targets.sensor == ("top", "left", "top")


def test_only_views_of_the_scored_sensor_are_targets(tmp_path):
    for sensor in ("top", "left"):
        write_scene(
            tmp_path / "rig" / "test" / "000001", suffix=f"_{sensor}",
            images={f"rgb_{sensor}": ".png"}, im_ids=(7, 8),
        )  # fmt: skip
    write_models(tmp_path / "rig" / "models_eval")
    views = [["top", 7], ["left", 7], ["top", 8]]
    write_json(tmp_path / "rig" / "t.json", [{"scene_id": 1, "im_id": views},
                                             {"scene_id": 1, "im_id": [["side", 7]]}])  # fmt: skip
    for sensor, im_ids in (("top", [7, 8]), ("left", [7])):
        targets = open_dataset(tmp_path / "rig", sensor=sensor).targets("t.json")
        assert targets.im_id.tolist() == im_ids
        assert targets.sensor == (sensor,) * len(im_ids)
        assert targets.group.tolist() == [0] * len(im_ids)
    write_json(tmp_path / "rig" / "t.json", [{"scene_id": 1, "im_id": [["top", 7]]}])
    with pytest.raises(UsageError, match=r"expected: views of left\n\s+got: views of top"):
        open_dataset(tmp_path / "rig", sensor="left").targets("t.json")


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ([{"scene_id": 1, "im_id": 2, "obj_id": 3, "inst_count": 1}] * 2, "object 3 2 times"),
        ([{"scene_id": 1, "im_id": 2}] * 3, "image 2 3 times"),
        ([{"scene_id": 1, "im_id": 2}, {"scene_id": 1, "im_id": 3, "obj_id": 1}], "an object"),
        ([{"scene_id": 1, "im_id": 2}, {"scene_id": 1, "im_id": [["a", 1]]}], "views"),
        ([{"scene_id": 1, "im_id": []}], "im_id"),
        ([{"scene_id": 1, "im_id": [["a", 1, 2]]}], "im_id"),
        ([{"scene_id": 1, "im_id": 2.5}], "im_id"),
    ],
)
def test_a_list_that_is_not_clear_is_refused(tmp_path, entries, words):
    write_json(tmp_path / "t.json", entries)
    with pytest.raises(FormatError, match=words):
        read_targets(tmp_path / "t.json")


def test_a_list_is_found_by_name_in_the_dataset_or_by_path(tmp_path, monkeypatch):
    dataset = open_dataset(write_classic(tmp_path / "bins"))
    assert len(dataset.targets("test_targets_bop19.json")) == 4
    write_json(tmp_path / "mine.json", [{"scene_id": 1, "im_id": 3}])
    assert len(dataset.targets(tmp_path / "mine.json")) == 1
    monkeypatch.chdir(tmp_path)
    assert len(dataset.targets("mine.json")) == 1
    with pytest.raises(MissingDataError, match="did you mean test_targets_bop19"):
        dataset.targets("test_targets_bop18.json")


def test_a_frame_holds_the_targets_of_its_image_and_lazy_images(tmp_path):
    dataset = open_dataset(write_classic(tmp_path / "bins"))
    frame = dataset.frame(1, 3, dataset.targets("test_targets_bop19.json"))
    assert [(t.obj_id, t.inst_count) for t in frame.targets] == [(2, 1), (1, 2)]
    assert frame.depth_mm is frame.depth_mm
    assert frame.rgb.shape == (6, 8, 3)
    dataset.image_path(1, 0, "depth").unlink()
    fresh = open_dataset(dataset.path)
    assert fresh.frame(1, 0).depth_mm is None
    with pytest.raises(MissingDataError, match="no image 99; it has 0, 3"):
        dataset.frame(1, 99)
