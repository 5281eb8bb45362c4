"""Correct, write and plan again, until the sides are those corrected for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import count

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.model import Model
from postproc.clock import Clock
from postproc.language.visits import Visits
from postproc.motion.planner import Reached, reach
from postproc.options import Options
from postproc.output import Output, write_numbers
from postproc.planning import Planned, Reading, read_program
from postproc.proposal import Proposal, propose
from postproc.resolve import targets_from_visits
from postproc.robot.cell import Cell
from postproc.robot.state import States
from postproc.solved import solve_again, solve_visits
from postproc.verify import check_output

Array = NDArray[np.float64]

ROUNDS = 8  # of correcting for changed sides, before targets are held
SAME = 0.01  # sides closer than this are the same
LEAST_SHIFT = 1e-3  # change of an aim that tells how the arrival follows it
FOLLOWS = 0.75  # gain above which the arrival runs away with the aim
OTHER = 1.0  # sides farther apart than this are different ones
CLOSE = 5e-6  # [m] how well rounded fly points are hit
CORNERS = 3  # rounds for that


@dataclass(frozen=True)
class Corrected:
    """A proposal, the files that hold it, and where those files lead."""

    proposal: Proposal
    output: Output
    reached: Reached


class SideSearch:
    """Search, joint by joint, for the side at which aim and arrival agree.

    A correction of a joint is as large as its play, so aiming where it was found last
    may swing or creep. Secant steps settle that; where the arrival follows the aim so
    closely that there is nothing to settle on, the joint is taken to its flank.
    """

    def __init__(self) -> None:
        """Start without a history."""
        self._aim: Array | None = None
        self._found: Array | None = None

    def next_aim(self, aim: Array, found: Array) -> Array:
        """Give the sides to aim for next, (n, 6).

        Args:
            aim: Sides that the targets are corrected for, (n, 6).
            found: Sides that joints then arrive at, (n, 6).
        """
        step = found - aim
        if self._aim is not None and self._found is not None:
            shift = aim - self._aim
            known = np.abs(shift) > LEAST_SHIFT
            gain = (found - self._found) / np.where(known, shift, np.inf)
            follows = gain > FOLLOWS
            step = step / np.where(follows, 1.0, 1.0 - gain)
            step = np.where(follows, 2.0 * np.sign(step), step)
        self._aim, self._found = np.array(aim), np.array(found)
        return np.clip(aim + step, -1.0, 1.0)


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
    anew for that. A target whose joints still change sides at the end is left alone.
    A rounded fly point also moves with its neighbours' corrections, which its own makes
    up for.
    """
    held, search = np.zeros(len(states), dtype=bool), SideSearch()
    with clock("solve"):
        solved = solve_visits(model, cell, planned, states, options.orientation)
    aside = np.array(planned.plan.aside)
    for number in count():  # ends: from round ROUNDS on, `held` grows
        with clock("decide"):
            proposal = propose(reading, planned, solved, aside, held, cell, options)
        with clock("plan again"):
            after = reached_after(reading.visits, proposal, cell)
        found, missed = after.side, np.linalg.norm(after.aside - aside, axis=1)
        rounds_on = number < CORNERS and (missed[proposal.corrected] > CLOSE).any()
        aside = np.array(after.aside) if rounds_on else aside
        off = np.abs(found - solved.direction).max(axis=1, initial=0.0)
        moved = proposal.corrected & (off > (SAME if number < ROUNDS else OTHER))
        if not moved.any() and not rounds_on:
            done = write_and_verify(reading, proposal, cell, model, clock)
            off = np.abs(done.reached.side - solved.direction)
            flipped = proposal.corrected & (off > OTHER).any(axis=1)
            if not flipped.any():
                return done
            held = held | flipped
            continue
        held = held | moved if number >= ROUNDS else held
        with clock("solve"):
            aimed = states.with_(direction=search.next_aim(solved.direction, found))
            solved = solve_again(
                solved, moved, model, cell, planned, aimed, options.orientation
            )
    raise AssertionError("unreachable")


def reached_after(visits: Visits, proposal: Proposal, cell: Cell) -> Reached:
    """Find where targets lead the arm once they have moved."""
    moved = replace(visits, values=proposal.decisions.corrected)
    return where(moved, cell)


def where(visits: Visits, cell: Cell) -> Reached:
    """Find where the targets of visits lead the arm."""
    targets, _ = targets_from_visits(visits, cell)
    return reach(cell.arm, targets)


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
