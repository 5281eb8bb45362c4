"""A long program corrected window by window, as if it were one window.

Only one window is in memory at a time in each process.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools
from postproc.compensation.options import Clock, Job
from postproc.compensation.program import ParsedProgram, PlannedProgram, plan_visits
from postproc.compensation.scale import windowing as cuts
from postproc.compensation.scale.consensus import RoundLog, same_looks, same_rows
from postproc.compensation.scale.windowing import Window, cut_points, seams, windows
from postproc.compensation.scale.workers import in_processes
from postproc.compensation.solver.decisions import Proposal
from postproc.compensation.solver.iterate import FROM_START, Boundary, NotAloneError
from postproc.compensation.window_result import (
    WindowResult,
    complete_room,
    example_of,
    in_shared_memory,
    room_like,
)
from postproc.language.visits import Graph
from postproc.motion.joint_path import StartState
from postproc.robot.direction import UNLED, Arrivals
from postproc.robot.trajectory import Motion

Solve = Callable[
    [ParsedProgram, Job, Boundary, Arrivals, int, RoundLog | None],
    tuple[PlannedProgram, WindowResult, Proposal],
]
"""Plans and corrects visits, see `pipeline.correct_visits`."""


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


def in_windows(
    reading: ParsedProgram, setting: Job, solve: Solve
) -> WindowResult | None:
    """Correct a program window by window, as if it were one window.

    A time law is found for a run between stops as a whole: where the model depends on
    the speed, programs are cut at stops alone.

    Args:
        reading: The program.
        setting: What it is compensated with.
        solve: Corrects visits.

    Returns:
        None where it must be one window: it is short, or something reaches too far.
    """
    if len(reading.visits) < 2 * cuts.LEAST:
        return None
    stops = cut_points(reading.visits)
    quiet = stops if "speed" in setting.model.needs else seams(reading.visits)
    cut = windows(quiet, cuts.share(len(quiet), setting.processes))
    if len(cut) == 1:
        return None
    make = np.empty if setting.processes == 1 else in_shared_memory
    width = reading.visits.target.values.shape[1]
    room = room_like(example_of(width, setting.options.orientation), len(quiet), make)
    work = _WindowWork(reading, setting, solve, quiet, stops, room)
    try:
        found = in_processes(work, cut, setting.clock, setting.processes)
    except NotAloneError:
        return None
    ends = [0, *(part.window.end for part in found)]
    return complete_room(room, [part.kept for part in found], ends)


@dataclass(frozen=True)
class _WindowWork:
    """What it takes to correct any window of a program.

    Attributes:
        reading: The program.
        setting: What it is compensated with.
        solve: Corrects visits.
        quiet: Behind which visits it may be cut, (n,).
        stops: .. where the arm stops, (n,).
        room: What is kept of all visits is put there.
    """

    reading: ParsedProgram
    setting: Job
    solve: Solve
    quiet: Bools
    stops: Bools
    room: WindowResult

    def correct(self, own: Window, before: Corrected | None, clock: Clock) -> Corrected:
        """Correct a window; see `workers.Work`.

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
        planned, kept, _ = self.solve(part, setting, lead, arrived, doubtful, trail)
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
