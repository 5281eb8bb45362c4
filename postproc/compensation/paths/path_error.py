"""How far the TCP leaves the programmed path between the targets, as the model says.

On its way to a target every joint goes from the flank on which it arrived at the place
before to that on which it arrives now: its drive crosses the gap while the joint rests.
Along dense samples of the planned joint path the play operator tells where each joint
lies in its play, and the model the error there. What is predicted is the systematic
part of the path accuracy AT_p of ISO 9283, chapter 8: the largest distance from the
programmed path, across it; what lags along the path is told apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import starmap
from typing import Any

import numpy as np

from postproc import _native
from postproc.arrays import Bools, Floats, Ints, any_in_rows, spans
from postproc.compensation.paths.arcs import NO_ARCS, WantedArcs
from postproc.compensation.paths.flank_cases import UNSURE, FlankCases
from postproc.compensation.paths.moved_corners import SourceCorners
from postproc.compensation.paths.path_samples import PathSamples, measure_along, ways_of
from postproc.compensation.paths.path_states import (
    AlongWays,
    ErrorAlong,
    refine_at_reversals,
)
from postproc.compensation.paths.plan_rule import ALONG, MoveDeviation
from postproc.model.model import Model
from postproc.motion.cycle_time import ProgramCycle
from postproc.robot.cell import Cell
from postproc.robot.pose import lengths
from postproc.robot.trajectory import Motion

NO_FLANK = 1e-6  # [m] no joint's flank makes so little a difference


@dataclass(frozen=True)
class Deviations:
    """How a program leaves m paths (structure of arrays), s samples in all.

    Attributes:
        off: From the path to the TCP at the samples, (s, 3) [m].
        across: Distance from the path there, (s,) [m].
        along: How far the TCP is ahead along it, (s,) [m].
        unsure: How much farther it may be where a joint's flank is not known, (s,) [m].
        largest: Sample of the largest distance of each path, (m,).
        shares: What the flank of every joint makes of it there, (m, 6) [m].
    """

    off: Floats
    across: Floats
    along: Floats
    unsure: Floats
    largest: Ints
    shares: Floats

    @property
    def joint(self) -> Ints:
        """Return the joints (1 to 6) whose flanks make most of it, (m,), 0: none."""
        largest = self.shares.max(axis=1, initial=0.0)
        most = self.shares.argmax(axis=1) if len(self.shares) else self.largest
        return np.where(largest > NO_FLANK, most + 1, 0)

    @property
    def sizes(self) -> Floats:
        """Return the largest distance from each path, (m,) [m]."""
        return self.across[self.largest]


@dataclass(frozen=True)
class PathAccuracy:
    """Predicted path accuracy of m LINEAR and CIRCULAR moves (structure of arrays).

    Attributes:
        visit: The visit at the end of each, (m,).
        first: Its samples are first[k] .. first[k + 1] - 1, (m + 1,).
        way: Path length up to every sample since the move began, (s,) [m].
        tangent: Directions of the programmed path there, (s, 3).
        before, after: Deviations of the program as it was written and compensated.
        unknown: Cartesian moves that nothing is predicted for.
        q, side: Joint angles [rad] of the program as it was written, and where each
            joint lies in its play, (s, 6) each.
        cases: Where the compensated program's paths are if joints change their flanks
            otherwise; None unless points may be inserted.
    """

    visit: Ints
    first: Ints
    way: Floats
    tangent: Floats
    before: Deviations
    after: Deviations
    unknown: int
    q: Floats
    side: Floats
    cases: FlankCases | None = None

    def __len__(self) -> int:
        """Return the number of paths."""
        return len(self.visit)

    def samples(self, k: int) -> slice:
        """Return the samples of a path."""
        return slice(int(self.first[k]), int(self.first[k + 1]))

    def samples_to(self, visit: int) -> slice:
        """Return the samples of the path to a visit."""
        return self.samples(self.row_of(visit))

    def sample_at(self, visit: int, shares: Sequence[float]) -> Ints:
        """Return the samples at shares (k,) of the way to a visit, (k,)."""
        rows = self.samples_to(visit)
        way = self.way[rows]
        at = np.searchsorted(way, np.array(shares) * way[-1])
        return np.asarray(rows.start + at.clip(0, len(way) - 1))

    def spans_to(self, visits: Ints) -> tuple[Ints, Ints]:
        """Return where the samples of the paths to visits begin, and how many, (k,)."""
        rows = self.rows_of(visits)
        return self.first[rows], self.first[rows + 1] - self.first[rows]

    def as_written(self, other: PathAccuracy) -> PathAccuracy:
        """Let another prediction tell what this one does of the program as written.

        Of each of its samples the one here tells that lies nearest along the path.

        Args:
            other: A prediction of some of the paths, at other samples.
        """
        start, count = self.spans_to(other.visit)
        number, rows = np.arange(len(count)), self.rows_of(other.visit)
        way, first = self.way[spans(start, count)], np.cumsum(count) - count
        whole = way[first + count - 1]
        apart_ = 1.0 + float(max(way.max(initial=0.0), other.way.max(initial=0.0)))
        there = way + apart_ * np.repeat(number, count)
        own = np.repeat(number, np.diff(other.first))
        here = np.minimum(other.way, whole[own]) + apart_ * own
        at = np.searchsorted((there[1:] + there[:-1]) / 2, here)
        at = at.clip(first[own], (first + count - 1)[own]) + (start - first)[own]
        top = there[self.before.largest[rows] - start + first]
        largest = np.searchsorted(here, top).clip(other.first[:-1], other.first[1:] - 1)
        told = {name: getattr(self.before, name).take(at, axis=0)
                for name in ("off", "across", "along", "unsure")}  # fmt: skip
        told["across"][largest] = self.before.sizes[rows]
        before = Deviations(**told, largest=largest, shares=self.before.shares[rows])
        return replace(other, before=before)

    def rows_of(self, visits: Ints) -> Ints:
        """Return which paths lead to visits, (k,)."""
        return np.searchsorted(self.visit, visits)

    def row_of(self, visit: int) -> int:
        """Return which path leads to a visit."""
        return int(np.searchsorted(self.visit, visit))

    def join(self, owner: Ints) -> PathAccuracy:
        """Take the ways to points that were inserted as parts of the source's moves.

        Args:
            owner: The move of the source that every visit belongs to, (n,).
        """
        lead, group = _groups(owner[self.visit])
        length = self.way[self.first[1:] - 1]
        begin = np.cumsum(length) - length
        offset = begin - begin[lead][group]

        def whole(told: Deviations) -> Deviations:
            part = largest_in(told.sizes, group, lead)
            return replace(told, largest=told.largest[part], shares=told.shares[part])

        return replace(
            self,
            visit=owner[self.visit][lead],
            first=np.append(self.first[lead], self.first[-1]),
            way=self.way + np.repeat(offset, np.diff(self.first)),
            before=whole(self.before),
            after=whole(self.after),
        )


def gather_paths(parts: Sequence[PathAccuracy], rows: Sequence[Ints]) -> PathAccuracy:
    """Take paths of several predictions of a program, in the order of their visits.

    Args:
        parts: The predictions; the first one is of all of it.
        rows: The paths that are taken of each.
    """
    pairs = [*zip(parts, rows, strict=True)]
    visit = np.concatenate([part.visit[own] for part, own in pairs])
    order = np.argsort(visit)
    begin = np.concatenate([part.first[own] for part, own in pairs])[order]
    count = np.concatenate([np.diff(part.first)[own] for part, own in pairs])[order]
    samples = np.cumsum([0, *(len(part.way) for part in parts)])
    part_of = np.repeat(np.arange(len(parts)), [len(own) for own in rows])[order]
    every = spans(begin + samples[part_of], count)
    first = np.append(0, np.cumsum(count))

    def gather(told: Sequence[Deviations]) -> Deviations:
        own = [*zip(told, rows, strict=True)]
        largest = np.concatenate([one.largest[k] for one, k in own])[order]
        return Deviations(
            **_gather_columns(told, ("off", "across", "along", "unsure"), every),
            largest=largest - begin + first[:-1],
            shares=np.concatenate([one.shares[k] for one, k in own])[order],
        )

    return PathAccuracy(
        visit=visit[order],
        first=first,
        before=gather([part.before for part in parts]),
        after=gather([part.after for part in parts]),
        unknown=parts[0].unknown + len(parts[0]) - len(visit),
        **_gather_columns(parts, ("way", "tangent", "q", "side"), every),
    )


def _gather_columns(
    parts: Sequence[Any], names: Sequence[str], rows: Ints
) -> dict[str, Any]:
    """Return rows of columns, the parts one after the other."""
    return {
        name: np.concatenate([getattr(part, name) for part in parts]).take(rows, axis=0)
        for name in names
    }


def deviations_of(paths: PathAccuracy, moves: Ints) -> dict[int, MoveDeviation]:
    """Say how far some moves of the compensated program leave their paths, by visit.

    Args:
        paths: The moves.
        moves: Which of them, (k,).
    """
    step = steps_of(paths.way, paths.first)
    within = _native.stays_within(ALONG, paths.after.across, step, paths.first, moves)
    pairs = zip(within.tolist(), paths.after.sizes[moves].tolist(), strict=True)
    return dict(
        zip(paths.visit[moves].tolist(), starmap(MoveDeviation, pairs), strict=True)
    )


def steps_of(way: Floats, first: Ints) -> Floats:
    """Return the way from the sample before to each, (s,) [m].

    Args:
        way: Path length at the samples since their path began, (s,) [m].
        first: Where the samples of each path begin, and the last ones end, (m + 1,).
    """
    step = np.diff(way, prepend=0.0)
    step[first[:-1]] = 0.0
    return step


def predict_paths(
    before: ProgramCycle,
    after: ProgramCycle,
    shift: Floats,
    cell: Cell,
    model: Model,
    temperature: float,
    owner: Ints | None = None,
    arcs: WantedArcs = NO_ARCS,
    corners: SourceCorners | None = None,
    source: PathAccuracy | None = None,
) -> PathAccuracy:
    """Predict how far a program leaves its paths, as written and as compensated.

    Args:
        before: The program as it was written, n visits.
        after: The same program, compensated.
        shift: From where the controller takes every target to be to where it is,
            (n, 3) [m]; see `PlannedProgram`.
        cell: The arm, its play as wide as its gaps, and its payload.
        model: The arm's error.
        temperature: Of the arm [deg C], NaN where not known.
        owner: The move of the source that every visit belongs to, (n,), where points
            were inserted on its way; each move is then one path.
        arcs: The arcs of the source that were cut.
        corners: How the source passes the visits; None: as the program does.
        source: What tells of the program as it was written; None: that is predicted.
    """
    cartesian = (before.targets.move != Motion.JOINT) & ~before.targets.curved
    known = cartesian & (before.ways[1] >= 0) & (after.ways[1] == before.ways[1])
    rows = np.flatnonzero(known)
    cycles, tools = (before, after), before.targets.tool[rows, :3, 3]
    pair = _ways(cell, model, cycles, rows, tools, source is None)
    run = AlongWays.of(cell, model, after, pair[1])
    error = ErrorAlong(cell, model, temperature)
    tools = tools[pair[0].way]
    wanted, commanded = (cell.arm.tcp(w.q, tools) for w in pair)
    way, tangent = measure_along(wanted, pair[0])
    off = _shift(shift, pair[0], way)
    moved = commanded - wanted - off
    if owner is not None and len(rows):
        # What chords cut off of arcs, and what points are rounded by.
        ways = pair[0]
        whole = way[ways.first[1:] - 1][ways.way]
        nearest = np.where(2 * way < whole, ways.source[ways.way], ways.visit[ways.way])
        on_arc = arcs.pieces(owner, before.targets.fly)[nearest]
        moved += arcs.off(wanted, owner[ways.visit][ways.way], on_arc)
        if corners is not None:
            moved += corners.off(cell.arm, before, ways, way)
    told, side = _deviations(run, error, moved, tangent, way), run.side
    usual = told
    if source is None:
        written = AlongWays.of(cell, model, before, pair[0])
        usual, side = _deviations(written, error, -off, tangent, way), written.side
    found = PathAccuracy(
        rows, pair[0].first, way, tangent, usual, told,
        int((cartesian & ~known).sum()), pair[0].q, side,
    )  # fmt: skip
    if owner is None or not len(rows):
        return found
    found = found.join(owner)
    off = found.after.off
    cases = FlankCases(run, error, off, tangent, found.way, found.first)
    found = replace(found, cases=cases)
    return found if source is None else source.as_written(found)


def _ways(
    cell: Cell,
    model: Model,
    cycles: tuple[ProgramCycle, ...],
    rows: Ints,
    tools: Floats,
    both: bool,
) -> list[PathSamples]:
    """Sample the ways to some visits before and after, at the same places.

    Densely where joints change their flanks after, or in both.
    """
    pair = [ways_of(cycle, rows) for cycle in cycles]
    if not len(rows):
        return pair
    wanted, commanded = (cell.arm.tcp(w.q, tools[w.way]) for w in pair)
    pair[1] = pair[1].as_many(pair[0], commanded, wanted)
    return refine_at_reversals(cell, model, cycles if both else cycles[1:], pair)


def _groups(owner: Ints) -> tuple[Ints, Ints]:
    """Find where groups of equal neighbours begin, (g,), and each one's group, (m,)."""
    begins = np.diff(owner, prepend=-1) != 0
    return np.flatnonzero(begins), np.cumsum(begins) - 1


