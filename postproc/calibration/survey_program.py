"""Write a survey as a robot program, in the language of the arm's controller."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.calibration.check_design import CheckDesign, design_check
from postproc.calibration.measured_program import plan_arrivals
from postproc.calibration.pose_design import design_survey, short_order
from postproc.calibration.reversal_design import STEPS, design_reversals
from postproc.exceptions import ProgramError
from postproc.files import write_all
from postproc.language.language import Language
from postproc.language.languages import file_named, language_of, languages
from postproc.language.measuring_program import (
    GENTLY,
    SHARE,
    TITLE,
    MeasuringMove,
    MeasuringProgram,
    MountedProbe,
    name_of_file,
)
from postproc.model.model import Model
from postproc.robot.cell import Cell, SurveySection, as_cell, explain_few_probes
from postproc.robot.pose import MM

BACK = np.deg2rad(2.0)  # how far to the side every approach starts [rad]
READING = 3.0  # [s] of the tracker for one reading, about
SETTLE = 1.5  # [s] pause before the tracker reads
AFTER_MEASURE = (
    "After a MEASURE comment: read the tracker when the next move has settled."
)


def plan_survey(
    cell: Cell,
    q: Floats,
    side: Floats,
    probe: Ints,
    name: str,
    reversals: Sequence[tuple[int, int]] = (),
    short: bool = False,
) -> MeasuringProgram:
    """Plan a survey: every pose is reached twice, with all joints from the other side.

    Args:
        cell: The cell; its probe points become the program's tools.
        q: Joint angles of the poses, (n, 6) [rad].
        side: Arrival direction of every joint in the first approach, (n, 6), +1 or -1.
        probe: Index of the probe point that is measured, (n,).
        name: Program name.
        reversals: Poses, from 0, at which drives, from 0, turn back step by step.
        short: Order the poses so that moves are short.

    Returns:
        The program. The measurement ids are the pose number with a or b; of reversals
        the numbers of pose, drive and step.
    """
    measured = 2 * len(q) + len(reversals) * (1 + len(STEPS))
    more = f", and {len(reversals)} reversals" if reversals else ""
    count = f"{len(q)} poses, each from both sides{more}: {measured} measurements"
    heading = (
        f"{TITLE} {cell.arm.name}: {count}",
        AFTER_MEASURE,
    )
    steps: list[MountedProbe | MeasuringMove] = []
    mounted = -1
    order = np.argsort(probe, kind="stable")
    if short:
        order = short_order(q, probe, joint_speeds(cell))
    for i in order:
        if probe[i] != mounted:
            mounted = int(probe[i])
            steps.append(_mount(cell, mounted))
        for letter, sign in (("a", 1.0), ("b", -1.0)):
            steps += _reading(q[i], sign * side[i], f"{i + 1}{letter}")
        for drive in (drive for pose, drive in reversals if pose == i):
            steps += _reversal(cell, q[i], side[i], int(i), drive)
    return _program(cell, name, heading, steps)


def plan_check(cell: Cell, check: CheckDesign, name: str) -> MeasuringProgram:
    """Plan a check, its readings in their order; the last one repeats the first.

    Args:
        cell: The cell; its probe points become the program's tools.
        check: What is read.
        name: Program name.
    """
    heading = (
        f"{TITLE} {cell.arm.name}: a check of {len(check.q)} readings, "
        "the last one repeats the first",
        AFTER_MEASURE,
    )
    steps: list[MountedProbe | MeasuringMove] = []
    mounted = -1
    columns = check.q, check.side, check.probe.tolist(), check.names
    for q, side, probe, reading in zip(*columns, strict=True):
        if probe != mounted:
            mounted = probe
            steps.append(_mount(cell, mounted))
        steps += _reading(q, side, reading)
    return _program(cell, name, heading, steps)


def _program(
    cell: Cell,
    name: str,
    heading: tuple[str, ...],
    steps: Sequence[MountedProbe | MeasuringMove],
) -> MeasuringProgram:
    """Put a program together, with the payload of the cell."""
    centre = tuple((cell.payload_com / MM).tolist())
    return MeasuringProgram(
        name, heading, tuple(steps), SETTLE, cell.payload_mass, centre
    )


def _mount(cell: Cell, probe: int) -> MountedProbe:
    """Measure another probe point of the cell from here on."""
    return MountedProbe(probe + 1, tuple((cell.probes[probe] / MM).tolist()))


def _reading(q: Floats, side: Floats, name: str) -> list[MeasuringMove]:
    """Arrive at a pose from one side of every joint, and measure."""
    return [_move(q - BACK * side), _move(q, name)]


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


def write_check(
    cell: Cell, output: Path, readings: int, model: Model | None = None
) -> tuple[str, CheckDesign]:
    """Design a check as [survey] of the cell says, and write it as a program.

    Args:
        cell: The cell.
        output: The program to write; its suffix names the language.
        readings: How many.
        model: The arm's error as it was surveyed, None where it was not.

    Returns:
        What was written, in words, and the check.

    Raises:
        ProgramError: The arm has a controller of another language.
        PostprocError: Too few readings, or too few poses can be measured.
        OutputError: The program cannot be written.
    """
    seed = (cell.file.survey or SurveySection()).seed
    check = design_check(cell.arm, cell.probes, readings, cell.tracker, seed, model)
    program = plan_check(cell, check, name_of_file(output.stem))
    _write(cell, output, program)
    poses = len(dict.fromkeys(name[:-1] for name in check.names))
    summary = (
        f"{output}: a check of {readings} readings at {poses} poses, the last one "
        f"repeats the first; chosen for {', '.join(check.effects)}\n"
        f"{describe_duration(cell, program)}"
    )
    return summary, check


def _write(cell: Cell, output: Path, program: MeasuringProgram) -> None:
    """Write a measuring program in the language that its file names."""
    text = language_for(cell, output).write_measuring(program, output)
    write_all({output: text.encode("ascii")})


def joint_speeds(cell: Cell) -> Floats:
    """Return the speeds of the joints, (6,) [rad/s], all the same if not known."""
    known = cell.arm.file.joints.velocity_deg_s is not None
    return cell.arm.velocity if known else np.ones(6)


def describe_duration(cell: Cell, program: MeasuringProgram) -> str:
    """Say how long a program takes, as far as the speeds of the joints are known."""
    moves = [one for one in program.steps if isinstance(one, MeasuringMove)]
    measured = sum(bool(one.measured) for one in moves)
    seconds = measured * (program.settle_s + READING)
    if cell.arm.file.joints.velocity_deg_s is None:
        return f"it takes more than {seconds / 60:.0f} min: {measured} readings"
    speed, gain = cell.arm.velocity, cell.arm.acceleration
    q = np.deg2rad([one.joints_deg for one in moves])
    turned = np.abs(np.diff(q, axis=0))
    speed, gain = speed * SHARE / 100, gain * GENTLY / 100
    slow = turned < speed**2 / gain  # it never reaches its speed
    times = np.where(slow, 2 * np.sqrt(turned / gain), turned / speed + speed / gain)
    seconds += float(times.max(axis=1).sum())
    return (
        f"it takes about {max(seconds / 60, 1):.0f} min at {SHARE} % of the speed of "
        f"the axes, with {READING:g} s for each of {measured} readings"
    )


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
    language_for(cell, output)
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
    program = plan_survey(
        cell, design.q, design.side, design.probe, name, turns, asked.order == "short"
    )
    _write(cell, output, program)
    told = (
        f"{output}: {design.summary()}", describe_duration(cell, program),
        "" if back is None else f"{len(turns)} {back.summary()}",
        explain_few_probes(cell),
    )  # fmt: skip
    return "\n".join(filter(None, told))


def language_for(cell: Cell, output: Path) -> Language:
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
