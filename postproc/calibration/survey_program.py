"""Write a survey as a robot program, in the language of the arm's controller."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.calibration.measured_program import plan_arrivals
from postproc.calibration.pose_design import design_survey
from postproc.calibration.reversal_design import STEPS, design_reversals
from postproc.exceptions import ProgramError
from postproc.files import write_all
from postproc.language.language import Language
from postproc.language.languages import file_named, language_of, languages
from postproc.language.measuring_program import (
    TITLE,
    MeasuringMove,
    MeasuringProgram,
    MountedProbe,
    name_of_file,
)
from postproc.robot.cell import Cell, SurveySection, as_cell
from postproc.robot.pose import MM

BACK = np.deg2rad(2.0)  # how far to the side every approach starts [rad]
SETTLE = 1.5  # [s] pause before the tracker reads
ANY_TOOL = 3  # probe points of a survey that holds for any tool


def plan_survey(
    cell: Cell,
    q: Floats,
    side: Floats,
    probe: Ints,
    name: str,
    reversals: Sequence[tuple[int, int]] = (),
) -> MeasuringProgram:
    """Plan a survey: every pose is reached twice, with all joints from the other side.

    Args:
        cell: The cell; its probe points become the program's tools.
        q: Joint angles of the poses, (n, 6) [rad].
        side: Arrival direction of every joint in the first approach, (n, 6), +1 or -1.
        probe: Index of the probe point that is measured, (n,).
        name: Program name.
        reversals: Poses, from 0, at which drives, from 0, turn back step by step.

    Returns:
        The program. The measurement ids are the pose number with a or b; of reversals
        the numbers of pose, drive and step.
    """
    measured = 2 * len(q) + len(reversals) * (1 + len(STEPS))
    more = f", and {len(reversals)} reversals" if reversals else ""
    count = f"{len(q)} poses, each from both sides{more}: {measured} measurements"
    heading = (
        f"{TITLE} {cell.arm.name}: {count}",
        "After a MEASURE comment: read the tracker when the next move has settled.",
    )
    steps: list[MountedProbe | MeasuringMove] = []
    mounted = -1
    for i in np.argsort(probe, kind="stable"):
        if probe[i] != mounted:
            mounted = int(probe[i])
            place = tuple((cell.probes[mounted] / MM).tolist())
            steps.append(MountedProbe(mounted + 1, place))
        for letter, sign in (("a", 1.0), ("b", -1.0)):
            steps.append(_move(q[i] - sign * BACK * side[i]))
            steps.append(_move(q[i], f"{i + 1}{letter}"))
        for drive in (drive for pose, drive in reversals if pose == i):
            steps += _reversal(cell, q[i], side[i], int(i), drive)
    centre = tuple((cell.payload_com / MM).tolist())
    return MeasuringProgram(
        name, heading, tuple(steps), SETTLE, cell.payload_mass, centre
    )


def _reversal(
    cell: Cell, q: Floats, side: Floats, pose: int, drive: int
) -> Iterator[MeasuringMove]:
    """Arrive from afar, and go steps of one drive back from there."""
    coupling = cell.arm.coupling
    back = -np.sign(coupling[drive] @ side) * np.linalg.inv(coupling)[:, drive]
    yield _move(q - BACK * side)
    for k, step in enumerate((0.0, *STEPS)):
        yield _move(q + step * back, f"{pose + 1}.{drive + 1}.{k}")


def _move(q: Floats, measured: str = "") -> MeasuringMove:
    return MeasuringMove(tuple(np.rad2deg(q).tolist()), measured)


def write_survey(
    cell: Cell | str | Path, output: Path, poses: int, job: Path | None = None
) -> str:
    """Design a survey as [survey] of the cell says, and write it as a program.

    Args:
        cell: The cell, or its file.
        output: The program to write; its suffix names the language.
        poses: Number of poses.
        job: A program whose working volume is surveyed; None: all that the arm reaches.

    Returns:
        What was written, with the observability of the design, in words.

    Raises:
        ProgramError: The arm has a controller of another language, or nothing that the
            job does is known.
        PostprocError: A wrong number of poses.
        OutputError: The program cannot be written.
    """
    cell = as_cell(cell)
    language = _language_for(cell, output)
    asked = cell.file.survey or SurveySection()
    arm, probes = cell.arm, cell.probes
    arrivals = None if job is None else plan_arrivals(job, cell)
    design = design_survey(
        arm, probes, poses, asked.mode, cell.tracker, asked.seed, arrivals
    )
    back = (
        design_reversals(arm, design, probes, asked.reversals)
        if asked.reversals
        else None
    )
    name, turns = name_of_file(output.stem), () if back is None else back.turns
    program = plan_survey(cell, design.q, design.side, design.probe, name, turns)
    text = language.write_measuring(program, output)
    write_all({output: text.encode("ascii")})
    summary = f"{output}: {design.summary()}"
    summary += "" if back is None else f"\n{len(turns)} {back.summary()}"
    if len(probes) < ANY_TOOL:
        summary += (
            f"\n{len(probes)} of {ANY_TOOL} probe points: the model will hold only for "
            f"tools with the tip there. Give {ANY_TOOL} under [survey] points_mm"
        )
    return summary


def _language_for(cell: Cell, output: Path) -> Language:
    """Return the language that a survey is written in.

    A file that is no program by its name is one of the arm's controller. A controller
    that runs no language of ours gets any of them, to be translated.

    Raises:
        ProgramError: The arm has a controller of another language.
    """
    run = [one for one in languages() if one.controller in cell.controllers]
    if not file_named(output).is_program:
        return (run or languages())[0]
    language = language_of(output.name)
    if run and language not in run:
        own, usual = " or ".join(cell.controllers), run[0].suffixes[0]
        raise ProgramError(
            output,
            f"the controller of {cell.arm.name} is of {own}, and {language.name} "
            f"programs run on those of {language.controller}",
            f"Write {output.stem}{usual}; if the controller is of "
            f'{language.controller}, write controller = "{language.controller}" under '
            f"[robot] of {cell.path}",
        )
    return language
