"""What all commands share: options, messages, and how errors end."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from postproc.exceptions import FileError, PostprocError, printable

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Compensate robot programs with a model learned from laser-tracker data.",
)

CellOption = Annotated[Path, typer.Option("--cell", help="Cell file (TOML).")]
ModelOption = Annotated[Path, typer.Option("--model", help="Model file (JSON).")]
SeedOption = Annotated[int, typer.Option("--seed", help="Seed of every random draw.")]


JsonOption = Annotated[
    str | None, typer.Option("--json", help="Write JSON to a file, - for stdout.")
]
LsvOption = Annotated[
    Path | None, typer.Option("--lsv", help="Variable file, default PROGRAM.lsv.")
]
HtmlOption = Annotated[
    Path | None, typer.Option("--html", help="Write a report (HTML) here.")
]
CloneOption = Annotated[
    bool, typer.Option("--clone", help="Clone variables whose arrivals disagree.")
]
OrientationOption = Annotated[
    bool,
    typer.Option("--orientation", help="Correct orientations too, not only places."),
]
ProcessesOption = Annotated[
    int,
    typer.Option(
        "--jobs", "-j", min=0, help="Processes; 0: one for a core, 8 at the most."
    ),
]
TemperatureOption = Annotated[
    float | None, typer.Option("--temperature", help="Arm temperature [deg C].")
]


def say(text: str) -> None:
    """Print a message for a person, on stderr; no name in it steers the terminal."""
    typer.echo("\n".join(map(printable, text.split("\n"))), err=True)


@contextmanager
def explained(*files: Path | None) -> Iterator[None]:
    """Turn an error that the user can mend into a message and exit code 2.

    Args:
        *files: Programs that an error may name by their bare names.
    """
    try:
        yield
    except PostprocError as exc:
        say(f"postproc: {exc}")
        if isinstance(exc, FileError):
            from postproc.pointing import point_at

            if shown := point_at(exc, files):
                say(shown)
        raise typer.Exit(2) from None
    except KeyboardInterrupt:
        say("postproc: interrupted; nothing is half written. Run the command again")
        raise typer.Exit(2) from None
    except BrokenPipeError:
        sys.stderr.close()
        raise typer.Exit(2) from None


def split_names(text: str) -> list[str]:
    """Split a comma-separated list of names.

    >>> split_names("geometry, backlash,")
    ['geometry', 'backlash']
    """
    return [name.strip() for name in text.split(",") if name.strip()]


@contextmanager
def busy(doing: str) -> Iterator[None]:
    """Show on a terminal what is being done, where it lasts."""
    from postproc.stages import stages

    with stages() as told:
        told(doing)
        yield


def as_path(target: str | None) -> Path | None:
    """Name the file of an option that may be - for stdout."""
    return None if target is None else Path(target)


def write_text(target: str, text: str | Iterable[str]) -> None:
    """Write text to a file, or to stdout for ``-``; a long one piece by piece.

    Raises:
        OutputError: The file cannot be written.
    """
    from postproc.files import write_all

    if isinstance(text, str):
        text = [text if target != "-" or text.endswith("\n") else text + "\n"]
    if target == "-":
        sys.stdout.writelines(text)
    else:
        write_all({Path(target): map(str.encode, text)})
