"""What the planner claims of a program and its output, for the second opinion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from postproc.arrays import Floats
from postproc.compensation.output.line_outcomes import directions_of_record
from postproc.compensation.output.sidecar import Sidecar
from postproc.compensation.program import read_program
from postproc.compensation.solver.payload import payload_of
from postproc.compensation.solver.targets import targets_from_visits
from postproc.language.visits import Visits
from postproc.motion.planner import plan
from postproc.motion.targets import CODE, LIMITS, PATH_LIMITS
from postproc.robot.cell import Cell
from postproc.robot.pose import MM
from postproc.verify.extra import require
from postproc.verify.judge import judge
from postproc.verify.opinion import ENOUGH, Allowance, ArmFacts, Claim, Opinion


def second_opinion(
    source: Mapping[str, bytes],
    output: Mapping[str, bytes],
    cell: Cell,
    record: Sidecar,
    allowance: Allowance = ENOUGH,
) -> Opinion:
    """Let Pinocchio, toppra and ruckig judge a compensated program.

    Args:
        source: The files of the program as they were, the program first.
        output: The same files as they were written.
        cell: The cell, with the play that the correction used.
        record: What the targets were corrected for.
        allowance: How long it may take.

    Raises:
        ProgramError: A file cannot be read as a program.
        PostprocError: A library is not installed.
    """
    require()
    before = _claim("source", read_program(source, cell).visits, cell)
    after = _claim("output", read_program(output, cell).visits, cell)
    after = _take_directions(after, before.visits, record)
    return judge(next(iter(source)), facts_of(cell), before, after, allowance)


def facts_of(cell: Cell) -> ArmFacts:
    """Take the numbers of arm file and cell."""
    arm, limits = cell.arm, cell.limits
    return ArmFacts(
        arm.file, arm.weight, arm.play, cell.home, cell.calibration,
        limits.elbow_mm * MM, limits.wrist_centre_mm * MM,
    )  # fmt: skip


def _claim(label: str, visits: Visits, cell: Cell) -> Claim:
    """Plan a program as `compensate` does, and say what comes of it."""
    arm, (targets, _) = cell.arm, targets_from_visits(visits, cell)
    timed = arm.file.joints.velocity_deg_s is not None
    planned = plan(arm, targets, np.deg2rad(cell.limits.wrist_deg), timed)
    q, load = planned.exact.q, _loads(visits, cell)
    # Whether joints stay within their limits, -1 where they do not, 0: unknown.
    beyond = np.isin(
        planned.exact.reason, [CODE[one] for one in (*LIMITS, *PATH_LIMITS)]
    )
    return Claim(
        label=label,
        visits=visits,
        q=q,
        direction=planned.direction,
        slot=planned.slot,
        singular=_singular(cell, q),
        payload=load,
        torque=_torque(cell, q, load),
        time=np.where(planned.untimed, np.nan, planned.time),
        within=np.where(beyond, -1, np.where(planned.exact.reason == 0, 1, 0)),
        own=np.arange(len(visits)),
    )


def _loads(visits: Visits, cell: Cell) -> Floats:
    """Return mass and centre of what is carried, (n, 4); mass 0 where not known."""
    mass, centre = payload_of(visits, cell)
    return np.nan_to_num(np.column_stack([mass, centre]))


def _singular(cell: Cell, q: Floats) -> Floats:
    """Return the smallest singular values of the Jacobians, (n,)."""
    out, known = np.full(len(q), np.nan), ~np.isnan(q).any(axis=1)
    J = cell.arm.jacobian(q[known], np.zeros(3))
    out[known] = np.linalg.svd(J, compute_uv=False)[:, -1]
    return out


def _torque(cell: Cell, q: Floats, load: Floats) -> Floats:
    """Return gravity torques, (n, 6) [N m]; nothing where no mass is known."""
    if not cell.arm.mass:
        return np.empty((0, 6))
    return cell.arm.gravity_torque(q, load[:, 0], load[:, 1:])


def _take_directions(output: Claim, source: Visits, record: Sidecar) -> Claim:
    """Take the directions that the record tells, where points were put on no way.

    They are those of the corrected program, so that the correction has not turned them.
    """
    told = directions_of_record(source, record)
    if len(output) != len(source):
        return replace(output, own=np.empty(0, dtype=np.int64))
    if told is None:
        return output
    direction = np.where(np.isnan(told), output.direction, told)
    return replace(output, direction=direction)
