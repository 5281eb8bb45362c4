"""Commands whose axes stay on the side that their flags name.

The sign of an axis near 0 depends on the last digits of machine data: where flags tell
it (T in KRL), a wrong one turns the axis by 360 deg. Where the source is on the side of
its flag, a command that takes the axis farther to that side is there, too, with any
such data. A tiny turn of the tool about its TCP does that.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import Bools, Floats, Ints, any_in_rows, take_rows
from postproc.compensation.program import PlannedProgram
from postproc.compensation.solver.inverse_model import (
    Commands,
    solve,
    turns_between,
)
from postproc.language.visits import Meaning, Visits
from postproc.model.model import Model
from postproc.robot.arm import Arm
from postproc.robot.cell import Cell
from postproc.robot.pose import inverse, lengths, rotation_from_vector
from postproc.robot.state import States

MOST_TURN = np.deg2rad(0.005)  # of the tool: 0.09 mm at 1 m from the TCP
SINGULAR = 1e-12


def poses_with_signs(visits: Visits) -> Bools:
    """Tell at which visits flags tell the controller the signs of axes, (n,)."""
    if not visits.dialect.sign_flags:
        return np.zeros(len(visits), dtype=bool)
    return np.asarray(
        visits.target.config_given & (visits.target.meaning == Meaning.POSE)
    )


def joints_written(
    arm: Arm, planned: PlannedProgram, rows: Ints, solved: Commands, aside: Floats
) -> tuple[Floats, Floats]:
    """Return the joints of targets as they are written, where flags count.

    A blended target lies beside the path, and the tool is turned otherwise there.

    Args:
        arm: The arm.
        planned: The program's plan, n visits.
        rows: k visits with known targets.
        solved: Where the path should pass them.
        aside: From the targets to there, (n, 3) [m].

    Returns:
        Joints of the commands, and of the source, (k, 6) [rad].
    """
    plan, q, before = planned.plan, solved.q[rows], planned.plan.exact.q[rows]
    known = np.isfinite(q).all(axis=1) & np.isfinite(before).all(axis=1)
    off = np.flatnonzero(known & any_in_rows(plan.aside[rows] != 0.0))
    if len(off) == 0:
        return q, before
    some, near = rows[off], before[off]
    new = np.array(planned.targets.tcp[some])
    new[:, :3, :3] = rotation_from_vector(solved.turn[some]) @ new[:, :3, :3]
    new[:, :3, 3] = solved.command[some, :3, 3] - aside[some]
    flange = new @ inverse(take_rows(plan.tool, some))
    q[off] = arm.nearest(flange, near, arm.branch(near))
    return q, before


def turn_from_borders(
    solved: Commands,
    rows: Bools,
    visits: Visits,
    model: Model,
    cell: Cell,
    planned: PlannedProgram,
    states: States,
    aside: Floats,
    orientation: bool = False,
) -> Commands:
    """Turn the tool where that takes axes off the border of their flags.

    Args:
        solved: Commands of n visits.
        rows: Visits that have just been solved, (n,).
        visits: What the program says.
        model: The arm's error.
        cell: The arm.
        planned: The program's plan.
        states: Planned states, with the directions that are corrected for.
        aside: From targets to where the corrected path passes them, (n, 3) [m].
        orientation: The orientation is corrected as well as the position.
    """
    some = np.flatnonzero(rows & solved.known & poses_with_signs(visits))
    plan, arm = planned.plan, cell.arm
    tool = take_rows(plan.tool, some)
    q, before = joints_written(arm, planned, some, solved, aside)
    moves = visits.dialect.leave_border(visits.target.values[some], q, before)
    if not moves.any():
        return solved
    moving = any_in_rows(moves != 0.0)
    some, q, moves, tool = some[moving], q[moving], moves[moving], tool[moving]
    turn = turns_moving(arm, q, tool[:, :3, 3], moves)
    small = lengths(turn) <= MOST_TURN  # NaN is not
    some, tool, turn = some[small], tool[small], turn[small]
    wanted = planned.reference_poses(some)
    wanted[:, :3, :3] = rotation_from_vector(turn) @ wanted[:, :3, :3]
    part = solve(model, arm, wanted, tool, states[some], orientation)
    return _with_commands(solved, some, part.q, part.command, part.residual, planned)


def _with_commands(
    solved: Commands,
    rows: Ints,
    q: Floats,
    command: Floats,
    residual: Floats,
    planned: PlannedProgram,
) -> Commands:
    """Put other commands in the place of some."""
    out = replace(
        solved,
        q=np.array(solved.q),
        command=np.array(solved.command),
        turn=np.array(solved.turn),
        residual=np.array(solved.residual),
    )
    out.q[rows], out.command[rows], out.residual[rows] = q, command, residual
    out.turn[rows] = turns_between(command, planned.plan.tcp[rows])
    return out


def turns_moving(arm: Arm, q: Floats, tool: Floats, moves: Floats) -> Floats:
    """Find the least turns of the tool about its TCP that move joints so far.

    Args:
        arm: The arm.
        q: Joint angles, (k, 6) [rad].
        tool: TCP in the flange frame, (k, 3) [m].
        moves: Of the joints, (k, 6) [rad]; 0: the joint is free.

    Returns:
        Rotation vectors in the base frame, (k, 3) [rad].
    """
    to_joints = np.linalg.inv(arm.jacobian(q, tool) + SINGULAR * np.eye(6))[:, :, 3:]
    by_turn = np.where((moves != 0.0)[:, :, None], to_joints, 0.0)
    turn = np.linalg.pinv(by_turn) @ moves[:, :, None]
    return np.asarray(turn[:, :, 0])
