"""The command that begins a project: init."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from postproc.cli.common import app, report_errors, say
from postproc.cli.project import NAME
from postproc.exceptions import OutputError, PostprocError
from postproc.files import toml_text, write_all

CELL = "cell.toml"
OTHER = "other"  # controller of arms of other makers


class PlacesFrame(StrEnum):
    """The frame of measured positions."""

    BASE = "base"
    TRACKER = "tracker"


class OnOff(StrEnum):
    """Whether an option of a controller is on."""

    ON = "on"
    OFF = "off"


@dataclass(frozen=True)
class Answers:
    """What is known of a cell: see the options of `init`."""

    arm: str | None
    language: str | None
    tool: str | None
    nest: list[str] | None
    frame: PlacesFrame | None
    instrument: str | None
    accuracy: OnOff | None


@app.command()
def init(
    folder: Annotated[Path, typer.Argument(help="Where the files go.")] = Path("."),
    arm: Annotated[
        str | None, typer.Option("--arm", help="A shipped arm, or an arm file.")
    ] = None,
    language: Annotated[
        str | None,
        typer.Option("--language", help="Of the programs. Default: the arm's."),
    ] = None,
    tool: Annotated[
        str | None,
        typer.Option(
            "--tool",
            metavar="X,Y,Z[,A,E,R]",
            help="The TCP in the flange frame, mm and degrees (Euler ZYZ).",
        ),
    ] = None,
    nest: Annotated[
        list[str] | None,
        typer.Option(
            "--nest",
            metavar="X,Y,Z",
            help="A reflector in the flange frame, mm; repeat it. Default: the TCP.",
        ),
    ] = None,
    frame: Annotated[
        PlacesFrame | None,
        typer.Option("--frame", help="Of the measured positions. Default: base."),
    ] = None,
    instrument: Annotated[
        str | None, typer.Option("--instrument", help="What measures, as a text.")
    ] = None,
    accuracy: Annotated[
        OnOff | None,
        typer.Option(
            "--absolute-accuracy", help="The controller's own compensation of the arm."
        ),
    ] = None,
) -> None:
    """Write the cell and project files of a folder; on a terminal, ask for them.

    Exit 2: a file exists already, or an answer is wrong; nothing is written.
    """
    from postproc.robot.cell import explain_few_probes, load_cell

    with report_errors():
        places = [folder / CELL, folder / NAME]
        for place in places:
            if place.exists():
                cure = "Edit it, or give another folder"
                raise OutputError(place, "exists already and is not overwritten", cure)
        given = Answers(arm, language, tool, nest, frame, instrument, accuracy)
        if arm is None and _asks():
            given = _ask(given)
        if given.arm is None:
            cure = "give --arm NAME; `postproc arm list` lists the shipped ones"
            raise PostprocError(f"init: no arm and no terminal to ask on: {cure}")
        own = given.arm.endswith(".toml")
        whole = str(Path(given.arm).absolute()) if own else given.arm
        runs = _controller_of(given.arm)
        cell = load_cell(_cell_text(given, whole, runs), name=str(places[0]))
        text = _cell_text(given, _arm_beside(given.arm, folder), runs)
        folder.mkdir(parents=True, exist_ok=True)
        write_all({places[0]: text, places[1]: PROJECT.encode()})
        for name in ("programs", "compensated"):
            (folder / name).mkdir(exist_ok=True)
        suffix = _suffix(cell.controllers)
        say(f"written {places[0]} and {places[1]}")
        if few := explain_few_probes(cell):
            say(few)
        say(f"next: postproc survey --poses 300 -o {folder / f'survey{suffix}'}")


PROJECT = """\
# What commands use in this folder where no option states it; places are relative to it.
cell = "cell.toml"
model = "model.json"          # `fit` writes it, `compensate` and others use it
source = "programs"           # of `batch` and `check`
output = "compensated"        # where compensated programs go
"""


def _suffix(controllers: tuple[str, ...]) -> str:
    """Return the suffix of programs that a controller runs."""
    from postproc.language.languages import languages

    found = [one for one in languages() if one.controller in controllers]
    return (found or list(languages()))[0].suffixes[0]


def _arm_beside(arm: str, folder: Path) -> str:
    """Return the name of a shipped arm, or the place of an arm file from the cell."""
    place = Path(arm)
    if place.suffix != ".toml" or place.is_absolute():
        return arm
    return Path(os.path.relpath(place, folder)).as_posix()


def _cell_text(given: Answers, arm: str, runs: object) -> bytes:
    """Write a cell file.

    Args:
        given: What is known of the cell.
        arm: The arm, as the cell names it.
        runs: Whose controllers run it, as its file has it.
    """
    lines = [
        "# Lengths in mm, angles in degrees (Euler ZYZ).",
        "",
        "[robot]",
        f"arm = {toml_text(arm)}",
        *_robot_lines(given, runs),
        *_tool_lines(given.tool),
        *_survey_lines(given.nest or []),
        *_measurement_lines(given.frame, given.instrument),
        "",
    ]
    return "\n".join(lines).encode()


def _controller_of(arm: str) -> object:
    """Return whose controllers run an arm, as its file has it."""
    from postproc.robot.arm import load_arm

    return load_arm(arm).file.controller


def _controller_running(language: str | None) -> str | None:
    """Return whose controllers run a language, by its name.

    Raises:
        PostprocError: There is no such language.
    """
    from postproc.language.languages import languages

    if language is None:
        return None
    known = {one.name.lower(): one.controller for one in languages()}
    if language.lower() not in known:
        listed = ", ".join(known)
        raise PostprocError(f"--language {language}: give one of {listed}")
    return known[language.lower()]


def _robot_lines(given: Answers, runs: object) -> list[str]:
    """Write [robot] but for the arm; the controller only where it is not the arm's."""
    lines = []
    own = runs if isinstance(runs, list) else [runs]
    wanted = _controller_running(given.language)
    if wanted is not None and wanted not in own:
        lines.append(f"controller = {toml_text(wanted)}")
    if given.accuracy is not None:
        state = "true" if given.accuracy is OnOff.ON else "false"
        lines.append(
            f"absolute_accuracy = {state}  # the controller's own compensation"
        )
    return lines


