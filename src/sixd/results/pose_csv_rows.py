"""The format of a pose CSV, row by row: what is accepted, and what is wrong with what is not.

This slow reader is the definition. The fast one in `sixd.results.pose_csv` takes a part of what
this one takes, with the same bits.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from sixd.errors import Problem
from sixd.results.findings import Findings, shown
from sixd.results.lines import LineBlock
from sixd.results.tables import INT64

HEADER = "scene_id,im_id,obj_id,score,R,t,time"
FIELDS = tuple(HEADER.split(","))
N_NUMBERS = {"score": 1, "R": 9, "t": 3, "time": 1}
MAX_NUMBER_CHARS = 400
"""A double written out in full needs 340; longer tokens only cost time."""
_BLANK = " \t"
_INTEGER = re.compile(r"[+-]?[0-9]+")
_DECIMAL = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[+-]?(?:nan|inf|infinity)", re.IGNORECASE)
_COLUMN_NAME = re.compile(r"[^,\w]*(?!nan|inf)[A-Za-z_]{2}", re.IGNORECASE)
_HOW = {
    "score": "one number",
    "R": "9 numbers with spaces between, row by row",
    "t": "3 numbers with spaces between, millimetres",
    "time": "one number, seconds; -1 if not measured",
}


@dataclass(frozen=True)
class Rows:
    """Rows of a pose CSV."""

    ids: NDArray[np.int64]
    """``(N, 3)``: scene, image, object."""
    numbers: NDArray[np.float64]
    """``(N, 14)``: score, R, t, time."""
    line: NDArray[np.int64]

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """All rows of all parts, in order."""
        return cls(
            np.concatenate([np.zeros((0, 3), np.int64), *(p.ids for p in parts)]),
            np.concatenate([np.zeros((0, 14)), *(p.numbers for p in parts)]),
            np.concatenate([np.zeros(0, np.int64), *(p.line for p in parts)]),
        )


def read_rows_slowly(block: LineBlock, found: Findings, longest: int) -> Rows:
    """Read row by row; all that is wrong goes to ``found``.

    Args:
        block: the lines.
        found: takes the problems.
        longest: longest line, bytes.

    Returns:
        The rows whose ids can be read, with NaN for each number that cannot.
    """
    header_may_come = block.first_line == 1
    ids: list[Sequence[int]] = []
    numbers: list[list[float]] = []
    lines: list[int] = []
    for line, byte, raw in block.split():
        text = _text_of(raw, line, byte, found, longest)
        if not text:
            continue
        is_header = _is_header(text, line, found, allowed=header_may_come)
        header_may_come = False
        if is_header:
            continue
        row = _plain_row(text) or _explained_row(text, line, found)
        if row is not None:
            ids.append(row[0])
            numbers.append(row[1])
            lines.append(line)
    return Rows(
        np.array(ids, np.int64).reshape(-1, 3),
        np.array(numbers, np.float64).reshape(-1, 14),
        np.array(lines, np.int64),
    )


def _plain_row(text: str) -> tuple[Sequence[int], list[float]] | None:
    """A row without any problem; a shortcut past `_explained_row`, with the same values."""
    if not _row_pattern().fullmatch(text):
        return None
    *id_texts, rest = text.split(",", 3)
    tokens = rest.replace(",", " ").split()
    ids, numbers = [int(token) for token in id_texts], [float(token) for token in tokens]
    in_range = min(ids) in INT64 and max(ids) in INT64
    short = max(map(len, tokens)) <= MAX_NUMBER_CHARS
    return (ids, numbers) if in_range and short and all(map(math.isfinite, numbers)) else None


@cache
def _row_pattern() -> re.Pattern[str]:
    """Seven fields of the right number of integers and decimals."""
    return re.compile(
        ",".join(
            r"[ \t]*" + r"[ \t]+".join([token] * n) + r"[ \t]*"
            for token, n in (
                *[(r"[+-]?[0-9]{1,19}", 1)] * 3,
                *[(_DECIMAL.pattern, n) for n in N_NUMBERS.values()],
            )
        )
    )


def _explained_row(
    text: str, line: int, found: Findings
) -> tuple[Sequence[int], list[float]] | None:
    fields = _fields_of(text, line, found)
    if fields is None:
        return None
    ids = [_id(name, field, line, found) for name, field in zip(FIELDS, fields[:3], strict=False)]
    row = [
        number
        for name, field in zip(FIELDS[3:], fields[3:], strict=True)
        for number in _numbers(name, field, line, found)
    ]
    known = [one for one in ids if one is not None]
    return (known, row) if len(known) == len(ids) else None


def _text_of(raw: bytes, line: int, byte: int, found: Findings, longest: int) -> str:
    """The line as text; empty if there is nothing to read in it, which is told."""
    if len(raw) > longest:
        found.add(
            Problem(
                code="line-too-long",
                what="the line is too long for a row",
                line=line,
                expected=f"at most {longest:,} characters",
                got="more",
                fix="end each row with a line feed (\\n)",
            )
        )
        return ""
    try:
        text = raw.decode()
    except UnicodeDecodeError as error:
        found.add(bad_encoding(error, byte, line))
        return ""
    if not text.strip(_BLANK):
        found.add(
            Problem(
                code="blank-line",
                what="the line is blank, which the BOP toolkit refuses",
                line=line,
                expected="a row",
                got="nothing",
                fix="remove the line, or: sixd check --fix OUT",
                severity="warning",
            )
        )
        return ""
    return text


def bad_encoding(error: UnicodeDecodeError, byte: int, line: int | None) -> Problem:
    """Text that is not UTF-8; ``byte`` is where the decoded piece begins in the file."""
    return Problem(
        code="encoding",
        what="the text is not UTF-8",
        line=line,
        expected="UTF-8",
        got=f"byte 0x{error.object[error.start]:02x} at offset {byte + error.start}",
        fix="save the file as UTF-8",
    )


def _is_header(text: str, line: int, found: Findings, *, allowed: bool) -> bool:
    if text.strip() == HEADER:
        if not allowed:
            found.add(
                Problem(
                    code="repeated-header",
                    what="a header after the first row",
                    line=line,
                    expected="a header on the first line only",
                    got=shown(text),
                    fix="remove the line; were files joined?",
                )
            )
        return True
    if HEADER not in text and not (allowed and _COLUMN_NAME.match(text)):
        return False
    found.add(
        Problem(
            code="bad-header",
            what="the header is not the one of the format",
            line=line,
            expected=HEADER,
            got=shown(text),
            fix="write exactly this header on a line of its own, or no header",
        )
    )
    return True


def _fields_of(text: str, line: int, found: Findings) -> list[str] | None:
    fields = text.split(",")
    if len(fields) != len(FIELDS):
        found.add(
            Problem(
                code="column-count",
                what="wrong number of columns",
                line=line,
                expected=f"7 fields with commas between: {HEADER}",
                got=f"{len(fields)}: {shown(text)}",
                fix=_mend_columns(text, len(fields)),
            )
        )
        return None
    return fields


def _mend_columns(text: str, n_fields: int) -> str:
    if n_fields == 17:
        return "R and t are one field each: put spaces, not commas, between their numbers"
    if n_fields == 1 and ";" in text:
        return "put commas, not semicolons, between the fields"
    if n_fields == 6:
        return "is the time missing? write -1 if it was not measured"
    if text.endswith(","):
        return "remove the comma at the end of the line"
    return "write exactly the seven fields, R and t with spaces inside"


def _id(name: str, text: str, line: int, found: Findings) -> int | None:
    token = text.strip(_BLANK)
    if len(token) <= MAX_NUMBER_CHARS and _INTEGER.fullmatch(token) and int(token) in INT64:
        return int(token)
    found.add(
        Problem(
            code="not-an-integer",
            what=f"{name} is not an integer",
            line=line,
            field=name,
            expected="an integer of at most 64 bits, digits only",
            got=shown(text),
            fix=_mend_number(token) or f"write {name} without decimal point or other signs",
        )
    )
    return None


def _numbers(name: str, text: str, line: int, found: Findings) -> list[float]:
    """The numbers of a field; NaN for each that cannot be read, which is told."""
    wanted = N_NUMBERS[name]
    tokens = [token for token in re.split(r"[ \t]+", text) if token]
    if len(tokens) != wanted:
        found.add(
            Problem(
                code="number-count",
                what=f"{name} has the wrong number of values",
                line=line,
                field=name,
                expected=_HOW[name],
                got=f"{len(tokens)}: {shown(text)}",
                fix=_mend_number(text) or f"write {name} as {_HOW[name]}",
            )
        )
        return [math.nan] * wanted
    return [_number(name, token, line, found) for token in tokens]


def _number(name: str, token: str, line: int, found: Findings) -> float:
    if len(token) <= MAX_NUMBER_CHARS and _DECIMAL.fullmatch(token):
        value = float(token)
        if math.isfinite(value):
            return value
        got = f"{token}, which is larger than a double can hold"
    elif _NOT_FINITE.fullmatch(token):
        got = token
    else:
        found.add(
            Problem(
                code="not-a-number",
                what=f"{name} cannot be read as a number",
                line=line,
                field=name,
                expected=f"{_HOW[name]}, written like -12.5 or 1e-3",
                got=shown(token),
                fix=_mend_number(token) or "write plain decimal numbers",
            )
        )
        return math.nan
    found.add(not_finite(name, got, line))
    return math.nan


def not_finite(name: str, got: str, line: int | None) -> Problem:
    """NaN or an infinity where a number must be."""
    return Problem(
        code="not-finite",
        what=f"{name} is not finite",
        line=line,
        field=name,
        expected="a finite number",
        got=got,
        fix="leave the estimate out"
        if not name.endswith("time")
        else "write -1 if the time was not measured",
    )


def _mend_number(text: str) -> str:
    """What to do about the usual ways to write numbers wrong; empty if none is seen."""
    if any(sign in text for sign in "[]()"):
        return "remove the brackets"
    if '"' in text or "'" in text:
        return "remove the quotes"
    if "\N{MINUS SIGN}" in text:
        return "write the minus sign as -, not as U+2212"
    if "_" in text:
        return "remove the underscores"
    return ""
