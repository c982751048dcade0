"""Reads a results file of either kind; what it contains decides, not what it is called."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from sixd.results.coco_json import parse_coco_json
from sixd.results.findings import Findings
from sixd.results.limits import Limits
from sixd.results.pose_csv import parse_pose_csv
from sixd.results.results_text import ResultsText, open_results_text, read_table
from sixd.results.tables import Table


def read_results(path: str | Path, *, limits: Limits | None = None) -> Table:
    """Read a pose CSV or a COCO results JSON, plain or gzipped.

    This finds what cannot be read. Whether what was read makes sense is the question of
    `sixd.results.lint.check_file`.

    Raises:
        FormatError: carries every problem, with line, field, what was expected and what came.
        MissingDataError: there is no such file.
    """
    return read_table(path, limits, parse_results)


def parse_results(text: ResultsText, found: Findings, limits: Limits) -> Table:
    """Read the table; what is unreadable goes to ``found``, and then the table is partial.

    Raises:
        FormatError: nothing can be read.
    """
    if text.kind == "pose-csv":
        return parse_pose_csv(text, found, limits)
    return parse_coco_json(text, found, limits)


def kind_of_results(path: str | Path) -> Literal["pose", "bbox", "segm"]:
    """What a file holds, from its beginning: poses, boxes, or masks without boxes.

    Raises:
        FormatError: it is neither a pose CSV nor COCO JSON.
        MissingDataError: there is no such file.
    """
    text = open_results_text(path, Limits())
    if text.kind == "pose-csv":
        return "pose"
    beginning = next(iter(text.blocks), b"")
    return "segm" if b'"segmentation"' in beginning and b'"bbox"' not in beginning else "bbox"
