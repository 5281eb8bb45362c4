"""All commands, as one application."""

from __future__ import annotations

from typing import Annotated

import typer

from postproc import __version__
from postproc.cli import arms, loop, models, plant, programs
from postproc.cli.common import app, epilog, guarded

NAME = "__name__"  # a command is called like its function

__all__ = ["app", "arms", "loop", "models", "plant", "programs"]

for _group, _commands in (
    ("", app.registered_commands),
    ("arm ", arms.arm.registered_commands),
):
    for _command in _commands:
        _name = str(_command.name or getattr(_command.callback, NAME))
        _command.epilog = epilog(_group + _name)
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
