"""Ways corrected between the targets: points where a path would be left too far.

A point is put where the predicted deviation of a move is largest, corrected as every
target is, and the program is predicted again, until no move leaves its path farther
than asked for or no point helps. Where a joint changes its flank that gives a point on
the old flank and one on the new, and few others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise

import numpy as np

from postproc.arrays import Bools, Ints, any_in_rows
from postproc.compensation.correction import BY_VISIT, EXPLAINING, Correction, correct
from postproc.compensation.in_time import InTime, run_in_time
from postproc.compensation.insertions import insert, lines_in_files
from postproc.compensation.options import Setting
from postproc.compensation.outcome import Status
from postproc.compensation.path_accuracy import PathAccuracy
from postproc.compensation.path_points import Insertions
from postproc.compensation.program import Reading
from postproc.compensation.rewrite import Output
from postproc.compensation.splitting import hindrances, shortest_pieces, unwritable
from postproc.compensation.taking_up import TakeUp, take_up
from postproc.language.interface import Splitter
from postproc.language.languages import language_of
from postproc.robot.pose import MM, lengths

ROUNDS = 16  # of points put on the ways
TAKEN = 2e-5, 1e-4, 3e-4  # [m] from where a move begins: where play is taken up
AIM = 0.6  # of the tolerance: what points are to reach
JUDGED = 4  # rounds in which points are taken back
UNSURE = 2e-5  # [m] a flank that is less sure is no reason to put points anywhere
WORSE = 5e-5  # [m] that the path may be worse where a flank is not as predicted
CONFIRMED = "confirmed"  # verdict of a measured path, see `flanks`
MOVED = 5e-6  # [m] that a rounded corner may move


@dataclass(frozen=True)
class Draft:
    """A corrected program, before it is told of.

    Attributes:
        reading: The program.
        kept: What came of its visits.
        output: What is to be written.
        in_time: The program in time; None where nobody asked.
    """

    reading: Reading
    kept: Correction
    output: Output
    in_time: InTime | None


Write = Callable[[Reading, Correction, Setting], tuple[Output, Reading]]


def correct_paths(draft: Draft, setting: Setting, write: Write) -> Draft:
    """Put points on the ways of a corrected program where it leaves them too far.

    Args:
        draft: The program, run in time.
        setting: What it is compensated with, a tolerance of paths among it.
        write: Writes a corrected program, and reads it again.

    Returns:
        The program, `kept` speaking of the visits of the source.
    """
    reading, first = draft.reading, draft.in_time
    if first is None or setting.options.path_mm is None:
        return draft
    splitter = language_of(reading.sources[0].name).splitter(reading.sources)
    work = _PathWork(draft, first, setting, write)
    work.find_split(splitter)
    if splitter is not None and work.open:
        work.improve(splitter)
        work.judge(splitter)
    return work.result()


@dataclass
class _PathWork:
    """The points of a program, round by round.

    Attributes:
        source: The program without points.
        first: .. in time.
        setting: What it is compensated with.
        write: Writes a corrected program, and reads it again.
        open: Moves that may be split, by their visit: the shortest piece, and how far
            from both ends [m].
        points: What is on their ways.
        stops: Moves whose first point is a stop, where play is taken up.
        idle: Moves that may have one, and how.
        tried: How far such a move began off, and where it stopped, try by try.
        left: Why moves that leave their path too far are not split.
        latest: The program with these points; at first the source.
        own: The visits of it that the source makes, (n,).
    """

    source: Draft
    first: InTime
    setting: Setting
    write: Write
    open: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    points: dict[int, tuple[float, ...]] = field(default_factory=dict)
    stops: set[int] = field(default_factory=set)
    idle: dict[int, TakeUp] = field(default_factory=dict)
    tried: dict[int, list[tuple[float, float]]] = field(default_factory=dict)
    left: dict[int, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Begin without points."""
        self.latest = self.source
        self.own: Ints = np.arange(len(self.source.reading.visits))

    @property
    def tolerance(self) -> float:
        """The largest deviation that is asked for [m]."""
        return (self.setting.options.path_mm or 0.0) * MM

    @property
    def aim(self) -> float:
        """What the points of a move are to reach [m]."""
        return AIM * self.tolerance

    @property
    def paths(self) -> PathAccuracy:
        """How the program keeps to its paths now."""
        told = self.latest.in_time
        return self.first.paths if told is None else told.paths

    @property
    def too_far(self) -> Ints:
        """The paths that are left too far, the worst first."""
        sizes = self.paths.after.sizes
        order = np.argsort(-sizes, kind="stable")
        return order[sizes[order] > self.tolerance]

    def find_split(self, splitter: Splitter | None) -> None:
        """Say which of the moves that leave their paths may be split."""
        reading, paths = self.source.reading, self.paths
        decided, cycle = self.source.kept.decisions, self.first.before
        why = hindrances(reading.visits, decided, cycle)
        lines = lines_in_files(reading, self.setting.cell)
        pieces = shortest_pieces(reading.visits, cycle)
        taking_up = partial(take_up, self.first.after, self.setting, reading.visits)
        for k in self.too_far.tolist():
            v = int(paths.visit[k])
            file = int(reading.visits.file[v])
            if splitter is None:
                name = language_of(reading.sources[0].name).name
                self.left[v] = f"no points are put on ways in {name}"
            elif why.get(v):
                self.left[v] = why[v]
            elif told := unwritable(splitter, reading.visits, v, file, int(lines[v])):
                self.left[v] = told
            elif paths.after.unsure[paths.samples(k)].max() > UNSURE:
                self.left[v] = "the side of a joint is not sure on its way"
            elif told := self._otherwise_in_motion(k):
                self.left[v] = told
            else:
                self.open[v] = pieces[v]
                before = int(reading.visits.before[v])
                still = self.setting.options.take_up and not reading.visits.fly[before]
                if still and splitter.stops(file, int(lines[v])):
                    self.idle[v] = taking_up(v)

    def _otherwise_in_motion(self, k: int) -> str:
        """Name a joint that changes its flank on a path, and in motion not as at stops.

        Joints whose changes nobody could measure make steps too small to matter.
        """
        found = self.setting.model.in_motion
        changing = np.flatnonzero(
            self.paths.crossing[self.paths.samples(k)].any(axis=0)
        )
        for joint in (changing + 1).tolist():
            said = found.get(str(joint), CONFIRMED)
            if said != CONFIRMED:
                return f"joint {joint} changes its flank, which in motion is {said}"
        return ""

    # Points where the paths are left the most, round by round.

    def improve(self, splitter: Splitter) -> None:
        """Put points on the ways until none is left too far, or none helps."""
        for _ in range(ROUNDS):
            new = dict(self._new_points())
            if not new:
                return
            self.points |= {v: tuple(sorted(shares)) for v, shares in new.items()}
            self._make(splitter)

    def _new_points(self) -> Iterator[tuple[int, list[float]]]:
        """Yield the points of moves that get more of them, by their visit."""
        room = self.setting.options.max_inserted - sum(map(len, self.points.values()))
        sizes = self.paths.after.sizes
        for k in np.argsort(-sizes, kind="stable").tolist():
            v = int(self.paths.visit[k])
            if v not in self.open or sizes[k] <= self.aim:
                continue
            known = self.points.get(v, ())
            stop = self._stop(k, v) if v in self.idle and room > 0 else None
            if stop is not None:
                room -= v not in self.stops
                yield v, [stop, *known[v in self.stops :]]
                self.stops.add(v)
                continue
            more = self._on_path(k, v)[: max(room, 0)]
            room -= len(more)
            if more:
                yield v, [*known, *more]

    def _stop(self, k: int, v: int) -> float | None:
        """Find where the arm stops to take up play before a path, as a share of it.

        How near does best is tried out. None where nothing is left to try.
        """
        paths, samples = self.paths, self.paths.samples(k)
        begin = paths.way[samples] < self.open[v][0]
        off = float(paths.after.across[samples][begin].max(initial=0.0))
        tried = self.tried.setdefault(v, [])
        if v in self.stops and len(tried) < len(TAKEN):
            tried.append((off, self.points[v][0]))
        if off <= self.aim or (v in self.stops and self.settled(v)):
            return None
        if len(tried) == len(TAKEN):
            best = min(tried)[1]
            tried.append((0.0, best))
            return best if best != self.points[v][0] else None
        return TAKEN[len(tried)] / float(paths.way[samples][-1])

    def settled(self, v: int) -> bool:
        """Tell whether a move stops where it does best."""
        return len(self.tried.get(v, ())) > len(TAKEN)

    def _on_path(self, k: int, v: int) -> list[float]:
        """Find a point in every part of a path that is left too far, the worst first.

        Args:
            k: The path.
            v: The visit at its end.
        """
        paths, samples = self.paths, self.paths.samples(k)
        way, far = paths.way[samples], paths.after.across[samples]
        known = self.points.get(v, ())
        least, clear, behind = self.open[v]
        ends = [0.0, *(share * way[-1] for share in known), float(way[-1])]
        found = []
        for i, (a, b) in enumerate(pairwise(ends)):
            low = a + (clear if i == 0 else least)
            high = b - (behind if i == len(known) else least)
            inside = np.flatnonzero((way >= a) & (way <= b))
            if high < low or not len(inside):
                continue
            top = inside[far[inside].argmax()]
            if far[top] > self.aim:
                at = min(max(float(way[top]), low), high)
                found.append((float(far[top]), at / float(way[-1])))
        return [share for _, share in sorted(found, reverse=True)]

    def _make(self, splitter: Splitter) -> None:
        """Correct the program with its points, and predict it."""
        if not self.points:
            self.__post_init__()
            return
        cell, clock = self.setting.cell, self.setting.clock
        with clock("insert"):
            stops = {v: self.idle[v] for v in self.stops & self.points.keys()}
            reading, own = insert(
                self.source.reading, self.points, stops, splitter, cell
            )
        options = replace(self.setting.options, clone=False)
        reading, kept = correct(reading, replace(self.setting, options=options))
        output, again = self.write(reading, kept, self.setting)
        n = len(reading.visits)
        owner = np.searchsorted(own, np.arange(n))
        with clock("time"):
            told = run_in_time(reading, again, kept.position, self.setting, owner)
        self.latest, self.own = Draft(reading, kept, output, told), own

    # Points that do not help, or not for certain, are taken back.

    def judge(self, splitter: Splitter) -> None:
        """Take back the points of moves that are no better for certain."""
        for _ in range(JUDGED):
            bad = dict(self._bad())
            if not bad:
                return
            self.left |= bad
            for v in bad:
                self.points.pop(v, None)
            self._make(splitter)
        self.left |= dict.fromkeys(self.points, "its points do not stay put")
        self.points.clear()
        self._make(splitter)

    def _bad(self) -> Iterator[tuple[int, str]]:
        """Yield the moves whose points must go, and why."""
        if not self.points:
            return
        told, without = self.latest.in_time, self._sizes(self.first.paths)
        if told is None:
            return
        with_points = self._worst(told)
        other, usual = map(self._otherwise, (told.paths, self.first.paths))
        corner = self._corners_moved(told)
        for v in sorted(self.points):
            before = without[v]
            if v not in with_points:
                yield v, "nothing is predicted for it with points"
            elif refused := self._refusal(v):
                yield v, f"points on its way cannot be corrected: {refused}"
            elif with_points[v] > before:
                yield v, "points on its way make it no better"
            elif other[v] > max(before, usual[v]) + WORSE:
                yield v, "it would be worse if a flank is not as predicted"
            elif corner[v]:
                yield v, "a rounded corner at one of its ends would move"

    def _refusal(self, v: int) -> str:
        """Say why points of a move cannot be corrected, "" where they can."""
        decided, end = self.latest.kept.decisions, int(self.own[v])
        rows = np.arange(end - len(self.points[v]), end)
        left = rows[decided.status[rows] != Status.SAFE]
        return decided.reasons[decided.why[left[0]]] if len(left) else ""

    @staticmethod
    def _sizes(paths: PathAccuracy) -> dict[int, float]:
        return dict(zip(paths.visit.tolist(), paths.after.sizes.tolist(), strict=True))

    @staticmethod
    def _otherwise(paths: PathAccuracy) -> dict[int, float]:
        """How far each move is from its path if flanks are not as predicted [m]."""
        far = np.maximum.reduceat(paths.otherwise, paths.first[:-1])
        return dict(zip(paths.visit.tolist(), far.tolist(), strict=True))

    def _worst(self, told: InTime) -> dict[int, float]:
        """How far each move leaves its path, however its points are rounded [m]."""
        found, rounded = self._sizes(told.paths), self._rounded(told)
        for k, v in enumerate(told.paths.visit.tolist()):
            samples = told.paths.samples(k)
            way, far = told.paths.way[samples], told.paths.after.across[samples]
            for share, (half, passed) in zip(
                self.points.get(v, ()), rounded.get(v, ()), strict=True
            ):
                near = far[np.abs(way - share * way[-1]) <= half]
                found[v] = max(found[v], passed + float(near.max(initial=0.0)))
        return found

    def _rounded(self, told: InTime) -> dict[int, list[tuple[float, float]]]:
        """Size of the largest zones at points, and how far they pass them [m].

        No corner is larger than half of a neighbouring piece; what cuts it off straight
        passes the point farthest.
        """
        cycle, found = told.after, dict[int, list[tuple[float, float]]]()
        p = self.setting.cell.arm.tcp(cycle.path.q, cycle.targets.tool[:, :3, 3])
        for v, shares in self.points.items():
            end = int(self.own[v])
            rows = np.arange(end - len(shares), end + 1)
            before = self.latest.reading.visits.before[rows[0]]
            steps = np.diff(p[np.append(before, rows)], axis=0)
            size = np.maximum(lengths(steps), 1e-9)
            unit = steps / size[:, None]
            bend = lengths(np.diff(unit, axis=0)) / 2  # sine of half of the angle
            half = np.minimum(size[1:], size[:-1]) / 2
            columns = half.tolist(), (half * bend).tolist()
            found[v] = list(zip(*columns, strict=True))
        return found

    def _corners_moved(self, told: InTime) -> Bools:
        """Tell at which moves a rounded corner at an end is passed otherwise, (n,)."""
        moved = told.before.path.aside[self.own] - self.first.before.path.aside
        there = any_in_rows(np.abs(np.nan_to_num(moved)) > MOVED)
        before = self.source.reading.visits.before
        return np.asarray(there | (there[before] & (before >= 0)))

    # What came of it.

    def result(self) -> Draft:
        """Tell of the program as of the source's visits."""
        told = self.latest.in_time or self.first
        budget = "no more points may be put on ways (--max-inserted)"
        if sum(map(len, self.points.values())) >= self.setting.options.max_inserted:
            for k in self.too_far.tolist():
                self.left.setdefault(int(self.paths.visit[k]), budget)
        for k in self.too_far.tolist():
            closer = "its pieces would be too short, or the path no better"
            self.left.setdefault(int(self.paths.visit[k]), closer)
        inserted = Insertions(
            self.own,
            self.tolerance,
            self.points,
            self.stops & self.points.keys(),
            {v: why for v, why in self.left.items() if v not in self.points},
            self._sizes(self.first.paths),
            self._otherwise(told.paths) if self.points else {},
        )
        in_time = replace(
            told,
            before=self.first.before,
            other_side=told.other_side[self.own],
            inserted=inserted,
        )
        kept = of_source(self.latest.kept, self.own)
        return replace(self.latest, kept=kept, in_time=in_time)


def of_source(kept: Correction, own: Ints) -> Correction:
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
