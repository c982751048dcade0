from __future__ import annotations

import ast
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import sixd
from sixd.datasets import known_datasets, load_spec
from sixd.datasets.ids import Ids
from sixd.datasets.spec import build_spec, merge, read_toml
from sixd.errors import FormatError, UsageError

# Typed from the papers and BOP's own table, not from our files:
# objects, ids of symmetric ones, test scenes, scored size, VSD delta, group.
FACTS = {
    "lm": (15, {3, 7, 10, 11}, 15, (640, 480), 15, "classic-extra"),
    "lmo": (8, {10, 11}, 1, (640, 480), 15, "classic-core"),
    "tless": (30, set(range(1, 31)), 20, (720, 540), 15, "classic-core"),
    "tudl": (3, set(), 3, (640, 480), 15, "classic-core"),
    "tyol": (21, set(range(1, 22)) - {1, 2, 9, 14, 20}, 21, (640, 480), 15, "classic-extra"),
    "ruapc": (14, {8, 9, 12, 13}, 14, (640, 480), 15, "classic-extra"),
    "icmi": (6, {1, 2, 6}, 6, (640, 480), 15, "classic-extra"),
    "icbin": (2, {1}, 3, (640, 480), 15, "classic-core"),
    "itodd": (28, set(range(1, 29)) - {1, 6, 10, 13, 15, 16, 20, 21, 22, 26}, 1, (1280, 960), 5,
              "classic-core"),
    "hb": (33, {6, 10, 11, 12, 13, 14, 18, 24, 29}, 13, (640, 480), 15, "classic-core"),
    "ycbv": (21, {1, 13, 14, 16, 18, 19, 20, 21}, 12, (640, 480), 15, "classic-core"),
    "hope": (28, set(), 40, (1920, 1080), 15, "classic-extra"),
    "hopev2": (28, set(), 47, (1920, 1080), None, "h3"),
    "handal": (40, {26, 35, 36, 37, 38, 39, 40}, 61, (1920, 1440), None, "h3"),
    "hot3d": (33, {1, 2, 3, 5, 22, 24, 25, 29, 30, 32}, 1028, None, None, "h3"),
    "ipd": (10, {8, 14, 18, 19, 20}, 15, (2064, 1544), None, "industrial"),
    "xyzibd": (15, {1, 2, 5, 8, 9, 11, 12, 16, 17}, 60, (1440, 1080), None, "industrial"),
    "itoddmv": (28, set(range(1, 29)) - {1, 6, 10, 13, 15, 16, 20, 21, 22, 26}, 1, (1280, 960),
                None, "industrial"),
}  # fmt: skip
PUBLIC_TEST_TRUTH = {"lm", "lmo", "tless", "tudl", "tyol", "ruapc", "icmi", "icbin", "ycbv"}
WITHOUT_TEST_DEPTH = {"hot3d", "handal"}


def scored(name: str, split: str = "test"):
    spec = load_spec(name)
    folder = spec.splits[split].folder(spec.splits[split].default_type)
    return [spec.sensors[s] for s in folder.eval_sensors or folder.sensors], folder


def test_every_known_dataset_has_facts_to_be_checked_against():
    assert known_datasets() == sorted(FACTS)


@pytest.mark.parametrize("name", sorted(FACTS))
def test_a_spec_says_what_the_papers_say(name):
    n_objects, symmetric, n_scenes, size, delta, group = FACTS[name]
    spec = load_spec(name)
    sensors, folder = scored(name)
    assert (spec.name, len(spec.objects), set(spec.symmetric_objects)) == (
        name, n_objects, symmetric)  # fmt: skip
    assert (len(folder.scenes), spec.vsd_delta_mm, spec.group) == (n_scenes, delta, group)
    if size:
        assert {s.size_px(s.scored_modality) for s in sensors} == {size}
    assert spec.max_estimates_per_image == (200 if name == "xyzibd" else 100)
    assert (spec.splits["test"].truth == "public") == (name in PUBLIC_TEST_TRUTH)
    assert ("depth" not in sensors[0].images) == (name in WITHOUT_TEST_DEPTH)
    assert spec.title
    assert spec.cite


def test_facts_that_only_one_dataset_has():
    assert load_spec("tless").models == "models_cad"
    assert load_spec("tless").splits["test"].default_type == "primesense"
    assert load_spec("hb").splits["test"].default_type == "primesense"
    assert load_spec("ycbv").splits["train"].default_type == "real"
    assert load_spec("tudl").splits["train"].default_type == "render"
    assert scored("itodd")[0][0].images == {"gray": ".tif", "depth": ".tif"}
    assert list(load_spec("ipd").objects) == [0, 1, 4, 8, 10, 11, 14, 18, 19, 20]
    assert 5 not in load_spec("xyzibd").splits["test"].scenes
    assert set(load_spec("xyzibd").splits["train"].folder("pbr").scenes) == (
        set(range(51)) - {6, 7, 8, 18, 19, 20})  # fmt: skip
    quest, aria = scored("hot3d")[0]
    assert (quest.scored_modality, quest.size_px("gray1")) == ("gray1", (1280, 1024))
    assert (aria.scored_modality, aria.size_px("rgb")) == ("rgb", (1408, 1408))
    assert aria.size_px("gray2") == (640, 480)
    test_scenes = load_spec("hot3d").splits["test"].scenes
    assert set(test_scenes) & set(quest.scenes) == set(range(1288, 1849))
    assert set(test_scenes) & set(aria.scenes) == set(range(3365, 3832))


