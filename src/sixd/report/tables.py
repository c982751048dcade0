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
    """One row per evaluation, then what each left out."""
    lines: list[RenderableType] = []
    for protocol in dict.fromkeys(e.protocol for e in evaluations):
        some = [e for e in evaluations if e.protocol == protocol]
        lines.append(_scores_table(protocol, some))
        lines += [text for e in some for text in _remarks(e, named=len(some) > 1)]
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
        {n: None if isinstance(v, float) and math.isnan(v) else v for n, v in zip(names, row, strict=True)}
        for row in zip(*columns, strict=True)
    ]


def _scores_table(protocol: str, evaluations: Sequence[Evaluation]) -> Table:
    table = _table(f"{protocol} on {', '.join(dict.fromkeys(e.dataset for e in evaluations))}")
    keys = dict.fromkeys(k for e in evaluations for k in e.scores)
    table.add_column("results", overflow="fold")
    for key in keys:
        table.add_column(key, justify="right")
    table.add_column("time (s)", justify="right")
    for e in evaluations:
        name = Path(e.provenance.results_file).name or "(in memory)"
        time = "-" if e.average_time_per_image < 0 else f"{e.average_time_per_image:.3f}"
        table.add_row(name, *(_cell(e.scores.get(k, np.nan)) for k in keys), time)
    return table


def _remarks(evaluation: Evaluation, named: bool) -> Iterable[str]:
    head = f"{Path(evaluation.provenance.results_file).name}: " if named else ""
    found = evaluation.n_targets - evaluation.n_without_estimate
    yield (
        f"{head}{evaluation.n_targets} targets, {evaluation.n_without_estimate} without an estimate"
        f" (misses), {found} with one."
    )
    for reason, count in evaluation.ignored.items():
        if count:
            yield f"{head}{count} of {evaluation.n_estimates} estimates play no part: {REASONS.get(reason, reason)}."
    for note in evaluation.notes:
        yield f"{head}note: {note}"


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
    console = Console(
        file=io.StringIO(), width=width, force_terminal=is_terminal, highlight=False
    )
    for part in parts:
        console.print(Text(part) if isinstance(part, str) else part)
    text: str = console.file.getvalue()  # type: ignore[attr-defined]
    return "\n".join(line.rstrip() for line in text.splitlines()) + "\n"
