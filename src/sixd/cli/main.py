"""The ``sixd`` command: one thin command per verb. Parse, call the public function, print."""

from __future__ import annotations

import gc
import io
import os
import sys

import click

import sixd
from sixd.cli.check import check_command
from sixd.cli.demo import demo_command
from sixd.cli.evaluate import eval_command
from sixd.cli.protocols import protocols_command
from sixd.cli.show import show_command
from sixd.errors import SixdError


@click.group(
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    no_args_is_help=True,
)
@click.version_option(sixd.__version__, prog_name="sixd")
def cli() -> None:
    """Score, check and compare 6D object pose estimates as the BOP benchmark does.

    Exit codes: 0 done, 1 problems were found, 2 wrong use.
    """


for command in (check_command, demo_command, eval_command, protocols_command, show_command):
    cli.add_command(command)


def run() -> None:
    """Entry point: a user's mistake ends in a message and an exit code, never in a traceback."""
    # BLAS starts a thread per core at import; sixd's own threads do the work, so they only burn
    # time. Set before NumPy is first imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # A command ends soon and large arrays die by reference count: collecting cycles while a
    # compiler is imported is a tenth of a detection evaluation.
    gc.disable()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a pipe may not know the lines of a table
    try:
        code = cli(standalone_mode=False)
    except SixdError as error:
        click.echo(f"sixd: {error}", err=True)
        code = error.exit_code
    except click.ClickException as error:
        error.show()
        code = 2
    except (click.Abort, KeyboardInterrupt):
        click.echo("sixd: interrupted; files that were begun were not kept", err=True)
        code = 130
    except BrokenPipeError:
        # The reader of a pipe (head, less) has gone; what it wanted it has.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    except OSError as error:  # a name that is too long, a folder that may not be searched
        click.echo(f"sixd: {error.filename or ''}: {error.strerror or error}", err=True)
        code = 2
    sys.exit(code if isinstance(code, int) else 0)
