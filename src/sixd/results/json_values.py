"""Walks through a JSON list one element at a time, for files that a typed decoder refused."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

from sixd.errors import FormatError, Problem
from sixd.results.findings import shown

_BLANK = re.compile(r"[ \t\r\n]*")
_LONGEST_INTEGER = 400
_QUOTED_CHARS = 40


def values_of_list(text: str, longest: int) -> Iterator[tuple[int, Any]]:
    """Line and value of each element of the list that the text is.

    The parser sees a window of at most twice ``longest`` characters, so that one endless element
    cannot fill the memory with small objects. ``NaN`` and ``Infinity``, which are no JSON but
    which Python writes, come as numbers.

    Raises:
        FormatError: the text is no list, or stops being JSON; what came before has been yielded.
    """
    decoder = json.JSONDecoder(parse_constant=float, parse_int=_integer)
    at = _skip_blank(text, 0)
    if text[at : at + 1] != "[":
        raise FormatError([_not_a_list(text[at:])])
    at = _skip_blank(text, at + 1)
    window_at, window = 0, text[: 2 * longest]
    line, counted = 1, 0
    while text[at : at + 1] != "]":
        line, counted = line + text.count("\n", counted, at), at
        if at - window_at > longest:
            window_at, window = at, text[at : at + 2 * longest]
        try:
            value, end = decoder.raw_decode(window, at - window_at)
        except RecursionError as error:
            raise FormatError([_malformed(line, "too many brackets inside each other")]) from error
        except json.JSONDecodeError as error:
            place = window_at + error.pos
            what = error.msg.lower()
            if window_at + len(window) < len(text):
                what += f" (or an entry of more than {longest:,} characters)"
            raise FormatError([_malformed_at(text, place, what)]) from error
        yield line, value
        at = _next_element(text, window_at + end)
    at = _skip_blank(text, at + 1)
    if at < len(text):
        raise FormatError([_malformed_at(text, at, "more text after the end of the list")])


def _next_element(text: str, at: int) -> int:
    """Place of the next element, or of the bracket that ends the list."""
    at = _skip_blank(text, at)
    if text[at : at + 1] == "]":
        return at
    if text[at : at + 1] != ",":
        raise FormatError([_malformed_at(text, at, "expecting a comma or ] after an entry")])
    at = _skip_blank(text, at + 1)
    if text[at : at + 1] == "]":
        raise FormatError([_malformed_at(text, at, "a comma after the last entry")])
    return at


def _skip_blank(text: str, at: int) -> int:
    blank = _BLANK.match(text, at)
    return blank.end() if blank else at


def _integer(digits: str) -> int | float:
    """Python refuses to convert very long integers; as a float they are found out of range."""
    return int(digits) if len(digits) <= _LONGEST_INTEGER else float(digits)


def _malformed_at(text: str, at: int, what: str) -> Problem:
    line = text.count("\n", 0, at) + 1
    column = at - (text.rfind("\n", 0, at) + 1) + 1
    here = text[at : at + _QUOTED_CHARS]
    return _malformed(line, f"{what}, at column {column}: {shown(here) if here else 'end of file'}")


def _malformed(line: int, what: str) -> Problem:
    return Problem(
        code="malformed-json",
        what="the file is not valid JSON; it was not read further",
        line=line,
        expected="one JSON list of detections",
        got=what,
        fix="write the file with a JSON library",
    )


def _not_a_list(text: str) -> Problem:
    is_truth = '"annotations"' in text
    return Problem(
        code="not-a-list",
        what="the file is not a list of detections",
        line=1,
        expected='[{"scene_id": ..., "image_id": ..., "category_id": ..., "score": ...}, ...]',
        got=shown(text[:_QUOTED_CHARS]),
        fix="this is COCO's form of ground truth; results are one plain list of detections"
        if is_truth
        else "put all detections into one list",
    )
