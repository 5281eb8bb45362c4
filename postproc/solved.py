"""Commands that would land where the program says, visit by visit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from postproc.accuracy.orientation import (
    UNSURE_TURN,
    refuse_unknown_rotations,
    unsure_turn,
)
from postproc.accuracy.solve import solve
from postproc.arrays import Bools, Floats, Ints
from postproc.model.model import UNSURE, Model
from postproc.planning import Planned
from postproc.robot.cell import Cell
from postproc.robot.pose import has_unknown, is_unknown, rotation_vector
from postproc.robot.state import States


@dataclass(frozen=True)
class Solved:
    """Corrected commands of n visits, NaN where pose or joint angles are not known.

    Attributes:
        known: Visits that can be solved, (n,).
        direction: Arrival direction that they are solved for, (n, 6).
        q: Joint angles, (n, 6) [rad], NaN where the command cannot be reached.
        command: TCP poses to command, base frame, (n, 4, 4) [m].
        turn: Rotation of the commands against the targets, (n, 3) [rad].
        residual: Predicted landing against the wanted position, (n,) [m].
        std_error: Standard error of the model there, per axis, (n, 3) [m], as far as
            that was asked for.
        outside: Reasons why visits lie outside what was surveyed, (n,) each.
    """

    known: Bools
    direction: Floats
    q: Floats
    command: Floats
    turn: Floats
    residual: Floats
    std_error: Floats
    outside: dict[str, Bools]

    @cached_property
    def turned(self) -> Ints:
        """Visits whose command is known to turn the tool, ascending."""
        some = (self.turn < 0.0) | (self.turn > 0.0)
        return np.unique(np.nonzero(some)[0])


def solve_visits(
    model: Model,
    cell: Cell,
    planned: Planned,
    states: States,
    orientation: bool = False,
) -> Solved:
    """Solve every visit whose pose and joint angles are known.

    Args:
        model: The arm's error.
        cell: The arm.
        planned: The program's plan.
        states: Planned states, with the directions to correct for.
        orientation: Correct the orientation as well as the position.

    Raises:
        ModelError: The orientation is asked for, and the model does not know it.
    """
    if orientation:
        refuse_unknown_rotations(model)
    n, plan = len(states), planned.plan
    known = ~(has_unknown(plan.q) | is_unknown(plan.tcp))
    empty = Solved(
        known=known,
        direction=np.array(states.direction),
        q=np.full((n, 6), np.nan),
        command=np.full((n, 4, 4), np.nan),
        turn=np.full((n, 3), np.nan),
        residual=np.full(n, np.nan),
        std_error=np.full((n, 3), np.nan),
        outside=_outside_survey(model, known, states),
    )
    everything = np.ones(n, dtype=bool)
    return solve_again(empty, everything, model, cell, planned, states, orientation)


def solve_again(
    solved: Solved,
    rows: Bools,
    model: Model,
    cell: Cell,
    planned: Planned,
    states: States,
    orientation: bool = False,
) -> Solved:
    """Solve some visits anew, for the directions of `states`; keep the others.

    Args:
        solved: What is known.
        rows: Visits to solve, (n,).
        model: The arm's error.
        cell: The arm.
        planned: The program's plan.
        states: Planned states, with the directions to correct for.
        orientation: Correct the orientation as well as the position.
    """
    plan, known = planned.plan, np.flatnonzero(rows & solved.known)
    here, wanted = states[known], planned.wanted(known)
    part = solve(model, cell.arm, wanted, plan.tool[known], here, orientation)
    out = replace(
        solved,
        direction=np.where(rows[:, None], states.direction, solved.direction),
        q=np.array(solved.q),
        command=np.array(solved.command),
        turn=np.array(solved.turn),
        residual=np.array(solved.residual),
        std_error=np.array(solved.std_error),
        outside=dict(solved.outside),
    )
    out.q[known], out.command[known] = part.q, part.command
    out.turn[known] = _turns(part.command, plan.tcp[known])
    out.residual[known] = part.residual
    std = model.std_on_flanks(cell.arm, here)
    out.std_error[known] = std
    _mark(out.outside, UNSURE, known, model.unsure(std), len(rows))
    if orientation:
        unsure = unsure_turn(model, cell.arm, here)
        _mark(out.outside, UNSURE_TURN, known, unsure, len(rows))
    return out


def std_errors(model: Model, cell: Cell, states: States, solved: Solved) -> Floats:
    """Standard errors of the errors that visits are corrected for, per axis.

    They are many times as costly as the errors: what solving has asked for is kept, the
    others are wanted of the last round alone.

    Returns:
        (n, 3) [m], NaN where pose or joint angles are not known.
    """
    out = np.array(solved.std_error)
    rows = np.flatnonzero(solved.known & np.isnan(out[:, 0]))
    here = states.with_(direction=solved.direction)[rows]
    out[rows] = model.std_error(cell.arm, here)
    return out


def _turns(new: Floats, old: Floats) -> Floats:
    """Return the rotation from old poses to new ones (n, 4, 4), (n, 3) [rad]."""
    new, old, out = new[:, :3, :3], old[:, :3, :3], np.zeros((len(new), 3))
    rows = np.unique(np.nonzero(new != old)[0])
    lost = np.isnan(new[rows]).any(axis=(1, 2))
    out[rows[lost]] = np.nan
    rows = rows[~lost]
    out[rows] = rotation_vector(new[rows] @ np.swapaxes(old[rows], 1, 2))
    return out


def _outside_survey(model: Model, known: Bools, states: States) -> dict[str, Bools]:
    """Say which visits lie outside of what was surveyed, whatever their directions."""
    rows, found = np.flatnonzero(known), dict[str, Bools]()
    for text, mask in model.ranges.outside(states[rows], model.needs).items():
        _mark(found, text, rows, mask, len(known))
    return found


def _mark(
    outside: dict[str, Bools], text: str, rows: Ints, mask: Bools, n: int
) -> None:
    """Say anew of some of n visits whether they lie outside for a reason."""
    if text in outside or mask.any():
        marked = np.array(outside.get(text, np.zeros(n, dtype=bool)))
        marked[rows] = mask
        outside[text] = marked
