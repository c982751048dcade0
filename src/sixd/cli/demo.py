"""``sixd demo``."""

from __future__ import annotations

import json
from pathlib import Path

import click


@click.command("demo")
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=Path("sixd-demo"),
              show_default=True, help="Where everything is written.")  # fmt: skip
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    help="Another seed, other scenes.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def demo_command(out: Path, seed: int, as_json: bool) -> None:
    """Make a small dataset and results of known quality; check and score them.

    The results are the truth, perturbed slightly, moderately and strongly: no method made them.
    """
    from sixd.cli.progress import prepare_kernels, progress_bar
    from sixd.report.tables import evaluation_table
    from sixd.synth.demo_run import run_demo

    prepare_kernels()
    with progress_bar() as progress:
        run = run_demo(out, seed=seed, progress=progress)
    if as_json:
        record = {
            "dataset": str(run.dataset),
            "results": list(map(str, run.results)),
            "saved": list(map(str, run.saved)),
            "n_problems": run.n_problems,
            "evaluations": [e.summary() for e in run.evaluations],
        }
        click.echo(json.dumps(record, indent=2))
        return
    click.echo(evaluation_table(run.evaluations), nl=False)
    click.echo("The results are the truth, perturbed; no method made them.")
    click.echo(f"dataset      {run.dataset}  (BOP layout; look into test/000001/rgb)")
    click.echo(f"results      {run.results[0].parent}  ({len(run.results)} files, "
               f"{run.n_problems} problems found by sixd check)")  # fmt: skip
    click.echo(f"evaluations  {run.saved[0].parent}")
    click.echo(f"next         sixd show {run.saved[0]} --by object")
    click.echo(f"             sixd eval {run.results[0]} --dataset {run.dataset}")
