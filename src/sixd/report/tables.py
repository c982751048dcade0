"""Terminal tables of evaluations. Colour on a terminal, plain text in a pipe."""

from __future__ import annotations

import io
import math
import shutil
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sixd.evaluation.evaluation import Evaluation
from sixd.evaluation.scores import Breakdown

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

PIPE_WIDTH = 200
MOST_COLUMNS = 8
COCO_COLUMNS = ("AP", "AP50", "AP75", "AR100")
REASONS = {
    "not_a_target": "of no target (image and object)",
    "beyond_instance_count": "beyond the number of instances asked for",
    "over_cap": "beyond the cap of estimates per image",
    "not_a_target_image": "not in a target image",
    "object_absent_from_image": "of an object that is not in the image",
    "unknown_category": "of an object that the truth does not list",
    "without_shape": "without a box or mask",
    "beyond_100": "beyond 100 per image and category",
}


def evaluation_table(evaluations: Sequence[Evaluation]) -> str:
    """One row per evaluation; of a single one also what it left out."""
    lines: list[RenderableType] = []
    for protocol in dict.fromkeys(e.protocol for e in evaluations):
        some = [e for e in evaluations if e.protocol == protocol]
        lines.append(_scores_table(protocol, some))
        if len(some) == 1:
            lines += _remarks(some[0])
    return _render(lines)


def breakdown_table(breakdown: Breakdown) -> str:
    """Scores by object, scene, threshold or visibility."""
    table = _table(f"by {breakdown.by}")
    for name in breakdown.columns:
        table.add_column(name, justify="right")
    for row in zip(*(c.tolist() for c in breakdown.columns.values()), strict=True):
        table.add_row(*(_cell(v) for v in row))
    return _render([table])


def breakdown_rows(breakdown: Breakdown) -> list[dict[str, Any]]:
    """The same as plain records for JSON; null where a score is not defined."""
    names = list(breakdown.columns)
    columns = [c.tolist() for c in breakdown.columns.values()]
    return [
        {
            n: None if isinstance(v, float) and math.isnan(v) else v
            for n, v in zip(names, row, strict=True)
        }
        for row in zip(*columns, strict=True)
    ]


def _scores_table(protocol: str, evaluations: Sequence[Evaluation]) -> Table:
    table = _table(f"{protocol} on {', '.join(dict.fromkeys(e.dataset for e in evaluations))}")
    keys = list(dict.fromkeys(k for e in evaluations for k in e.scores))
    if len(keys) > MOST_COLUMNS:
        keys = [k for k in keys if k in COCO_COLUMNS]
    table.add_column("results", overflow="fold")
    for key in (*keys, "time (s)", "targets", "no estimate", "not scored"):
        table.add_column(key, justify="right")
    for e in evaluations:
        name = Path(e.provenance.results_file).name or "(in memory)"
        time = "-" if e.average_time_per_image < 0 else f"{e.average_time_per_image:.3f}"
        counts = (e.n_targets, e.n_without_estimate, sum(e.ignored.values()))
        scores = (_cell(e.scores.get(k, np.nan)) for k in keys)
        table.add_row(name, *scores, time, *map(str, counts))
    return table


def _remarks(evaluation: Evaluation) -> Iterable[str]:
    """What a single evaluation left out, and why."""
    if len(evaluation.scores) > MOST_COLUMNS:
        others = [f"{k} {_cell(v)}" for k, v in evaluation.scores.items() if k not in COCO_COLUMNS]
        yield ", ".join(others)
    for reason, count in evaluation.ignored.items():
        if count:
            why = REASONS.get(reason, reason)
            yield f"{count} of {evaluation.n_estimates} estimates play no part: {why}."
    for note in evaluation.notes:
        yield f"note: {note}"


def _cell(value: object) -> str:
    if isinstance(value, float):
        return "-" if math.isnan(value) else f"{value:.4f}"
    return str(value)


def _table(title: str) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    return Table(title=Text(title), title_justify="left", box=box.SIMPLE_HEAD, header_style="bold")


def _render(parts: Iterable[RenderableType]) -> str:
    from rich.console import Console
    from rich.text import Text

    is_terminal = sys.stdout.isatty()
    width = shutil.get_terminal_size().columns if is_terminal else PIPE_WIDTH
    console = Console(file=io.StringIO(), width=width, force_terminal=is_terminal, highlight=False)
    for part in parts:
        console.print(Text(part) if isinstance(part, str) else part)
    text: str = console.file.getvalue()  # type: ignore[attr-defined]
    return "\n".join(line.rstrip() for line in text.splitlines()) + "\n"
