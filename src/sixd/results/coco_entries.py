"""The format of a COCO results JSON, entry by entry: what is accepted, what is wrong with the rest.

This slow reader is the definition. The typed decoder in `sixd.results.coco_json` takes a part of
what this one takes, with the same bits.
"""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from sixd.errors import FormatError, Problem
from sixd.results.findings import Findings, shown
from sixd.results.json_values import values_of_list
from sixd.results.limits import Limits
from sixd.results.pose_csv_rows import not_finite
from sixd.results.tables import INT64, Int64, Rle

_OTHER_NAMES = {
    "scene_id": ("scene", "sceneId"),
    "image_id": ("im_id", "img_id", "image"),
    "category_id": ("obj_id", "object_id", "cat_id", "class_id"),
    "score": ("confidence", "scores"),
}
NO_BBOX = (math.nan,) * 4


class Entry(msgspec.Struct, frozen=True, gc=False, omit_defaults=True):
    """One detection or segmentation, under the names of the file."""

    scene_id: Int64
    image_id: Int64
    category_id: Int64
    score: float
    bbox: tuple[float, float, float, float] | None = None
    segmentation: Rle | None = None
    time: float | None = None


def read_entries_slowly(
    text: str, found: Findings, limits: Limits
) -> tuple[list[Entry], NDArray[np.int64]]:
    """Read entry by entry; all that is wrong goes to ``found``.

    Returns:
        The entries whose ids can be read, with NaN for each number that cannot, and ``(N, 2)``
        their lines and indices in the list.
    """
    entries: list[Entry] = []
    places: list[tuple[int, int]] = []
    try:
        for index, (line, value) in enumerate(values_of_list(text, limits.entry_chars)):
            if index > limits.rows:  # the caller tells
                break
            entry = _Reader(found, index, line).entry(value)
            if entry is not None:
                entries.append(entry)
                places.append((line, index))
    except FormatError as error:
        found.stop(error)
    return entries, np.array(places, np.int64).reshape(-1, 2)


class _Reader:
    """Reads the fields of one entry; knows its place for what it has to tell."""

    def __init__(self, found: Findings, index: int, line: int) -> None:
        self._found = found
        self._index = index
        self._line = line

    def entry(self, value: Any) -> Entry | None:
        if not isinstance(value, dict):
            self._wrong_type("", "an object {...}", value)
            return None
        ids = [self._id(name, value) for name in ("scene_id", "image_id", "category_id")]
        score = self._score(value)
        bbox = self._bbox(value.get("bbox"))
        segmentation = self._segmentation(value.get("segmentation"))
        time = self._time(value.get("time"))
        scene_id, image_id, category_id = ids
        if scene_id is None or image_id is None or category_id is None:
            return None
        return Entry(scene_id, image_id, category_id, score, bbox, segmentation, time)

    def _id(self, name: str, entry: dict[str, Any]) -> int | None:
        if name not in entry:
            self._missing(name, entry)
            return None
        value = entry[name]
        if isinstance(value, int) and not isinstance(value, bool) and value in INT64:
            return value
        self._add(
            "not-an-integer",
            f"{name} is not an integer",
            name,
            expected="an integer of at most 64 bits",
            got=shown_json(value),
            fix=f"write {name} without quotes and decimal point",
        )
        return None

    def _score(self, entry: dict[str, Any]) -> float:
        if "score" not in entry:
            self._missing("score", entry)
            return math.nan
        return self._number("score", entry["score"])

    def _number(self, name: str, value: Any) -> float:
        if not is_number(value):
            self._add(
                "not-a-number",
                f"{name} is not a number",
                name,
                expected="a number",
                got=shown_json(value),
                fix="write it without quotes",
            )
            return math.nan
        number = as_float(value)
        if not math.isfinite(number):
            self._found.add(not_finite(self._place(name), shown_json(value), self._line))
            return math.nan
        return number

    def _time(self, value: Any) -> float | None:
        return None if value is None else self._number("time", value)

    def _bbox(self, value: Any) -> tuple[float, float, float, float] | None:
        if value is None:
            return None
        if not isinstance(value, list) or len(value) != 4:
            self._wrong_type("bbox", "[left, top, width, height]", value)
            return NO_BBOX
        left, top, width, height = (self._number("bbox", one) for one in value)
        return left, top, width, height

    def _segmentation(self, value: Any) -> Rle | None:
        if value is None:
            return None
        wanted = '{"size": [height, width], "counts": ...}'
        if not isinstance(value, dict) or not {"size", "counts"} <= value.keys():
            is_polygon = isinstance(value, list)
            fix = "code the mask in run lengths; polygons are not read" if is_polygon else ""
            self._wrong_type("segmentation", wanted, value, fix)
            return None
        size, counts = value["size"], value["counts"]
        if not (isinstance(size, list) and len(size) == 2 and all(map(_is_size, size))):
            self._wrong_type("segmentation.size", "[height, width], integers", size)
            return None
        if isinstance(counts, list):
            if not all(map(_is_int64, counts)):
                self._wrong_type("segmentation.counts", "integers", counts)
                return None
        elif not isinstance(counts, str):
            self._wrong_type("segmentation.counts", "a string or a list of integers", counts)
            return None
        return Rle((size[0], size[1]), counts)

    def _missing(self, name: str, entry: dict[str, Any]) -> None:
        other = [alias for alias in _OTHER_NAMES[name] if alias in entry]
        self._add(
            "missing-field",
            f"{name} is missing",
            name,
            expected=f'"{name}"',
            got=f"fields {', '.join(map(str, entry)) or '(none)'}"[:200],
            fix=f'rename "{other[0]}" to "{name}"' if other else f"add {name}",
        )

    def _wrong_type(self, name: str, expected: str, value: Any, fix: str = "") -> None:
        self._add(
            "wrong-type",
            f"{name or 'entry'} is not of the right form",
            name,
            expected=expected,
            got=shown_json(value),
            fix=fix or f"write {expected}",
        )

    def _add(self, code: str, what: str, name: str, *, expected: str, got: str, fix: str) -> None:
        place = self._place(name)
        self._found.add(
            Problem(code, what, line=self._line, field=place, expected=expected, got=got, fix=fix)
        )

    def _place(self, name: str) -> str:
        return f"[{self._index}].{name}".removesuffix(".")


def is_number(value: Any) -> bool:
    """Whether a JSON value is a number; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def as_float(value: float) -> float:
    """An integer beyond all doubles is an infinity, as it is where it is written with a point."""
    try:
        return float(value)
    except OverflowError:
        return math.copysign(math.inf, value)


def shown_json(value: Any) -> str:
    """A JSON value as a message quotes it: not longer than a line."""
    if isinstance(value, list | dict) and len(value) > 8:
        return f"a {'list' if isinstance(value, list) else 'object'} of {len(value)}"
    text = repr(value) if not isinstance(value, str) else shown(value)
    return text if len(text) <= 72 else f"{text[:72]}..."


def _is_size(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**31


def _is_int64(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value in INT64
