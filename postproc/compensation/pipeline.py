"""A program corrected until its sides stay put, window by window where it is long."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import (
    Bools,
    Floats,
    Indices,
    Interned,
    isin_sorted,
    release_memory,
)
from postproc.compensation import windowing as cuts
from postproc.compensation.clones import give_own_points
from postproc.compensation.consensus import (
    RoundLog,
    same_looks,
    same_rows,
)
from postproc.compensation.decisions import Proposal, with_what_moves_along
from postproc.compensation.eligibility import find_overruled
from postproc.compensation.iterate import (
    FROM_START,
    Boundary,
    Converged,
    NotAloneError,
    iterate,
)
from postproc.compensation.options import (
    Clock,
    Job,
)
from postproc.compensation.outcome import (
    Decisions,
    Status,
)
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
from postproc.compensation.windowing import Window, cut_points, seams, windows
from postproc.compensation.workers import in_processes
from postproc.diagnostics import NO_REASON
from postproc.language.text.source import Replacements
from postproc.language.visits import Graph, Visits
from postproc.model.model import Model
from postproc.motion.joint_path import StartState
from postproc.robot.cell import Cell
from postproc.robot.direction import UNLED, Arrivals
from postproc.robot.pose import MM
from postproc.robot.state import States
from postproc.robot.trajectory import Motion

if TYPE_CHECKING:
    from postproc.compensation.rewrite import Output
    from postproc.compensation.timing_comparison import InTime

# What is kept of a program, or of a window of it, once its targets are corrected.


@dataclass(frozen=True)
class WindowResult:
    """A corrected program without poses, paths and plans (structure of arrays).

    Attributes:
        edited: Literals that get new numbers, (m,).
        edits: The edits of these, file by file.
        decisions: What was decided for n visits.
        corrected: Visits whose target moves, (n,).
        before, after: Size of the predicted error of the k visits that move, (k,) [m].
        position: Where the program wants the TCP, (n, 3) [m], base frame.
        away: How far the path passes it, (n,) [mm].
        overruled: The path does not follow the configuration string, and nobody said
            that it must, (n,).
        untimed: No time law was found, (n,).
        travel: Of every joint since its last reversal, (n, 6) [rad].
        speed: Of the TCP, (n,) [m/s], NaN where nobody asked.
        departure: Largest change on the way to every visit of a joint [rad], elbow,
            wrist centre and TCP [m], (n, 4), NaN where not known; of a part its
            largest, one row.
    """

    edited: Indices
    edits: tuple[Replacements, ...]
    decisions: Decisions
    corrected: Bools
    before: Floats
    after: Floats
    position: Floats
    away: Floats
    overruled: Bools
    untimed: Bools
    travel: Floats
    speed: Floats
    departure: Floats

    def part(self, visits: Visits, own: slice) -> WindowResult:
        """Keep some of these visits, which share no number with the others.

        Args:
            visits: All visits.
            own: Those to keep.
        """
        moved = np.flatnonzero(self.corrected)
        rows = slice(*np.searchsorted(moved, [own.start, own.stop]).tolist())
        literals = np.sort(visits.target.literal[own])
        mine = isin_sorted(self.edited, literals)
        starts = np.sort(visits.literals.places[self.edited[mine]].start, axis=None)
        edits = tuple(
            Replacements(e.start[at], e.end[at], e.new[at])
            for e in self.edits
            for at in [isin_sorted(e.start, starts)]
        )
        return replace(
            self, edited=self.edited[mine].astype(np.int32), edits=edits,
            before=self.before[rows], after=self.after[rows],
            decisions=self.decisions.part(own),
            departure=np.fmax.reduce(self.departure[own], axis=0, keepdims=True),
            **{
                name: np.array(getattr(self, name)[own])
                for name in (*BY_VISIT, *EXPLAINING)
            },
        )  # fmt: skip

    def rows(self, some: slice) -> dict[str, NDArray[Any]]:
        """Return what is kept of some visits."""
        decided = self.decisions.part(some)
        names = (*BY_VISIT, *EXPLAINING, "departure")
        found = {name: np.array(getattr(self, name)[some]) for name in names}
        for f in fields(Decisions):
            if f.name not in ("why", "reasons"):
                found[f"decided {f.name}"] = np.array(getattr(decided, f.name))
        why = [decided.reasons[k] for k in decided.why.tolist()]
        return found | {"why": np.array(why, dtype=object)}


BY_VISIT = ("corrected", "position", "away", "overruled", "untimed")
EXPLAINING = ("travel", "speed")


@dataclass(frozen=True)
class CompensatedProgram:
    """A corrected program, before it is told of.

    Attributes:
        reading: The program.
        kept: What came of its visits.
        output: What is to be written.
        in_time: The program in time; None where nobody asked.
    """

    reading: ParsedProgram
    kept: WindowResult
    output: Output
    in_time: InTime | None


def correction_of(
    visits: Visits,
    planned: PlannedProgram,
    states: States,
    found: Converged,
    cell: Cell,
    model: Model,
) -> WindowResult:
    """Keep what a report says of corrected visits."""
    proposal, done, plan = found.proposal, found.reached, planned.plan
    moved = proposal.corrected
    new = states.with_(q=np.array(done.q), direction=np.array(done.side))[moved]
    wanted = plan.tcp[:, :3, 3] + planned.shift
    before = model.error(cell.arm, states[moved]) - planned.shift[moved]
    after = done.tcp[moved, :3, 3] + model.error(cell.arm, new) - wanted[moved]
    return WindowResult(
        edited=proposal.edited,
        edits=found.edits,
        decisions=with_what_moves_along(visits, planned, cell, proposal.decisions),
        corrected=moved,
        before=np.linalg.norm(before, axis=1),
        after=np.linalg.norm(after, axis=1),
        position=wanted - plan.aside,
        away=np.linalg.norm(np.nan_to_num(plan.aside), axis=1) / MM,
        overruled=find_overruled(planned.targets, plan).find_unchecked(visits),
        untimed=plan.untimed,
        travel=plan.travel,
        speed=plan.speed,
        departure=found.moved.sizes,
    )


def join_windows(parts: list[WindowResult]) -> WindowResult:
    """Put the windows of a program one after the other.

    Args:
        parts: The windows; the list is emptied, and nothing is held twice for long.
    """
    if len(parts) == 1:
        return parts[0]
    own = [dict(vars(part)) for part in parts]
    decisions = [dict(vars(part.pop("decisions"))) for part in own]
    parts.clear()
    edits = zip(*(part.pop("edits") for part in own), strict=True)
    return WindowResult(
        edits=tuple(Replacements.merge(some) for some in edits),
        decisions=_one_after_another(decisions),
        **{name: _column(name, own) for name in list(own[0])},
    )


def _one_after_another(parts: Sequence[dict[str, Any]]) -> Decisions:
    """Join decisions, and their reasons; the parts are emptied."""
    numbers = Interned([NO_REASON])
    for part in parts:
        why, reasons = part["why"], part.pop("reasons")
        new = np.zeros(len(reasons), dtype=np.int32)
        for k in np.unique(why).tolist():
            new[k] = numbers[reasons[k]]
        part["why"] = new[why]
    columns = {name: _column(name, parts) for name in list(parts[0])}
    return Decisions(reasons=tuple(numbers), **columns)


def _column(name: str, parts: Sequence[dict[str, Any]]) -> NDArray[Any]:
    """Take a column from all parts, and join it."""
    column = np.concatenate([part.pop(name) for part in parts])
    release_memory(len(column))
    return column


# A program corrected window by window, so that only one is in memory at a time.


@dataclass(frozen=True)
class Corrected:
    """A window that was worked through, and what its neighbours must know of it.

    Attributes:
        window: The window.
        kept: What is kept of its own visits.
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
    work = _WindowWork(reading, setting, quiet, stops)
    cut = windows(quiet, cuts.share(len(quiet), setting.processes))
    if len(cut) > 1:
        try:
            found = in_processes(work, cut, setting.clock, setting.processes)
            parts = [part.kept for part in found]
            found.clear()
            return join_windows(parts)
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
    """

    reading: ParsedProgram
    setting: Job
    quiet: Bools
    stops: Bools

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
        at, rows = after - own.begin, own.rows(after, own.end)
        return Corrected(
            window=own,
            kept=kept.part(visits, own.own),
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
