"""All commands, as one application."""

from __future__ import annotations

from typing import Annotated

import typer

from postproc import __version__
from postproc.cli import loop, models, plant, programs
from postproc.cli.common import app, epilog, guarded

NAME = "__name__"  # a command is called like its function

__all__ = ["app", "loop", "models", "plant", "programs"]

for _command in app.registered_commands:
    _command.epilog = epilog(str(_command.name or getattr(_command.callback, NAME)))
    if _command.callback is not None:
        _command.callback = guarded(_command.callback)


@app.callback(invoke_without_command=True)
def _main(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.")
    ] = False,
) -> None:
    if version:
        typer.echo(f"postproc {__version__}")
        raise typer.Exit(0)
