"""``sixd show``."""

from __future__ import annotations

import json
from pathlib import Path

import click


@click.command("show")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--by", type=click.Choice(["object", "scene", "threshold", "visibility"]), default=None,
    help="Break the scores down.",
)  # fmt: skip
@click.option("--export", type=click.Path(path_type=Path), default=None,
              help="Write every measured error to this .csv or .parquet file.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def show_command(file: Path, by: str | None, export: Path | None, as_json: bool) -> None:
    """Show a saved evaluation; needs no dataset."""
    from sixd.evaluation.evaluation import load_evaluation
    from sixd.report.tables import breakdown_rows, breakdown_table, evaluation_table

    evaluation = load_evaluation(file)
    if export:
        evaluation.export_errors(export)
    if as_json:
        record = evaluation.summary()
        if by:
            record["by"] = by
            record["rows"] = breakdown_rows(evaluation.by(by))
        click.echo(json.dumps(record, indent=2))
        return
    click.echo(evaluation_table([evaluation]), nl=False)
    if by:
        click.echo(breakdown_table(evaluation.by(by)), nl=False)
    if export:
        click.echo(f"errors written to {export}")
