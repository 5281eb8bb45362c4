"""Write a survey as a robot program."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.calibration.pose_design import design_survey, where_to_reverse
from postproc.files import write_all
from postproc.robot.cell import Cell, SurveySection, as_cell
from postproc.robot.pose import MM

BACK = np.deg2rad(2.0)  # how far to the side every approach starts [rad]
SETTLE_MS = 1500  # pause before the tracker reads
STEPS = np.array([0.1, 0.2, 0.4, 0.8, 1.6]) * 1e-3  # [rad] of a drive that turns back


def survey_program(
    cell: Cell,
    q: Floats,
    side: Floats,
    probe: Ints,
    name: str,
    reversals: Sequence[tuple[int, int]] = (),
) -> str:
    """Write a survey: every pose is reached twice, with all joints from the other side.

    Args:
        cell: The cell; its probe points become the program's tools.
        q: Joint angles of the poses, (n, 6) [rad].
        side: Arrival direction of every joint in the first approach, (n, 6), +1 or -1.
        probe: Index of the probe point that is measured, (n,).
        name: Program name.
        reversals: Poses, from 0, at which drives, from 0, turn back step by step.

    Returns:
        The program text. The measurement ids are the pose number with a or b; of
        reversals the numbers of pose, drive and step.
    """
    measured = 2 * len(q) + len(reversals) * (1 + len(STEPS))
    more = f", and {len(reversals)} reversals" if reversals else ""
    count = f"{len(q)} poses, each from both sides{more}: {measured} measurements"
    lines = [
        f"-- Laser-tracker survey of {cell.arm.name}: {count}",
        "-- After a MEASURE comment: read the tracker when the next move has settled.",
        f"PROGRAM {name} EZ, HOLD",
        "BEGIN",
        "  $TERM_TYPE := FINE",
    ]
    mounted = -1
    for i in np.argsort(probe, kind="stable"):
        if probe[i] != mounted:
            mounted = int(probe[i])
            lines.append(f"  -- probe point {mounted + 1}")
            xyz = ", ".join(f"{v:.3f}" for v in cell.probes[mounted] / MM)
            lines.append(f"  $TOOL := POS({xyz}, 0, 0, 0, '')")
        for letter, sign in (("a", 1.0), ("b", -1.0)):
            lines.append(f"  MOVE JOINT TO {_joints(q[i] - sign * BACK * side[i])}")
            lines += _write_measured_move(f"{i + 1}{letter}", q[i])
        for drive in (drive for pose, drive in reversals if pose == i):
            lines += _reversal(cell, q[i], side[i], int(i), drive)
    return "\n".join([*lines, f"END {name}", ""])


def _reversal(cell: Cell, q: Floats, side: Floats, pose: int, drive: int) -> list[str]:
    """Write an arrival from afar, and steps of one drive back from there."""
    coupling = cell.arm.coupling
    back = -np.sign(coupling[drive] @ side) * np.linalg.inv(coupling)[:, drive]
    lines = [f"  MOVE JOINT TO {_joints(q - BACK * side)}"]
    for k, step in enumerate((0.0, *STEPS)):
        lines += _write_measured_move(f"{pose + 1}.{drive + 1}.{k}", q + step * back)
    return lines


def _write_measured_move(name: str, q: Floats) -> list[str]:
    return [
        f"  -- MEASURE {name}",
        f"  MOVE JOINT TO {_joints(q)}",
        f"  DELAY {SETTLE_MS}",
    ]


def _joints(q: Floats) -> str:
    """Write joint angles [rad] as a joint target."""
    return "{" + ", ".join(f"{v:.5f}" for v in np.rad2deg(q)) + "}"


def write_survey(cell: Cell | str | Path, output: Path, poses: int) -> str:
    """Design a survey as [survey] of the cell says, and write it as a program.

    Args:
        cell: The cell, or its file.
        output: The program to write.
        poses: Number of poses.

    Returns:
        What was written, with the observability of the design, in words.

    Raises:
        PostprocError: A wrong number of poses.
        OutputError: The program cannot be written.
    """
    cell = as_cell(cell)
    asked = cell.file.survey or SurveySection()
    arm, probes = cell.arm, cell.probes
    design = design_survey(arm, probes, poses, asked.mode, cell.tracker, asked.seed)
    name = "".join(c if c.isalnum() else "_" for c in output.stem) or "survey"
    turned = (
        where_to_reverse(arm, design, probes, asked.reversals)
        if asked.reversals
        else []
    )
    text = survey_program(cell, design.q, design.side, design.probe, name, turned)
    write_all({output: text.encode("ascii")})
    return f"{output}: {design.summary()}"
