"""A progress bar on a terminal, nothing in a pipe."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from sixd.evaluation.measure import Progress, no_progress


def prepare_kernels() -> None:
    """Load the compiler, and say so if it has work to do: that takes a while, once."""
    import click

    from sixd.metrics.compilation import is_compiled, load_numba_lean

    load_numba_lean()
    if not is_compiled():
        click.echo("sixd: first run: compiling, about 20 s more than later runs", err=True)


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """Yield a callback that draws on standard error while the block runs."""
    if not sys.stderr.isatty():
        yield no_progress
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        tasks: dict[str, object] = {}

        def report(what: str, done: int, total: int) -> None:
            if what not in tasks:
                tasks[what] = bar.add_task(what, total=total)
            bar.update(tasks[what], completed=done, total=total)  # type: ignore[arg-type]

        yield report
