"""A program corrected window by window, so that only one is in memory at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from postproc.accuracy.model import Model
from postproc.clock import Clock
from postproc.cloning import give_own_points
from postproc.kept import Kept, joined, keep
from postproc.language import windows as cuts
from postproc.language.windows import Window, windows
from postproc.motion.standing import NOWHERE, Standing
from postproc.options import Options
from postproc.planning import Reading, plan_visits, states_of
from postproc.proposal import Proposal
from postproc.robot.cell import Cell
from postproc.settling import AT_START, Left, settle
from postproc.taught import correct_taught


@dataclass(frozen=True)
class _Stop:
    """How a window leaves the program as it was, and as it is corrected."""

    planned: Standing = NOWHERE
    doubtful: bool = False
    corrected: Left = AT_START


def correct(
    reading: Reading, cell: Cell, model: Model, options: Options, clock: Clock
) -> tuple[Reading, Kept]:
    """Plan a program, and correct it until its sides are those corrected for.

    Moves can only be given points of their own when all arrivals are at hand: with
    --clone a program is one window, however long; so is one fly run.

    A window is settled before the next one begins, while a whole program settles at
    once: fly points may differ by what `CLOSE` allows, and the first targets behind a
    cut within the play of joints that hardly move there.

    Args:
        reading: The program.
        cell: The robot's surroundings.
        model: The arm's error.
        options: What the user asked for.
        clock: Times the stages.

    Returns:
        The program, with clones where they were asked for, and what came of it.
    """
    given = (cell, model, options, clock)
    if not options.clone:
        return reading, joined([kept for kept, _ in _each(reading, cuts.LEAST, *given)])
    whole = len(reading.visits)
    ((kept, proposal),) = _each(reading, whole, *given)
    with clock("clone"):
        reading = give_own_points(reading, proposal, cell)
    if reading.cloned:
        ((kept, _),) = _each(reading, whole, *given)
    return reading, kept


def _each(
    reading: Reading,
    least: int,
    cell: Cell,
    model: Model,
    options: Options,
    clock: Clock,
) -> Iterator[tuple[Kept, Proposal]]:
    """Correct window by window; yield what is kept of each, and all of its proposal."""
    stop = _Stop()
    for window in windows(reading.visits, least):
        kept, proposal, stop = _corrected(
            window, stop, reading, cell, model, options, clock
        )
        yield kept, proposal


def _corrected(
    window: Window,
    begin: _Stop,
    reading: Reading,
    cell: Cell,
    model: Model,
    options: Options,
    clock: Clock,
) -> tuple[Kept, Proposal, _Stop]:
    """Correct one window."""
    visits = window.of(reading.visits)
    part, timed = replace(reading, visits=visits), "speed" in model.needs
    with clock("plan"):
        planned = plan_visits(visits, cell, timed, begin.planned, begin.doubtful)
        planned = correct_taught(planned, visits, cell, model)
    temperature = options.temperature
    states = states_of(
        planned.plan, cell, cell.temperature if temperature is None else temperature
    )
    found = settle(part, planned, states, cell, model, options, clock, begin.corrected)
    with clock("report"):
        kept = keep(visits, planned, states, found, cell, model, window.seeds)
    end = _Stop(planned.plan.end, planned.doubtful, found.left)
    return kept, found.proposal, end
