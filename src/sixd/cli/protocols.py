"""``sixd protocols``."""

from __future__ import annotations

import json

import click


@click.command("protocols")
@click.option("--json", "as_json", is_flag=True, help="Print a JSON list.")
def protocols_command(as_json: bool) -> None:
    """List the evaluation protocols."""
    from dataclasses import asdict

    from sixd.evaluation.protocol import PROTOCOLS

    if as_json:
        click.echo(json.dumps([asdict(p) for p in PROTOCOLS.values()], indent=2))
        return
    width = max(map(len, PROTOCOLS))
    for protocol in PROTOCOLS.values():
        click.echo(f"{protocol.name:<{width}}  {protocol.title}")
