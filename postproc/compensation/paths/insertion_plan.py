"""A program with points on its ways, as it is worked on round by round."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.compensation.options import Job
from postproc.compensation.outcome import Status
from postproc.compensation.paths.arcs import Cut, WantedArcs, halves
from postproc.compensation.paths.backlash_preload import (
    BacklashPreload,
    MeantSides,
    cross_at_once,
    find_drive_turns,
)
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
from postproc.model.flank_hypotheses import FlankOfJoint, flanks_of
from postproc.robot.pose import MM

AIM = 0.4  # of the tolerance: what points are to reach
MOST = 0.95  # of a way: that much is to be within half of the tolerance


Write = Callable[[ParsedProgram, WindowResult, Job], tuple[Output, ParsedProgram]]


@dataclass
class InsertionPlan:
    """The points of a program, round by round.

    Attributes:
        source: The program without points.
        first: .. in time.
        setting: What it is compensated with.
        write: Writes a corrected program, and reads it again.
        splitter: Writes points into its files.
        open: Moves that may be split, by their visit: the shortest piece, and how far
            from both ends [m].
        beside: Those among them that keep near enough, but are halves of others' arcs.
        points: What is on their ways.
        stops: Moves whose first point is a stop, where play is taken up.
        idle: Moves that may have one, and how.
        unconfirmed: Moves that may not, as too much is open of their flanks.
        halved: Moves whose points correct half of what flanks change by.
        tried: How far such a move began off, and where it stopped, try by try.
        chords: Pieces of arcs that are chords whatever they bend.
        shut: Where no points may lie any more: corrections changed too fast there.
        crowded: More points were wanted than there was room for.
        approaches: Stops from which targets are approached anew, by visit, (w,) each.
        left: Why moves that leave their path too far are not split.
        cures: What would help those among them that something else hinders than room.
        latest: The program with these points; at first the source.
        own: The visits of it that the source makes, (n,).
    """

    source: CompensatedProgram
    first: InTime
    setting: Job
    write: Write
    splitter: Splitter
    open: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    beside: set[int] = field(default_factory=set)
    points: dict[int, tuple[float, ...]] = field(default_factory=dict)
    stops: set[int] = field(default_factory=set)
    idle: dict[int, BacklashPreload] = field(default_factory=dict)
    unconfirmed: set[int] = field(default_factory=set)
    halved: set[int] = field(default_factory=set)
    tried: dict[int, list[tuple[float, float]]] = field(default_factory=dict)
    chords: set[Cut] = field(default_factory=set)
    shut: dict[int, set[float]] = field(default_factory=dict)
    crowded: bool = False
    approaches: dict[int, Floats] = field(default_factory=dict)
    left: dict[int, str] = field(default_factory=dict)
    cures: dict[int, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Begin without points."""
        self.latest = self.source
        self.own: Ints = np.arange(len(self.source.reading.visits))

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
        visits, decided = self.source.reading.visits, self.source.kept.decisions
        cell, keeps_aux = self.setting.cell, self.splitter.keeps_aux
        return hindrances(visits, decided, self.first.before, cell, keeps_aux)

    def find_hindrance(self, v: int) -> str:
        """Say why nothing can be put on the way to a visit, "" for nothing."""
        visits = self.source.reading.visits
        file, line = int(visits.file[v]), int(self.lines[v])
        given = self._hindrances.get(v)
        return given or unwritable(self.splitter, visits, v, file, line)

    @property
    def tolerance(self) -> float:
        """The largest deviation that is asked for [m]."""
        asked = self.setting.options.path_tolerance_mm
        return np.inf if asked is None else asked * MM

    @property
    def room(self) -> int:
        """How many more points may be put in."""
        count = sum(map(len, self.points.values())) + len(self.approaches)
        return self.setting.options.max_inserted - count

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

    @property
    def to_split(self) -> Ints:
        """The paths that are left too far, or most of whose way is not near enough."""
        paths = self.paths
        step = np.diff(paths.way, prepend=0.0)
        step[paths.first[:-1]] = 0.0
        far = np.where(paths.after.across > self.tolerance / 2, step, 0.0)
        off, whole = (np.add.reduceat(each, paths.first[:-1]) for each in (far, step))
        far_off = off > (1.0 - MOST) * whole
        return np.flatnonzero(far_off | (paths.after.sizes > self.tolerance))

    def make(self) -> None:
        """Correct the program with its points, and predict it."""
        if not self.points and not self.approaches:
            self.__post_init__()
            return
        cell, clock = self.setting.cell, self.setting.clock
        with clock("insert"):
            stops = {v: self.idle[v] for v in self.stops & self.points.keys()}
            reading, own = insert(
                self.source.reading, self.points, stops, self.splitter, cell,
                self.chords, self.approaches, self._list_meant_sides(),
                self._joints_along,
            )  # fmt: skip
        options = self.setting.options.without_clones()
        reading, kept = correct(reading, replace(self.setting, options=options))
        output, again = self.write(reading, kept, self.setting)
        n = len(reading.visits)
        owner = np.searchsorted(own, np.arange(n))
        with clock("time"):
            arcs = self.list_wanted_arcs()
            told = run_in_time(reading, again, kept.position, self.setting, owner, arcs)
        self.latest, self.own = CompensatedProgram(reading, kept, output, told), own

    def _joints_along(self, v: int, share: Floats) -> Floats:
        """Return the joint angles at shares (k,) of the way to a visit, (k, 6)."""
        paths = self.first.paths
        rows = paths.samples_to(v)
        way = paths.way[rows]
        found = [np.interp(share * way[-1], way, q) for q in paths.q[rows].T]
        return np.stack(found, axis=1)

    def _list_meant_sides(self) -> dict[int, MeantSides]:
        """Say from which sides points on ways are meant to be passed.

        An arc is one way, from where it begins to where it ends.
        """
        paths, found = self.first.paths, {}
        visits = self.source.reading.visits
        sharp = np.array([flank.nominal == 1.0 for flank in self.flanks])
        for move in {halves(visits, v) for v in self.points}:
            own = [paths.samples_to(v) for v in move]
            side = np.array(paths.side[own[0].start : own[-1].stop])
            side[:, sharp] = cross_at_once(side[:, sharp])
            if self.halved.intersection(move):
                side = (side + _evenly(side, [paths.way[rows] for rows in own])) / 2
            for v, rows in zip(move, own, strict=True):
                if v not in self.points:
                    continue
                way = paths.way[rows]
                ends = np.array([0.0, *self.points[v], 1.0]) * way[-1]
                at = np.searchsorted(way, ends).clip(0, len(way) - 1) + rows.start
                there = side[at - own[0].start]
                tool = self.first.after.targets.tool[v, :3, :3]
                turn = find_drive_turns(
                    self.setting, visits, v, tool, paths.q[at], there - side[0]
                )
                between = (there[:-1] + there[1:]) / 2
                found[v] = MeantSides(there[1:-1], turn[1:-1], between)
        return found

    def list_wanted_arcs(self) -> WantedArcs:
        """Return the arcs that are cut."""
        before = self.source.reading.visits.before
        return WantedArcs.of(self.first.before, before, self.cut_arcs())

    def cut_arcs(self) -> list[int]:
        """Return the points on the ways of the arcs that are cut."""
        return sorted(v for v in self.points if self.source.reading.visits.via[v])

    def refusal(self, v: int) -> str:
        """Say why points of a move cannot be corrected, "" where they can."""
        decided = self.latest.kept.decisions
        rows = self._on_way(v)
        left = rows[decided.status[rows] != Status.CORRECTED]
        if len(left):
            why = decided.reasons[decided.why[left[0]]]
            return f"points inserted into it cannot be corrected: {why}"
        visits = self.latest.reading.visits
        passed = rows[~visits.via[rows]][v in self.stops :]
        sized = visits.fly[passed] & (visits.zone_mm[passed] > 0.0)
        return "" if sized.all() else self.splitter.unsized

    def steep_pieces(self, v: int) -> list[int]:
        """List the pieces of a move, from 0, on which corrections change too fast."""
        decided, via = self.latest.kept.decisions, self.latest.reading.visits.via
        steps = [one.code is Code.CORRECTION_STEP for one in decided.reasons]
        marked = np.array(steps)[decided.why]
        begin = int(self.own[self.source.reading.visits.before[v]])
        pieces = enumerate(pairwise([begin, *self.ends(v)]))
        return [
            k for k, (a, b) in pieces
            if (marked[b - 1] if via[b - 1] else marked[a] and marked[b])
        ]  # fmt: skip

    def drop(self, v: int, gone: Collection[float]) -> None:
        """Take back points of a move; pieces that grow by it are chords no more."""
        left = tuple(s for s in self.points.pop(v) if s not in gone)
        longer = {min((s for s in left if s > share), default=1.0) for share in gone}
        self.chords -= {(v, share) for share in (*gone, *longer)}
        if left:
            self.points[v] = left
        elif self.points.get(v - 1) == (1.0,):  # an arc that is cut at its point alone
            del self.points[v - 1]

    def _on_way(self, v: int) -> Ints:
        """Return the visits with points on the way to one, without it."""
        return np.arange(int(self.own[v - 1]) + 1 if v else 0, int(self.own[v]))

    def ends(self, v: int) -> list[int]:
        """Return the visits with points at which the pieces of a move end, itself too.

        Those of the program with points.
        """
        rows = np.append(self._on_way(v), self.own[v])
        ends: list[int] = rows[~self.latest.reading.visits.via[rows]].tolist()
        return ends


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
