"""A program with the points of a plan: written, read, corrected, and predicted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.compensation.options import Job
from postproc.compensation.outcome import Status
from postproc.compensation.paths.arcs import (
    STRAIGHT,
    Cut,
    WantedArcs,
    flat_pieces,
    halves,
)
from postproc.compensation.paths.backlash_preload import (
    MeantSides,
    cross_at_once,
    find_drive_turns,
)
from postproc.compensation.paths.insertion_plan import InsertionPlan, Written
from postproc.compensation.paths.path_error import PathAccuracy
from postproc.compensation.paths.split_constraints import hindrances, unwritable
from postproc.compensation.paths.write_points import insert, lines_in_files
from postproc.compensation.pipeline import (
    BY_VISIT,
    EXPLAINING,
    CompensatedProgram,
    WindowResult,
    correct,
)
from postproc.compensation.program import ParsedProgram
from postproc.compensation.rewrite import Output
from postproc.compensation.timing_comparison import InTime, run_in_time
from postproc.diagnostics import Code
from postproc.language.language import Splitter
from postproc.language.visits import Visits
from postproc.model.flank_hypotheses import FlankOfJoint, flanks_of
from postproc.robot.pose import MM

AIM = 0.4  # of the tolerance: what points are to reach
MOST = 0.95  # of a way: that much is to be within half of the tolerance
KEPT = 4  # predictions that are kept: plans return to what was tried


Write = Callable[[ParsedProgram, WindowResult, Job], tuple[Output, ParsedProgram]]


@dataclass(frozen=True, eq=False)
class InsertionTask:
    """A corrected program that may get points.

    Attributes:
        source: The program without points.
        first: .. in time.
        setting: What it is compensated with.
        write: Writes a corrected program, and reads it again.
        splitter: Writes points into its files.
    """

    source: CompensatedProgram
    first: InTime
    setting: Job
    write: Write
    splitter: Splitter
    _known: dict[Written, PathPrediction] = field(default_factory=dict, repr=False)

    @property
    def visits(self) -> Visits:
        """Return the visits of the source, n."""
        return self.source.reading.visits

    @cached_property
    def lines(self) -> Ints:
        """Return the lines of the source's visits in its files, (n,)."""
        return lines_in_files(self.source.reading, self.setting.cell)

    @cached_property
    def flanks(self) -> tuple[FlankOfJoint, ...]:
        """Return what is known of how joints 1 to 6 change their flanks."""
        return flanks_of(self.setting.model, self.setting.cell.arm)

    @cached_property
    def _hindrances(self) -> dict[int, str]:
        decided, keeps_aux = self.source.kept.decisions, self.splitter.keeps_aux
        return hindrances(
            self.visits, decided, self.first.before, self.setting.cell, keeps_aux
        )

    def find_hindrance(self, v: int) -> str:
        """Say why nothing can be put on the way to a visit, "" for nothing."""
        file, line = int(self.visits.file[v]), int(self.lines[v])
        found = self._hindrances.get(v)
        return found or unwritable(self.splitter, self.visits, v, file, line)

    @property
    def tolerance(self) -> float:
        """The largest deviation that is asked for [m]."""
        asked = self.setting.options.path_tolerance_mm
        return np.inf if asked is None else asked * MM

    @property
    def aim(self) -> float:
        """What the points of a move are to reach [m]."""
        return AIM * self.tolerance

    def predict(self, plan: InsertionPlan) -> PathPrediction:
        """Correct the program with the points of a plan, and predict it.

        What was predicted lately is not predicted again.
        """
        key = plan.written
        found = self._known.pop(key, None)
        found = self._make(plan) if found is None else replace(found, plan=plan)
        self._known[key] = found
        if len(self._known) > KEPT:
            del self._known[next(iter(self._known))]
        return found

    def _make(self, plan: InsertionPlan) -> PathPrediction:
        own = np.arange(len(self.visits))
        if not (plan.points or plan.approaches):
            return PathPrediction(self, plan, self.source, own)
        cell, clock = self.setting.cell, self.setting.clock
        with clock("insert"):
            reading, own = insert(
                self.source.reading, plan.points, plan.preloads, self.splitter, cell,
                plan.chords, plan.approaches, self._list_meant_sides(plan),
                self._joints_along,
            )  # fmt: skip
        options = self.setting.options.without_clones()
        reading, kept = correct(reading, replace(self.setting, options=options))
        output, again = self.write(reading, kept, self.setting)
        owner = np.searchsorted(own, np.arange(len(reading.visits)))
        with clock("time"):
            told = run_in_time(
                reading, again, kept.position, self.setting, owner,
                self.list_wanted_arcs(plan),
            )  # fmt: skip
        program = CompensatedProgram(reading, kept, output, told)
        return PathPrediction(self, plan, program, own)

    def _joints_along(self, v: int, share: Floats) -> Floats:
        """Return the joint angles at shares (k,) of the way to a visit, (k, 6)."""
        paths = self.first.paths
        rows = paths.samples_to(v)
        way = paths.way[rows]
        found = [np.interp(share * way[-1], way, q) for q in paths.q[rows].T]
        return np.stack(found, axis=1)

    def _list_meant_sides(self, plan: InsertionPlan) -> dict[int, MeantSides]:
        """Say from which sides points on ways are meant to be passed.

        An arc is one way, from where it begins to where it ends.
        """
        paths, found = self.first.paths, dict[int, MeantSides]()
        sharp = np.array([flank.nominal == 1.0 for flank in self.flanks])
        for move in {halves(self.visits, v) for v in plan.points}:
            own = [paths.samples_to(v) for v in move]
            side = np.array(paths.side[own[0].start : own[-1].stop])
            side[:, sharp] = cross_at_once(side[:, sharp])
            if plan.halved.intersection(move):
                side = (side + _evenly(side, [paths.way[rows] for rows in own])) / 2
            for v, rows in zip(move, own, strict=True):
                if v in plan.points:
                    there = side[rows.start - own[0].start :]
                    found[v] = self._mean(v, plan.points[v], rows, side[0], there)
        return found

    def _mean(
        self, v: int, points: Sequence[float], rows: slice, begin: Floats, side: Floats
    ) -> MeantSides:
        """Say from which sides the points of one way are meant to be passed.

        Args:
            v: The visit at its end.
            points: Shares of the way, (k,).
            rows: Its samples.
            begin: Where joints lie in their play where the move begins, (6,).
            side: .. at these samples, and any behind them, (s, 6).
        """
        paths = self.first.paths
        way = paths.way[rows]
        ends = np.array([0.0, *points, 1.0]) * way[-1]
        at = np.searchsorted(way, ends).clip(0, len(way) - 1)
        tool, there = self.first.after.targets.tool[v, :3, :3], side[at]
        turn = find_drive_turns(
            self.setting, self.visits, v, tool, paths.q[at + rows.start], there - begin
        )
        between = (there[:-1] + there[1:]) / 2
        return MeantSides(there[1:-1], turn[1:-1], between)

    def list_wanted_arcs(self, plan: InsertionPlan) -> WantedArcs:
        """Return the arcs that a plan cuts."""
        cut = cut_arcs(self.visits, plan)
        return WantedArcs.of(self.first.before, self.visits.before, cut)


