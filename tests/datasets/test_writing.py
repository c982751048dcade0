from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sixd.datasets.images import read_depth_mm, read_image
from sixd.datasets.writing import (
    camera_entry,
    new_folder,
    pose_entry,
    write_coco,
    write_depth,
    write_image,
    write_json_list,
    write_json_object,
    write_mask,
)
from sixd.errors import OutputError, SixdError, UsageError
from sixd.files import write_atomically


def names_in(folder):
    return sorted(p.name for p in folder.iterdir())


def test_a_failed_folder_leaves_nothing_behind(tmp_path):
    def die_half_way():
        with new_folder(tmp_path / "set") as folder:
            write_atomically(folder / "half.json", b"{")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        die_half_way()
    assert names_in(tmp_path) == []


def test_a_finished_folder_has_its_name_and_only_that(tmp_path):
    with new_folder(tmp_path / "deep" / "set") as folder:
        write_atomically(folder / "a" / "b.json", b"{}")
        assert not (tmp_path / "deep" / "set").exists()
    assert names_in(tmp_path / "deep") == ["set"]
    assert (tmp_path / "deep" / "set" / "a" / "b.json").read_bytes() == b"{}"


def test_a_folder_that_exists_is_not_touched(tmp_path):
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "mine.txt").write_text("mine")
    with pytest.raises(UsageError, match="exists already"), new_folder(tmp_path / "set"):
        pytest.fail("the block must not run")
    assert names_in(tmp_path) == ["set"]
    assert names_in(tmp_path / "set") == ["mine.txt"]


def test_what_is_written_has_the_rights_the_user_wants(tmp_path):
    with new_folder(tmp_path / "set") as folder:
        write_atomically(folder / "a.json", b"{}")
    (tmp_path / "plain").mkdir()
    (tmp_path / "plain" / "a.json").write_bytes(b"{}")
    for name in ("", "a.json"):
        made, plain = (tmp_path / where / name for where in ("set", "plain"))
        assert made.stat().st_mode == plain.stat().st_mode


def test_a_failed_write_keeps_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "x.json"
    write_atomically(path, b"old")
    monkeypatch.setattr("pathlib.Path.replace", lambda *_: (_ for _ in ()).throw(OSError("full")))
    with pytest.raises(OutputError, match="full"):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert names_in(tmp_path) == ["x.json"]


@pytest.mark.parametrize("where", ["x", "x/y/z"])
def test_a_folder_that_cannot_be_made_is_told(tmp_path, where):
    (tmp_path / "file").touch()
    with (
        pytest.raises(OutputError, match="cannot be written"),
        new_folder(tmp_path / "file" / where),
    ):
        pass
    assert names_in(tmp_path) == ["file"]


def test_json_has_one_image_per_line(tmp_path):
    path = tmp_path / "scene_gt.json"
    entries = {0: [pose_entry(5, np.eye(3), np.array([0.1, 1 / 3, 700.0]))], 12: []}
    write_json_object(path, entries)
    lines = path.read_text().splitlines()
    assert len(lines) == 4
    assert lines[1].startswith('  "0": [{')
    assert lines[2] == '  "12": []'
    assert json.loads(path.read_text()) == {str(k): v for k, v in entries.items()}


@given(
    entries=st.lists(
        st.dictionaries(st.text(max_size=3), st.floats(allow_nan=False, allow_infinity=False))
    )
)
def test_lists_come_back_bit_for_bit(tmp_path_factory, entries):
    path = tmp_path_factory.mktemp("json") / "targets.json"
    write_json_list(path, entries)
    assert json.loads(path.read_text()) == entries


def test_coco_files_come_back(tmp_path):
    coco = {"info": {"description": "x"}, "images": [{"id": 1}, {"id": 2}], "annotations": []}
    write_coco(tmp_path / "c.json", coco)
    assert json.loads((tmp_path / "c.json").read_text()) == coco


def test_numbers_json_does_not_have_are_refused(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        write_json_list(tmp_path / "x.json", [{"score": float("nan")}])
    assert names_in(tmp_path) == []


@given(stored=arrays(np.uint16, (3, 5)), scale=st.sampled_from([0.1, 0.001, 1.0, 0.3]))
def test_depth_comes_back_as_stored(tmp_path_factory, stored, scale):
    path = tmp_path_factory.mktemp("depth") / "000000.png"
    write_depth(path, stored * scale, scale)
    expected = stored.astype(np.float32) * np.float32(scale)
    np.testing.assert_array_equal(read_depth_mm(path, scale), expected)


@pytest.mark.parametrize("value", [-1.0, 6553.6, np.nan, np.inf])
def test_depth_that_does_not_fit_is_refused(tmp_path, value):
    with pytest.raises(UsageError, match=r"depth must be in 0 \.\. 6553\.5 mm"):
        write_depth(tmp_path / "d.png", np.array([[value, 1.0]]), 0.1)
    assert names_in(tmp_path) == []


def test_masks_are_0_and_255_and_colours_keep_their_order(tmp_path):
    write_mask(tmp_path / "m.png", np.array([[True, False]]))
    assert read_image(tmp_path / "m.png").tolist() == [[255, 0]]
    rgb = np.array([[[255, 0, 0], [0, 10, 200]]], np.uint8)
    write_image(tmp_path / "c.png", rgb)
    assert read_image(tmp_path / "c.png").tolist() == rgb.tolist()


def test_depth_must_be_an_image(tmp_path):
    with pytest.raises(SixdError, match=r"\(H, W\)"):
        write_depth(tmp_path / "d.png", np.zeros((2, 2, 3)), 1.0)


def test_a_camera_without_depth_has_no_scale():
    assert camera_entry(np.eye(3), None) == {"cam_K": [1, 0, 0, 0, 1, 0, 0, 0, 1]}
