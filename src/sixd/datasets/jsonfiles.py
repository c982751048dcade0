"""JSON files of a dataset, decoded into typed records; a failure names file, place and fix.

`msgspec` reads numbers correctly rounded (bit-exact) and refuses NaN, infinities and numbers that
overflow, so what comes out of here is finite.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Hashable
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast, get_args, get_origin

import msgspec

from sixd.datasets.ids import LARGEST_ID
from sixd.errors import FormatError, MissingDataError, Problem

T = TypeVar("T")

Id = Annotated[int, msgspec.Meta(ge=0, le=LARGEST_ID)]
Vector3 = tuple[float, float, float]
Vector9 = tuple[float, float, float, float, float, float, float, float, float]

_NOT_JSON = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)
_MOST_PROBLEMS = 100
"""A file that is wrong throughout is explained as well by its first hundred problems."""


def read_json(path: Path, kind: type[T], *, advice: str = "") -> T:
    """Decode a whole file as ``kind``.

    Raises:
        MissingDataError: the file cannot be read; ``advice`` is added to the message.
        FormatError: it is not JSON, or not of this form; names every wrong entry.
    """
    return decode(path, read_bytes(path, advice=advice), kind)


def read_bytes(path: Path, *, advice: str = "") -> bytes:
    """All bytes of a file, or a `MissingDataError` that says why not."""
    try:
        return path.read_bytes()
    except OSError as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else error.strerror
        raise MissingDataError(
            f"{path}: {reason}" + (f"\n    fix: {advice}" if advice else "")
        ) from error


def decode(path: Path, raw: bytes, kind: type[T]) -> T:
    """Decode the bytes of ``path``, which is only named in errors. See `read_json`."""
    try:
        decoded: T = _decoder(cast(Hashable, kind)).decode(raw)
    except _NOT_JSON as error:
        raise FormatError(_explain(path, raw, kind, error)) from error
    return decoded


def repeated_keys(path: Path, raw: bytes) -> list[Problem]:
    """Keys that one JSON object holds twice: a decoder keeps the last and loses the rest.

    Slow, so it is asked only where a count of entries shows that something was lost.
    """
    found: list[str] = []

    def note(pairs: list[tuple[str, Any]]) -> None:
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                found.append(key)
            seen.add(key)

    try:
        # Values are not looked at, so digits stay text: Python limits the length of integers.
        json.loads(raw.decode("utf-8", "replace"), object_pairs_hook=note, parse_int=str)
    except (ValueError, RecursionError):
        return []
    return [
        Problem(
            "repeated-key",
            "occurs twice in one JSON object; only one of them can be meant",
            file=str(path),
            field=f'"{key}"',
            fix="merge the entries under one key",
        )
        for key in found[:_MOST_PROBLEMS]
    ]


@lru_cache(maxsize=64)
def _decoder(kind: Any) -> msgspec.json.Decoder[Any]:
    return msgspec.json.Decoder(kind)


def _explain(path: Path, raw: bytes, kind: Any, error: Exception) -> list[Problem]:
    if isinstance(error, msgspec.ValidationError):
        try:
            tree = msgspec.json.decode(raw)
        except msgspec.ValidationError:
            return [_overflow(path, raw, error)]
        except _NOT_JSON as deeper:
            return [_malformed(path, raw, deeper)]
        return _misfits(path, tree, kind) or [_misfit(path, str(error))]
    return [_malformed(path, raw, error)]


def _overflow(path: Path, raw: bytes, error: Exception) -> Problem:
    """The first number that no 64-bit float can hold, such as ``1e999``."""
    numbers = re.finditer(rb"-?\d+(?:\.\d+)?[eE]\+?\d{3,}|-?\d{300,}", raw)
    found = next((m for m in numbers if math.isinf(float(m[0]))), None)
    if found is None:
        return _misfit(path, str(error))
    line = raw.count(b"\n", 0, found.start()) + 1
    got = found[0][:40].decode()
    what = "holds a number that does not fit a 64-bit float"
    return Problem(
        "bad-json-entry", what, file=str(path), line=line, expected="a finite number", got=got
    )


def _misfits(path: Path, tree: Any, kind: Any) -> list[Problem]:
    """Every entry of a wrong file is tried alone, since the decoder stops at the first."""
    if isinstance(tree, dict) and get_origin(kind) is dict:
        parts: list[tuple[str, Any]] = [(f'["{key}"]', {key: value}) for key, value in tree.items()]
    elif isinstance(tree, list) and get_origin(kind) is list and get_args(kind):
        parts = [(f"[{i}]", [value]) for i, value in enumerate(tree)]
    else:
        return []
    problems: list[Problem] = []
    for place, part in parts:
        try:
            msgspec.convert(part, kind, str_keys=True)
        except msgspec.ValidationError as error:
            problems.append(_misfit(path, str(error), place))
            if len(problems) == _MOST_PROBLEMS:
                break
    return problems


def _misfit(path: Path, message: str, place: str = "") -> Problem:
    what, _, where = message.partition(" - at ")
    where = where.strip("`")
    if where.startswith("key` in"):
        where, what = f"${place}", f"{what} as key"
    else:
        where = re.sub(r"^\$(\[\.\.\.\]|\[0\])?", lambda _: f"${place}", where or "$")
    expected, got = "", ""
    if match := re.match(r"Expected (.+?)(?:, got (.+))?$", what):
        expected, got = match[1].replace("`", ""), (match[2] or "").replace("`", "")
        what = "has the wrong type or length" if got else "is out of range or has the wrong length"
    else:
        what = what.replace("`", "").replace("Object missing", "lacks the")
    return Problem("bad-json-entry", what, file=str(path), field=where, expected=expected, got=got)


def _malformed(path: Path, raw: bytes, error: Exception) -> Problem:
    what, line, got, fix = "is not valid JSON", None, "", "restore it from the archive it came from"
    match = re.search(r"(.*) \(byte (\d+)\)", str(error))
    if raw.startswith(b"\xef\xbb\xbf"):
        what, fix = "starts with a byte order mark", "save it as UTF-8 without BOM"
    elif not raw.strip():
        what = "is empty"
    elif match:
        at = int(match[2])
        line = raw.count(b"\n", 0, at) + 1
        got = raw[max(0, at - 20) : at + 20].decode("utf-8", "replace").strip()
        what += f": {match[1].removeprefix('JSON is malformed: ')}"
        if re.match(rb"-?(NaN|Inf)", raw[at : at + 4]):
            what = "holds NaN or Infinity, which JSON does not have"
            fix = "every number must be finite: remove the entry or mend the value"
    elif "truncated" in str(error):
        what = "ends in the middle of a value: the file was cut off"
    elif isinstance(error, RecursionError):
        what = "is nested too deeply"
    else:
        what += f": {error}"
    return Problem("bad-json", what, file=str(path), line=line, got=got, fix=fix)
