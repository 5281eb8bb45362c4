"""A program corrected until its sides stay put, window by window where it is long."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools
from postproc.compensation import windowing as cuts
from postproc.compensation.clones import give_own_points
from postproc.compensation.consensus import (
    RoundLog,
    same_looks,
    same_rows,
)
from postproc.compensation.decisions import Proposal
from postproc.compensation.iterate import (
    FROM_START,
    Boundary,
    NotAloneError,
    iterate,
)
from postproc.compensation.options import (
    Clock,
    Job,
)
from postproc.compensation.outcome import Status
from postproc.compensation.program import (
    ParsedProgram,
    PlannedProgram,
    plan_visits,
    states_of,
)
from postproc.compensation.rewrite import (
    check_motion,
)
from postproc.compensation.taught_frames import correct_taught
from postproc.compensation.window_result import (
    WindowResult,
    complete_room,
    correction_of,
    example_of,
    in_shared_memory,
    room_like,
)
from postproc.compensation.windowing import Window, cut_points, seams, windows
from postproc.compensation.workers import in_processes
from postproc.language.visits import Graph
from postproc.motion.joint_path import StartState
from postproc.robot.direction import UNLED, Arrivals
from postproc.robot.trajectory import Motion

# A program corrected window by window, so that only one is in memory at a time.


@dataclass(frozen=True)
class Corrected:
    """A window that was worked through, and what its neighbours must know of it.

    Attributes:
        window: The window.
        kept: What is kept of it but for its visits.
        trail: What was looked at at its ends.
        left: What came of the visits beside the cut before it.
        right: .. of those beside the cut behind, and of the next window's halo.
        exit: Where the arm stands at the first visit of that halo.
        arrivals: How it arrives there.
        doubtful: Why what comes from there is doubtful; 0 where it is not.
    """

    window: Window
    kept: WindowResult
    trail: RoundLog
    left: Mapping[str, NDArray[Any]]
    right: Mapping[str, NDArray[Any]]
    exit: StartState
    arrivals: Arrivals
    doubtful: int


def correct(reading: ParsedProgram, setting: Job) -> tuple[ParsedProgram, WindowResult]:
    """Plan a program, and correct it until its sides are those corrected for.

    Moves can only be given points of their own when all arrivals are at hand: with
    shared_points = "clone" a program is one window, however long.

    Args:
        reading: The program.
        setting: What it is compensated with.

    Returns:
        The program, with clones where they were asked for, and what came of it.
    """
    clock = setting.clock
    if setting.options.shared_points != "clone":
        return reading, _in_windows(reading, setting)
    kept, proposal = _whole(reading, replace(setting, averages=False))
    with clock("clone"):
        reading = give_own_points(reading, proposal, setting.cell)
    if reading.cloned or kept.decisions.count(Status.CONFLICT):
        kept, _ = _whole(reading, setting)
    return reading, kept


def _in_windows(reading: ParsedProgram, setting: Job) -> WindowResult:
    """Correct a program window by window, as if it were one window.

    A time law is found for a run between stops as a whole: where the model depends on
    the speed, programs are cut at stops alone.
    """
    timed = "speed" in setting.model.needs
    if len(reading.visits) < 2 * cuts.LEAST:
        return _whole(reading, setting)[0]
    stops = cut_points(reading.visits)
    quiet = stops if timed else seams(reading.visits)
    cut = windows(quiet, cuts.share(len(quiet), setting.processes))
    if len(cut) > 1:
        make = np.empty if setting.processes == 1 else in_shared_memory
        width = reading.visits.target.values.shape[1]
        example = example_of(width, setting.options.orientation)
        room = room_like(example, len(quiet), make)
        work = _WindowWork(reading, setting, quiet, stops, room)
        try:
            found = in_processes(work, cut, setting.clock, setting.processes)
            ends = [0, *(part.window.end for part in found)]
            return complete_room(room, [part.kept for part in found], ends)
        except NotAloneError:
            pass
    return _whole(reading, setting)[0]


def _whole(reading: ParsedProgram, setting: Job) -> tuple[WindowResult, Proposal]:
    """Correct a program as one window; return all of its proposal."""
    _, kept, proposal = _correct_visits(reading, setting)
    return kept, proposal


def _correct_visits(
    reading: ParsedProgram,
    setting: Job,
    lead: Boundary = FROM_START,
    arrived: Arrivals = UNLED,
    doubtful: int = 0,
    trail: RoundLog | None = None,
) -> tuple[PlannedProgram, WindowResult, Proposal]:
    """Plan and correct some visits.

    Args:
        reading: The visits.
        setting: What they are compensated with.
        lead: How they go on from others, see `iterate`.
        arrived: How the arm arrives at the first of them, see `plan_visits`.
        doubtful: Why what comes from the first one is doubtful, 0 where it is not.
        trail: See `iterate`.
    """
    cell, model, visits = setting.cell, setting.model, reading.visits
    timed, clock = "speed" in model.needs, setting.clock
    with clock("plan"):
        planned = plan_visits(visits, cell, timed, lead.begin, arrived, doubtful)
        planned = correct_taught(planned, visits, cell, model)
    states = states_of(planned.plan, cell, setting.temperature, visits)
    found = iterate(reading, planned, states, setting, lead, trail)
    check_motion(visits, found.moved, cell.limits)
    with clock("report"):
        kept = correction_of(visits, planned, states, found, cell, model)
    return planned, kept, found.proposal


@dataclass(frozen=True)
class _WindowWork:
    """What it takes to correct any window of a program.

    Attributes:
        reading: The program.
        setting: What it is compensated with.
        quiet: Behind which visits it may be cut, (n,).
        stops: .. where the arm stops, (n,).
        room: What is kept of all visits is put there.
    """

    reading: ParsedProgram
    setting: Job
    quiet: Bools
    stops: Bools
    room: WindowResult

    def correct(self, own: Window, before: Corrected | None, clock: Clock) -> Corrected:
        """Correct a window; see `parallel.Work`.

        Where the arm comes from is foretold by many targets before, if it is not known.
        That the program begins there is an invention.
        """
        if before is None:
            own = cuts.window(self.quiet, own.first, own.end, cuts.RUN_UP)
        visits = own.of(self.reading.visits, known=before is not None)
        lead, arrived, doubtful = _lead(own, before)
        if before is None and own.begin:
            lead = replace(lead, begin=self._foretell(own.begin))
        trail, after = self._watch(own), self._after(own)
        setting = self.setting.with_clock(clock)
        aims = self.reading.aims[own.begin : own.stop]
        part = replace(self.reading, visits=visits, aims=aims)
        planned, kept, _ = _correct_visits(
            part, setting, lead, arrived, doubtful, trail
        )
        self.room.put(slice(own.first, own.end), kept, own.own)
        at, rows = after - own.begin, own.rows(after, own.end)
        return Corrected(
            window=own,
            kept=kept.of_window(visits, own.own),
            trail=trail,
            left=kept.rows(trail.left),
            right=kept.rows(trail.right),
            exit=planned.plan.exact.at(at),
            arrivals=deepcopy(planned.plan.lead(rows)),
            doubtful=int(planned.doubtful[at : at + 1].max(initial=0)),
        )

    def _foretell(self, visit: int) -> StartState:
        """Guess where the arm stands at a visit: on the branch of the last joint move.

        Lines do not say on which branch they are, in some languages. A wrong guess is
        found out where windows are joined.
        """
        visits = self.reading.visits
        tells = visits.motion.kind[:visit] == Motion.JOINT
        rows = np.append(np.flatnonzero(tells)[-1:], visit)
        steps = np.arange(len(rows))
        taken = visits.take(rows, Graph(np.append(steps, len(rows)), steps - 1))
        alone = taken.with_columns(block=np.full(len(rows), -1))
        return plan_visits(alone, self.setting.cell, False).plan.exact.at(steps[-1])

    def _after(self, own: Window) -> int:
        """Return where the window behind one begins."""
        n = len(self.quiet)
        return cuts.window(self.quiet, own.end, n).begin if own.end < n else n

    def _watch(self, own: Window) -> RoundLog:
        """Say what is to be watched of a window."""
        first = max(own.first - cuts.BAND, own.begin)
        left = own.rows(first, min(own.first + cuts.BAND, own.stop))
        if own.first == 0:
            left = slice(0, 0)
        right = own.rows(self._after(own), min(own.end + cuts.BAND, own.stop))
        return RoundLog(left, right)

    def whole(self) -> list[Window]:
        """Return the program as one window."""
        n = len(self.quiet)
        return [Window(0, n, 0, n)]

    def joins(self, before: Corrected, after: Corrected) -> bool:
        """Tell whether two windows found the same at the cut between them."""
        cut, n = after.window.first, len(self.quiet)
        first, end = max(cut - cuts.BAND, 0), min(cut + cuts.BAND, n)
        from_left = first - self._after(before.window)
        rows = slice(from_left, from_left + end - first)
        ours = {name: part[rows] for name, part in before.right.items()}
        return same_rows(ours, after.left) and same_looks(
            before.trail.end[rows], after.trail.begin
        )

    def merge(self, windows: Sequence[Window], cut: int) -> list[Window]:
        """Make one window of those on both sides of a cut, up to the next stops."""
        place = windows[cut].first
        stops = np.flatnonzero(self.stops) + 1
        low = stops[stops < place].max(initial=0)
        high = stops[stops > place].min(initial=len(self.quiet))
        ends = [w.end for w in windows[:-1]]
        kept = [e for e in ends if e != place and not low < e < high]
        bounds = pairwise([0, *kept, len(self.quiet)])
        return [cuts.window(self.quiet, a, b) for a, b in bounds]


def _lead(window: Window, before: Corrected | None) -> tuple[Boundary, Arrivals, int]:
    """Say how a window goes on from the one before."""
    if before is None or window.begin == 0:
        return FROM_START, UNLED, 0
    rows = slice(0, window.first - window.begin)
    lead = Boundary(before.exit, before.trail.end[rows], before.trail.settled)
    return lead, before.arrivals, before.doubtful
