"""Says where in its file a row of a table stands."""

from __future__ import annotations

from sixd.results.tables import Detections, Table


def place_of(table: Table, row: int, name: str) -> tuple[int | None, str]:
    """Line, and field as a message names it: ``R``, ``[17].bbox``, or with the row in memory."""
    if table.line is None:
        return None, f"{name} (row {row})"
    line = int(table.line[row])
    if isinstance(table, Detections) and table.entry is not None:
        return line, f"[{table.entry[row]}].{name}"
    return line, name