@dataclass(frozen=True, eq=False)
class PathPrediction:
    """A program with the points of a plan, and how it keeps to its paths.

    Attributes:
        task: The program without points.
        plan: What is on its ways.
        program: It with these points, corrected; the source where there are none.
        own: The visits of it that the source makes, (n,).
    """

    task: InsertionTask
    plan: InsertionPlan
    program: CompensatedProgram
    own: Ints

    @property
    def in_time(self) -> InTime:
        """Return the program in time."""
        return self.program.in_time or self.task.first

    @property
    def paths(self) -> PathAccuracy:
        """Return how the program keeps to its paths."""
        return self.in_time.paths

    @property
    def room(self) -> int:
        """Return how many more points may be put in."""
        return self.task.setting.options.max_inserted - self.plan.count

    @property
    def too_far(self) -> Ints:
        """The paths that are left too far, the worst first."""
        sizes = self.paths.after.sizes
        order = np.argsort(-sizes, kind="stable")
        return order[sizes[order] > self.task.tolerance]

    @property
    def to_split(self) -> Ints:
        """The paths that are left too far, or most of whose way is not near enough."""
        paths, tolerance = self.paths, self.task.tolerance
        step = np.diff(paths.way, prepend=0.0)
        step[paths.first[:-1]] = 0.0
        far = np.where(paths.after.across > tolerance / 2, step, 0.0)
        off, whole = (np.add.reduceat(each, paths.first[:-1]) for each in (far, step))
        far_off = off > (1.0 - MOST) * whole
        return np.flatnonzero(far_off | (paths.after.sizes > tolerance))

    @property
    def cut_arcs(self) -> list[int]:
        """Return the points on the ways of the arcs that are cut."""
        return cut_arcs(self.task.visits, self.plan)

    @cached_property
    def refusals(self) -> dict[int, str]:
        """Say why points of moves cannot be corrected, by visit, of those alone."""
        return {v: why for v in self.plan.points if (why := self._refusal(v))}

    def _refusal(self, v: int) -> str:
        decided = self.program.kept.decisions
        rows = self._on_way(v)
        left = rows[decided.status[rows] != Status.CORRECTED]
        if len(left):
            why = decided.reasons[decided.why[left[0]]]
            return f"points inserted into it cannot be corrected: {why}"
        visits = self.program.reading.visits
        passed = rows[~visits.via[rows]][v in self.plan.stops :]
        sized = visits.fly[passed] & (visits.zone_mm[passed] > 0.0)
        return "" if sized.all() else self.task.splitter.unsized

    def steep_pieces(self, v: int) -> list[int]:
        """List the pieces of a move, from 0, on which corrections change too fast."""
        decided, via = self.program.kept.decisions, self.program.reading.visits.via
        steps = [one.code is Code.CORRECTION_STEP for one in decided.reasons]
        marked = np.array(steps)[decided.why]
        begin = int(self.own[self.task.visits.before[v]])
        pieces = enumerate(pairwise([begin, *self.ends(v)]))
        return [
            k for k, (a, b) in pieces
            if (marked[b - 1] if via[b - 1] else marked[a] and marked[b])
        ]  # fmt: skip

    @cached_property
    def flat(self) -> dict[Cut, float]:
        """What the pieces of arcs bend that are too flat for arcs [m]."""
        visits, points = self.program.reading.visits, self.plan.points
        values = self.program.kept.decisions.corrected
        moved = (values - visits.values)[:, :3] * MM
        ends = {
            row: (half, share)
            for via in self.cut_arcs
            for half in (via, via + 1)
            for row, share in zip(
                self.ends(half), (*points.get(half, ()), 1.0), strict=False
            )
        }
        arcs = [row - 1 for row in sorted(ends) if visits.via[row - 1]]
        found = flat_pieces(visits, moved, np.array(arcs, dtype=np.int64))
        return {ends[row]: bent for row, bent in found}

    def may_be_chord(self, cut: Cut) -> bool:
        """Return True if a piece that is too flat may be a chord, but the last."""
        last = cut[1] == 1.0 and not self.task.visits.via[cut[0]]
        return self.flat[cut] <= STRAIGHT * self.task.tolerance and not last

    def _on_way(self, v: int) -> Ints:
        """Return the visits with points on the way to one, without it."""
        return np.arange(int(self.own[v - 1]) + 1 if v else 0, int(self.own[v]))

    def ends(self, v: int) -> list[int]:
        """Return the visits with points at which the pieces of a move end, itself too.

        Those of the program with points.
        """
        rows = np.append(self._on_way(v), self.own[v])
        ends: list[int] = rows[~self.program.reading.visits.via[rows]].tolist()
        return ends


