"""Correct, write and plan again, until the sides are those corrected for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import count

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.model import Model
from postproc.clock import Clock
from postproc.courses import Courses, where
from postproc.motion.planner import Plan
from postproc.motion.reach import Reached
from postproc.options import Options
from postproc.output import Output, write_numbers
from postproc.planning import Planned, Reading, read_program
from postproc.proposal import Proposal, propose
from postproc.robot.cell import Cell
from postproc.robot.state import States
from postproc.side_search import SideSearch
from postproc.solved import Solved, solve_again, solve_visits
from postproc.verify import check_output

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

ROUNDS = 8  # of correcting for changed sides, before targets are settled for
SAME = 0.01  # sides closer than this are the same
OTHER = 1.0  # sides farther apart than this are different ones
CLOSE = 5e-6  # [m] how well rounded fly points are hit
CORNERS = 3  # rounds for what is curved there


@dataclass(frozen=True)
class Corrected:
    """A proposal, the files that hold it, and where those files lead."""

    proposal: Proposal
    output: Output
    reached: Reached


def settle(
    reading: Reading,
    planned: Planned,
    states: States,
    cell: Cell,
    model: Model,
    options: Options,
    clock: Clock,
) -> Corrected:
    """Correct, write and plan again, until the sides are those corrected for.

    The corrected program makes slightly other moves than the original, so a joint may
    come from the other side, or lie elsewhere in its play: the correction is computed
    anew for that. Where joints still change sides at the end, the target is corrected
    for the middle between both, and listed: to leave it alone would bend a fly run by
    the whole correction, and move its neighbours' sides with it.

    A rounded fly point also moves with its neighbours' corrections, which its own makes
    up for.
    """
    held, search = np.zeros(len(states), dtype=bool), SideSearch()
    with clock("solve"):
        solved = solve_visits(model, cell, planned, states, options.orientation)
    courses = Courses(reading.visits, planned.targets, cell)
    bent = np.zeros_like(planned.plan.aside)
    settled_for = np.zeros(len(states), dtype=bool)
    for number in count():  # ends: from round ROUNDS on, `settled_for` or `held` grows
        with clock("decide"):
            aside = aside_after(planned.plan, solved, held) + bent
            proposal = propose(reading, planned, solved, aside, held, cell, options)
        with clock("plan again"):
            after = courses.after(proposal.decisions.corrected)
        found, missed = after.side, np.zeros_like(bent)
        sharp = planned.plan.pull.visit
        missed[sharp] = (after.aside - aside)[sharp]
        missed[~proposal.corrected] = 0.0
        rounds_on = number < CORNERS and np.abs(missed).max(initial=0.0) > CLOSE
        bent = bent + missed if rounds_on else bent
        off = np.abs(found - solved.direction).max(axis=1, initial=0.0)
        moved = proposal.corrected & ~settled_for
        moved = moved & (off > (SAME if number < ROUNDS else OTHER))
        if not moved.any() and not rounds_on:
            done = write_and_verify(reading, proposal, cell, model, clock)
            off = np.abs(done.reached.side - solved.direction)
            flipped = proposal.corrected & ~settled_for & (off > OTHER).any(axis=1)
            if not flipped.any():
                return done
            held = held | flipped
            continue
        settled_for = settled_for | moved if number >= ROUNDS else settled_for
        with clock("solve"):
            aimed = states.with_(direction=search.next_aim(solved.direction, found))
            solved = solve_again(
                solved, moved, model, cell, planned, aimed, options.orientation
            )
    raise AssertionError("unreachable")


def aside_after(plan: Plan, solved: Solved, held: Bools) -> Array:
    """Foretell where the path passes its fly points once targets have moved, (n, 3)."""
    wanted = np.nan_to_num(solved.command[:, :3, 3] - plan.tcp[:, :3, 3])
    wanted[held] = 0.0
    return plan.aside + plan.pull.on(plan.pull.to_move(wanted))


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
        reached = where(again.visits, cell)
    decisions = replace(proposal.decisions, corrected=np.array(again.visits.values))
    return Corrected(replace(proposal, decisions=decisions), output, reached)
