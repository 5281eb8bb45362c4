"""All commands, as one application."""

from __future__ import annotations

from copy import copy
from typing import Annotated

import typer
from typer.models import CommandInfo

from postproc import __version__
from postproc.cli import (
    arms,
    iso9283,
    loop,
    models,
    plant,
    programs,
    robot,
    setup,
)
from postproc.cli.click_classes import Command
from postproc.cli.common import app, epilog, guard_output

NAME = "__name__"  # a command is called like its function

__all__ = [
    "app", "application", "arms", "iso9283", "loop", "models", "plant", "programs",
    "robot",
    "setup",
]  # fmt: skip


def _name_of(command: CommandInfo) -> str:
    return str(command.name or getattr(command.callback, NAME))


for _group, _commands in (
    ("", app.registered_commands),
    ("arm ", arms.arm.registered_commands),
    ("robot ", robot.robot.registered_commands),
):
    for _command in _commands:
        _command.cls = Command
        _command.epilog = epilog(_group + _name_of(_command))
        if _command.callback is not None:
            _command.callback = guard_output(_command.callback)


@app.callback(invoke_without_command=True)
def _main(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.")
    ] = False,
) -> None:
    if version:
        typer.echo(f"postproc {__version__}")
        raise typer.Exit(0)


def application(first: str) -> typer.Typer:
    """Return the application; with that command alone, where there is one of the name.

    To prepare one takes 1 ms, all of them 18.
    """
    named = [c for c in app.registered_commands if _name_of(c) == first]
    if not named:
        return app
    alone = copy(app)
    alone.registered_commands, alone.registered_groups = named, []
    return alone
