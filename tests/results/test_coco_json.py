from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sixd.errors import FormatError, UsageError
from sixd.results import Detections, Limits, Rle, read_coco_json, write_coco_json
from sixd.results.coco_entries import Entry, read_entries_slowly
from sixd.results.findings import Findings
from tests.results.makers import bits, detection_tables

ENTRY: dict[str, Any] = {"scene_id": 2, "image_id": 3, "category_id": 5, "score": 0.5}
BOX = ENTRY | {"bbox": [1, 2, 30, 40]}


@given(detection_tables())
def test_what_is_written_is_read_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory, table: Detections
) -> None:
    path = tmp_path_factory.mktemp("json") / "any name at all"
    write_coco_json(path, table)
    assert bits(read_coco_json(path)) == bits(table)
    assert len(json.loads(path.read_text())) == len(table)


def test_masks_keep_their_form(tmp_path: Path) -> None:
    masks = [Rle((2, 2), "04"), Rle((2, 2), [0, 4]), None]
    table = Detections.from_arrays(
        scene_id=1, im_id=1, obj_id=[1, 2, 3], score=1, segmentation=masks
    )
    write_coco_json(tmp_path / "x.json.gz", table)
    assert read_coco_json(tmp_path / "x.json.gz").segmentation == tuple(masks)


def test_each_entry_knows_its_line_and_index(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    mask = ENTRY | {"segmentation": {"size": [1, 1], "counts": "01"}}
    path.write_text(f"[\n{json.dumps(BOX)},\n\n{json.dumps(mask)}, {json.dumps(BOX)}]")
    table = read_coco_json(path)
    assert table.line.tolist() == [2, 4, 4]  # type: ignore[union-attr]
    assert table.entry.tolist() == [0, 1, 2]  # type: ignore[union-attr]


def test_what_cannot_be_written_whole_is_not_written(tmp_path: Path) -> None:
    table = Detections.from_arrays(
        scene_id=1, im_id=1, obj_id=[1], score=1, bbox_xywh_px=[[1, 2, np.nan, 4]]
    )
    with pytest.raises(UsageError, match="bbox is not finite in 1 rows, first in row 0"):
        write_coco_json(tmp_path / "x.json", table)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("entry", "field", "code", "words"),
    [
        (BOX | {"scene_id": "2"}, "[0].scene_id", "not-an-integer", "without quotes"),
        (BOX | {"scene_id": 2.0}, "[0].scene_id", "not-an-integer", "decimal point"),
        (BOX | {"scene_id": True}, "[0].scene_id", "not-an-integer", "True"),
        (BOX | {"image_id": 2**63}, "[0].image_id", "not-an-integer", "64 bits"),
        (BOX | {"score": "0.5"}, "[0].score", "not-a-number", "without quotes"),
        (BOX | {"score": None}, "[0].score", "not-a-number", "None"),
        (BOX | {"score": float("nan")}, "[0].score", "not-finite", "nan"),
        (BOX | {"bbox": [1, 2, 3]}, "[0].bbox", "wrong-type", "[left, top, width, height]"),
        (BOX | {"bbox": [1, 2, 3, float("inf")]}, "[0].bbox", "not-finite", "inf"),
        (BOX | {"time": float("-inf")}, "[0].time", "not-finite", "-inf"),
        (BOX | {"segmentation": [[1, 2, 3, 4]]}, "[0].segmentation", "wrong-type", "polygons"),
        (
            BOX | {"segmentation": {"size": [1], "counts": "1"}},
            "[0].segmentation.size",
            "wrong-type",
            "[height, width]",
        ),
        (
            BOX | {"segmentation": {"size": [1, 1], "counts": [0.5]}},
            "[0].segmentation.counts",
            "wrong-type",
            "integers",
        ),
        (
            {"im_id": 3, "scene_id": 2, "category_id": 5, "score": 1},
            "[0].image_id",
            "missing-field",
            'rename "im_id" to "image_id"',
        ),
        ([], "[0]", "wrong-type", "object"),
    ],
)
def test_a_wrong_field_is_told(
    tmp_path: Path, entry: object, field: str, code: str, words: str
) -> None:
    path = tmp_path / "x.json"
    path.write_text("[\n" + json.dumps(entry) + ",\n" + json.dumps(BOX) + "]")
    with pytest.raises(FormatError) as caught:
        read_coco_json(path)
    (problem,) = caught.value.problems
    assert (problem.line, problem.field, problem.code) == (2, field, code)
    assert problem.expected
    assert problem.got
    assert words in str(problem)


