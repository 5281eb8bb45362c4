"""Correct and plan again, until the sides are those corrected for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from postproc.aiming import Aim, Aiming
from postproc.arrays import Bools, Floats
from postproc.as_read import numbers_as_read
from postproc.clock import Clock
from postproc.courses import Courses
from postproc.language.rewrite import edits as number_edits
from postproc.language.source import Replacements
from postproc.model.model import Model
from postproc.motion.replan import Reached
from postproc.motion.trace import NOWHERE, Standing
from postproc.options import Options
from postproc.planning import Planned, Reading
from postproc.proposal import Proposal
from postproc.robot.cell import Cell
from postproc.robot.state import States
from postproc.side_search import SideSearch
from postproc.solved import std_errors

ROUNDS = 8  # of correcting for changed sides, before targets are settled for
SAME = 0.01  # sides closer than this are the same
OTHER = 1.0  # sides farther apart than this are different ones
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
    wanted: Floats


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
    aiming = Aiming(
        reading, planned, states, cell, model, options, clock, before.wanted
    )
    courses, search = Courses(reading.visits, planned.targets, cell), SideSearch()
    aim = aiming.first_aim()
    for number in count():  # ends: from round ROUNDS on, `settled` or `held` grows
        proposal, meant = aiming.propose(aim)
        with clock("plan again"):
            looked = courses.after(proposal.decisions.corrected, before.looked)
        most = SAME if number < ROUNDS else OTHER
        moved = aim.turned(proposal, looked.side, most)
        missed = aiming.missed(proposal, looked.aside, meant)
        bend_on = number < CORNERS and bool(missed.any())
        if not moved.any() and not bend_on:
            found, flipped = _written(aiming, aim, proposal, courses, before)
            if found is not None:
                return found
            aim = replace(aim, held=aim.held | flipped)
            continue
        bent = aim.bent + missed if bend_on else aim.bent
        settled = aim.settled | moved if number >= ROUNDS else aim.settled
        aim = replace(aim, bent=bent, settled=settled)
        aim = aiming.next_aim(aim, moved, looked.side, search)
    raise AssertionError("unreachable")


def _written(
    aiming: Aiming, aim: Aim, proposal: Proposal, courses: Courses, before: Left
) -> tuple[Corrected | None, Bools]:
    """Write the numbers, and look at them as they will be read.

    Returns:
        What came of it, None where targets now come from another side; and those.

    Raises:
        NotTogetherError: There are some, in programs side by side.
    """
    looked = courses.end
    edits, proposal = write(aiming.reading, proposal, aiming.clock)
    with aiming.clock("plan again"):
        last = courses.after(proposal.decisions.corrected, before.written)
    flipped = aim.turned(proposal, last.side, OTHER)
    if flipped.any():
        if len(aiming.reading.begins) > 1:
            raise NotTogetherError
        return None, flipped
    left = Left(looked, last.end, aiming.wanted(aim)[-1:].copy())
    with aiming.clock("solve"):
        std_error = std_errors(aiming.model, aiming.cell, aiming.states, aim.solved)
    decided = replace(proposal.decisions, std_error=std_error)
    proposal = replace(proposal, decisions=decided)
    return Corrected(proposal, edits, last.reached, left), flipped


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