def largest_in(sizes: Floats, group: Ints, starts: Ints) -> Ints:
    """Find the first of the largest values of every group, (g,)."""
    if not len(starts):
        return starts
    top = np.maximum.reduceat(sizes, starts)[group]
    hit = np.flatnonzero(sizes == top)
    return np.asarray(hit[np.searchsorted(group[hit], np.arange(len(starts)))])


def _shift(shift: Floats, ways: PathSamples, way: Floats) -> Floats:
    """Interpolate what taught frames are off along ways, (s, 3) [m]."""
    whole = way[ways.first[1:] - 1][ways.way]
    u = np.where(whole > 0, way / np.maximum(whole, 1e-12), 1.0)[:, None]
    begin, end = shift[ways.source][ways.way], shift[ways.visit][ways.way]
    return np.asarray((1 - u) * begin + u * end)


def _deviations(
    run: AlongWays, error: ErrorAlong, moved: Floats, tangent: Floats, way: Floats
) -> Deviations:
    """Tell how far the TCP is from where it should be, as the model says.

    Args:
        run: The program.
        error: The arm's error.
        moved: From the wanted to the commanded places, (s, 3) [m].
        tangent: Directions of the wanted path, (s, 3).
        way: Its length up to every sample, (s,) [m].
    """
    side = run.side
    off = moved + error(run, slice(None), side)
    across, along = apart(off, tangent)
    unsure, starts = _uncertain_share(run, error), run.ways.first[:-1]
    if not len(starts):
        return Deviations(off, across, along, unsure, starts, np.empty((0, 6)))
    largest = largest_in(across, run.ways.way, starts)
    shares = _shares(run, error, largest, way)
    return Deviations(off, across, along, unsure, largest, shares)


