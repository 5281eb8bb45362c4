"""The command line: arguments, a call, and what is printed."""

from __future__ import annotations

from typing import Annotated

import typer

from postproc import __version__
from postproc.cli import loop, models, plant, programs
from postproc.cli.common import app

__all__ = ["app", "loop", "main", "models", "plant", "programs"]


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
    """Run the command line."""
    app()
