"""Commands on the record of robots: add, list, show, check, event, refresh, .."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from postproc.cli.common import (
    CellOption,
    ModelOption,
    app,
    report_errors,
    say,
    stages,
    write_text,
)
from postproc.cli.project import cell_file, find_project, model_file
from postproc.cli.reports import ReportOption, Reports
from postproc.exceptions import PostprocError, RecordError
from postproc.files import check_places

if TYPE_CHECKING:
    from postproc.record.database import Record
    from postproc.record.robots import CheckFile, Release

robot = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Keep the record of robots: models, checks, events, stale programs.",
)
app.add_typer(robot, name="robot")

RecordOption = Annotated[
    Path | None,
    typer.Option("--record", help="Record. Default: plant.sqlite of the project."),
]
Serial = Annotated[str, typer.Argument(help="Serial number of the robot.")]
Readings = Annotated[Path, typer.Argument(help="Readings of a check (CSV).")]
ProgramOption = Annotated[
    Path | None,
    typer.Option("--program", help="Check program, for files of id, x, y, z."),
]
At = Annotated[
    str | None, typer.Option("--at", help="When, as 2026-11-28T07:30. Default: now.")
]
Operator = Annotated[str, typer.Option("--operator", help="Who read them.")]


def record_file(given: Path | None, beside: Path | None = None) -> Path:
    """Return the record of an option, else of the project or the working folder."""
    from postproc.record.database import NAME

    if given is not None:
        return given
    project = find_project(beside)
    return (Path() if project is None else project.path.parent) / NAME


@contextmanager
def _open(record: Path | None, create: bool = False) -> Iterator[Record]:
    from postproc.record.database import open_record

    with report_errors(), open_record(record_file(record), create) as found:
        yield found


def _moment(text: str | None) -> str:
    from postproc.record.life import moment

    try:
        return moment(text)
    except ValueError:
        raise PostprocError(
            f"--at {text}: write a date, as 2026-11-28, or 2026-11-28T07:30"
        ) from None


def _readings_of(
    file: Path, program: Path | None, at: str | None, operator: str
) -> CheckFile:
    from postproc.record.robots import CheckFile

    return CheckFile(file, program, _moment(at), operator)


@robot.command("add")
def add(
    serial: Serial,
    cell: CellOption = None,
    model: ModelOption = None,
    line: Annotated[str, typer.Option("--line", help="Where it stands.")] = "",
    record: RecordOption = None,
) -> None:
    """Add a robot with the model of its survey, or the model of a newer survey."""
    from postproc.record.robots import NewModel, add_robot

    with report_errors():
        new = NewModel.read(serial, cell_file(cell), model_file(model))
    with _open(record, create=True) as found:
        add_robot(found, serial, new, line)
        say(f"{serial} is in {found.path}")


@robot.command("list")
def list_(record: RecordOption = None) -> None:
    """List the robots and how they are."""
    from postproc.report.record import list_robots

    with _open(record) as found:
        typer.echo(list_robots(found))


@robot.command("show")
def show(serial: Serial, record: RecordOption = None) -> None:
    """Show the life of a robot: models, events, checks."""
    from postproc.record.life import Life
    from postproc.report.record import show_robot

    with _open(record) as found:
        typer.echo(show_robot(Life.of(found, serial)))


@robot.command("check")
def check(
    serial: Serial,
    readings: Readings,
    program: ProgramOption = None,
    at: At = None,
    operator: Operator = "",
    record: RecordOption = None,
    report: ReportOption = None,
) -> None:
    """Check a robot: exit 0 in control, 1 it has moved, 2 error.

    Readings are compared with what its survey and all checks since expect. Three fixed
    points of the survey and two nests tell the base from the arm, and the tool from its
    last joint.
    """
    from postproc.record.robots import check_robot
    from postproc.report.record import check_json, tell_check

    with _open(record) as found:
        reports = Reports.of(report)
        check_places(reports.files, [readings, program, found.path])
        with stages() as told:
            told("follow the robot since its survey")
            given = _readings_of(readings, program, at, operator)
            verdict, known = check_robot(found, serial, given)
        reports.write_json(lambda: check_json(serial, verdict))
        if not reports.on_stdout:
            typer.echo(tell_check(serial, verdict, known))
    raise typer.Exit(0 if verdict.in_control else 1)


@robot.command("event")
def event(
    serial: Serial,
    kind: Annotated[
        str,
        typer.Argument(
            help="remastered, motor, gear, arm, tool, base, crash, payload or software."
        ),
    ],
    joints: Annotated[
        str | None, typer.Option("--joints", help="Its joints, as 2,3. Default: all.")
    ] = None,
    at: At = None,
    note: Annotated[str, typer.Option("--note", help="A remark.")] = "",
    record: RecordOption = None,
) -> None:
    """Record what happened to a robot: what that can have changed is open again."""
    from postproc.record.robots import note_event

    with _open(record) as found:
        try:
            numbers = tuple(int(j) for j in (joints or "").split(",") if j.strip())
        except ValueError:
            problem, cure = f"--joints {joints}", "Write numbers, as 2,3"
            raise RecordError(found.path, problem, cure) from None
        row = note_event(found, serial, kind, numbers, _moment(at), note)
        say(f"{serial}: {row.kind} {row.joints}".rstrip() + f" at {row.date}")


@robot.command("refresh")
def refresh(
    serial: Serial,
    readings: Readings,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="MODEL.json. Default: SERIAL-DATE.json."),
    ] = None,
    program: ProgramOption = None,
    at: At = None,
    operator: Operator = "",
    record: RecordOption = None,
) -> None:
    """Make a robot's model new by a few readings, and name the stale programs.

    Exit 1: there are stale programs.
    """
    from postproc.record.robots import refresh_robot
    from postproc.report.record import tell_refresh

    with _open(record) as found:
        given = _readings_of(readings, program, at, operator)
        place = output or found.path.parent / f"{serial}-{given.date[:10]}.json"
        check_places([place], [readings, program, found.path])
        if output is None and place.exists():
            raise RecordError(place, "exists already", "Name another place with -o")
        with stages() as told:
            done = refresh_robot(found, serial, given, place, told)
        typer.echo(tell_refresh(serial, done, str(place)))
    raise typer.Exit(1 if any(s.is_stale() for s in done.stale) else 0)


@robot.command("replace")
def replace(
    old: Annotated[str, typer.Argument(help="Serial number of the old robot.")],
    new: Annotated[str, typer.Argument(help="Serial number of the one in its place.")],
    folder: Annotated[
        Path, typer.Option("-o", "--output", help="Folder of the new programs.")
    ],
    record: RecordOption = None,
) -> None:
    """Compensate the programs of one robot for the robot that takes its place.

    Exit 1: a program is not written, or targets keep their values.
    """
    from postproc.record.replacement import replace_robot
    from postproc.report.record import tell_replacement

    with _open(record) as found:
        with stages() as told:
            told("compensate programs")
            done = replace_robot(found, old, new, folder)
        typer.echo(tell_replacement(new, done))
    raise typer.Exit(1 if any(p.why or p.uncorrected for p in done) else 0)


@robot.command("page")
def page(
    output: Annotated[Path, typer.Option("-o", "--output", help="PLANT.html")],
    record: RecordOption = None,
) -> None:
    """Write a page of all robots with their control charts."""
    from postproc.report.html.plant import plant_page

    with _open(record) as found:
        check_places([output], [found.path])
        write_text(str(output), plant_page(found))
        say(f"written {output}")


@robot.command("backup")
def backup(
    output: Annotated[Path, typer.Option("-o", "--output", help="COPY.sqlite")],
    record: RecordOption = None,
) -> None:
    """Copy the record as it is at one moment, also while others write to it."""
    with _open(record) as found:
        check_places([output], [found.path])
        if output.exists():
            raise RecordError(output, "exists already", "Name another place with -o")
        found.back_up(output)
        say(f"written {output}")


def release(beside: Path, releases: Callable[[], list[Release]]) -> None:
    """Record compensated programs in the record of the project, if there is one.

    Args:
        beside: A program, or the folder of them: its project's record counts.
        releases: Lists the programs.

    Raises:
        RecordError: The record cannot be used.
    """
    place = record_file(None, beside)
    if not place.exists() or not (found := releases()):
        return
    from postproc.record.database import open_record
    from postproc.record.robots import note_releases, tell_outdated

    with open_record(place) as record:
        note_releases(record, found)
        for line in tell_outdated(record, found):
            say(f"warning: {line}")