def apart(off: Floats, tangent: Floats) -> tuple[Floats, Floats]:
    """Tell what is across a path (s,) and along it (s,) [m] of what is off (s, 3)."""
    along = np.einsum("si,si->s", off, tangent)
    return lengths(off - along[:, None] * tangent), along


def _uncertain_share(run: AlongWays, error: ErrorAlong) -> Floats:
    """Half of what flanks that are not known make, all joints added up, (s,) [m]."""
    out, open_ = np.zeros(len(run.least)), run.most - run.least > UNSURE
    for joint in np.flatnonzero(open_.any(axis=0)).tolist():
        rows = np.flatnonzero(open_[:, joint])
        low, high = np.array([run.side[rows]] * 2)
        low[:, joint], high[:, joint] = run.least[rows, joint], run.most[rows, joint]
        out[rows] += lengths(error(run, rows, high) - error(run, rows, low)) / 2
    return out


def _shares(run: AlongWays, error: ErrorAlong, rows: Ints, way: Floats) -> Floats:
    """Return what every joint's flank makes of what stands at samples, (m, 6) [m].

    That is how much the error changes if the joint went from the side on which it
    arrived at the place before to that on which it arrives evenly, as the corrections
    of both places do.
    """
    ways, side = run.ways, run.side[rows]
    last = ways.first[1:] - 1
    u = (way[rows] / np.maximum(way[last], 1e-12))[:, None]
    even = (1 - u) * run.side[ways.first[:-1]] + u * run.side[last]
    here, size = error(run, rows, side), np.zeros((len(rows), 6))
    for joint in range(6):
        other = np.array(side)
        other[:, joint] = even[:, joint]
        size[:, joint] = lengths(here - error(run, rows, other))
    return size