@pytest.mark.parametrize("name", sorted(FACTS))
def test_every_scene_of_every_split_has_one_scored_sensor(name):
    spec = load_spec(name)
    for split in spec.splits.values():
        for kind in split.types or [""]:
            folder = split.folder(kind)
            chosen = [spec.sensors[s] for s in folder.eval_sensors or folder.sensors]
            assert len(chosen) == 1 or folder.eval_sensors or not folder.sensors
            for scene in folder.scenes if folder.sensors else ():
                took = [s for s in chosen if s.scenes is None or scene in s.scenes]
                assert len(took) == 1, (name, scene)


@pytest.mark.parametrize("name", sorted(FACTS))
def test_pbr_images_are_jpg_and_of_one_unnamed_sensor(name):
    train = load_spec(name).splits.get("train")
    pbr = train.folder("pbr") if train and "pbr" in train.types else None
    for sensor in pbr.sensors if pbr else ():
        assert load_spec(name).sensors[sensor].images == {"rgb": ".jpg", "depth": ".png"}
        assert load_spec(name).sensors[sensor].suffix == ""


def test_no_dataset_is_named_in_code():
    names = set(known_datasets())
    for file in Path(sixd.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                parts = set(node.value.replace("\\", "/").split("/"))
                assert not parts & names, f"{file}:{node.lineno} names a dataset"
            if isinstance(node, ast.Name | ast.Attribute):
                word = node.id if isinstance(node, ast.Name) else node.attr
                assert word.lower() not in names, f"{file}:{node.lineno} names a dataset"


def test_an_unknown_name_is_answered_with_the_nearest():
    with pytest.raises(UsageError, match="did you mean lmo"):
        load_spec("lm-o")


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("max_estimates_per_image = 'many'", "max_estimates_per_image", "int"),
        ("vsd_delta = 3.0", "vsd_delta", "vsd_delta_mm"),
        ("objects = '3-1'", "objects", "3-1"),
        ("objects = [1, 1]", "objects", "distinct"),
        ("[sensors.left]\nimage_size = [1, 2]", "sensors[...].image_size", "image_size_px"),
        ("group = 'mine'", "group", "mine"),
        ("name = =", "", "line 1"),
    ],
)
def test_a_wrong_dataset_toml_is_refused_with_file_and_field(tmp_path, text, place, words):
    file = tmp_path / "dataset.toml"
    file.write_text(text)
    with pytest.raises(FormatError) as caught:
        read_toml(file)
    problem = caught.value.problems[0]
    assert (problem.file, problem.field) == (str(file), place)
    assert words in str(problem)


def test_contradictions_within_a_spec_are_all_named():
    raw = {
        "objects": "1-3",
        "symmetric_objects": "4",
        "vsd_delta_mm": -1.0,
        "max_estimates_per_image": 0,
        "sensors": {
            "a": {"images": {"rgb": "png"}, "image_size_px": [0, 4], "suffix": "/../x"},
            "b": {"images": {"gray": ".png"}, "eval_modality": "rgb"},
        },
        "splits": {
            "test": {"sensors": ["a"], "default_type": "real", "eval_sensors": ["b"]},
            "val": {"sensors": ["c"]},
        },
    }
    with pytest.raises(FormatError) as caught:
        build_spec(raw, "x.toml")
    assert {p.field for p in caught.value.problems} == {
        "symmetric_objects", "vsd_delta_mm", "max_estimates_per_image", "sensors.a.images.rgb",
        "sensors.a.image_size_px", "sensors.a.suffix", "sensors.b.eval_modality",
        "splits.test.default_type", "splits.test.eval_sensors", "splits.val.sensors",
    }  # fmt: skip


@given(st.sets(st.integers(0, 2000), max_size=40))
def test_ids_survive_their_short_form(ids):
    assert set(Ids.parse(str(Ids.parse(ids)))) == ids


@given(st.text(alphabet="0123456789,- ", max_size=12))
def test_any_text_is_ids_or_a_value_error(text):
    try:
        ids = Ids.parse(text)
    except ValueError:
        return
    assert list(ids) == sorted(set(ids))


def test_laying_a_table_over_another_keeps_what_it_does_not_say():
    below = {"a": {"x": 1, "y": [1, 2]}, "b": 1}
    assert merge(below, {"a": {"y": [3]}}) == {"a": {"x": 1, "y": [3]}, "b": 1}
    assert below == {"a": {"x": 1, "y": [1, 2]}, "b": 1}
