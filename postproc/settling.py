"""Correct, write and plan again, until the directions are those corrected for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import count

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.model import Model
from postproc.clock import Clock
from postproc.language.visits import Visits
from postproc.motion.planner import directions
from postproc.options import Options
from postproc.output import Output, write_numbers
from postproc.planning import Planned, Reading, plan_visits, read_program
from postproc.proposal import Proposal, propose
from postproc.resolve import targets_from_visits
from postproc.robot.cell import Cell
from postproc.robot.state import States
from postproc.solved import solve_again, solve_visits
from postproc.verify import check_output

Array = NDArray[np.float64]

FREE_ROUNDS = 2  # of correcting for changed directions, before targets are held


@dataclass(frozen=True)
class Corrected:
    """A proposal, the files that hold it, and the plan of those files."""

    proposal: Proposal
    output: Output
    planned: Planned


def settle(
    reading: Reading,
    planned: Planned,
    states: States,
    cell: Cell,
    model: Model,
    options: Options,
    clock: Clock,
) -> Corrected:
    """Correct, write and plan again, until the directions are those corrected for.

    The corrected program makes slightly other moves than the original. Where one of
    them turns a joint the other way, the correction is computed anew for that side;
    where that flips it back, the target is left alone.
    """
    held = np.zeros(len(states), dtype=bool)
    with clock("solve"):
        solved = solve_visits(model, cell, planned, states)
    for number in count():  # ends: from the third round on `held` grows
        with clock("decide"):
            proposal = propose(reading, planned, solved, held, cell, options)
        with clock("plan again"):
            found = directions_after(reading.visits, proposal, cell)
        changed = proposal.corrected & (found != solved.direction).any(axis=1)
        flipped = proposal.corrected & (found * solved.direction < 0).any(axis=1)
        if not (changed if number < FREE_ROUNDS else flipped).any():
            done = write_and_verify(reading, proposal, cell, model, clock)
            found = done.planned.plan.direction
            flipped = proposal.corrected & (found * solved.direction < 0).any(axis=1)
            if not flipped.any():
                return done
            held = held | flipped
            continue
        held = held | flipped if number >= FREE_ROUNDS else held
        with clock("solve"):
            aimed = states.with_(direction=found)
            solved = solve_again(solved, changed, model, cell, planned, aimed)
    raise AssertionError("unreachable")


def directions_after(visits: Visits, proposal: Proposal, cell: Cell) -> Array:
    """Find the arrival directions of a program whose targets have moved, (n, 6)."""
    moved = replace(visits, values=proposal.decisions.corrected)
    targets, _ = targets_from_visits(moved, cell)
    return np.array(directions(cell.arm, targets)[1])


def write_and_verify(
    reading: Reading, proposal: Proposal, cell: Cell, model: Model, clock: Clock
) -> Corrected:
    """Write the numbers, and read and plan what was written.

    Raises:
        VerificationError: The output is not what was meant.
    """
    with clock("rewrite"):
        output = write_numbers(reading, proposal.edited, proposal.values, model.id)
    with clock("verify"):
        again = read_program(output.files, cell)
        check_output(reading, again, output, proposal.edited)
        replanned = plan_visits(again.visits, cell)
    decisions = replace(proposal.decisions, corrected=np.array(again.visits.values))
    return Corrected(replace(proposal, decisions=decisions), output, replanned)