def sides_on_moves(
    cycle: ProgramCycle, cell: Cell, model: Model, visits: Ints
) -> tuple[Floats, Floats, Ints]:
    """Tell where each joint lies in its play along some moves, s samples in all.

    Args:
        cycle: The program.
        cell: The arm, its play as wide as its gaps.
        model: The arm's error.
        visits: Those at the ends of m moves. What is known where each begins is what
            the program knows there, but where one follows the other here as well.

    Returns:
        The way since each move began, (s,) [m], the sides there, (s, 6), and which
        samples are those of move k: first[k] .. first[k + 1] - 1, (m + 1,).
    """
    ways = ways_of(cycle, visits)
    run = AlongWays.of(cell, model, cycle, ways)
    tool = cycle.targets.tool[visits, :3, 3][ways.way]
    way, _ = measure_along(cell.arm.tcp(ways.q, tool), ways)
    return way, run.side, ways.first


# The ways of a program as the arm should go them: to compare with what was measured.

SPACING = 2e-3  # [m] between places on the way, about


@dataclass(frozen=True)
class PredictedWays:
    """Where the tool goes on m moves, as the model says, s samples in all.

    Attributes:
        visit, source: The visits at both ends of each, (m,).
        first: Its samples are first[k] .. first[k + 1] - 1, (m + 1,).
        q: Joint angles, (s, 6) [rad].
        side: Where every joint lies in its play, (s, 6), 0 in the middle.
        sure: That is known of all joints, (s,).
        place: TCP in the arm's base frame, (s, 3) [m].
        flank: What the TCP moves by as each joint goes from its lower flank to its
            upper one, (s, 6, 3) [m].
    """

    visit: Ints
    source: Ints
    first: Ints
    q: Floats
    side: Floats
    sure: Bools
    place: Floats
    flank: Floats


