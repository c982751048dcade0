"""Writes results of either kind."""

from __future__ import annotations

from pathlib import Path

from sixd.results.coco_json import write_coco_json
from sixd.results.pose_csv import write_pose_csv
from sixd.results.tables import PoseEstimates, Table


def write_results(path: str | Path, table: Table) -> None:
    """Write poses as BOP's CSV, detections as COCO's JSON, atomically; gzipped if named ``.gz``.

    Numbers are written with the fewest digits that read back to the same bits.

    Raises:
        UsageError: a number is not finite; nothing is written.
        OutputError: the file cannot be written.
    """
    if isinstance(table, PoseEstimates):
        write_pose_csv(path, table)
    else:
        write_coco_json(path, table)
