"""Commands that would land where the program says, visit by visit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.model import Model
from postproc.accuracy.orientation import UNSURE, refuse_unknown_rotations, unsure_turn
from postproc.accuracy.solve import solve
from postproc.planning import Planned
from postproc.pose import is_unknown
from postproc.robot.cell import Cell
from postproc.robot.state import States

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Solved:
    """Corrected commands of n visits, NaN where pose or joint angles are not known.

    Attributes:
        direction: Arrival direction that they are solved for, (n, 6).
        q: Joint angles, (n, 6) [rad], NaN where the command cannot be reached.
        command: TCP poses to command, base frame, (n, 4, 4) [m].
        residual: Predicted landing against the wanted position, (n,) [m].
        std_error: Standard error of the predicted error, per axis, (n, 3) [m].
        outside: Reasons why visits lie outside what was surveyed, (n,) each.
    """

    direction: Array
    q: Array
    command: Array
    residual: Array
    std_error: Array
    outside: dict[str, Bools]


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
    n = len(states)
    empty = Solved(
        direction=np.array(states.direction),
        q=np.full((n, 6), np.nan),
        command=np.full((n, 4, 4), np.nan),
        residual=np.full(n, np.nan),
        std_error=np.full((n, 3), np.nan),
        outside={},
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
    plan = planned.plan
    lost = np.isnan(plan.q).any(axis=1) | is_unknown(plan.tcp)
    known = np.asarray(rows & ~lost)
    here = states[known]
    predicted = model.predict(cell.arm, here)
    part = solve(
        model, cell.arm, planned.wanted[known], plan.tool[known], here, orientation,
        predicted.error,
    )  # fmt: skip
    out = Solved(
        direction=np.where(rows[:, None], states.direction, solved.direction),
        q=np.array(solved.q),
        command=np.array(solved.command),
        residual=np.array(solved.residual),
        std_error=np.array(solved.std_error),
        outside={text: mask & ~known for text, mask in solved.outside.items()},
    )
    out.q[known], out.command[known] = part.q, part.command
    out.residual[known], out.std_error[known] = part.residual, predicted.std_model
    for text, mask in predicted.outside.items():
        merged = out.outside.setdefault(text, np.zeros(len(states), dtype=bool))
        merged[known] = mask
    if orientation:
        unsure = unsure_turn(model, cell.arm, here)
        merged = out.outside.setdefault(UNSURE, np.zeros(len(states), dtype=bool))
        merged[known] = unsure
    return out