@pytest.mark.parametrize(
    ("text", "code", "words"),
    [
        ('{"annotations": []}', "not-a-list", "ground truth"),
        ("[{]", "malformed-json", "column 3"),
        (f"[{json.dumps(BOX)}", "malformed-json", "end of file"),
        (f"[{json.dumps(BOX)},]", "malformed-json", "comma after the last"),
        (f"[{json.dumps(BOX)}] []", "malformed-json", "after the end"),
        (f"[{json.dumps(BOX)} {json.dumps(BOX)}]", "malformed-json", "comma"),
        ("[" * 100_000, "malformed-json", "brackets"),
    ],
)
def test_what_is_no_json_list_is_told(tmp_path: Path, text: str, code: str, words: str) -> None:
    path = tmp_path / "x.json"
    path.write_text("\n" + text)
    with pytest.raises(FormatError) as caught:
        read_coco_json(path)
    (problem,) = caught.value.problems
    assert problem.code == code
    assert problem.line
    assert problem.fix
    assert words in str(problem)


def test_bytes_that_are_no_text_are_told_by_their_place(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_bytes(b'\xef\xbb\xbf[\n{"scene_id": "\xff"}]')
    with pytest.raises(FormatError) as caught:
        read_coco_json(path)
    (problem,) = caught.value.problems
    assert (problem.code, problem.line) == ("encoding", 2)
    assert "0xff at offset 19" in problem.got


def test_an_endless_entry_is_refused_before_it_fills_the_memory(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_text('[{"score": "x", "bbox": [' + "[]," * 100_000 + "[]]}]")
    with pytest.raises(FormatError, match="more than 1,000 characters"):
        read_coco_json(path, limits=Limits(entry_chars=1000))


def test_entries_longer_than_half_the_window_are_read(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    long = BOX | {"note": "x" * 900, "score": "bad"}
    path.write_text(json.dumps([long] * 20))
    with pytest.raises(FormatError) as caught:
        read_coco_json(path, limits=Limits(entry_chars=1100))
    assert [p.field for p in caught.value.problems] == [f"[{i}].score" for i in range(20)]


# --- fast accepts, slow explains: both must mean the same format ---

json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**65), 2**65)
    | st.floats()
    | st.text(max_size=4)
    | st.sampled_from([0, 1, -1, -0.0, 2**63, 10**400]),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=3)
    ),
    max_leaves=6,
)
names = st.sampled_from(
    ["scene_id", "image_id", "category_id", "score", "bbox", "segmentation", "time", "more"]
)


@st.composite
def json_entries(draw: st.DrawFn) -> object:
    mask = {"size": [2, draw(json_values)], "counts": draw(json_values)}
    whole = BOX | {"segmentation": draw(st.sampled_from([None, {"size": [2, 2], "counts": "13"}]))}
    changed = draw(st.dictionaries(names, json_values | st.just(mask), max_size=2))
    removed = draw(st.sets(names, max_size=1))
    entry = {k: v for k, v in (whole | changed).items() if k not in removed}
    return draw(st.sampled_from([entry, entry, entry, draw(json_values)]))


@given(st.lists(json_entries(), max_size=3))
@example([BOX | {"score": 10**400}])
@example([BOX | {"score": -0}])
def test_what_the_fast_decoder_takes_the_slow_one_takes_with_the_same_bits(
    entries: list[object],
) -> None:
    text = json.dumps(entries)
    found = Findings("x", 100)
    slow, _ = read_entries_slowly(text, found, Limits())
    try:
        fast = msgspec.json.decode(text.encode(), type=list[Entry])
    except msgspec.MsgspecError:
        return
    assert found.problems() == ()
    assert repr(slow) == repr(fast)


@given(st.lists(json_entries(), max_size=3))
def test_an_entry_is_lost_only_if_a_problem_says_so(entries: list[object]) -> None:
    found = Findings("x", 1000)
    slow, places = read_entries_slowly(json.dumps(entries), found, Limits())
    told = {int(p.field[1:].split("]")[0]) for p in found.problems()}
    kept = {int(index) for _, index in places}
    assert kept | told == set(range(len(entries)))
    for entry, index in zip(slow, places[:, 1], strict=True):
        assert np.isfinite(entry.score) or int(index) in told
