"""A program with the points of a plan: written, read, corrected, and predicted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from postproc.arrays import Bools, Floats, Ints, spans
from postproc.compensation.findings.timing_comparison import (
    InTime,
    run_in_time,
    run_visits,
)
from postproc.compensation.options import Job
from postproc.compensation.output.rewrite import Output
from postproc.compensation.paths import changed_windows
from postproc.compensation.paths.arcs import (
    STRAIGHT,
    Cut,
    WantedArcs,
    flat_pieces,
)
from postproc.compensation.paths.changed_windows import (
    Key,
    Part,
    Windows,
    take_windows,
)
from postproc.compensation.paths.gathered import Gathered
from postproc.compensation.paths.insertion_plan import InsertionPlan, Written
from postproc.compensation.paths.meant_sides import PlanSides
from postproc.compensation.paths.moved_corners import SourceCorners
from postproc.compensation.paths.path_error import (
    PathAccuracy,
    deviations_of,
    gather_paths,
)
from postproc.compensation.paths.plan_outcomes import (
    MoveOutcomes,
    Predicted,
    Rows,
    compare,
    expect_better,
)
from postproc.compensation.paths.plan_rule import NEGLIGIBLE, MoveDeviation
from postproc.compensation.paths.split_constraints import (
    hindrances,
    speeds_of_pieces,
    unwritable,
)
from postproc.compensation.paths.write_points import (
    PathPoints,
    insert,
    lines_in_files,
)
from postproc.compensation.pipeline import correct
from postproc.compensation.program import ParsedProgram
from postproc.compensation.window_result import CompensatedProgram, WindowResult
from postproc.language.insert_moves import Splitter
from postproc.language.visits import Visits
from postproc.model.flank_hypotheses import FlankKind, FlankOfJoint, flanks_of
from postproc.robot.pose import MM, lengths

AIM = 0.4  # of the tolerance: what points are to reach
AT_ONCE = 600  # windows that are predicted: arrays of more leave the processor's cache
KEPT = 4  # predictions that are kept: plans return to what was tried

Write = Callable[[ParsedProgram, WindowResult, Job], tuple[Output, ParsedProgram]]

Compared = tuple[Rows, tuple[Part, ...]]
"""A move, and what tells of it with each of the plans that are compared."""


@dataclass(frozen=True, eq=False)
class Whole:
    """A program with the points of a plan, written.

    Attributes:
        own: Which of its visits each visit of the source is, (n,).
        program: It, corrected and in time.
    """

    own: Ints
    program: CompensatedProgram


@dataclass(frozen=True, eq=False)
class InsertionTask:
    """A corrected program that may get points.

    Attributes:
        reading: The program without points.
        kept: How it is corrected.
        first: It, corrected, in time.
        setting: What it is compensated with.
        write: Writes a corrected program, and reads it again.
        splitter: Writes points into its files.
    """

    reading: ParsedProgram
    kept: WindowResult
    first: InTime
    setting: Job
    write: Write
    splitter: Splitter
    _whole: dict[Written, PathPrediction] = field(default_factory=dict, repr=False)
    _parts: dict[tuple[int, Key], Part] = field(default_factory=dict, repr=False)
    _settled: set[tuple[int, Key]] = field(default_factory=set, repr=False)
    _compared: dict[Compared, MoveOutcomes] = field(default_factory=dict, repr=False)

    @property
    def visits(self) -> Visits:
        """Return the visits of the source, n."""
        return self.reading.visits

    @cached_property
    def lines(self) -> Ints:
        """Return the lines of the source's visits in its files, (n,)."""
        return lines_in_files(self.reading, self.setting.cell)

    @cached_property
    def flanks(self) -> tuple[FlankOfJoint, ...]:
        """Return what is known of how joints 1 to 6 change their flanks."""
        return flanks_of(self.setting.model, self.setting.cell.arm)

    @cached_property
    def sides(self) -> PlanSides:
        """Return from which sides points of plans are meant to be passed."""
        return PlanSides(self.setting, self.visits, self.first, self.flanks)

    @cached_property
    def open_moves(self) -> frozenset[int]:
        """Return the moves on the way of which flanks may change otherwise by any data.

        Without points; of steps that are too small to count none.
        """
        paths, found = self.first.paths, set[int]()
        for case in paths.cases.cases if paths.cases else ():
            if case.key[1] not in (FlankKind.RAN_ON, FlankKind.START):
                rows = case.rows[lengths(case.by) > NEGLIGIBLE * self.tolerance]
                at = np.searchsorted(paths.first, rows, side="right") - 1
                found.update(paths.visit[np.unique(at)].tolist())
        return frozenset(found)

    @cached_property
    def windows(self) -> Windows:
        """Return the windows of the program between its stops."""
        return Windows.of(self.visits, self.first.before, self.setting, self.flanks)

    @cached_property
    def speeds(self) -> Floats:
        """Return the largest speed that each move may have, (n,) [m/s]."""
        setting = self.setting
        return speeds_of_pieces(self.first.before, setting.cell, setting.model)

    @cached_property
    def corners(self) -> SourceCorners:
        """Return how the source passes its visits."""
        return SourceCorners.of(
            self.setting.cell.arm, self.first.before, self.visits.motion.via
        )

    @cached_property
    def _hindrances(self) -> dict[int, str]:
        decided, keeps_aux = self.kept.decisions, self.splitter.keeps_aux
        return hindrances(
            self.visits, decided, self.first.before, self.setting.cell, self.speeds,
            keeps_aux,
        )  # fmt: skip

    def find_hindrance(self, v: int) -> str:
        """Say why nothing can be put on the way to a visit, "" for nothing."""
        file, line = int(self.visits.place.file[v]), int(self.lines[v])
        found = self._hindrances.get(v)
        return found or unwritable(self.splitter, self.visits, v, file, line)

    @cached_property
    def deviations(self) -> dict[int, MoveDeviation]:
        """Return how far each move leaves its path without points, by visit."""
        paths = self.first.paths
        return deviations_of(paths, np.arange(len(paths)))

    @cached_property
    def sizes(self) -> dict[int, float]:
        """Return how far each move leaves its path without points, at the most [m]."""
        return {v: one.largest for v, one in self.deviations.items()}

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

        Only windows whose points, or whose run-up's, have not been predicted, and those
        behind them where links lie otherwise; all where that is most of the program.
        """
        if plan.approaches:
            return self.predict_whole(plan)
        keys = self.windows.list_keys(plan)
        own = self.windows.of_visits(plan.points)
        if not self._know(plan, keys, own.tolist()):
            return self._predict_all(plan, keys)
        behind = self._list_changed_behind(keys, own)
        if not self._know(plan, keys, behind):
            return self._predict_all(plan, keys)
        part = np.zeros(len(self.visits), dtype=np.int64)
        parts = {self._source: 0}  # no two of them are equal
        for k in (*own.tolist(), *behind):
            number = parts.setdefault(self._parts[k, keys[k]], len(parts))
            part[self.windows.own(k)] = number
        return PathPrediction(self, plan, tuple(parts), part)

    def _know(
        self, plan: InsertionPlan, keys: Mapping[int, Key], some: Sequence[int]
    ) -> bool:
        """Predict those of some windows that are new, see `_predict_windows`."""
        while new := [k for k in some if (k, keys[k]) not in self._parts]:
            if not self._predict_windows(plan, keys, new[:AT_ONCE]):
                return False
        return True

    def _predict_all(
        self, plan: InsertionPlan, keys: Mapping[int, Key]
    ) -> PathPrediction:
        """Predict the whole program, and keep what it says of every window."""
        found = self.predict_whole(plan)
        (part,) = found.parts
        if self._is_where_it_was(part, np.ones(len(self.visits), dtype=bool)):
            self._keep(part, keys, list(keys))
        return found

    def _keep(self, part: Part, keys: Mapping[int, Key], some: Sequence[int]) -> None:
        """Keep the prediction of some windows, and note which end as in the source."""
        self._parts.update({(k, keys[k]): part for k in some})
        travels = "travel" in self.setting.model.needs
        alike = part.ends_as(self.first.after, self.windows.end[list(some)], travels)
        pairs = zip(some, alike.tolist(), strict=True)
        self._settled.update((k, keys[k]) for k, settled in pairs if settled)

    def _list_changed_behind(self, keys: Mapping[int, Key], own: Ints) -> list[int]:
        """List the windows that others with points before them may change.

        Where these end with all links as in the source nothing is changed behind them.

        Args:
            keys: What the plan puts on windows and their run-ups.
            own: The windows with points.
        """
        behind = np.array(sorted(keys.keys() - {*own.tolist()}), dtype=np.int64)
        last = own[np.searchsorted(own, behind) - 1].tolist()
        pairs = zip(behind.tolist(), last, strict=True)
        return [k for k, at in pairs if (at, keys[at]) not in self._settled]

    def predict_whole(self, plan: InsertionPlan) -> PathPrediction:
        """Correct the program with the points of a plan, write it, and predict it.

        What was predicted lately is not predicted again.
        """
        key = plan.written
        found = self._whole.pop(key, None) or self._make(plan)
        self._whole[key] = found
        if len(self._whole) > KEPT:
            del self._whole[next(iter(self._whole))]
        return replace(found, plan=plan)

    def compare(
        self, made: Sequence[PathPrediction], moves: Sequence[Rows]
    ) -> dict[Rows, MoveOutcomes]:
        """Compare no points on moves with what some plans put there.

        What was compared stays as long as the same predictions tell of a move.
        """
        plans = [self.predict(InsertionPlan()), *made]
        keys = [
            (rows, tuple(plan.part_of(v) for plan in plans for v in rows))
            for rows in moves
        ]
        new = [key[0] for key in keys if key not in self._compared]
        found = compare([plan.predicted for plan in plans], new, self.tolerance)
        self._compared.update((key, found[key[0]]) for key in keys if key[0] in found)
        return {key[0]: self._compared[key] for key in keys}

    def expect_halves(
        self, now: PathPrediction, compared: Mapping[Rows, MoveOutcomes]
    ) -> list[Rows]:
        """List the moves for which half of a correction may be the better plan.

        Args:
            now: The program with points that correct all.
            compared: How its moves do with these and with other plans.
        """
        lines: dict[Rows, MoveOutcomes] = {
            rows: one
            for rows, one in compared.items()
            if len(rows) == 1 and rows[0] in now.plan.points
        }
        arcs = [rows for rows in compared if len(rows) > 1]
        shifts = self.sides.half_shifts(now.plan, [rows[0] for rows in lines])
        return [*arcs, *expect_better(now.predicted, shifts, lines)]

    @cached_property
    def _source(self) -> Part:
        own = np.arange(len(self.visits))
        return Part(self.visits, self.kept, self.first, own)

    def _make(self, plan: InsertionPlan) -> PathPrediction:
        reading, own = self._insert(plan)
        reading, kept = self._correct(reading)
        output, again = self.write(reading, kept, self.setting)
        owner = np.searchsorted(own, np.arange(len(reading.visits)))
        part = self._run(plan, reading, again, kept, own, owner)
        program = CompensatedProgram(reading, kept, output, part.in_time)
        number = np.zeros(len(self.visits), dtype=np.int64)
        return PathPrediction(self, plan, (part,), number, Whole(own, program))

    def write_whole(self, now: PathPrediction) -> PathPrediction:
        """Write a program as its windows were corrected.

        It is run in time once more. Where its joints arrive as in the windows, these
        tell of it; else all of it is corrected and predicted.
        """
        plan = now.plan
        if not plan.points:
            output, _ = self.write(self.reading, self.kept, self.setting)
            program = CompensatedProgram(self.reading, self.kept, output, self.first)
            return replace(now, written=Whole(now.parts[0].own, program))
        reading, own = self._insert(plan)
        gathered = Gathered.of(now.parts, now.part, own, len(reading.visits))
        kept = gathered.correct(reading)
        if kept is None:
            return self.predict_whole(plan)
        output, again = self.write(reading, kept, self.setting)
        with self.setting.clock("time"):
            after = run_visits(again.visits, self.setting.cell)
        if not gathered.arrives_as(after, "travel" in self.setting.model.needs):
            return self.predict_whole(plan)
        in_time = replace(self.first, after=after, paths=now.paths)
        program = CompensatedProgram(reading, kept, output, in_time)
        return replace(now, written=Whole(own, program))

    def _run(
        self, plan: InsertionPlan, reading: ParsedProgram, again: ParsedProgram,
        kept: WindowResult, own: Ints, owner: Ints,
    ) -> Part:  # fmt: skip
        """Run some visits of a program with points, k in all.

        Args:
            plan: Its points.
            reading: They, as they were to be.
            again: .. and as they are corrected.
            kept: How they are corrected.
            own: Which of them each visit of the source is, (n,); -1 where it is none.
            owner: On the way to which visit of the source each of them is, (k,).
        """
        with self.setting.clock("time"):
            in_time = run_in_time(
                reading, again, kept.position, self.setting, owner,
                self.list_wanted_arcs(plan), self.corners.at(own, len(owner)),
                self.first.paths,
            )  # fmt: skip
        return Part(reading.visits, kept, in_time, own)

    def _predict_windows(
        self, plan: InsertionPlan, keys: Mapping[int, Key], some: Sequence[int]
    ) -> bool:
        """Predict some windows, and keep them; all where they are most of the program.

        Args:
            plan: The points of the program.
            keys: What it puts on the windows.
            some: These windows.

        Returns:
            False where joints are elsewhere, and the program should be written.
        """
        inside, seeds = self.windows.cover(some)
        if np.count_nonzero(inside) > changed_windows.MOST * len(inside):
            some, inside[:] = [*keys], True
        own = {v: at for v, at in plan.points.items() if inside[v]}
        plan = replace(plan, points=own)
        reading, rows = self._insert(plan, proves=False)
        mine, taken = rows, np.arange(len(reading.visits))
        if not inside.all():
            reading, mine, taken = take_windows(
                reading, rows, inside, seeds, self.windows.q
            )
        reading, kept = self._correct(reading)
        again = reading.with_values(kept.decisions.corrected)
        owner = np.searchsorted(rows, taken)
        part = self._run(plan, reading, again, kept, mine, owner)
        if not self._is_where_it_was(part, inside):
            return False
        self._keep(part, keys, some)
        return True

    def _is_where_it_was(self, part: Part, inside: Bools) -> bool:
        """Return True if the joints are at the source's targets as they were."""
        rows = np.flatnonzero(inside & ~self.visits.motion.via)
        q = part.in_time.before.path.q[part.own[rows]]
        off = np.abs(q - self.windows.q[rows])
        return bool(np.nan_to_num(off).max(initial=0.0) < changed_windows.SAME)

    def _insert(
        self, plan: InsertionPlan, proves: bool = True
    ) -> tuple[ParsedProgram, Ints]:
        """Put the points of a plan into the program, see `insert`."""
        with self.setting.clock("insert"):
            put = PathPoints(
                plan.points, plan.preloads, plan.chords, plan.approaches,
                self.sides.of_plan(plan), self._joints_along,
            )  # fmt: skip
            return insert(self.reading, put, self.splitter, self.setting.cell, proves)

    def _correct(self, reading: ParsedProgram) -> tuple[ParsedProgram, WindowResult]:
        options = self.setting.options.without_clones()
        return correct(reading, replace(self.setting, options=options))

    def _joints_along(self, visits: Ints, share: Floats) -> Floats:
        """Return the joint angles at shares (k,) of the ways to visits, (k, 6)."""
        paths = self.first.paths
        start, count = paths.spans_to(visits)
        rows, last = spans(start, count), np.cumsum(count) - 1
        way, move = paths.way[rows], np.arange(len(visits))
        apart = 1.0 + float(way.max(initial=0.0))
        at = share * way[last]
        ends = np.searchsorted(way + apart * np.repeat(move, count), at + apart * move)
        ends = np.clip(ends, np.minimum(last - count + 2, last), last)
        begins = np.maximum(ends - 1, last - count + 1)
        u = (at - way[begins]) / np.maximum(way[ends] - way[begins], 1e-12)
        q, u = paths.q[rows], np.clip(u, 0.0, 1.0)[:, None]
        return np.asarray((1 - u) * q[begins] + u * q[ends])

    def list_wanted_arcs(self, plan: InsertionPlan) -> WantedArcs:
        """Return the arcs that a plan cuts."""
        cut = cut_arcs(self.visits, plan)
        return WantedArcs.of(self.first.before, self.visits.graph.before, cut)


