"""Writes the pages of the docs that repeat what the code says: commands and API reference.

    python docs/generate.py

A test fails when a page is not what this would write.
"""

from __future__ import annotations

from pathlib import Path

import click

import sixd
from sixd.cli.main import cli

DOCS = Path(__file__).parent


def cli_page() -> str:
    """``--help`` of every command."""
    parts = ["# Commands", "Written by `docs/generate.py` from `--help`."]
    for name in [None, *sorted(cli.commands)]:
        command = cli if name is None else cli.commands[name]
        path = "sixd" if name is None else f"sixd {name}"
        context = click.Context(command, info_name=path, max_content_width=98, terminal_width=98)
        with context:
            text = command.get_help(context)
        parts += [f"## {path}", f"```text\n{text}\n```"]
    return "\n\n".join(parts) + "\n"


def reference_page() -> str:
    """Every name of the public API."""
    parts = ["# Python API", "Written by `docs/generate.py` from `sixd.__all__`."]
    options = "    options:\n      show_root_heading: false\n      show_root_toc_entry: false"
    for name in sorted(sixd.__all__, key=str.lower):
        if name == "__version__":
            continue
        home = sixd._HOME[name]
        parts += [f"## `sixd.{name}`", f"::: sixd.{home}.{name}\n{options}"]
    return "\n\n".join(parts) + "\n"


PAGES = {"cli.md": cli_page, "reference.md": reference_page}

if __name__ == "__main__":
    for file, page in PAGES.items():
        (DOCS / file).write_text(page())
