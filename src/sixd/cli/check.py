"""``sixd check``."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from sixd.datasets.dataset import Dataset
    from sixd.results.fix import FixReport
    from sixd.results.lint import CheckReport, CheckRules
    from sixd.results.report_text import Line


@click.command("check")
@click.argument("files", metavar="FILE...", nargs=-1, required=True,
                type=click.Path(path_type=Path))  # fmt: skip
@click.option("--dataset", default=None, help="Check ids and image sizes too: a folder, or a name "
              "looked up in $BOP_PATH.")  # fmt: skip
@click.option("--protocol", default=None,
              help="Check kind and cap too and, with --dataset, the targets.")  # fmt: skip
@click.option("--split", default="test", show_default=True, help="Split of the dataset.")
@click.option("--strict", is_flag=True, help="Warnings fail too.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object (a list for several).")
@click.option("--fix", "out", type=click.Path(path_type=Path), default=None, metavar="OUT",
              help="Write a copy of the one FILE with all that can be mended safely.")  # fmt: skip
@click.option("--max-problems", type=click.IntRange(1), default=None,
              help="Problems of a kind that are listed; the rest is counted. Default: 5, with "
              "--json 10,000.")  # fmt: skip
@click.pass_context
def check_command(
    context: click.Context,
    files: tuple[Path, ...],
    dataset: str | None,
    protocol: str | None,
    split: str,
    strict: bool,
    as_json: bool,
    out: Path | None,
    max_problems: int | None,
) -> None:
    """Find everything that is wrong with results files. The same as `sixd.check_file(...)`.

    Exit codes: 0 all files are fine, 1 problems were found, 2 wrong use.
    """
    from sixd.errors import UsageError
    from sixd.results.fix import fix_file
    from sixd.results.limits import Limits
    from sixd.results.lint import check_file

    if out is not None and len(files) > 1:
        raise UsageError("--fix mends one file at a time; give one FILE")
    _refuse_missing(files)
    limits = Limits(problems=max_problems) if max_problems and as_json else Limits()
    opened = _opened(dataset, split)
    rules = _rules(protocol, opened)
    fixed = None if out is None else fix_file(files[0], out, limits=limits)
    # With --fix, what counts is what was written.
    checked = [out] if out is not None and fixed is not None and fixed.written else files
    reports = (check_file(f, opened, rules, strict=strict, limits=limits) for f in checked)
    ok = _print_json(reports, fixed) if as_json else _print_text(reports, fixed, max_problems)
    context.exit(0 if ok else 1)


def _refuse_missing(files: Iterable[Path]) -> None:
    """Name every file that is not there before any is read."""
    from sixd.errors import MissingDataError

    missing = [f"{file} is a folder" for file in files if file.is_dir()]
    missing += [f"{file} does not exist" for file in files if not file.exists()]
    if missing:
        raise MissingDataError(f"no results file: {', '.join(missing)}")


def _opened(dataset: str | None, split: str) -> Dataset | None:
    if dataset is None:
        return None
    from sixd.datasets.opening import open_dataset

    return open_dataset(dataset, split, bop_path=os.environ.get("BOP_PATH"))


def _rules(name: str | None, dataset: Dataset | None) -> CheckRules | None:
    if name is None:
        return None
    from sixd.evaluation.protocol import get_protocol

    return get_protocol(name).check_rules("test" if dataset is None else dataset.split)


def _print_json(reports: Iterable[CheckReport], fixed: FixReport | None) -> bool:
    ok = True
    records: list[dict[str, Any]] = []
    for report in reports:
        ok &= report.ok
        records.append(report.to_dict())
    if fixed is not None:
        records[0]["fix"] = {
            "file": fixed.file,
            "out": fixed.out,
            "written": fixed.written,
            "changes": [asdict(change) for change in fixed.changes],
        }
    click.echo(json.dumps(records[0] if len(records) == 1 else records, indent=2))
    return ok


def _print_text(
    reports: Iterable[CheckReport], fixed: FixReport | None, max_problems: int | None
) -> bool:
    from sixd.results.report_text import SHOWN_OF_A_KIND, fix_lines, report_lines

    shown = max_problems or SHOWN_OF_A_KIND
    ok = True
    if fixed is not None:
        _print_lines(fix_lines(fixed, shown))
    for report in reports:
        ok &= report.ok
        _print_lines(report_lines(report, shown))
    return ok


def _print_lines(lines: Iterable[Line]) -> None:
    if not sys.stdout.isatty():
        for _, text in lines:
            click.echo(text)
        return
    from rich.console import Console
    from rich.text import Text

    console = Console(highlight=False)
    styles = {
        "plain": "",
        "good": "green",
        "error": "bold red",
        "warning": "yellow",
        "faint": "dim",
    }
    for style, text in lines:
        console.print(Text(text, style=styles[style]), soft_wrap=True)