@dataclass(frozen=True, eq=False)
class PathPrediction:
    """A program with the points of a plan, and how it keeps to its paths.

    Attributes:
        task: The program without points.
        plan: What is on its ways.
        parts: What was predicted of it, and when.
        part: Which of these tells of each visit of the source, (n,).
        written: The program with these points; None where it was not written.
    """

    task: InsertionTask
    plan: InsertionPlan
    parts: tuple[Part, ...]
    part: Ints
    written: Whole | None = None

    @property
    def program(self) -> CompensatedProgram:
        """Return it with its points, corrected; the source where there are none."""
        return self._whole.program

    @property
    def own(self) -> Ints:
        """Return the visits of it that the source makes, (n,)."""
        return self._whole.own

    @property
    def in_time(self) -> InTime:
        """Return the program in time."""
        found = self._whole.program.in_time
        assert found is not None
        return found

    @property
    def _whole(self) -> Whole:
        found = self.whole().written
        assert found is not None
        return found

    def whole(self) -> PathPrediction:
        """Return the same, written."""
        return self if self.written else self.task.write_whole(self)

    @property
    def paths(self) -> PathAccuracy:
        """Return how it keeps to its paths, from what was predicted of each."""
        paths = [part.paths for part in self.parts]
        mine = [np.flatnonzero(self.part[own.visit] == k)
                for k, own in enumerate(paths)]  # fmt: skip
        return gather_paths(paths, mine)

    def part_of(self, v: int) -> Part:
        """Return what tells of a visit of the source."""
        return self.parts[int(self.part[v])]

    @property
    def predicted(self) -> Predicted:
        """Return what tells of its moves."""
        return Predicted([part.paths for part in self.parts], self.part)

    def path_to(self, v: int) -> tuple[PathAccuracy, int]:
        """Return paths among which is that to a visit, and which it is."""
        paths = self.part_of(v).paths
        return paths, paths.row_of(v)

    def length_of(self, v: int) -> float:
        """Return the length of the path to a visit [m]."""
        paths, k = self.path_to(v)
        return float(paths.way[paths.samples(k)][-1])

    @cached_property
    def deviations(self) -> dict[int, MoveDeviation]:
        """Return how far each move leaves its path, by visit."""
        found: dict[int, MoveDeviation] = {}
        for k, part in enumerate(self.parts):
            mine = np.flatnonzero(self.part[part.paths.visit] == k)
            found.update(deviations_of(part.paths, mine))
        return dict(sorted(found.items()))

    @cached_property
    def sizes(self) -> dict[int, float]:
        """Return how far each move leaves its path at the most [m], by visit."""
        return {v: one.largest for v, one in self.deviations.items()}

    @property
    def room(self) -> int:
        """Return how many more points may be put in."""
        return self.task.setting.options.max_inserted - self.plan.count

    @property
    def too_far(self) -> list[int]:
        """The moves that leave their paths too far, the worst first."""
        tolerance, sizes = self.task.tolerance, self.sizes
        return [v for v in self.worst_first if sizes[v] > tolerance]

    @property
    def worst_first(self) -> list[int]:
        """The moves, the one that leaves its path the farthest first."""
        return sorted(self.sizes, key=lambda v: -self.sizes[v])

    @property
    def cut_arcs(self) -> list[int]:
        """Return the points on the ways of the arcs that are cut."""
        return cut_arcs(self.task.visits, self.plan)

    @cached_property
    def refusals(self) -> dict[int, str]:
        """Say why points of moves cannot be corrected, by visit, of those alone."""
        stops, unsized = self.plan.stops, self.task.splitter.unsized
        told = {
            v: self.part_of(v).refuse(v, v in stops, unsized) for v in self.plan.points
        }
        return {v: why for v, why in told.items() if why}

    def steep_pieces(self, v: int) -> list[int]:
        """List the pieces of a move, from 0, on which corrections change too fast."""
        part = self.part_of(v)
        if v not in part.steep_pieces:
            part.steep_pieces[v] = self._find_steep_pieces(part, v)
        return part.steep_pieces[v]

    def _find_steep_pieces(self, part: Part, v: int) -> list[int]:
        marked, via = part.steep, part.visits.motion.via
        begin = int(part.own[self.task.visits.graph.before[v]])
        pieces = enumerate(pairwise([begin, *self.ends(v)]))
        return [
            k for k, (a, b) in pieces
            if (marked[b - 1] if via[b - 1] else marked[a] and marked[b])
        ]  # fmt: skip

    @cached_property
    def flat(self) -> dict[Cut, float]:
        """What the pieces of arcs bend that are too flat for arcs [m]."""
        found: dict[Cut, float] = {}
        for via in self.cut_arcs:
            part, points = self.part_of(via), self.plan.points
            visits = part.visits
            ends = {
                row: (half, share)
                for half in (via, via + 1)
                for row, share in zip(
                    self.ends(half), (*points.get(half, ()), 1.0), strict=False
                )
            }
            arcs = [row - 1 for row in sorted(ends) if visits.motion.via[row - 1]]
            flat = flat_pieces(visits, part.moves, np.array(arcs, dtype=np.int64))
            found.update({ends[row]: bent for row, bent in flat})
        return found

    def may_be_chord(self, cut: Cut) -> bool:
        """Return True if a piece that is too flat may be a chord, but the last."""
        last = cut[1] == 1.0 and not self.task.visits.motion.via[cut[0]]
        return self.flat[cut] <= STRAIGHT * self.task.tolerance and not last

    def ends(self, v: int) -> list[int]:
        """Return the visits with points at which the pieces of a move end, itself too.

        Those of the part that tells of the move.
        """
        part = self.part_of(v)
        rows = np.append(part.rows_on_way(v), part.own[v])
        ends: list[int] = rows[~part.visits.motion.via[rows]].tolist()
        return ends


def cut_arcs(visits: Visits, plan: InsertionPlan) -> list[int]:
    """Return the points on the ways of the arcs that a plan cuts."""
    return sorted(v for v in plan.points if visits.motion.via[v])
