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

from postproc.arrays import Bools, Floats, Ints, any_in_rows
from postproc.compensation.approach import place_to_approach
from postproc.compensation.arc_splitting import (
    STRAIGHT,
    Cut,
    WantedArcs,
    flat_pieces,
    is_arc,
    largest_zones,
    passed,
    point_on_way,
)
from postproc.compensation.correction import BY_VISIT, EXPLAINING, Correction, correct
from postproc.compensation.in_time import InTime, run_in_time
from postproc.compensation.insertions import insert, lines_in_files, numbers_at
from postproc.compensation.notes import SURE
from postproc.compensation.options import Setting
from postproc.compensation.outcome import Status
from postproc.compensation.path_accuracy import PathAccuracy
from postproc.compensation.path_points import Insertions
from postproc.compensation.program import Reading
from postproc.compensation.rewrite import Output
from postproc.compensation.splitting import hindrances, shortest_pieces, unwritable
from postproc.compensation.taking_up import (
    MeantSides,
    TakeUp,
    crossed_at_once,
    take_up,
    turned_by_drives,
)
from postproc.exceptions import PostprocError
from postproc.language.interface import Splitter
from postproc.language.languages import language_of
from postproc.robot.pose import MM, lengths
from postproc.robot.trajectory import Motion

ROUNDS = 16  # of points put on the ways
TAKEN = 2e-5, 1e-4, 3e-4  # [m] from where a move begins: where play is taken up
AIM = 0.6  # of the tolerance: what points are to reach
JUDGED = 8  # rounds in which points are taken back
UNSURE = 2e-5  # [m] a flank that is less sure is no reason to put points anywhere
WORSE = 5e-5  # [m] that the path may be worse where a flank is not as predicted
CONFIRMED, NOT_SURE = "confirmed", "not sure"  # verdicts of a measured path
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

    Raises:
        PostprocError: Targets cannot be approached anew in its language.
    """
    reading, first = draft.reading, draft.in_time
    if first is None or not setting.options.inserts:
        return draft
    language = language_of(reading.sources[0].name)
    splitter = language.splitter(reading.sources)
    if splitter is None and setting.options.approach:
        raise PostprocError(
            f"--approach: targets are not approached anew in {language.name} programs. "
            "Leave it out: side-not-sure says how to approach them"
        )
    work = _PathWork(draft, first, setting, write)
    if splitter is not None and setting.options.approach:
        work.approach(splitter)
    work.find_split(splitter)
    if splitter is not None and (work.open or work.approaches):
        work.improve(splitter)
        work.bend(splitter)
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
        unconfirmed: Moves that may not, as no measured path confirms their flanks.
        tried: How far such a move began off, and where it stopped, try by try.
        chords: Pieces of arcs that are chords whatever they bend.
        approaches: Stops from which targets are approached anew, by visit, (w,) each.
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
    unconfirmed: set[int] = field(default_factory=set)
    tried: dict[int, list[tuple[float, float]]] = field(default_factory=dict)
    chords: set[Cut] = field(default_factory=set)
    approaches: dict[int, Floats] = field(default_factory=dict)
    left: dict[int, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Begin without points."""
        self.latest = self.source
        self.own: Ints = np.arange(len(self.source.reading.visits))

    @property
    def tolerance(self) -> float:
        """The largest deviation that is asked for [m]."""
        asked = self.setting.options.path_mm
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
            elif v in self.approaches:
                self.left[v] = "its target is approached anew"
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
                moving = reading.visits.fly[before] or reading.visits.via[before]
                still = self.setting.options.take_up and not moving
                if still and splitter.stops(file, int(lines[v])):
                    self._may_stop(v, taking_up(v))

    def _may_stop(self, v: int, taken: TakeUp) -> None:
        """Let the arm stop where a move begins, if flanks change there for certain.

        What gives way before it carries, or lies where weight pushes it, would be led
        off by what a sharp gap asks for, and nothing behind the stop mends that.
        """
        found = self.setting.model.in_motion
        if all(
            found.get(str(joint)) == CONFIRMED
            or (found.get(str(joint)) == NOT_SURE and self._step(v, joint) < WORSE)
            for joint in taken.crossing
        ):
            self.idle[v] = taken
        else:
            self.unconfirmed.add(v)

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
            if said != CONFIRMED and not self._small(k, said, joint):
                return f"joint {joint} changes its flank, which in motion is {said}"
        return ""

    def _small(self, k: int, said: str, joint: int) -> bool:
        """Tell whether a step that nobody could measure is too small to matter."""
        if said != NOT_SURE:
            return False
        v = int(self.paths.visit[k])
        return self._step(v, joint) < WORSE

    def _step(self, v: int, joint: int) -> float:
        """Return how far a joint's change of its flank moves the TCP at a visit [m]."""
        cycle, arm = self.first.after, self.setting.cell.arm
        tool = cycle.targets.tool[v, :3, 3]
        by_joint = arm.jacobian(cycle.path.q[v][None], tool)[0, :3, joint - 1]
        gap = 2.0 * self.setting.gap[joint - 1]
        return float(np.linalg.norm(by_joint) * gap)

    # Stops from which targets are approached anew.

    def approach(self, splitter: Splitter) -> None:
        """Approach targets anew that a joint reaches from a side that is not sure."""
        reading, decided = self.source.reading, self.source.kept.decisions
        visits, why = (
            reading.visits,
            hindrances(reading.visits, decided, self.first.before),
        )
        lines = lines_in_files(reading, self.setting.cell)
        ends = (visits.motion == Motion.LINEAR) & ~visits.fly
        ends &= ~visits.fly[visits.before]
        for v in np.flatnonzero(ends & self._unsure(self.source.kept)).tolist():
            file, line = int(visits.file[v]), int(lines[v])
            hindered = why.get(v) or unwritable(splitter, visits, v, file, line)
            if not hindered and splitter.stops(file, line) and self.room > 0:
                place = self._place_to_approach(v)
                if place is not None:
                    self.approaches[v] = place
        if self.approaches:
            self._make(splitter)

    def _place_to_approach(self, v: int) -> Floats | None:
        """Find the numbers of a stop from which to approach a target."""
        cell, cycle = self.setting.cell, self.first.before
        visits, side = self.source.reading.visits, self.source.kept.decisions.side
        q = place_to_approach(
            cell.arm, cycle, v, int(visits.before[v]), np.abs(side[v]) < SURE,
            cell.limits.approach_mm * MM,
        )  # fmt: skip
        if q is None:
            return None
        pose = cell.arm.flange(q[None]) @ cycle.targets.tool[[v]]
        return numbers_at(visits, v, pose[0])

    def _unsure(self, kept: Correction) -> Bools:
        """Tell which targets move that a joint reaches from a side that is not sure."""
        return kept.corrected & any_in_rows(np.abs(kept.decisions.side) < SURE)

    def _bad_approaches(self) -> set[int]:
        """Find the targets that are approached anew and are no better for it."""
        kept = of_source(self.latest.kept, self.own)
        unsure, status = self._unsure(kept), kept.decisions.status
        stops = self.latest.kept.decisions.status[self.own - 1]
        others = np.flatnonzero(unsure & ~self._unsure(self.source.kept))
        asked = np.array(sorted(self.approaches), dtype=np.int64)
        bad = (
            unsure[asked]
            | (status[asked] != Status.SAFE)
            | (stops[asked] != Status.SAFE)
        )
        cause = np.searchsorted(asked, others, side="right") - 1
        return {*asked[bad].tolist(), *asked[cause[cause >= 0]].tolist()}

    # Points where the paths are left the most, round by round.

    def improve(self, splitter: Splitter) -> None:
        """Put points on the ways until none is left too far, or none helps."""
        for _ in range(ROUNDS):
            new, flat = dict(self._new_points()), self._new_chords()
            halved = dict(self._halved({*new, *(v for v, _ in flat)}))
            if not new and not flat and not halved:
                return
            for v, shares in (new | halved).items():
                self.points[v] = tuple(sorted(map(float, shares)))
            self.chords |= flat
            self._cut_at_vias()
            self._make(splitter)

    def bend(self, splitter: Splitter) -> None:
        """Let pieces of arcs that are too flat go on to the next cut."""
        for _ in range(ROUNDS):
            joined = False
            for v, points in self._joined().items():
                joined |= points != self.points[v]
                if points[:1] != self.points[v][:1]:
                    self.stops.discard(v)  # what comes first now is passed
                self.points[v] = points
            self.points = {v: points for v, points in self.points.items() if points}
            if not joined:
                return
            self._make(splitter)

    def _joined(self) -> dict[int, tuple[float, ...]]:
        """Return the points of arcs with such pieces, one less where one can go."""
        found = {}
        for (v, end), bent in self._flat_pieces().items():
            if v in found or v not in self.points or self._chord((v, end), bent):
                continue
            known = self.points[v]
            begin = max((s for s in known if s < end), default=0.0)
            gone = end if end < 1.0 else begin
            found[v] = tuple(s for s in known if s != gone)
        return found

    def _cut_at_vias(self) -> None:
        """Cut arcs that are cut anywhere at the points on their ways as well."""
        visits = self.source.reading.visits
        for v in [v for v in self.points if is_arc(visits, v)]:
            via = point_on_way(visits, v)
            self.points[via] = tuple(sorted({*self.points.get(via, ()), 1.0}))

    def _new_chords(self) -> set[Cut]:
        """Find pieces of arcs that are too flat for arcs, and may be chords."""
        may = {
            cut for cut, bent in self._flat_pieces().items() if self._chord(cut, bent)
        }
        return may - self.chords

    def _halved(self, changed: set[int]) -> Iterator[tuple[int, list[float]]]:
        """Yield the points of arcs with pieces that are too flat, and no chords yet.

        Args:
            changed: Moves that change anyway.
        """
        room = self.room
        flat, found = self._flat_pieces(), dict[int, list[float]]()
        for (v, end), bent in flat.items():
            known = found.get(v, [*self.points.get(v, ())])
            begin = max((s for s in known if s < end), default=0.0)
            k = int(np.flatnonzero(self.paths.visit == v)[0])
            size = (end - begin) * float(self.paths.way[self.paths.samples(k)][-1])
            least = self.open[v][0] if v in self.open else np.inf
            if v in changed or self._chord((v, end), bent):
                continue
            if room > 0 and size >= 2 * least:
                found[v] = [*known, (begin + end) / 2]
                room -= 1
        yield from found.items()

    def _chord(self, cut: Cut, bent: float) -> bool:
        """Tell whether a piece that bends so little may be a chord, but the last."""
        last = cut[1] == 1.0 and not self.source.reading.visits.via[cut[0]]
        return bent <= STRAIGHT * self.tolerance and not last

    def _flat_pieces(self) -> dict[Cut, float]:
        """What the pieces of arcs bend that are too flat for arcs [m]."""
        visits = self.latest.reading.visits
        values = self.latest.kept.decisions.corrected
        moved = (values - visits.values)[:, :3] * MM
        ends = {
            row: (half, share)
            for via in self._cut_arcs()
            for half in (via, via + 1)
            for row, share in zip(
                self._ends(half), (*self.points.get(half, ()), 1.0), strict=False
            )
        }
        arcs = [row - 1 for row in sorted(ends) if visits.via[row - 1]]
        found = flat_pieces(visits, moved, np.array(arcs, dtype=np.int64))
        return {ends[row]: bent for row, bent in found}

    def _cut_arcs(self) -> list[int]:
        """Return the points on the ways of the arcs that are cut."""
        return sorted(v for v in self.points if self.source.reading.visits.via[v])

    def _ends(self, v: int) -> list[int]:
        """Return the visits with points at which the pieces of a move end, itself too.

        Those of the program with points.
        """
        first = int(self.own[v - 1]) + 1 if v else 0
        rows = np.arange(first, int(self.own[v]) + 1)
        ends: list[int] = rows[~self.latest.reading.visits.via[rows]].tolist()
        return ends

    def _new_points(self) -> Iterator[tuple[int, list[float]]]:
        """Yield the points of moves that get more of them, by their visit."""
        room = self.room
        sizes, whole = self.paths.after.sizes, self._whole_arcs()
        for k in np.argsort(-sizes, kind="stable").tolist():
            v = int(self.paths.visit[k])
            if v not in self.open or sizes[k] <= self.aim:
                continue
            known, via = self.points.get(v, ()), v in whole
            left = room - via  # the point on the way of an arc becomes one, too
            stop = self._stop(k, v) if v in self.idle and left > 0 else None
            if stop is not None:
                left -= v not in self.stops
                more = [stop, *known[v in self.stops :]]
                self.stops.add(v)
            else:
                new = self._on_path(k, v)[: max(left, 0)]
                left -= len(new)
                more = [*known, *new] if new else []
            if more:
                room = left
                if via:
                    first = point_on_way(self.source.reading.visits, v)
                    whole -= {first, first + 1}
                yield v, more

    def _whole_arcs(self) -> set[int]:
        """Return both visits of arcs that are not cut."""
        via = self.source.reading.visits.via
        arcs = np.flatnonzero(via & ~np.isin(np.arange(len(via)), self._cut_arcs()))
        return {*arcs.tolist(), *(arcs + 1).tolist()}

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
        if not self.points and not self.approaches:
            self.__post_init__()
            return
        cell, clock = self.setting.cell, self.setting.clock
        with clock("insert"):
            stops = {v: self.idle[v] for v in self.stops & self.points.keys()}
            reading, own = insert(
                self.source.reading, self.points, stops, splitter, cell,
                self.chords, self.approaches, self._meant(),
            )  # fmt: skip
        options = replace(self.setting.options, clone=False)
        reading, kept = correct(reading, replace(self.setting, options=options))
        output, again = self.write(reading, kept, self.setting)
        n = len(reading.visits)
        owner = np.searchsorted(own, np.arange(n))
        with clock("time"):
            arcs = self._wanted_arcs()
            told = run_in_time(reading, again, kept.position, self.setting, owner, arcs)
        self.latest, self.own = Draft(reading, kept, output, told), own

    def _meant(self) -> dict[int, MeantSides]:
        """Say from which sides points of lines are meant to be passed."""
        paths, found = self.first.paths, {}
        visits = self.source.reading.visits
        for v, shares in self.points.items():
            rows = paths.samples(int(np.searchsorted(paths.visit, v)))
            way, side = paths.way[rows], crossed_at_once(paths.side[rows])
            at = np.searchsorted(way, np.array(shares) * way[-1]).clip(0, len(way) - 1)
            tool = self.first.after.targets.tool[v, :3, :3]
            turn = turned_by_drives(
                self.setting, visits, v, tool, paths.q[rows][at], side[at] - side[0]
            )
            found[v] = MeantSides(side[at], turn)
        return found

    def _wanted_arcs(self) -> WantedArcs:
        """Return the arcs that are cut."""
        before = self.source.reading.visits.before
        return WantedArcs.of(self.first.before, before, self._cut_arcs())

    # Points that do not help, or not for certain, are taken back.

    def judge(self, splitter: Splitter) -> None:
        """Take back points that make moves no better for certain."""
        for k in range(JUDGED):
            bad, anew = dict(self._bad()), self._bad_approaches()
            if not bad and not anew:
                return
            for v, (why, share) in bad.items():
                if share is None or k >= JUDGED / 2 or not self._thin_out(v, share):
                    self.left[v] = why
                    self._take_back(v)
            for v in anew:
                self._take_back(v)
            self._make(splitter)
        self.left |= dict.fromkeys(self.points, "its points do not stay put")
        self.points.clear()
        self.approaches.clear()
        self._make(splitter)

    def _thin_out(self, v: int, share: float) -> bool:
        """Take back the points around a place of a move, if that leaves others."""
        known = self.points.get(v, ())
        free = np.array([s for s in known[v in self.stops :] if s < 1.0])
        behind = int(np.searchsorted(free, share))
        gone = set(free[max(behind - 1, 0) : behind + 1].tolist())
        if not gone or len(gone) == len(free):
            return False
        self.points[v] = tuple(s for s in known if s not in gone)
        return True

    def _take_back(self, v: int) -> None:
        """Take back the points of a move; an arc that is cut no more stays whole."""
        own = self.points.pop(v, ())
        self.stops.discard(v)
        self.approaches.pop(v, None)
        visits = self.source.reading.visits
        if not is_arc(visits, v):
            return
        via = point_on_way(visits, v)
        if own in ((), (1.0,)):  # what it has is the cut at the point on the way alone
            self.points.pop(via, None)
            self.points.pop(via + 1, None)
        elif v == via and via + 1 in self.points:
            self.points[via] = (1.0,)
        elif self.points.get(via) == (1.0,):
            del self.points[via]

    def _bad(self) -> Iterator[tuple[int, tuple[str, float | None]]]:
        """Yield the moves with points that must go: why, and where if not all of them."""
        if not self.points:
            return
        told, without = self.latest.in_time, self._sizes(self.first.paths)
        if told is None:
            return
        with_points = self._worst(told)
        other = _largest_otherwise(told.paths)
        usual = _largest_otherwise(self.first.paths)
        corner = self._corners_moved(told)
        flat = self._flat_pieces()
        bent = {cut[0] for cut, far in flat.items() if not self._chord(cut, far)}
        for v in sorted({*self.points, *(via + 1 for via in self._cut_arcs())}):
            before = without[v]
            if self.points.get(v, ()) in ((), (1.0,)):  # its other half is cut
                before = max(before, self.aim)
            if v not in with_points:
                yield v, ("nothing is predicted for it with points", None)
            elif v in bent:
                yield v, ("pieces of it would bend too little for arcs", None)
            elif refused := self._refusal(v):
                why = f"points on its way cannot be corrected: {refused}"
                yield v, (why, None)
            elif with_points[v][0] > before:
                why = "points on its way make it no better"
                yield v, (why, with_points[v][1])
            elif other[v][0] > max(before, usual[v][0]) + WORSE:
                why = "it would be worse if a flank is not as predicted"
                yield v, (why, other[v][1])
            elif corner[v]:
                yield v, ("a rounded corner at one of its ends would move", None)

    def _refusal(self, v: int) -> str:
        """Say why points of a move cannot be corrected, "" where they can."""
        decided = self.latest.kept.decisions
        rows = np.arange(int(self.own[v - 1]) + 1, int(self.own[v]))
        left = rows[decided.status[rows] != Status.SAFE]
        return decided.reasons[decided.why[left[0]]] if len(left) else ""

    @staticmethod
    def _sizes(paths: PathAccuracy) -> dict[int, float]:
        return dict(zip(paths.visit.tolist(), paths.after.sizes.tolist(), strict=True))

    def _worst(self, told: InTime) -> dict[int, tuple[float, float]]:
        """How far each move leaves its path, however its points are rounded.

        Returns:
            The distance [m], and where, as a share of the way.
        """
        rounded, found = self._rounded(told), dict[int, tuple[float, float]]()
        for k, v in enumerate(told.paths.visit.tolist()):
            samples = told.paths.samples(k)
            way, far = told.paths.way[samples], told.paths.after.across[samples]
            worst = np.array(far)
            for share, (half, beside) in zip(
                self.points.get(v, ()), rounded.get(v, ()), strict=True
            ):
                there = np.abs(way - share * way[-1]) / max(half, 1e-12)
                near = far + beside * (1 - there**2)  # bounds chords and parabolas
                worst = np.maximum(worst, np.where(there <= 1, near, 0.0))
            found[v] = _largest_on(way, worst)
        return found

    def _rounded(self, told: InTime) -> dict[int, list[tuple[float, float]]]:
        """Size of the largest zones at points, and how far they pass them [m].

        No corner is larger than half of a neighbouring piece; what cuts it off straight
        passes the point farthest. On an arc it is no larger than zones are, by any law.
        """
        p, c = (
            self.setting.cell.arm.tcp(cycle.path.q, cycle.targets.tool[:, :3, 3])
            for cycle in (told.after, told.before)
        )
        found = dict[int, list[tuple[float, float]]]()
        visits, arcs = self.source.reading.visits, self._wanted_arcs()
        zone = largest_zones(self.setting.cell.arm, told.after) if len(arcs) else None
        for v, shares in self.points.items():
            rows = [int(self.own[visits.before[v]]), *self._ends(v)]
            if shares[-1] == 1.0:
                rows.append(self._ends(v + 1)[0])
            rows = rows[: len(shares) + 2]
            size = np.maximum(lengths(np.diff(p[rows], axis=0)), 1e-9)
            slope = np.diff((p - c)[rows], axis=0) / size[:, None]
            bend = lengths(np.diff(slope, axis=0)) / 2  # sine of half of the angle
            half = np.minimum(size[1:], size[:-1]) / 2
            far = half * bend
            if zone is not None and is_arc(visits, v):
                half = np.minimum(half, zone[rows[1:-1]])
                far = half * bend + passed(half, arcs.radius_of(v))
            found[v] = list(zip(half.tolist(), far.tolist(), strict=True))
        return found

    def _corners_moved(self, told: InTime) -> Bools:
        """Tell at which moves a rounded corner at an end is passed otherwise, (n,)."""
        moved = told.before.path.aside[self.own] - self.first.before.path.aside
        there = any_in_rows(np.abs(np.nan_to_num(moved)) > MOVED)
        there[self._cut_arcs()] = False  # judged as the points that they are
        before = self.source.reading.visits.before
        return np.asarray(there | (there[before] & (before >= 0)))

    # What came of it.

    def result(self) -> Draft:
        """Tell of the program as of the source's visits."""
        told = self.latest.in_time or self.first
        budget = "no more points may be put on ways (--max-inserted)"
        if self.room <= 0:
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
            {v: far for v, (far, _) in _largest_otherwise(told.paths).items()}
            if self.latest is not self.source
            else {},
            self._approached(told),
            frozenset(self.unconfirmed),
        )
        in_time = replace(
            told,
            before=self.first.before,
            other_side=told.other_side[self.own],
            inserted=inserted,
        )
        kept = of_source(self.latest.kept, self.own)
        return replace(self.latest, kept=kept, in_time=in_time)

    def _approached(self, told: InTime) -> dict[int, float]:
        """Return the shares of the ways at which targets are approached anew."""
        p = self.setting.cell.arm.tcp(
            told.before.path.q, told.before.targets.tool[:, :3, 3]
        )
        found = {}
        for v in self.approaches:
            row = int(self.own[v])
            there, back = (float(np.linalg.norm(p[row - 1] - p[k])) for k in
                           (row - 2, row))  # fmt: skip
            found[v] = there / (there + back)
        return found


def _largest_on(way: Floats, far: Floats) -> tuple[float, float]:
    """Return the largest distance on a way, and where, as a share of it."""
    top = int(far.argmax())
    return float(far[top]), float(way[top] / max(way[-1], 1e-12))


def _largest_otherwise(paths: PathAccuracy) -> dict[int, tuple[float, float]]:
    """How far each move is from its path if flanks are not as predicted, and where."""
    rows = map(paths.samples, range(len(paths)))
    return {
        v: _largest_on(paths.way[own], paths.otherwise[own])
        for v, own in zip(paths.visit.tolist(), rows, strict=True)
    }


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
