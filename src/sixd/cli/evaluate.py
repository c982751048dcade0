"""``sixd eval``."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from sixd.evaluation.evaluation import Evaluation


@click.command("eval")
@click.argument("results", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--dataset", required=True,
              help="Folder of a dataset, or a name looked up in $BOP_PATH.")  # fmt: skip
@click.option("--protocol", default=None,
              help="Which rules; `sixd protocols` lists them. Default: bop19-localization for "
              "poses, bop22-detection2d for 2D detections.")  # fmt: skip
@click.option("--split", default="test", show_default=True, help="Split of the dataset.")
@click.option("--targets", default=None,
              help="Another list of targets: a path, or a file of the dataset.")  # fmt: skip
@click.option("--errors", default=None, metavar="LIST",
              help="Measure only these errors of the protocol, as mssd,mspd. Without all of them "
              "there is no headline score.")  # fmt: skip
@click.option("--workers", type=click.IntRange(1), default=None,
              help="Threads. Default: all cores.")  # fmt: skip
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), default=None,
              help="Save the evaluation to this file, for `sixd show`.")  # fmt: skip
@click.option("--bop-out", type=click.Path(path_type=Path, file_okay=False), default=None,
              help="Also write bop_toolkit's score files into this folder.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object (a list for several).")
def eval_command(
    results: tuple[Path, ...],
    dataset: str,
    protocol: str | None,
    split: str,
    targets: str | None,
    errors: str | None,
    workers: int | None,
    out: Path | None,
    bop_out: Path | None,
    as_json: bool,
) -> None:
    """Score one or several results files. The same as `sixd.evaluate(...)`."""
    from sixd.cli.progress import prepare_kernels, progress_bar
    from sixd.datasets.opening import open_dataset
    from sixd.errors import UsageError
    from sixd.evaluation.bop_files import check_bop_files
    from sixd.evaluation.evaluate import evaluate_all
    from sixd.evaluation.protocol import default_protocol, get_protocol

    if out and len(results) > 1:
        raise UsageError("--out names one file, so it goes with one results file")
    chosen = get_protocol(protocol or default_protocol(results[0]))
    names = None if errors is None else tuple(e.strip() for e in errors.split(","))
    if bop_out:
        check_bop_files(chosen, names, results)
    opened = open_dataset(dataset, split, bop_path=os.environ.get("BOP_PATH"))
    if chosen.kind == "pose":
        prepare_kernels()
    with progress_bar() as progress:
        evaluations = evaluate_all(
            results, opened, chosen, targets=targets, errors=names, workers=workers,
            progress=progress,
        )  # fmt: skip
    _write(evaluations, out, bop_out)
    _print(evaluations, out, as_json)


def _write(evaluations: list[Evaluation], out: Path | None, bop_out: Path | None) -> None:
    from sixd.evaluation.bop_files import write_bop_files

    for evaluation in evaluations:
        if out:
            evaluation.save(out)
        if bop_out:
            write_bop_files(evaluation, bop_out)


def _print(evaluations: list[Evaluation], out: Path | None, as_json: bool) -> None:
    if as_json:
        records = [e.summary() for e in evaluations]
        click.echo(json.dumps(records[0] if len(records) == 1 else records, indent=2))
        return
    from sixd.report.tables import evaluation_table

    click.echo(evaluation_table(evaluations), nl=False)
    if out:
        click.echo(f"saved to {out}; see it again with: sixd show {out} --by object")
