"""Pose estimates as BOP's CSV, read and written bit for bit.

One row is ``scene_id,im_id,obj_id,score,R,t,time``: R nine numbers row by row, t three in
millimetres, time in seconds for the whole image (-1: not measured).

Reading is fast where the file is plain and explains itself where it is not: block by block, either
the fast reader takes all rows or the slow one in `sixd.results.pose_csv_rows`, which defines the
format, goes through them.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from sixd.errors import FormatError, Problem, UsageError
from sixd.results.findings import Findings
from sixd.results.limits import Limits
from sixd.results.lines import LineBlock, line_blocks
from sixd.results.pose_csv_rows import HEADER, MAX_NUMBER_CHARS, Rows, read_rows_slowly
from sixd.results.results_text import ResultsText, read_table
from sixd.results.row_places import row_name
from sixd.results.tables import PoseEstimates, times_of_file
from sixd.results.text_writing import write_results_text

_ROW_SEPARATORS = np.frombuffer(b",,,,        ,  ,\n", np.uint8)
_IS_ID_CHAR = np.isin(np.arange(256), np.frombuffer(b"-0123456789,", np.uint8))
_NUMBERS = msgspec.json.Decoder(list[float])
_EXACT_IN_A_FLOAT = 2**53
_SMALL_BLOCK_BYTES = 32 << 10
_ROWS_AT_ONCE = 20_000


def read_pose_csv(path: str | Path, *, limits: Limits | None = None) -> PoseEstimates:
    """Read BOP's pose CSV, plain or gzipped, whatever its name.

    Raises:
        FormatError: carries every unreadable line, with what was expected and what came.
        MissingDataError: there is no such file.
    """
    return read_table(path, limits, parse_pose_csv)


def write_pose_csv(path: str | Path, estimates: PoseEstimates) -> None:
    """Write BOP's pose CSV, atomically; gzipped if the name ends in ``.gz``.

    Numbers are written with the fewest digits that read back to the same bits.

    Raises:
        UsageError: a number is not finite; nothing is written.
        OutputError: the file cannot be written.
    """
    refuse_rows(path, "score", ~np.isfinite(estimates.score))
    refuse_rows(path, "R", ~np.isfinite(estimates.R).all(axis=(1, 2)))
    refuse_rows(path, "t_mm", ~np.isfinite(estimates.t_mm).all(axis=1))
    refuse_rows(path, "time_s", np.isinf(estimates.time_s))
    header = f"{HEADER}\n".encode()
    write_results_text(path, b"".join([header, *_written_rows(estimates)]))


def refuse_rows(path: str | Path, name: str, wrong: NDArray[np.bool_] | np.bool_) -> None:
    """Raise `UsageError` if a column holds what no results file may hold."""
    rows = np.flatnonzero(wrong)
    if len(rows):
        raise UsageError(
            f"{path}: {name} is not finite in {len(rows)} rows, first in {row_name(int(rows[0]))}"
        )


def parse_pose_csv(text: ResultsText, found: Findings, limits: Limits) -> PoseEstimates:
    """Read all rows; what is unreadable goes to ``found``.

    A row whose ids can be read is kept, with NaN for each number that cannot; the table is of use
    only if ``found`` has no errors.

    Raises:
        FormatError: the text is that of another kind.
    """
    if text.kind != "pose-csv":
        raise FormatError([_not_a_csv(text.kind)])
    parts: list[Rows] = []
    n_rows = 0
    crlf = _WindowsLineEnds()
    try:
        for block in line_blocks(text.blocks, text.first_byte, limits.line_bytes):
            if block.first_line > 2 * limits.rows + 2:  # blank and broken lines are rows too
                raise FormatError([too_many_rows(limits, block.first_line)])
            crlf.count(block)
            for rows in _read_rows(block, found, limits):
                parts.append(rows)
                n_rows += len(rows.line)
                if n_rows > limits.rows:
                    raise FormatError([too_many_rows(limits, int(rows.line[limits.rows - n_rows]))])
    except FormatError as error:
        found.stop(error)
    crlf.tell(found)
    return _table(Rows.concatenate(parts))


def too_many_rows(limits: Limits, line: int | None) -> Problem:
    """More rows than the limits allow."""
    return Problem(
        code="too-many-rows",
        what="the file has too many rows; it was not read further",
        line=line,
        expected=f"at most {limits.rows:,} rows",
        got="more",
        fix="keep the best estimates of each image, or raise Limits.rows",
    )


def _table(rows: Rows) -> PoseEstimates:
    return PoseEstimates(
        scene_id=rows.ids[:, 0].copy(),
        im_id=rows.ids[:, 1].copy(),
        obj_id=rows.ids[:, 2].copy(),
        score=rows.numbers[:, 0].copy(),
        R=rows.numbers[:, 1:10].reshape(-1, 3, 3),
        t_mm=rows.numbers[:, 10:13].copy(),
        time_s=times_of_file(rows.numbers[:, 13]),
        line=rows.line,
    )


class _WindowsLineEnds:
    """Counts them over the blocks of a file, to tell once."""

    n = 0
    first_line = 0

    def count(self, block: LineBlock) -> None:
        n = block.text.count(b"\r\n") if b"\r" in block.text else 0
        if n and not self.n:
            self.first_line = block.after(block.text.index(b"\r\n")).first_line
        self.n += n

    def tell(self, found: Findings) -> None:
        if self.n:
            found.add(
                Problem(
                    code="crlf",
                    what="lines end with CR LF, as on Windows",
                    line=self.first_line,
                    expected="\\n at the end of a line",
                    got=f"\\r\\n at the end of {self.n:,} lines, this one first",
                    fix="nothing has to be done; sixd check --fix OUT changes them",
                    severity="warning",
                )
            )


def _read_rows(block: LineBlock, found: Findings, limits: Limits) -> Iterator[Rows]:
    """Read fast what can be, slowly what must be: halve a block that is not plain."""
    rows = _read_rows_fast(block)
    if rows is not None:
        yield rows
        return
    middle = block.text.rfind(b"\n", 0, len(block.text) // 2) + 1
    if not middle or len(block.text) < _SMALL_BLOCK_BYTES:
        yield read_rows_slowly(block, found, limits.line_bytes)
        return
    half = LineBlock(block.text[:middle], block.first_line, block.first_byte)
    for part in (half, block.after(middle)):
        yield from _read_rows(part, found, limits)


def _read_rows_fast(block: LineBlock) -> Rows | None:
    """All rows of a block if it is plain through and through, else None.

    Separators stand in exactly the places of the format, so what is between them are 17 tokens a
    row. With commas for separators they are one JSON list, for which a fast and correctly rounding
    reader exists. JSON numbers are a part of what `read_rows_slowly` takes.
    """
    block = _after_header(block)
    text = block.text
    if b"\r" in text:
        text = text.replace(b"\r\n", b"\n")
    if b"\r" in text or b"\t" in text:  # JSON would pass over them inside a token
        return None
    as_json = bytearray(b"[" + text)
    chars = np.frombuffer(as_json, np.uint8)[1:]
    at = np.flatnonzero((chars == ord(",")) | (chars == ord(" ")) | (chars == ord("\n")))
    n = len(at) // 17
    if n == 0 or len(at) % 17 or not (chars[at].reshape(n, 17) == _ROW_SEPARATORS).all():
        return None
    if np.diff(at, prepend=-1).max() > MAX_NUMBER_CHARS + 1:
        return None
    if not _IS_ID_CHAR[_id_chars(chars, at.reshape(n, 17))].all():
        return None
    chars[at] = ord(",")
    if b",-0," in as_json:  # an integer, so plain zero, in JSON; -0.0 in a CSV
        return None
    chars[-1] = ord("]")
    try:
        numbers = np.array(_NUMBERS.decode(as_json)).reshape(n, 17)
    except msgspec.MsgspecError:
        return None
    if (np.abs(numbers[:, :3]) >= _EXACT_IN_A_FLOAT).any():
        return None
    line = np.arange(block.first_line, block.first_line + n)
    return Rows(numbers[:, :3].astype(np.int64), numbers[:, 3:], line)


def _after_header(block: LineBlock) -> LineBlock:
    end = block.text.index(b"\n") + 1
    is_header = block.first_line == 1 and block.text[:end].rstrip() == HEADER.encode()
    return block.after(end) if is_header else block


def _id_chars(chars: NDArray[np.uint8], at: NDArray[np.intp]) -> NDArray[np.uint8]:
    """The characters of every row up to the third comma, one row after the other."""
    begin = np.concatenate([[0], at[:-1, 16] + 1])
    length = at[:, 2] - begin
    ends = np.cumsum(length)
    which = np.arange(length.sum()) + np.repeat(begin - ends + length, length)
    some: NDArray[np.uint8] = chars[which]
    return some


def _written_rows(estimates: PoseEstimates) -> Iterator[bytes]:
    """The way of `_read_rows_fast`, backwards: a JSON list, whose commas become separators."""
    for begin in range(0, len(estimates), _ROWS_AT_ONCE):
        some = estimates.where(slice(begin, begin + _ROWS_AT_ONCE))
        numbers = np.column_stack([some.score, some.R.reshape(-1, 9), some.t_mm]).tolist()
        ids = zip(some.scene_id.tolist(), some.im_id.tolist(), some.obj_id.tolist(), strict=True)
        times = [-1 if time != time else time for time in some.time_s.tolist()]
        flat = chain.from_iterable(
            (*row_ids, *row, time) for row_ids, row, time in zip(ids, numbers, times, strict=True)
        )
        text = bytearray(msgspec.json.encode(list(flat)))
        text[-1:] = b","
        chars = np.frombuffer(text, np.uint8)[1:]
        chars[np.flatnonzero(chars == ord(","))] = np.tile(_ROW_SEPARATORS, len(some))
        yield chars.tobytes()


def _not_a_csv(kind: str) -> Problem:
    return Problem(
        code="wrong-kind",
        what="the file is not a pose CSV",
        expected="rows of scene_id,im_id,obj_id,score,R,t,time",
        got=kind,
        fix="read it with read_coco_json, or let read_results choose",
    )
