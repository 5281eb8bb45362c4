"""Correct and plan again, until the sides are those corrected for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import count, pairwise

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.model import Model
from postproc.as_read import numbers_as_read
from postproc.clock import Clock
from postproc.courses import Courses
from postproc.language.edits import Replacements
from postproc.language.rewrite import edits as number_edits
from postproc.motion.planner import Plan
from postproc.motion.reach import Reached
from postproc.motion.standing import NOWHERE, Standing
from postproc.options import Options
from postproc.planning import Planned, Reading
from postproc.proposal import Proposal, propose
from postproc.robot.cell import Cell
from postproc.robot.state import States
from postproc.side_search import SideSearch
from postproc.solved import Solved, solve_again, solve_visits, std_errors

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

ROUNDS = 8  # of correcting for changed sides, before targets are settled for
SAME = 0.01  # sides closer than this are the same
OTHER = 1.0  # sides farther apart than this are different ones
CLOSE = 5e-6  # [m] how well rounded fly points are hit
CORNERS = 3  # rounds for what is curved there


@dataclass(frozen=True)
class Left:
    """How the last target of some visits is left, for what comes after it.

    Attributes:
        looked: Where the arm stands with its number as it was corrected.
        written: .. with its number as it is written, which has less digits.
        wanted: What it moves by, (k, 3) [m]; k is 1, or 0 where nothing was before.
    """

    looked: Standing
    written: Standing
    wanted: Array


AT_START = Left(NOWHERE, NOWHERE, np.empty((0, 3)))


class NotTogetherError(Exception):
    """A program goes on by rounds that others beside it did not take."""


@dataclass(frozen=True)
class Corrected:
    """A proposal, the edits that write it, and where the written numbers lead."""

    proposal: Proposal
    edits: tuple[Replacements, ...]
    reached: Reached
    left: Left


def settle(
    reading: Reading,
    planned: Planned,
    states: States,
    cell: Cell,
    model: Model,
    options: Options,
    clock: Clock,
    before: Left = AT_START,
) -> Corrected:
    """Correct and plan again, until the sides are those corrected for.

    The corrected program makes slightly other moves than the original, so a joint may
    come from the other side, or lie elsewhere in its play: the correction is computed
    anew for that. Where joints still change sides at the end, the target is corrected
    for the middle between both, and listed: to leave it alone would bend a fly run by
    the whole correction, and move its neighbours' sides with it.

    A rounded fly point also moves with its neighbours' corrections, which its own makes
    up for. The last look is at the numbers as they will be read from the output.

    Programs side by side do not wait for each other: what has come to rest in one stays
    as it is while others go on. Only what the last look finds would come rounds later
    than in a program alone, and how targets are settled depends on the round.

    Raises:
        NotTogetherError: The last look found something in programs side by side.
    """
    held, search = np.zeros(len(states), dtype=bool), SideSearch()
    with clock("solve"):
        solved = solve_visits(model, cell, planned, states, options.orientation)
    courses = Courses(reading.visits, planned.targets, cell)
    bent = np.zeros_like(planned.plan.aside)
    settled_for = np.zeros(len(states), dtype=bool)
    for number in count():  # ends: from round ROUNDS on, `settled_for` or `held` grows
        with clock("decide"):
            wanted = wanted_moves(planned.plan, solved, held, before)
            aside = aside_after(planned.plan, wanted) + bent
            proposal = propose(reading, planned, solved, aside, held, cell, options)
        with clock("plan again"):
            looked = courses.after(proposal.decisions.corrected, before.looked)
            after = looked.reached
        found, missed = after.side, _missed(planned.plan, proposal, after.aside, aside)
        far = _far_off(missed, reading.begins)
        rounds_on = number < CORNERS and bool(far.any())
        bent = bent + np.where(far, missed, 0.0) if rounds_on else bent
        off = np.abs(found - solved.direction).max(axis=1, initial=0.0)
        moved = proposal.corrected & ~settled_for
        moved = moved & (off > (SAME if number < ROUNDS else OTHER))
        if not moved.any() and not rounds_on:
            edits, proposal = write(reading, proposal, clock)
            stood = looked.end
            with clock("plan again"):
                last = courses.after(proposal.decisions.corrected, before.written)
            off = np.abs(last.side - solved.direction)
            flipped = proposal.corrected & ~settled_for & (off > OTHER).any(axis=1)
            if not flipped.any():
                left = Left(stood, last.end, wanted[-1:].copy())
                with clock("solve"):
                    std_error = std_errors(model, cell, planned, states, solved)
                decided = replace(proposal.decisions, std_error=std_error)
                proposal = replace(proposal, decisions=decided)
                return Corrected(proposal, edits, last.reached, left)
            if len(reading.begins) > 1:
                raise NotTogetherError
            held = held | flipped
            continue
        settled_for = settled_for | moved if number >= ROUNDS else settled_for
        with clock("solve"):
            aimed = states.with_(direction=search.next_aim(solved.direction, found))
            solved = solve_again(
                solved, moved, model, cell, planned, aimed, options.orientation
            )
    raise AssertionError("unreachable")


def _missed(plan: Plan, proposal: Proposal, aside: Array, meant: Array) -> Array:
    """Tell how far the path passes from where it should at sharp corners, (n, 3) [m].

    Args:
        plan: Tells which corners are sharp.
        proposal: Tells which targets can make up for it.
        aside: From targets to where the path passes them, (n, 3) [m].
        meant: .. to where it should.
    """
    missed, sharp = np.zeros_like(aside), plan.pull.visit
    missed[sharp] = (aside - meant)[sharp]
    missed[~proposal.corrected] = 0.0
    return missed


def _far_off(missed: Array, begins: tuple[int, ...]) -> Bools:
    """Tell the visits of programs with a fly point that is not hit well, (n, 1).

    Args:
        missed: How far the path passes from where it should, (n, 3) [m].
        begins: The first visit of every program.
    """
    out = np.zeros((len(missed), 1), dtype=bool)
    for first, end in pairwise((*begins, len(missed))):
        out[first:end] = np.abs(missed[first:end]).max(initial=0.0) > CLOSE
    return out


def wanted_moves(plan: Plan, solved: Solved, held: Bools, before: Left) -> Array:
    """Say what the path should move by at every target, (n, 3) [m]."""
    wanted = np.nan_to_num(solved.command[:, :3, 3] - plan.tcp[:, :3, 3])
    wanted[held] = 0.0
    wanted[: len(before.wanted)] = before.wanted
    return wanted


def aside_after(plan: Plan, wanted: Array) -> Array:
    """Foretell where the path passes its fly points once targets have moved, (n, 3)."""
    return plan.aside + plan.pull.on(plan.pull.to_move(wanted))


def write(
    reading: Reading, proposal: Proposal, clock: Clock
) -> tuple[tuple[Replacements, ...], Proposal]:
    """Write the numbers; return the edits, and the proposal as it will be read."""
    with clock("rewrite"):
        literals, edited = reading.visits.literals, proposal.edited
        edits = number_edits(literals, reading.sources, edited, proposal.values)
        values = numbers_as_read(reading.visits, edited, edits)
    decisions = replace(proposal.decisions, corrected=values)
    return edits, replace(proposal, decisions=decisions)