def predict_ways(
    cycle: ProgramCycle, cell: Cell, model: Model, temperature: float
) -> PredictedWays:
    """Predict where a program leads the tool on all moves from known places.

    Args:
        cycle: The program that ran.
        cell: The arm, its play as wide as its gaps, and its payload.
        model: The arm's error.
        temperature: Of the arm [deg C], NaN where not known.
    """
    rows = np.flatnonzero(cycle.ways[1] >= 0)
    ways = _space_samples(cell, cycle, ways_of(cycle, rows))
    (ways,) = refine_at_reversals(cell, model, (cycle,), [ways])
    run = AlongWays.of(cell, model, cycle, ways)
    error = ErrorAlong(cell, model, temperature)
    tools = cycle.targets.tool[rows, :3, 3][ways.way]
    place = cell.arm.tcp(ways.q, tools) + error(run, slice(None), run.side)
    flank = np.empty((len(ways.q), 6, 3))
    for joint in range(6):
        ends = np.array([run.side, run.side])
        ends[0, :, joint], ends[1, :, joint] = -1.0, 1.0
        flank[:, joint] = error(run, slice(None), ends[1]) - error(
            run, slice(None), ends[0]
        )
    sure = ~any_in_rows(run.most - run.least > UNSURE)
    return PredictedWays(
        rows, ways.source, ways.first, ways.q, run.side, sure, place, flank
    )


def _space_samples(cell: Cell, cycle: ProgramCycle, ways: PathSamples) -> PathSamples:
    """Put samples on ways so that the TCP moves by little between them."""
    tools = cycle.targets.tool[ways.visit, :3, 3][ways.way]
    step = lengths(np.diff(cell.arm.tcp(ways.q, tools), axis=0, prepend=0.0))
    step[ways.first[:-1]] = 0.0
    parts = np.maximum(np.ceil(step / SPACING).astype(np.int64), 1)[1:]
    after = np.repeat(np.arange(len(parts)), parts - 1)
    share = (spans(np.ones_like(parts), parts - 1)) / np.repeat(parts, parts - 1)
    return ways.refine(after, share)
