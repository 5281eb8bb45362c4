"""Where moved targets lead the arm: another look after a few of them moved."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Bools, Floats, Ints, all_in_rows, any_in_rows, spans
from postproc.motion.blending import blend
from postproc.motion.joint_path import NOWHERE, FixedTargets, StartState, Trace, trace
from postproc.motion.spline_moves import sides_on_curves
from postproc.motion.targets import TargetKind, Targets
from postproc.robot.arm import Arm
from postproc.robot.backlash_operator import Edges, PlayOperator
from postproc.robot.direction import NO_SIDES, FlankState, Passages, passages, sides

# Where moved targets lead the arm: joint angles and sides, without a time law.


@dataclass(frozen=True)
class Reached:
    """Where n arrivals end up.

    Attributes:
        q: Joint angles, (n, 6) [rad], NaN where not known; as in `Plan`.
        tcp: TCP pose, (n, 4, 4) [m], base frame, NaN where not known; as in `Plan`.
        aside: From the target to that place, (n, 3) [m].
        side: Where every joint lies in its play, (n, 6) from -1 to 1; 0: not known.
    """

    q: Floats
    tcp: Floats
    aside: Floats
    side: Floats


@dataclass(frozen=True)
class PlannedPoints:
    """The n targets themselves.

    Attributes:
        q: Joint angles, (n, 6) [rad], NaN where not known.
        flange: (n, 4, 4) [m], NaN where not known.
    """

    q: Floats
    flange: Floats


@dataclass(frozen=True)
class PatchedEdges:
    """The paths to all targets, as if the arm stopped at each.

    Attributes:
        edges: As they were when all were traced.
        changes: What has replaced some of them since, the latest last.
    """

    edges: Edges
    changes: tuple[ChangedEdges, ...] = ()

    def with_(self, change: ChangedEdges) -> PatchedEdges:
        """Return them with some edges replaced."""
        return PatchedEdges(self.edges, (*self.changes, change))

    def join(self) -> Edges:
        """Return all edges as they are now."""
        if not self.changes:
            return self.edges
        edges, paths = self.edges, [self.edges.path]
        source, begin = edges.source, np.array(edges.start[:-1])
        count, size = np.diff(edges.start), len(edges.path)
        for change in self.changes:
            source = change.splice_sources(source, change.edges.source)
            start = change.edges.start
            begin[change.edge] = size + start[change.new]
            count[change.edge] = np.diff(start)[change.new]
            paths.append(change.edges.path)
            size += len(change.edges.path)
        path = np.concatenate(paths)[spans(begin, count)]
        return Edges(edges.first, source, path, np.append(0, np.cumsum(count)))


@dataclass(frozen=True)
class Replanned:
    """The way through n targets, with what it takes to look at parts of it again.

    Attributes:
        arm: The arm.
        targets: The moves.
        exact: At the targets, as if the arm stopped at each.
        passed: Joint angles where the path, its corners rounded, passes them, (n, 6)
            [rad], NaN where not known.
        aside: From the targets to there, (n, 3) [m].
        rounded: Their corners, (n, 7), see `BlendCoupling`.
        slot: Branch taken, (n,), -1 where it was not looked up.
        passages: What the rounded paths between do to the joints' play.
        sides: On which sides the joints arrive.
        edges: The paths to the targets, as if the arm stopped at each.
        begin: Where the arm stands at the first target, if that is known beforehand.
    """

    arm: Arm
    targets: Targets
    exact: PlannedPoints
    passed: Floats
    aside: Floats
    rounded: Floats
    slot: Ints
    passages: Passages
    sides: FlankState
    edges: PatchedEdges
    begin: StartState = NOWHERE

    @property
    def side(self) -> Floats:
        """Return where every joint lies in its play, as in `Reached`."""
        return self.sides.side

    @property
    def places(self) -> Floats:
        """Return where the targets are, (n, 3) [m], base frame."""
        tool, flange = self.targets.tool[:, :3, 3], self.exact.flange
        turned: Floats = np.einsum("nij,nj->ni", flange[:, :3, :3], tool)
        return turned + flange[:, :3, 3]

    @property
    def reached(self) -> Reached:
        """Return where the arrivals end up."""
        flange = where_passed(self.arm, self.exact, self.passed)
        tcp = flange @ self.targets.tool
        return Reached(self.passed, tcp, self.aside, self.side)


def replan_all(
    arm: Arm, targets: Targets, begin: StartState = NOWHERE, lead: FlankState = NO_SIDES
) -> Replanned:
    """Find joint angles and sides only.

    For targets that a correction has moved: their speeds are those of the plan.

    Args:
        arm: The arm.
        targets: The moves.
        begin: Where the arm stands at the first target, if that is known beforehand.
        lead: What is known of the first sides, see `direction.arrivals`.
    """
    exact = trace(arm, targets, begin.known)
    traced = blend(arm, targets, exact, timed=False)
    ways = passages(arm, traced.q, traced.driven)
    found = sides(arm, traced.q, ways, lead)
    found = sides_on_curves(arm, targets, traced.q, found)
    return Replanned(
        arm, targets, points_of_plan(exact), traced.q, traced.aside, traced.rounded,
        exact.slot, ways, found, PatchedEdges(exact.edges), begin,
    )  # fmt: skip


def points_of_plan(traced: Trace) -> PlannedPoints:
    """Return the targets of a trace."""
    return PlannedPoints(traced.q, traced.flange)


def where_passed(arm: Arm, exact: PlannedPoints, q: Floats) -> Floats:
    """Place the flange where the path passes targets, (n, 4, 4) [m].

    Args:
        arm: The arm.
        exact: At the targets themselves.
        q: Joint angles where the path passes them, (n, 6) [rad].
    """
    flange = np.array(exact.flange)
    beside = np.flatnonzero(any_in_rows(q != exact.q) & ~any_in_rows(np.isnan(q)))
    flange[beside] = arm.flange(q[beside])
    return flange


# Another look at a course, after a few of its targets have moved.
#
# A moved target changes the edges into and out of it and the corners at both ends of
# these; farther off, the same numbers come out as before as long as the path arrives
# there on the same branch and turn. So it is enough to trace a stretch round each moved
# target, from a place that is known; where a stretch does not join the old course
# again, or lies where the flow branches, the whole course is traced anew.

CHANGED = 2  # targets on each side of a moved one whose passing may change
TRACED = 3  # targets on each side that must be traced for that
SAME = 1e-9  # [rad] arriving on the same branch and turn
MOST = 0.85  # of all targets; if more have to be traced, all are
STEPS = (
    TargetKind.TOOL_STEP,
    TargetKind.BASE_STEP,
    TargetKind.JOINT_STEP,
    TargetKind.TOWARDS,
    TargetKind.PARTIAL_POSE,
    TargetKind.PARTIAL_JOINTS,
)
IS_STEP = np.isin(np.arange(max(TargetKind) + 1), STEPS)


@dataclass(frozen=True)
class _Part:
    """Some stretches of a program.

    Attributes:
        rows: Their m targets, in the program's order, (m,).
        seeds: Targets among them that stretches begin at, from a known place, (m,).
        lasts: Targets among them that the program goes on from, (m,).
        kept: Targets among them whose passing may change, (m,).
        targets: The stretches as a program of their own.
    """

    rows: Ints
    seeds: Bools
    lasts: Bools
    kept: Bools
    targets: Targets


def replan(
    arm: Arm,
    before: Replanned,
    targets: Targets,
    moved: Bools,
    lead: FlankState = NO_SIDES,
) -> Replanned:
    """Find where targets lead of which only some have moved.

    The result is that of `replan_all`.

    Args:
        arm: The arm.
        before: The course before they moved.
        targets: All targets as they are now.
        moved: Which have another `tcp` or other `joints` than in `before`, (n,).
        lead: What is known of the first sides, see `direction.arrivals`.
    """
    if not moved.any():
        found = sides(arm, before.passed, before.passages, lead)
        found = sides_on_curves(arm, targets, before.passed, found)
        return replace(before, targets=targets, sides=found)
    part = _part(targets, moved, len(before.begin) > 0)
    if part is None:
        return replan_all(arm, targets, before.begin, lead)
    begins = part.rows[part.seeds]
    known = FixedTargets(
        np.flatnonzero(part.seeds), before.exact.q[begins],
        before.exact.flange[begins], before.slot[begins],
    )  # fmt: skip
    exact = trace(arm, part.targets, known)
    old, new = before.exact.q[part.rows], exact.q
    same = all_in_rows(np.isclose(new, old, rtol=0, atol=SAME, equal_nan=True))
    same &= exact.slot == before.slot[part.rows]
    if not same[part.lasts].all():
        return replan_all(arm, targets, before.begin, lead)
    traced = blend(arm, part.targets, exact, timed=False)
    slot = np.array(before.slot)
    slot[part.rows[part.kept]] = exact.slot[part.kept]
    passed = _patch_rows(before.passed, part, traced.q)
    at_targets = PlannedPoints(
        _patch_rows(before.exact.q, part, exact.q),
        _patch_rows(before.exact.flange, part, exact.flange),
    )
    now = passages(arm, traced.q, traced.driven)
    changed = ChangedEdges.of(before.passages.first, part, exact.edges)
    ways = changed.splice(before.passages, now)
    found = sides_on_curves(arm, targets, passed, sides(arm, passed, ways, lead))
    aside = _patch_rows(before.aside, part, traced.aside)
    corners = _patch_rows(before.rounded, part, traced.rounded)
    return Replanned(
        arm, targets, at_targets, passed, aside, corners, slot, ways, found,
        before.edges.with_(changed), before.begin,
    )  # fmt: skip


def _part(targets: Targets, moved: Bools, begun: bool) -> _Part | None:
    """Cut out what moved targets touch; None where that has no simple answer."""
    n, first = len(targets), targets.pred_start
    begins = np.array(targets.from_nowhere)
    begins[:1] &= not begun
    touched = _add_touched(targets, moved)
    inside, kept = _with_arcs(targets, _near(touched, TRACED)), _near(touched, CHANGED)
    if not inside.any() or np.count_nonzero(inside) > MOST * n:
        return None
    starts = inside & (begins | ~np.append(False, inside[:-1]))
    simple = starts | targets.one_after_another
    clipped = inside[0] and not begins[0] and not begun
    if clipped or not simple[inside].all() or (touched & starts & ~begins).any():
        return None
    rows = np.flatnonzero(inside)
    seeds = starts & ~begins
    row = np.cumsum(inside) - 1
    count = np.where(seeds, 0, np.diff(first))[rows]
    pred_start = np.concatenate([[0], np.cumsum(count)])
    pred = targets.pred[spans(first[rows], count)]
    pred = np.where(pred >= 0, row[np.maximum(pred, 0)], pred)
    goes_on = np.append(~inside[1:] & ~begins[1:], False)
    return _Part(
        rows, seeds[rows], goes_on[rows], kept[rows],
        targets.part(rows, pred_start, pred),
    )  # fmt: skip


def _add_touched(targets: Targets, moved: Bools) -> Bools:
    """Add the targets whose edges change with others: steps, and both parts of arcs."""
    touched = np.array(moved)
    via = np.flatnonzero(targets.via)
    last = len(moved) - 1
    near = np.stack([np.clip(via + k, 0, last) for k in (-1, 0, 1)])
    arcs = via[moved[near].any(axis=0)]
    touched[arcs] = touched[np.minimum(arcs + 1, last)] = True
    steps = IS_STEP[targets.kind]
    while steps.any():
        more = steps & np.append(False, touched[:-1]) & ~touched
        if not more.any():
            break
        touched |= more
    return touched


def _with_arcs(targets: Targets, inside: Bools) -> Bools:
    """Add both ends of the arcs whose point on the way is inside."""
    out, via = np.array(inside), inside & targets.via
    out[1:] |= via[:-1]
    out[:-1] |= via[1:]
    return out


def _near(rows: Bools, distance: int) -> Bools:
    """Tell which places are at most so far from True ones, (n,)."""
    out = np.array(rows)
    for k in range(1, distance + 1):
        out[k:] |= rows[:-k]
        out[:-k] |= rows[k:]
    return out


def _patch_rows(before: Floats, part: _Part, now: Floats) -> Floats:
    """Put new rows in, of targets whose passing may change."""
    out = np.array(before)
    out[part.rows[part.kept]] = now[part.kept]
    return out


@dataclass(frozen=True)
class ChangedEdges:
    """k edges that some stretches of a program replace.

    Attributes:
        edge: Which they are in the program, (k,).
        new: .. and among the edges of the stretches, (k,).
        rows: The targets of the stretches in the program, (m,).
        edges: The edges of the stretches, as if the arm stopped at every target.
    """

    edge: Ints
    new: Ints
    rows: Ints
    edges: Edges

    @classmethod
    def of(cls, first: Ints, part: _Part, edges: Edges) -> ChangedEdges:
        """Take the edges between targets whose passing may change.

        Args:
            first: Edges to the targets of the program, see `Edges`.
            part: The stretches.
            edges: Their edges.
        """
        last_kept = np.append(False, part.kept[:-1]) & ~part.seeds
        alone = part.targets.from_nowhere
        rows = np.flatnonzero(part.kept & ~part.seeds & (last_kept | alone))
        new = _edges_of(edges.first, rows)
        return cls(_edges_of(first, part.rows[rows]), new, part.rows, edges)

    def splice(self, before: Passages, now: Passages) -> Passages:
        """Put in what passing the new edges does to plays."""
        lo, hi = np.array(before.clamps.lo), np.array(before.clamps.hi)
        lo[self.edge] = now.clamps.lo[self.new]
        hi[self.edge] = now.clamps.hi[self.new]
        source = self.splice_sources(before.source, now.source)
        return Passages(before.first, source, PlayOperator(lo, hi))

    def splice_sources(self, before: Ints, now: Ints) -> Ints:
        """Put in where the new edges come from, negative where that is not known."""
        source, found = np.array(before), now[self.new]
        source[self.edge] = np.where(found >= 0, self.rows[np.maximum(found, 0)], found)
        return source


def _edges_of(first: Ints, rows: Ints) -> Ints:
    """List the edges that lead to visits."""
    return spans(first[rows], first[rows + 1] - first[rows])
