"""A program corrected window by window, so that only one is in memory at a time."""

from __future__ import annotations

from dataclasses import dataclass, replace

from postproc.ahead import in_processes, steady
from postproc.clock import Clock, silent
from postproc.cloning import give_own_points
from postproc.kept import Kept, joined, keep
from postproc.language import windows as cuts
from postproc.language.visits import Visits
from postproc.language.windows import Window, run_up, windows
from postproc.model.model import Model
from postproc.motion.trace import NOWHERE, Standing
from postproc.options import Options
from postproc.planning import Reading, plan_visits, states_of
from postproc.proposal import Proposal
from postproc.robot.cell import Cell
from postproc.settling import AT_START, Left, settle
from postproc.taught import correct_taught


@dataclass(frozen=True)
class Stop:
    """How a window leaves the program as it was, and as it is corrected."""

    planned: Standing = NOWHERE
    doubtful: bool = False
    corrected: Left = AT_START


def correct(
    reading: Reading,
    cell: Cell,
    model: Model,
    options: Options,
    clock: Clock,
    processes: int = 1,
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
        processes: How many may work at once; the result is the same.

    Returns:
        The program, with clones where they were asked for, and what came of it.
    """
    work = _Work(reading, cell, model, options)
    if not options.clone:
        cut = windows(reading.visits, cuts.LEAST)
        return reading, joined(list(in_processes(work, cut, Stop(), clock, processes)))
    kept, proposal = work.whole(clock)
    with clock("clone"):
        reading = give_own_points(reading, proposal, cell)
    if reading.cloned:
        kept, _ = replace(work, reading=reading).whole(clock)
    return reading, kept


@dataclass(frozen=True)
class _Work:
    """What it takes to correct any window of a program."""

    reading: Reading
    cell: Cell
    model: Model
    options: Options

    def whole(self, clock: Clock) -> tuple[Kept, Proposal]:
        """Correct the program as one window; return all of its proposal."""
        kept, proposal, _ = self._correct(self.reading.visits, 0, Stop(), clock)
        return kept, proposal

    def correct(self, window: Window, begin: Stop, clock: Clock) -> tuple[Kept, Stop]:
        """Correct a window; return what is kept of it, and how it ends."""
        visits = window.of(self.reading.visits)
        kept, _, end = self._correct(visits, window.seeds, begin, clock)
        return kept, end

    def foretell(self, window: Window) -> Stop | None:
        """Tell how the windows before will end, by the last targets there alone.

        Right where the joints have lost their memory of what was before these. That the
        program begins there is an invention: what fails of it tells nothing.
        """
        visits = run_up(self.reading.visits, window)
        if visits is None:
            return None
        try:
            _, _, end = self._correct(visits, 1, Stop(), Clock(silent))
        except Exception:
            return None
        return end

    def _correct(
        self, visits: Visits, seeds: int, begin: Stop, clock: Clock
    ) -> tuple[Kept, Proposal, Stop]:
        """Correct some visits, the first `seeds` of which are only where they begin."""
        cell, model, options = self.cell, self.model, self.options
        part, timed = replace(self.reading, visits=visits), "speed" in model.needs
        with clock("plan"):
            planned = plan_visits(visits, cell, timed, begin.planned, begin.doubtful)
            planned = correct_taught(planned, visits, cell, model)
        given = options.temperature
        temperature = cell.temperature if given is None else given
        states = states_of(planned.plan, cell, temperature)
        left = begin.corrected
        found = settle(part, planned, states, cell, model, options, clock, left)
        with clock("report"):
            kept = keep(visits, planned, states, found, cell, model, seeds)
        end = steady(Stop(planned.plan.end, planned.doubtful, found.left))
        return kept, found.proposal, end
