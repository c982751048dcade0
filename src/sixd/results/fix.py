"""Mends what can be mended without inventing anything, and tells each change.

Rows that are not touched keep their bytes. Everything else that is wrong is left and told.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from sixd.errors import Problem, UsageError
from sixd.results.json_values import values_of_list
from sixd.results.limits import Limits
from sixd.results.lint import CheckReport, check_file
from sixd.results.lint_images import wrong_times
from sixd.results.lint_poses import (
    EXACT_ROTATION_ERROR,
    MENDABLE_ROTATION_ERROR,
    determinant,
    orthogonality_error,
)
from sixd.results.results_text import open_results_text
from sixd.results.tables import Detections, Floats, PoseEstimates
from sixd.results.text_writing import write_results_text


@dataclass(frozen=True)
class Change:
    """One thing that was mended."""

    what: str
    line: int | None
    """Line of the original file; None for what concerns all of it."""
    field: str
    before: str
    after: str


@dataclass(frozen=True)
class FixReport:
    """What was mended, and what was not."""

    file: str
    out: str
    written: bool
    """False where rows are unreadable; then ``left`` says what to mend first."""
    changes: tuple[Change, ...]
    left: tuple[Problem, ...]
    """All problems of the output, warnings included; of the input if nothing was written."""


def fix_file(path: str | Path, out: str | Path, *, limits: Limits | None = None) -> FixReport:
    """Write a mended copy: nearest rotations, one time per image, no BOM, CR LF or blank lines.

    A matrix whose max|R R^T - I| is below `MENDABLE_ROTATION_ERROR` is replaced by the nearest
    rotation (SVD; Golub and Van Loan, Matrix Computations 12.4.1). A time that differs from the
    first one of its image is replaced by that. NaN, missing columns, metres are left and told.

    Args:
        path: a results file.
        out: where the copy goes, never the file itself; ``.gz`` is compressed.
        limits: how much the file may ask of this machine.

    Raises:
        UsageError: ``out`` is the file itself.
        MissingDataError: there is no such file.
        OutputError: ``out`` cannot be written.
    """
    path, out = Path(path), Path(out)
    if out.exists() and path.exists() and out.samefile(path):
        raise UsageError(f"{out}: a file is not mended in place; give --fix another path")
    limits = limits or Limits()
    before = check_file(path, limits=limits)
    if before.table is None:
        return FixReport(str(path), str(out), False, (), before.problems)
    text = b"".join(open_results_text(path, limits).blocks)
    changes = _changes_of_file(before)
    if isinstance(before.table, PoseEstimates):
        new_text = _mend_csv(text, before.table, changes)
    else:
        new_text = _mend_json(text, before.table, changes)
    write_results_text(out, new_text)
    left = check_file(out, limits=limits).problems
    return FixReport(str(path), str(out), True, tuple(changes), left)


def nearest_rotations(R: Floats) -> Floats:
    """The rotation nearest to each matrix ``(N, 3, 3)`` in the Frobenius norm."""
    U, _, Vt = np.linalg.svd(R)
    nearest: Floats = U @ Vt
    return nearest


def _changes_of_file(report: CheckReport) -> list[Change]:
    mended = {
        "bom": ("byte order mark removed", "nothing"),
        "crlf": ("line ends changed", "\\n"),
        "blank-line": ("blank line removed", "no line"),
    }
    return [
        Change(mended[p.code][0], p.line, "", before=p.got, after=mended[p.code][1])
        for p in report.problems
        if p.code in mended
    ]


def _mend_csv(text: bytes, table: PoseEstimates, changes: list[Change]) -> bytes:
    lines = text.replace(b"\r\n", b"\n").split(b"\n")
    assert table.line is not None  # it comes from a file
    for row, R in _mended_rotations(table):
        line = int(table.line[row])
        _put(lines, line, 4, "R", " ".join(map(repr, R)), "R made a rotation", changes)
    for row, leader in zip(*wrong_times(table), strict=True):
        line = int(table.line[row])
        time = repr(float(table.time_s[leader]))
        _put(lines, line, 6, "time", time, "time made that of its image", changes)
    return b"\n".join(line for line in lines if line.strip(b" \t")) + b"\n"


def _mended_rotations(table: PoseEstimates) -> list[tuple[int, list[float]]]:
    with np.errstate(over="ignore", invalid="ignore"):
        error = orthogonality_error(table.R)
        mendable = (error > EXACT_ROTATION_ERROR) & (error < MENDABLE_ROTATION_ERROR)
        rows = np.flatnonzero(mendable & (determinant(table.R) > 0))
    R = nearest_rotations(table.R[rows]).reshape(-1, 9)
    return list(zip(rows.tolist(), R.tolist(), strict=True))


def _put(
    lines: list[bytes],
    line: int,
    place: int,
    field: str,
    new: str,
    what: str,
    changes: list[Change],
) -> None:
    fields = lines[line - 1].split(b",")
    changes.append(Change(what, line, field, fields[place].decode(), new))
    fields[place] = new.encode()
    lines[line - 1] = b",".join(fields)


def _mend_json(text: bytes, table: Detections, changes: list[Change]) -> bytes:
    """Entries are put together again from their own bytes, but for those that change."""
    rows, leaders = wrong_times(table)
    if not len(rows):
        return text
    try:
        entries = [bytes(raw) for raw in msgspec.json.decode(text, type=list[msgspec.Raw])]
    except msgspec.MsgspecError:  # what the slow reader took, a stricter one may refuse
        values = values_of_list(text.decode(), len(text))
        entries = [json.dumps(value).encode() for _, value in values]
    for row, leader in zip(rows.tolist(), leaders.tolist(), strict=True):
        entry = json.loads(entries[row])
        time = float(table.time_s[leader])
        line = None if table.line is None else int(table.line[row])
        what = "time made that of its image"
        changes.append(Change(what, line, f"[{row}].time", repr(entry["time"]), repr(time)))
        entries[row] = json.dumps({**entry, "time": time}).encode()
    return b"[\n" + b",\n".join(entries) + b"\n]\n"
