"""The windows of a program between its stops, and those alone that a plan changes.

What lies on both sides of a stop does not act on each other, but for what the joints
remember: on which flanks their links rest. So a window is predicted with a run-up from
an earlier stop, behind which every joint has turned farther than its gap is wide.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.findings.timing_comparison import InTime
from postproc.compensation.options import Job
from postproc.compensation.outcome import Decisions, Status
from postproc.compensation.paths.backlash_preload import cross_at_once
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.compensation.paths.path_error import PathAccuracy
from postproc.compensation.program import ParsedProgram
from postproc.compensation.scale.windowing import cut_points
from postproc.compensation.window_result import WindowResult
from postproc.diagnostics import Code
from postproc.language.visits import Graph, Meaning, Visits
from postproc.model.backlash_width import half_widths
from postproc.model.flank_hypotheses import FlankOfJoint
from postproc.motion.cycle_time import ProgramCycle
from postproc.robot.direction import half_width
from postproc.robot.pose import MM
from postproc.robot.trajectory import Motion

MOST = 0.6  # of the visits: more are predicted as a whole
BACK = 60  # visits of a run-up; where they do not tell, the program's start does
MARGIN = 5e-3  # [rad] that a joint turns beyond its gap: what corrections move it by
SAME = 1e-4  # [rad] by which joints at a target may differ
ALIKE = 1e-3  # of half the play: by which links may lie otherwise where windows end

Key = tuple[Any, ...]
"""What a plan puts on the ways of a window and of its run-up."""


@dataclass(frozen=True, eq=False)
class Part:
    """Some visits of a program with points, corrected and predicted.

    Attributes:
        visits: They, k in all.
        kept: How they are corrected.
        in_time: They, in time; its paths are those of the source's moves.
        own: Which of them each visit of the source is, (n,); -1 where it is none.
        steep_pieces: What is known of the pieces of moves, see `PathPrediction`.
        wanted: Which points moves want beside those that they have, likewise.
    """

    visits: Visits
    kept: WindowResult
    in_time: InTime
    own: Ints
    steep_pieces: dict[int, list[int]] = field(default_factory=dict, repr=False)
    wanted: dict[tuple[Any, ...], list[float]] = field(default_factory=dict, repr=False)
    _refused: dict[tuple[int, bool], str] = field(default_factory=dict, repr=False)

    @property
    def decisions(self) -> Decisions:
        """Return how they are corrected."""
        return self.kept.decisions

    @property
    def paths(self) -> PathAccuracy:
        """Return how far they leave their paths."""
        return self.in_time.paths

    @cached_property
    def off_at_points(self) -> Floats:
        """How far points at samples of paths are to move these, reversed, (s, 3) [m].

        That is where the TCP is if drives cross their gaps where they begin to, as
        points let them.
        """
        cases = self.paths.cases
        if cases is None:
            return self.paths.after.off
        return cases.off_with(cross_at_once(cases.run.side, cases.first))

    @cached_property
    def steep(self) -> Bools:
        """Return where corrections change too fast, (k,)."""
        decided = self.decisions
        steps = [one.code is Code.CORRECTION_STEP for one in decided.reasons]
        return np.asarray(np.array(steps)[decided.why])

    @cached_property
    def moves(self) -> Floats:
        """Return what they are corrected by, (k, 3) [m]."""
        moved = self.decisions.corrected - self.visits.target.values
        return np.asarray(moved[:, :3] * MM)

    def ends_as(self, source: ProgramCycle, visits: Ints, travels: bool) -> Bools:
        """Return where joints lie in their play as they do in the source, (k,).

        Args:
            source: The source, compensated, in time.
            visits: Visits of the source, (k,).
            travels: How far joints have travelled matters too.
        """
        here = _lie_in_play(self.in_time.after, self.own[visits], travels)
        there = _lie_in_play(source, visits, travels)
        alike = np.isclose(here, there, rtol=0.0, atol=ALIKE, equal_nan=True)
        return np.asarray(alike.all(axis=1))

    def refuse(self, v: int, stops: bool, unsized: str) -> str:
        """Say why points of a move cannot be corrected, "" where they can.

        Args:
            v: The move.
            stops: Its first point is a stop.
            unsized: Why points stay out whose blending is not known.
        """
        if (v, stops) not in self._refused:
            self._refused[v, stops] = self._refuse(v, stops, unsized)
        return self._refused[v, stops]

    def _refuse(self, v: int, stops: bool, unsized: str) -> str:
        decided, rows, visits = self.decisions, self.rows_on_way(v), self.visits
        left = rows[decided.status[rows] != Status.CORRECTED]
        if len(left):
            why = decided.reasons[decided.why[left[0]]]
            return f"points inserted into it cannot be corrected: {why}"
        passed = rows[~visits.motion.via[rows]][stops:]
        sized = visits.motion.fly[passed] & (visits.zone.size_mm[passed] > 0.0)
        return "" if sized.all() else unsized

    def rows_on_way(self, v: int) -> Ints:
        """Return its visits on the way to a visit of the source, without that."""
        return np.arange(int(self.own[v - 1]) + 1 if v else 0, int(self.own[v]))


def _lie_in_play(cycle: ProgramCycle, rows: Ints, travels: bool) -> Floats:
    """Return what is known of links at some visits, of half their play, (k, w)."""
    arm, arrived = cycle.arm, cycle.arrived
    angles, half = cycle.path.q[rows] @ arm.coupling.T, half_width(arm)
    ends = (arrived.past.play.lo, arrived.past.play.hi)
    columns = [arrived.side[rows], *((z[rows] - angles) / half for z in ends)]
    if travels:
        columns.append(arrived.travel[rows] / half)
    return np.concatenate(columns, axis=1)


@dataclass(frozen=True, eq=False)
class Windows:
    """Where a program of n visits may be cut, w windows.

    Attributes:
        end: The last visit of each, (w,), ascending: there the arm stops.
        lead: The stop at which its run-up begins, (w,); -1: where the program does.
        q: Joint angles at all visits, (n, 6) [rad].
    """

    end: Ints
    lead: Ints
    q: Floats

    @classmethod
    def of(
        cls,
        visits: Visits,
        cycle: ProgramCycle,
        setting: Job,
        flanks: Sequence[FlankOfJoint],
    ) -> Windows:
        """Cut a program at its stops.

        Args:
            visits: The program.
            cycle: .. in time.
            setting: Its arm, and the gaps of its model.
            flanks: What is known of joints 1 to 6.
        """
        arm, n, q = setting.cell.arm, len(visits), cycle.path.q
        cuts = cut_points(visits)
        cuts[-1:] = True
        end = np.flatnonzero(cuts)
        half = np.nan_to_num(half_widths(setting.model, arm, q)).max(axis=0, initial=0)
        wide = np.array([max(*flank.widths, flank.nominal) for flank in flanks])
        driven = q @ arm.coupling.T
        travel = None
        if "travel" in setting.model.needs:
            travel = cycle.arrived.travel
        back = _find_run_ups(driven, 2.0 * wide * half + MARGIN, travel)
        begin = np.append(-1, end[:-1])
        known = (begin >= 0) & (back[begin] > 0)
        at = np.searchsorted(end, begin - back[begin], side="right") - 1
        lead = np.where(known & (at >= 0), end[at], -1)
        return cls(end, lead, q) if n else cls(end, end, q)

    def list_keys(self, plan: InsertionPlan) -> dict[int, Key]:
        """Say what a plan puts on every window and its run-up, by window.

        Only of those on which it puts anything.
        """
        moves = np.array(sorted(plan.points), dtype=np.int64)
        low = np.searchsorted(moves, self.lead, side="right")
        high = np.searchsorted(moves, self.end, side="right")
        chords: dict[int, set[float]] = {}
        for v, share in plan.chords:
            chords.setdefault(v, set()).add(share)
        puts = [
            (
                v, plan.points[v], v in plan.stops, v in plan.halved,
                tuple(sorted(chords.get(v, ()))),
            )
            for v in moves.tolist()
        ]  # fmt: skip
        rows = np.flatnonzero(high > low).tolist()
        return {k: tuple(puts[low[k] : high[k]]) for k in rows}

    def of_visits(self, visits: Collection[int]) -> Ints:
        """Return the windows in which visits lie, ascending, (k,)."""
        rows = np.fromiter(visits, dtype=np.int64)
        return np.unique(np.searchsorted(self.end, rows))

    def own(self, k: int) -> slice:
        """Return the visits of a window."""
        return slice(int(self.end[k - 1]) + 1 if k else 0, int(self.end[k]) + 1)

    def cover(self, some: Collection[int]) -> tuple[Bools, Ints]:
        """Return the visits of windows with their run-ups, and where those begin.

        Args:
            some: The windows.

        Returns:
            Which visits, (n,), and the stops before them, (s,).
        """
        inside = np.zeros(len(self.q), dtype=bool)
        for k in some:
            inside[int(self.lead[k]) + 1 : int(self.end[k]) + 1] = True
        begins = inside & ~np.append(False, inside[:-1])
        seeds = np.flatnonzero(begins) - 1
        return inside, seeds[seeds >= 0]


def _find_run_ups(driven: Floats, need: Floats, travel: Floats | None) -> Ints:
    """Say behind how many visits every joint lies in its play as it would anyway.

    A joint that has turned by its whole gap, whichever way, lies where that led it.

    Args:
        driven: Angles of the drives, (n, 6) [rad].
        need: By how much each turns for that, (6,) [rad].
        travel: Since the last reversal, (n, 6) [rad], where that matters.

    Returns:
        (n,); 0 where so many visits do not tell.
    """
    n = len(driven)
    found = np.zeros(n, dtype=np.int64)
    low, high = np.array(driven), np.array(driven)
    way = np.zeros_like(driven)
    for k in range(1, min(BACK, n - 1) + 1):
        earlier = driven[:-k]
        low[k:], high[k:] = np.fmin(low[k:], earlier), np.fmax(high[k:], earlier)
        settled = (high[k:] - low[k:] > need).all(axis=1)
        if travel is not None:
            way[k:] += np.nan_to_num(np.abs(driven[1 : n - k + 1] - earlier))
            settled &= (way[k:] > travel[k:] + MARGIN).all(axis=1)
        found[k:][settled & (found[k:] == 0)] = k
    return found


def take_windows(
    reading: ParsedProgram, own: Ints, inside: Bools, seeds: Ints, q: Floats
) -> tuple[ParsedProgram, Ints, Ints]:
    """Take some visits of a program with points; to where they begin the joints go.

    Args:
        reading: The program.
        own: Which of its visits those of the source are, (n,).
        inside: Visits of the source whose moves are taken, (n,).
        seeds: Stops where those begin, (s,).
        q: Joint angles at the visits of the source, (n, 6) [rad].

    Returns:
        These visits as a program, which of its visits are those of the source, (n,), -1
        where none is, and which of the program's they are, (k,).
    """
    owner = np.searchsorted(own, np.arange(len(reading.visits)))
    taken = inside[owner]
    taken[own[seeds]] = True
    rows = np.flatnonzero(taken)
    number = np.cumsum(taken) - 1
    mine = np.where(taken[own], number[own], -1)
    visits = _take(reading.visits, rows)
    visits = _begin_at(visits, mine[seeds], q[seeds])
    aims = reading.aims[rows] if len(reading.aims) else reading.aims
    return replace(reading, visits=visits, aims=aims), mine, rows


def _take(visits: Visits, rows: Ints) -> Visits:
    """Take some visits as a program in which one follows the other, (k,)."""
    before = np.arange(-1, len(rows) - 1)
    if len(rows) and rows[0] == 0:
        before[0] = visits.graph.predecessors(0)[0]
    taken = visits.take(rows, Graph(np.arange(len(rows) + 1), before))
    block = taken.motion.block
    return taken.with_columns(
        block=np.where(block >= 0, np.searchsorted(rows, block), block)
    )


def _begin_at(visits: Visits, rows: Ints, q: Floats) -> Visits:
    """Let the joints go to some visits (s,), where nothing is corrected."""
    values = np.array(visits.target.values)
    values[rows] = np.nan
    values[rows, :6] = np.rad2deg(q)
    fixed = {
        "kind": int(Motion.JOINT), "meaning": int(Meaning.JOINTS), "literal": -1,
        "follows": -1, "shift": -1, "block": -1, "via": False, "curved": False,
        "fly": False,
    }  # fmt: skip
    columns = {name: np.array(visits.columns[name]) for name in fixed}
    for name, column in columns.items():
        column[rows] = fixed[name]
    return visits.with_columns(values=values, **columns)
