"""What all commands share: options, messages, progress, and how errors end."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from enum import StrEnum
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, ParamSpec, TextIO, TypeVar

import typer

from postproc.cli.click_classes import Groups
from postproc.exceptions import FileError, OutputError, PostprocError, printable
from postproc.files import STREAM, disk_error, write_all

# What all commands share: options, messages, and how errors end.

P = ParamSpec("P")
R = TypeVar("R")

app = typer.Typer(
    cls=Groups,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Compensate robot programs with a model learned from laser-tracker data.",
)

CellOption = Annotated[
    Path | None,
    typer.Option("--cell", help="Cell file (TOML). Default: the project's."),
]
ModelOption = Annotated[
    Path | None,
    typer.Option("--model", help="Model file (JSON). Default: the project's."),
]

VariablesOption = Annotated[
    Path | None,
    typer.Option("--variables", help="Variable file (PDL2). Default: PROGRAM.lsv."),
]


class SharedPoints(StrEnum):
    """What is done with a point that several arrivals share."""

    MEAN = "mean"
    CLONE = "clone"
    LEAVE = "leave"


SharedPointsOption = Annotated[
    SharedPoints | None,
    typer.Option(
        "--shared-points",
        help="Points that moves share: mean correction, a clone for a move, or none.",
    ),
]


def _set_option(example: str) -> Any:
    """Return --set with an example of what the command follows."""
    text = f"Set a key of the cell for this run, such as {example}."
    return typer.Option("--set", metavar="SECTION.KEY=VALUE", help=text)


SetOption = Annotated[list[str] | None, _set_option("compensation.reapproach=true")]
SetMeasured = Annotated[list[str] | None, _set_option("measurements.unit=m")]
SetSurvey = Annotated[list[str] | None, _set_option("survey.seed=7")]
SetSimulated = Annotated[list[str] | None, _set_option("simulation.seed=2")]
OrientationOption = Annotated[
    bool,
    typer.Option("--orientation", help="Correct orientations too, not only places."),
]
EveryOption = Annotated[
    bool, typer.Option("--all", help="List equal findings one by one, not grouped.")
]
PathToleranceOption = Annotated[
    float | None,
    typer.Option(
        "--path-tolerance",
        metavar="MM",
        help="Insert points into moves whose predicted path error is larger.",
    ),
]


def changes_of(
    given: Sequence[str] | None,
    orientation: bool = False,
    shared_points: SharedPoints | None = None,
    path_tolerance: float | None = None,
) -> tuple[str, ...]:
    """Return what a run changes of the cell, as `load_cell` takes it."""
    found = list(given or ())
    if orientation:
        found.append("compensation.orientation=true")
    if shared_points is not None:
        found.append(f"compensation.shared_points={shared_points}")
    if path_tolerance is not None:
        found.append(f"compensation.path_tolerance_mm={path_tolerance!r}")
    return tuple(found)


def say(text: str) -> None:
    """Print a message for a person, on stderr; no name in it steers the terminal.

    Where stderr takes nothing, the exit code has to tell.
    """
    text = "\n".join(map(printable, text.split("\n")))
    with suppress(OSError):
        if is_terminal():
            from postproc.report.terminal import lay_out_message

            text = lay_out_message(text, sys.stderr)
        typer.echo(text, err=True)


def is_terminal() -> bool:
    """Return True if a person reads the messages on a terminal."""
    return sys.stderr is not None and sys.stderr.isatty()


def suggest(*words: object, **options: Path | None) -> None:
    """Print the next command to type, on a terminal only.

    Args:
        *words: The command.
        **options: Files that the user has named by options; the project has others.
    """
    if is_terminal():
        given = (f"--{name} {path}" for name, path in options.items() if path)
        say(f"next: postproc {' '.join([*map(str, words), *given])}")


def guard_output(command: Callable[P, R]) -> Callable[P, R]:
    """Let a command end with 2 and in words where a place takes what it prints no more.

    What it printed is written when it returns: later, nobody could tell.
    """

    @wraps(command)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            try:
                return command(*args, **kwargs)
            finally:
                if sys.stdout is not None:
                    sys.stdout.flush()
        except OSError as exc:
            raise typer.Exit(report_os_error(exc)) from None

    return run


def report_os_error(exc: OSError) -> int:
    """Say why the system refused to go on, and return the exit code.

    That somebody has read enough is nothing to tell.
    """
    with suppress(OSError, AttributeError, ValueError):
        # What is left in the buffer is for nobody; the interpreter would try again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    if exc.filename is not None:
        say(f"postproc: {FileError(exc.filename, str(exc.strerror), 'Check it')}")
    elif not isinstance(exc, BrokenPipeError):
        say(f"postproc: {disk_error(exc, 'standard output')}")
    return 2


@contextmanager
def report_errors(*files: Path | None) -> Iterator[None]:
    """Turn an error that the user can mend into a message and exit code 2.

    Args:
        *files: Programs that an error may name by their bare names.
    """
    try:
        yield
    except PostprocError as exc:
        say(f"postproc: {exc}")
        if isinstance(exc, FileError):
            from postproc.cli.source_excerpt import point_at

            if shown := point_at(exc, files):
                say(shown)
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
    if isinstance(text, str):
        text = [text if target != STREAM or text.endswith("\n") else text + "\n"]
    if target == STREAM:
        _stdout().writelines(text)
    else:
        write_all({Path(target): map(str.encode, text)})


def write_stdout(data: bytes) -> None:
    """Write bytes to standard output.

    Raises:
        OutputError: It is closed.
    """
    out = _stdout().buffer
    out.write(data)
    out.flush()


def _stdout() -> TextIO:
    """Return standard output.

    Raises:
        OutputError: It is closed.
    """
    if sys.stdout is None:
        raise OutputError("standard output", "is closed", "Name a file with -o")
    return sys.stdout


# What every command looks like in use; its --help shows them.

KEEP = "\b"  # begins a paragraph whose lines are not wrapped

EXAMPLES: dict[str, tuple[str, ...]] = {
    "compensate": (
        "postproc compensate job.pdl --cell cell.toml --model model.json",
        "postproc compensate job.pdl --cell cell.toml --model model.json"
        " -o out/job.pdl --report job.html",
        "cat job.pdl | postproc compensate - --cell cell.toml --model model.json > out",
        "cat job.pdl | postproc compensate - --variables job.lsv"
        " --variables-out new.lsv --cell cell.toml --model model.json > new.pdl",
    ),
    "diff": (
        "postproc diff job.pdl out/job.pdl | less -S",
        "postproc diff job.pdl out/job.pdl --report -",
    ),
    "restore": (
        "postproc restore out/job.pdl",
        "postproc restore out/job.pdl -o original.pdl",
    ),
    "explain": (
        "postproc explain job.pdl --cell cell.toml",
        "postproc explain job.pdl --cell cell.toml --model model.json --line 42",
    ),
    "survey": (
        "postproc survey --cell cell.toml --poses 300 -o survey.pdl",
        "postproc survey --cell cell.toml --iso9283 -o iso.pdl",
    ),
    "iso9283": (
        "postproc iso9283 readings.csv --before before.csv --load '118 kg'"
        " --speed '200 mm/s'",
        "postproc iso9283 measured.csv --program iso.pdl --cell cell.toml",
    ),
    "simulate": (
        "postproc simulate survey.pdl --cell cell.toml -o measured.csv",
        "postproc simulate out/job.pdl --cell cell.toml --reference job.pdl",
        "postproc simulate out/job.pdl --cell cell.toml --track track.csv",
    ),
    "init": (
        "postproc init",
        "postproc init cell7 --arm irb6640-185-2.8 --tool 0,0,250"
        " --absolute-accuracy off",
    ),
    "read": (
        "postproc read measured.csv --cell cell.toml",
        "postproc read targets.xlsx --program survey.mod --cell cell.toml -o map.toml",
    ),
    "fit": (
        "postproc fit measured.csv --cell cell.toml -o model.json --report model.html",
        "postproc fit measured.csv --cell cell.toml -o model.json"
        " --set measurements.frame=tracker",
    ),
    "predict": (
        "postproc predict states.csv --cell cell.toml --model model.json -o errors.csv",
    ),
    "compare": (
        "postproc compare measured.csv --cell cell.toml --report methods.html",
        "postproc compare measured.csv --cell cell.toml --report methods.svg",
    ),
    "diagnose": (
        "postproc diagnose fresh.csv --cell cell.toml --model model.json"
        " -o better.json --report diagnosis.html",
        "postproc diagnose points.csv --program job.pdl --cell cell.toml"
        " --model model.json",
        "postproc diagnose --path track.csv --program job.pdl --cell cell.toml"
        " --model model.json",
    ),
    "history": ("postproc history better.json",),
    "report": (
        "postproc report model.json -o model.html",
        "postproc report diagnosis.json -o diagnosis.html",
    ),
    "batch": (
        "postproc batch nominal compensated --cell cell.toml --model model.json"
        " --jobs 8",
        "postproc batch nominal compensated --plan batch.toml --resume",
    ),
    "check": ("postproc check compensated --model model.json --source nominal",),
    "robot add": (
        "postproc robot add R010 --cell cell.toml --model model.json --line 3",
    ),
    "robot list": ("postproc robot list",),
    "robot show": ("postproc robot show R010",),
    "robot check": (
        "postproc robot check R010 readings.csv",
        "postproc robot check R010 points.csv --program check.pdl --report -",
    ),
    "robot event": (
        "postproc robot event R010 remastered --joints 2,3",
        "postproc robot event R010 crash --at 2026-11-28T07:30",
    ),
    "robot refresh": ("postproc robot refresh R010 readings.csv -o model.json",),
    "robot replace": ("postproc robot replace R010 R011 -o compensated",),
    "robot page": ("postproc robot page -o plant.html",),
    "robot backup": ("postproc robot backup -o copy.sqlite",),
    "arm list": ("postproc arm list",),
    "arm from-urdf": (
        "postproc arm from-urdf robot.urdf -o arm.toml",
        "postproc arm from-urdf robot.urdf --base base_link --tip flange",
        "postproc arm from-urdf robot.urdf -o arm.toml --verify new",
    ),
    "arm from-machine-dat": (
        "postproc arm from-machine-dat 'R1/Mada/$machine.dat' -o arm.toml",
    ),
}


def epilog(command: str) -> str | None:
    """Write the examples of a command for the end of its help."""
    if (lines := EXAMPLES.get(command)) is None:
        return None
    return "\n".join([KEEP, "Examples:", *(f"  {line}" for line in lines)])


# The running stage, shown to a person who waits; others load nothing for it.

PATIENCE = 2.0  # [s] before a person is shown what is being done


@contextmanager
def stages(
    out: TextIO | None = None, log: bool = False
) -> Iterator[Callable[[str], None]]:
    """Show on a terminal which stage is running, after some seconds.

    Args:
        out: Where to; default: stderr.
        log: Whether lines tell it where there is no terminal.

    Yields:
        A function that takes the name of every stage.
    """
    out = out or sys.stderr
    if not out.isatty():
        from postproc.report.terminal import StageLog

        yield StageLog(out) if log else lambda stage: None
        return
    told = _StageLine(out)
    timer = threading.Timer(PATIENCE, told.show)
    timer.daemon = True
    timer.start()
    try:
        yield told
    finally:
        timer.cancel()
        timer.join()  # it may be about to show something
        told.hide()


class _StageLine:
    """The newest stage, shown after some time."""

    def __init__(self, out: TextIO) -> None:
        self._out, self._stage = out, "starting"
        self._update: Callable[[str], None] = lambda stage: None
        self.hide: Callable[[], None] = lambda: None

    def __call__(self, stage: str) -> None:
        self._stage = printable(stage)
        self._update(self._stage)

    def show(self) -> None:
        """Begin to show it."""
        from postproc.report.terminal import show_status

        self._update, self.hide = show_status(self._out, self._stage)
        self._update(self._stage)  # another one may have begun just now