def cut_arcs(visits: Visits, plan: InsertionPlan) -> list[int]:
    """Return the points on the ways of the arcs that a plan cuts."""
    return sorted(v for v in plan.points if visits.via[v])


def _evenly(side: Floats, ways: list[Floats]) -> Floats:
    """Let joints go evenly from where they lie first to where they lie last, (s, 6).

    Args:
        side: Where they lie along a move, (s, 6).
        ways: Path length at the samples of its parts [m].
    """
    ends = np.cumsum([0.0, *(way[-1] for way in ways)])
    along = np.concatenate([way + end for way, end in zip(ways, ends, strict=False)])
    u = (along / max(ends[-1], 1e-12))[:, None]
    return np.asarray((1 - u) * side[0] + u * side[-1])


def of_source(kept: WindowResult, own: Ints) -> WindowResult:
    """Keep what is told of some visits (n,) of a corrected program."""
    moved = np.isin(np.flatnonzero(kept.corrected), own)
    explained = len(kept.travel) > 0
    return replace(
        kept,
        decisions=kept.decisions.part(own),
        before=kept.before[moved],
        after=kept.after[moved],
        departure=kept.departure[own]
        if len(kept.departure) == len(kept.corrected)
        else kept.departure,
        **{name: getattr(kept, name)[own] for name in BY_VISIT},
        **{name: getattr(kept, name)[own] for name in EXPLAINING if explained},
    )
