"""Says where in its file a row of a table stands."""

from __future__ import annotations

from sixd.results.tables import Detections, Table


def row_name(row: int) -> str:
    """A row of a table in memory, as its user finds it: ``table.score[row]``."""
    return f"row {row}, counted from 0"


def other_place(table: Table, row: int) -> str:
    """Another row that a message refers to."""
    return row_name(row) if table.line is None else f"line {table.line[row]}"


def place_of(table: Table, row: int, name: str) -> tuple[int | None, str]:
    """Line, and field as a message names it: ``R``, ``[17].bbox``, or with the row in memory."""
    if table.line is None:
        return None, f"{name} ({row_name(row)})"
    line = int(table.line[row])
    if isinstance(table, Detections) and table.entry is not None:
        return line, f"[{table.entry[row]}].{name}"
    return line, name
