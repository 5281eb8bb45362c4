"""The command line: arguments, a call, and what is printed."""

from __future__ import annotations

import os
import signal
import sys
from typing import Annotated

import typer

from postproc import __version__
from postproc.cli import loop, models, plant, programs
from postproc.cli.common import app, epilog, say

NAME = "__name__"  # a command is called like its function

__all__ = ["app", "loop", "main", "models", "plant", "programs"]

for _command in app.registered_commands:
    _command.epilog = epilog(str(_command.name or getattr(_command.callback, NAME)))


@app.callback(invoke_without_command=True)
def _main(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.")
    ] = False,
) -> None:
    if version:
        typer.echo(f"postproc {__version__}")
        raise typer.Exit(0)


def main() -> None:
    """Run the command line; a defect of ours ends with 2, like all that failed."""
    # SIGTERM ends a command as Ctrl-C does: what was begun is cleaned up.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        app()
    except Exception as exc:
        if os.environ.get("POSTPROC_DEBUG"):
            raise
        say(
            f"postproc: internal error: {type(exc).__name__}: {exc}. Nothing more was "
            "written. Set POSTPROC_DEBUG=1 for the trace, and please report it"
        )
        sys.exit(2)