def _tool_lines(tool: str | None) -> list[str]:
    """Write [tool]."""
    if not tool:
        return []
    numbers = _numbers("--tool", tool, (3, 6))
    lines = ["", "[tool]", f"xyz_mm = {numbers[:3]}"]
    if len(numbers) > 3:
        lines.append(f"euler_zyz_deg = {numbers[3:]}")
    return [*lines, 'source = "cad"']


def _survey_lines(nests: list[str]) -> list[str]:
    """Write [survey]."""
    if not nests:
        return []
    points = [f"    {_numbers('--nest', nest, (3,))}," for nest in nests]
    return ["", "[survey]", "points_mm = [", *points, "]"]


def _measurement_lines(frame: PlacesFrame | None, instrument: str | None) -> list[str]:
    """Write [measurements]."""
    lines = ["", "[measurements]"]
    if frame is not None:
        lines.append(f"frame = {toml_text(frame)}")
    if instrument:
        lines.append(f"instrument = {toml_text(instrument)}")
    return lines if len(lines) > 2 else []


def _numbers(option: str, text: str, counts: tuple[int, ...]) -> list[float]:
    """Read numbers between commas.

    Raises:
        PostprocError: They are none, or not as many as needed.
    """
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts:
        many = " or ".join(map(str, counts))
        raise PostprocError(f"{option} {text}: give {many} numbers between commas")
    return numbers


# Questions on a terminal.


def _asks() -> bool:
    """Return True if a person can answer."""
    return sys.stdin is not None and sys.stdin.isatty()


def _ask(given: Answers) -> Answers:
    """Ask for all that no option states; Enter takes what stands in brackets."""
    arm = _ask_arm()
    language, tool, nest = given.language, given.tool, given.nest
    frame, instrument, accuracy = given.frame, given.instrument, given.accuracy
    if language is None:
        language = _ask_language(arm)
    if tool is None:
        tool = _prompt("Tool: its TCP in the flange frame, x,y,z[,a,e,r] in mm and deg")
    if nest is None:
        text = _prompt(
            "Reflectors in the flange frame, x,y,z; x,y,z; .. (none: the TCP)"
        )
        nest = [part.strip() for part in text.split(";") if part.strip()]
    if frame is None:
        frame = PlacesFrame(_choose("Frame of the measured positions", PlacesFrame))
    if instrument is None:
        instrument = _prompt("Instrument, for the record")
    if accuracy is None:
        text = "The controller's own absolute accuracy for this arm"
        accuracy = OnOff(_choose(text, (OnOff.OFF, OnOff.ON)))
    return Answers(arm, language, tool, nest, frame, instrument, accuracy)


def _ask_arm() -> str:
    """Ask for the brand, then for one of its arms, or an arm file."""
    from postproc.robot.arm_file import list_shipped_arms

    brands = {name: str(_controller_of(name)) for name in list_shipped_arms()}
    brand = _choose("Brand", [*sorted(set(brands.values()) - {OTHER}), OTHER])
    arms = [name for name, own in brands.items() if own == brand]
    say(f"Shipped arms: {', '.join(arms)}. `postproc arm from-urdf` writes others.")
    return str(typer.prompt("Arm, or an arm file", default=arms[0], err=True))


def _ask_language(arm: str) -> str:
    """Ask for the language; that of the arm's controller is proposed."""
    from postproc.language.languages import languages

    own = _controller_of(arm)
    ranked = sorted(languages(), key=lambda one: one.controller != own)
    return _choose("Language of the programs", [one.name.lower() for one in ranked])


def _choose(text: str, words: Iterable[str]) -> str:
    """Ask for one of some words, until it is one; the first is proposed."""
    listed = [str(word) for word in words]
    question = f"{text} ({', '.join(listed)})"
    while True:
        answer = (
            str(typer.prompt(question, default=listed[0], err=True)).strip().lower()
        )
        if answer in listed:
            return answer
        say(f"{answer} is none of {', '.join(listed)}")


def _prompt(text: str) -> str:
    """Ask for a text that may be empty."""
    return str(typer.prompt(text, default="", show_default=False, err=True)).strip()
