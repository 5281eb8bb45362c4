"""The geometric path of a whole program in joint space."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc import _native
from postproc.arrays import (
    Bools,
    Floats,
    Ints,
    any_in_rows,
    chunks,
    floats,
    spans,
)
from postproc.motion.branches import (
    LOST,
    SUSPICIOUS,
    Branched,
    BranchedLazily,
    SolvedBranches,
    follow,
    nearest_slot,
    nearest_slots,
    nearest_turns,
    on_other_turns,
    on_written_turns,
    wrist_interpolated,
)
from postproc.motion.path import Segments, arcs, lines, sample
from postproc.motion.targets import (
    AMBIGUOUS,
    ARC_END,
    CODE,
    LIMITS,
    NO_BRANCH,
    NO_CIRCLE,
    NO_START,
    NO_TARGET,
    OTHER_BRANCH,
    OUT_OF_REACH,
    PATH_JUMP,
    PATH_LIMITS,
    PATH_REACH,
    STRANDS,
    TargetKind,
    Targets,
)
from postproc.robot.arm import Arm
from postproc.robot.backlash_operator import Edges
from postproc.robot.pose import inverse, is_unknown
from postproc.robot.trajectory import Motion

# Where one move leads to from one place.


@dataclass(frozen=True)
class EdgeEnd:
    """Where one edge leads to.

    Attributes:
        q: (6,) [rad], NaN where not known.
        flange: (4, 4) [m].
        slot: Branch, -1 where unknown.
        path: Joint angles along the edge, the target included, (k, 6); empty where the
            path is not known.
        reason: Index into `REASONS`.
    """

    q: Floats
    flange: Floats
    slot: int
    path: Floats
    reason: int


NO_PATH = np.empty((0, 6))

# The arrays that a trace fills in program order.

PARTIAL = (TargetKind.PARTIAL_POSE, TargetKind.PARTIAL_JOINTS)
STEPS = (
    TargetKind.TOOL_STEP, TargetKind.BASE_STEP, TargetKind.JOINT_STEP,
    TargetKind.TOWARDS,
)  # fmt: skip
PLACING = (TargetKind.TOOL_STEP, TargetKind.BASE_STEP, TargetKind.PARTIAL_POSE)
CHUNK = 50_000  # poses solved at a time; solving needs room for copies
SAME_POSE = 1e-7  # [m] and sines; poses that several predecessors agree on
LONG = 256  # targets on one path from which on one branch is cheaper than all of them


@dataclass(frozen=True)
class FixedTargets:
    """What is known beforehand of k targets, whatever leads to them.

    Attributes:
        rows: The targets, (k,).
        q: Their joint angles, (k, 6) [rad].
        flange: Their flange poses, (k, 4, 4) [m].
        slot: Their branches, (k,).
    """

    rows: Ints
    q: Floats
    flange: Floats
    slot: Ints


class PathSolver:
    """What is known so far of n targets, e edges and s samples on them.

    Attributes:
        q: Joint angles at the targets, (n, 6) [rad], NaN where not known yet.
        flange: Flange poses at the targets, (n, 4, 4) [m], NaN where not known yet.
        slot: Branch taken, (n,), -1 where unknown.
        reason: Index into `REASONS`, (n,).
        samples: Where the samples stand.
        source: Predecessor of each edge, (e,); becomes -1 where a path stays unknown.
        place: Where the poses of samples stand in those of `samples`, or -1 less their
            target, (s,).
        path: Joint angles at the samples, (s, 6) [rad], NaN where not known yet.
        placed: Flange poses known beforehand that joint angles must be found for, (n,).
        told: Targets that are known whatever leads to them, (n,).
        long: Targets of long stretches of single Cartesian paths, (n,); these are
            followed on one branch, and the others are not looked for.
    """

    def __init__(
        self, arm: Arm, targets: Targets, known: FixedTargets | None = None
    ) -> None:
        """Place what does not depend on joint angles and solve for it in one batch."""
        self.arm, self.targets = arm, targets
        n = len(targets)
        self.tool_inverse = inverse(targets.tool)
        self.q = np.full((n, 6), np.nan)
        self.slot = np.full(n, -1, dtype=np.int64)
        self.reason = np.zeros(n, dtype=np.int64)
        self._place()
        self.given = np.zeros(n, dtype=bool)
        if known is not None:
            self._give(known)
        self._settle_steps()
        self.samples = sample(targets, self.flange)
        self.source = np.array(self.samples.source)
        self.path = np.full((int(self.samples.start[-1]), 6), np.nan)
        self.place = np.repeat(-1 - self.samples.visit, np.diff(self.samples.start))
        self.place[self.samples.inner] = np.arange(len(self.samples.inner))
        placed = ~is_unknown(self.flange)
        self.placed = placed & (targets.kind != TargetKind.JOINTS) & ~self.given
        self.told = np.zeros(n, dtype=bool)
        self._find_simple()

    def _place(self) -> None:
        """Place the flange at poses and joint angles."""
        targets = self.targets
        self.flange = targets.tcp @ self.tool_inverse
        self.flange[targets.kind != TargetKind.POSE] = np.nan
        joints = np.flatnonzero(targets.kind == TargetKind.JOINTS)
        self.q[joints] = targets.joints[joints]
        known = joints[~any_in_rows(np.isnan(self.q[joints]))]
        self.flange[known] = self.arm.flange(self.q[known])

    def _settle_steps(self) -> None:
        """Place the flange after steps from places that are known already."""
        kind = self.targets.kind
        for v in np.flatnonzero(np.isin(kind, PLACING)).tolist():
            sources = self.targets.pred[
                self.targets.pred_start[v] : self.targets.pred_start[v + 1]
            ]
            if len(sources) and (sources >= 0).all():
                after = [self.after_step(v, self.flange[s]) for s in sources]
                if np.ptp(after, axis=0).max() < SAME_POSE:
                    self.flange[v] = after[0]

    def after_step(self, v: int, flange: Floats) -> Floats:
        """Place the flange after step `v` from a flange pose, (4, 4) [m]."""
        step, tcp = self.targets.tcp[v], flange @ self.targets.tool[v]
        kind = self.targets.kind[v]
        if kind == TargetKind.TOOL_STEP:
            tcp = tcp @ step
        elif kind == TargetKind.PARTIAL_POSE:
            axes, place = step[:3, :3], step[:3, 3]
            stays = axes.T @ tcp[:3, 3]
            tcp[:3, 3] = axes @ np.where(np.isnan(place), stays, place)
        else:
            tcp[:3, :3] = step[:3, :3] @ tcp[:3, :3]
            tcp[:3, 3] += step[:3, 3]
        moved: Floats = tcp @ self.tool_inverse[v]
        return moved

    def _give(self, known: FixedTargets) -> None:
        """Take over what is known of some targets."""
        self.q[known.rows], self.slot[known.rows] = known.q, known.slot
        self.flange[known.rows] = known.flange
        self.given[known.rows] = True

    def _find_simple(self) -> None:
        """Find what needs but its configuration string, or the one target before.

        Of these, long runs of a Cartesian path are solved together.
        """
        t, samples = self.targets, self.samples
        flagged = (t.kind == TargetKind.POSE) & (t.slot >= 0) & ~t.nearest_turn
        self.by_string = flagged & (t.move == Motion.JOINT) & self.placed
        single = np.flatnonzero(np.diff(t.pred_start) == 1)
        edge = t.pred_start[single]
        self.single = np.zeros(len(self.q), dtype=bool)
        self.single[single] = samples.ready[edge] & (samples.source[edge] == single - 1)
        self.single &= self.placed
        edges = np.flatnonzero(np.diff(np.concatenate([[0], self.single, [0]])))
        begin, end = edges[::2], edges[1::2]
        run = np.zeros(len(self.q), dtype=np.int64)  # length of that which each is in
        run[self.single] = np.repeat(end - begin, end - begin)
        self.long = self.single & (run >= LONG)

    def solve(self, settled: Bools) -> None:
        """Solve for all branches where there is no long stretch, in one batch.

        Args:
            settled: Targets that are settled, with the ways to them, (n,).
        """
        samples, start = self.samples, self.samples.start
        poses = np.flatnonzero(self.placed & ~settled & ~self.long)
        edge = np.searchsorted(start, samples.inner, side="right") - 1
        visit = samples.visit[edge]
        inner = np.flatnonzero(~self.long[visit] & ~settled[visit])
        asked = np.concatenate([self.flange[poses], samples.flange[inner]])
        self.branches = np.empty((len(asked), 8, 6))
        for rows in chunks(len(asked), CHUNK):
            self.branches[rows] = self.arm.inverse(asked[rows]).q
        self.solved = np.full(len(self.q), -1)
        self.solved[poses] = np.arange(len(poses))
        self.row = np.full(int(start[-1]), -1)
        self.row[samples.inner[inner]] = len(poses) + np.arange(len(inner))
        self.row[start[1:] - 1] = self.solved[samples.visit]

    def solutions(self, v: int, flange: Floats) -> Floats:
        """Return all branches at target v with its flange pose, (8, 6) [rad]."""
        if self.solved[v] >= 0:
            known: Floats = self.branches[self.solved[v]]
            return known
        found: Floats = self.arm.inverse(flange[None]).q[0]
        return found

    def all_solutions(self, rows: Ints) -> Floats:
        """Return all branches at placed targets, (k, 8, 6) [rad]."""
        found = np.empty((len(rows), 8, 6))
        known = self.solved[rows] >= 0
        found[known] = self.branches[self.solved[rows[known]]]
        found[~known] = self.arm.inverse(self.flange[rows[~known]]).q
        return found

    def ways(self, span: slice) -> Branched:
        """Return the solutions at some samples of ready edges."""
        rows = self.row[span]
        if len(rows) and (rows >= 0).all():
            return SolvedBranches(self.branches[rows])
        return BranchedLazily(
            self.arm, self.flange_at(np.arange(span.start, span.stop))
        )

    def flange_at(self, at: Ints) -> Floats:
        """Look up the flange poses at samples of ready edges, (k, 4, 4) [m]."""
        place, out = self.place[at], np.empty((len(at), 4, 4))
        ends, inside = np.flatnonzero(place < 0), np.flatnonzero(place >= 0)
        out[ends] = self.flange.take(-1 - place[ends], axis=0)
        out[inside] = self.samples.flange.take(place[inside], axis=0)
        return out

    def is_known(self, v: int) -> bool:
        """Tell whether the joint angles at a target are known already."""
        return v >= 0 and not np.isnan(self.q[v, 0])

    def is_known_before(self, v: int, source: int) -> bool:
        """Tell whether a place is known when v is come to, in the program's order."""
        return self.is_known(source) and (source < v or bool(self.told[source]))

    def branch_at(self, v: int) -> int:
        """Return the branch at a target, -1 where it is not known or not one alone."""
        return int(self.branches_at(np.array([v]))[0])

    def branches_at(self, rows: Ints) -> Ints:
        """Return the branches at targets, (k,), likewise."""
        straight = np.abs(self.q[rows, 4]) < _native.STRAIGHT
        return np.where(straight, -1, self.slot[rows])

    def span(self, edge: int) -> slice:
        """Return the samples of an edge."""
        return slice(int(self.samples.start[edge]), int(self.samples.start[edge + 1]))


# One arrival over a Cartesian path: a line, or a part of an arc.


def along_line(
    work: PathSolver, v: int, edge: int, flange: Floats, end: EdgeEnd
) -> EdgeEnd:
    """Follow a Cartesian path; where that fails, keep the end and say why."""
    joints = work.targets.kind[v] == TargetKind.JOINTS
    if work.samples.ready[edge]:
        span = work.span(edge)
        ways = work.ways(slice(span.start, span.stop - joints))
    else:
        tool = work.targets.tool[v]
        line = lines(
            (work.flange[work.source[edge]] @ tool)[None], (flange @ tool)[None]
        )
        ways = _ways(work, v, edge, line, not joints)
    return _follow_path(work, v, edge, flange, end, ways)


def along_late_arc(
    work: PathSolver, v: int, edge: int, flange: Floats, end: EdgeEnd
) -> EdgeEnd:
    """Follow a part of an arc whose points were not all known beforehand."""
    t, begins = work.targets, int(work.samples.begins[edge])
    unknown = EdgeEnd(end.q, flange, end.slot, NO_PATH, end.reason)
    if begins < 0 or t.wrist_joint[v] or work.source[begins] < 0:
        return unknown
    via, start = v if t.via[v] else v - 1, work.source[begins]
    places = np.array(work.flange[[start, via, via + 1]])
    places[1 + v - via] = flange
    if np.isnan(places[0]).any():
        return unknown
    if np.isnan(places).any():
        return replace(unknown, reason=end.reason or CODE[ARC_END])
    begin, between, last = (places @ t.tool[v])[:, None]
    parts = arcs(begin, between, last, past_start=t.past_start[[v]])
    part = parts[0 if t.via[v] else 1]
    if not part.valid[0]:
        return replace(unknown, reason=CODE[NO_CIRCLE])
    ways = _ways(work, v, edge, part, t.kind[v] != TargetKind.JOINTS)
    return _follow_path(work, v, edge, flange, end, ways)


def _follow_path(
    work: PathSolver, v: int, edge: int, flange: Floats, end: EdgeEnd, ways: Branched
) -> EdgeEnd:
    """Follow a Cartesian path through solutions; see `along_line`."""
    near = work.q[work.source[edge]]
    joints = work.targets.kind[v] == TargetKind.JOINTS
    done = follow(near, ways)
    if len(done.q) < len(ways):
        lost = OUT_OF_REACH if len(end.path) == 0 else PATH_REACH
        reason = CODE[PATH_JUMP if done.reached else lost]
        return EdgeEnd(end.q, flange, end.slot, NO_PATH, reason)
    if not joints:
        before = work.branch_at(int(work.source[edge]))
        single = (done.slot == (done.slot[0] if before < 0 else before)).all()
        reason = 0 if single else CODE[PATH_JUMP]
        return EdgeEnd(done.q[-1], flange, int(done.slot[-1]), done.q, reason)
    last = done.q[-1] if len(done.q) else near
    if np.abs(last - end.q).max() > LOST:
        return EdgeEnd(end.q, flange, -1, NO_PATH, CODE[OTHER_BRANCH])
    return EdgeEnd(end.q, flange, -1, np.vstack([done.q, end.q]), 0)


def _ways(
    work: PathSolver, v: int, edge: int, path: Segments, target: bool
) -> Branched:
    """Solve along one path to v, with or without the target itself."""
    k = work.samples.count(edge)
    u = np.arange(1, k + (1 if target else 0)) / k
    tcp = path.poses(np.zeros(len(u), dtype=np.int64), u)
    return SolvedBranches(work.arm.inverse(tcp @ work.tool_inverse[v]).q)


# One arrival: from known joint angles over one edge to a target.


def arrive(work: PathSolver, v: int, edge: int) -> EdgeEnd:
    """Go over an edge whose source has known joint angles."""
    targets, source = work.targets, int(work.source[edge])
    kind, near = targets.kind[v], work.q[source]
    if kind == TargetKind.JOINT_STEP:
        q = near + targets.joints[v]
        return EdgeEnd(q, work.arm.flange(q[None])[0], -1, q[None], 0)
    if kind == TargetKind.PARTIAL_JOINTS:
        q = np.where(np.isnan(targets.joints[v]), near, targets.joints[v])
        return EdgeEnd(q, work.arm.flange(q[None])[0], -1, q[None], 0)
    flange = work.flange[v]
    if kind == TargetKind.TOWARDS:
        flange = part_way(work, v, work.flange[source])
        if np.isnan(flange).any():
            return EdgeEnd(np.full(6, np.nan), flange, -1, NO_PATH, CODE[NO_TARGET])
    elif np.isnan(flange).any():
        flange = work.after_step(v, work.flange[source])
    if kind == TargetKind.JOINTS:
        end = EdgeEnd(work.q[v], flange, -1, work.q[v][None], 0)
    else:
        end = choose(work, v, flange, near)
    if targets.move[v] == Motion.JOINT or np.isnan(flange).any():
        return end
    if work.samples.broken[edge]:
        return EdgeEnd(end.q, flange, end.slot, NO_PATH, CODE[NO_CIRCLE])
    if np.isnan(targets.tool[v]).any():
        return EdgeEnd(end.q, flange, end.slot, NO_PATH, end.reason)
    if targets.move[v] == Motion.CIRCULAR and not work.samples.ready[edge]:
        return along_late_arc(work, v, edge, flange, end)
    if targets.wrist_joint[v]:
        path = wrist_interpolated(
            work.arm, near, end.q, targets.tool[v], work.samples.count(edge)
        )
        reason = end.reason if len(path) else end.reason or CODE[PATH_REACH]
        return EdgeEnd(end.q, flange, end.slot, path, reason)
    return along_line(work, v, edge, flange, end)


def part_way(work: PathSolver, v: int, flange: Floats) -> Floats:
    """Place the flange after going a distance towards a pose, (4, 4) [m].

    The tool turns in proportion; NaN where the pose is nearer than the distance, for
    what the arm does then is not known.
    """
    targets = work.targets
    line = lines((flange @ targets.tool[v])[None], targets.tcp[v][None])
    distance, length = float(targets.distance[v]), float(line.length[0])
    if not distance <= length:
        return np.full((4, 4), np.nan)
    share = np.array([distance / length if length > 0.0 else 0.0])
    tcp = line.poses(np.zeros(1, dtype=np.int64), share)[0]
    reached: Floats = tcp @ work.tool_inverse[v]
    return reached


def choose(work: PathSolver, v: int, flange: Floats, near: Floats | None) -> EdgeEnd:
    """Choose a solution by configuration string, else the nearest one.

    Args:
        work: The workspace.
        v: The target.
        flange: Its flange pose, (4, 4) [m].
        near: Joint angles before, (6,) [rad], or None where they are not known.
    """
    arm, targets = work.arm, work.targets
    unknown = np.full(6, np.nan)
    if np.isnan(flange).any():
        return EdgeEnd(unknown, flange, -1, NO_PATH, CODE[OUT_OF_REACH])
    branches = work.solutions(v, flange)
    if np.isnan(branches).any(axis=1).all():
        return EdgeEnd(unknown, flange, -1, NO_PATH, CODE[OUT_OF_REACH])
    slot = int(targets.slot[v])
    if slot < 0 and near is None:
        return EdgeEnd(unknown, flange, -1, NO_PATH, CODE[NO_START])
    if slot < 0 and near is not None:
        slot = nearest_slot(branches, near)
    q = branches[slot]
    if np.isnan(q).any():
        return EdgeEnd(unknown, flange, slot, NO_PATH, CODE[NO_BRANCH])
    if near is None or (targets.slot[v] >= 0 and not targets.nearest_turn[v]):
        q = on_written_turns(q[None], targets.turns[v][None])[0]
    else:
        turned = nearest_turns(q, near)
        q = np.where((turned >= arm.lower) & (turned <= arm.upper), turned, q)
    return EdgeEnd(q, flange, slot, q[None], 0)


# Stretches that begin behind a known target, followed all together.
#
# Each keeps to the branch nearest to where it begins, as long as every step along it is
# a small one: no other branch makes a stretch of small steps shorter; the first step of
# a stretch may be larger. From its first large step on it is left to be followed on its
# own.


@dataclass(frozen=True)
class _Stretches:
    """Samples of e edges to n targets, and r stretches of them, as the core takes them.

    Attributes:
        targets: Flange poses at the targets, (n, 4, 4) [m].
        between, place, start: .. and at the samples, see `PathSolver`.
        edge: First edge of each stretch, (r,).
        count: Number of its edges, (r,).
        near: Joint angles before it, (r, 6) [rad].
        slot: Its branch, (r,), -1 where there is none.
    """

    targets: Floats
    between: Floats
    place: Ints
    start: Ints
    edge: Ints
    count: Ints
    near: Floats
    slot: Ints

    @classmethod
    def of(cls, work: PathSolver, first: Ints, count: Ints) -> _Stretches:
        """Begin stretches at targets, (r,), behind known ones."""
        edge, near = work.targets.pred_start[first], work.q[first - 1]
        head = work.flange_at(work.samples.start[edge])
        slot = nearest_slots(work.arm.inverse(head).q, near)
        known = work.flange, work.samples.flange, work.place, work.samples.start
        return cls(*known, edge, count, near, slot)


def trace_stretches(work: PathSolver, smooth: Bools) -> Bools:
    """Follow what goes on from known targets; tell which targets that settles, (n,).

    Args:
        work: The workspace, on whose paths nothing is known yet.
        smooth: Targets that continue a Cartesian path from the one before, (n,).
    """
    settled = np.zeros(len(smooth), dtype=bool)
    ends = np.flatnonzero(np.diff(np.concatenate([[0], smooth, [0]])))
    first, count = ends[::2], ends[1::2] - ends[::2]
    known = ~np.isnan(work.q[first - 1, 0])
    if not known.any():
        return settled
    some = _Stretches.of(work, first[known], count[known])
    arm, steps = work.arm, (LOST, SUSPICIOUS)
    limits = floats(arm.lower), floats(arm.upper)
    work.path, done = _native.along_stretches(arm.solver, some, limits, steps)
    v, slot = first[known], some.slot
    before = work.branches_at(v - 1)
    work.reason[v[(done > 0) & (before >= 0) & (before != slot)]] = CODE[PATH_JUMP]
    rows, edge = spans(v, done), spans(some.edge, done)
    work.q[rows] = work.path[some.start[edge + 1] - 1]
    work.slot[rows] = np.repeat(slot, done)
    settled[rows] = True
    return settled


# The geometric path of a whole program in joint space.

AGREE = 1e-6  # [rad] several predecessors lead to the same joint angles
SLACK = 1e-9  # [rad] rounding at a joint limit
FEW = 256  # targets whose solutions are looked at together
WINDOW = 4096  # targets followed at a time, so that a break costs little


@dataclass(frozen=True)
class Trace:
    """Joint angles at n targets and along the paths between them.

    Attributes:
        q: (n, 6) [rad], NaN where not known.
        flange: (n, 4, 4) [m] at the targets themselves, NaN where not known.
        slot: Branch taken, (n,), -1 where it was not looked up.
        edges: The paths from every predecessor; source -1 where a path is not known.
        reason: Index into `REASONS`, (n,).
        length, turning: TCP path length [m] and reorientation [rad] of each edge, (e,);
            0 for JOINT moves and where they are not known.
        share: Part of its edge's way that leads to each sample of the edges, (s,).
        overruled: Continuity took another branch or turn than the string says, (n,).
        aside: From the targets to where the path passes them, (n, 3) [m], NaN where not
            known.
        rounded: Corners of the targets, (n, 7), see `BlendCoupling`.
        stops: As of the targets, (n,).
    """

    q: Floats
    flange: Floats
    slot: Ints
    edges: Edges
    length: Floats
    turning: Floats
    share: Floats
    reason: Ints
    overruled: Bools
    aside: Floats
    rounded: Floats
    stops: Bools

    @property
    def driven(self) -> Edges:
        """The edges, but that nobody knows how the arm leaves where it strands."""
        edges, strands = self.edges, STRANDS[self.reason] | self.stops
        lost = (edges.source >= 0) & strands[np.maximum(edges.source, 0)]
        if not lost.any():
            return edges
        count = np.diff(edges.start)
        to = np.repeat(np.arange(len(self.q)), np.diff(edges.first))
        path = np.array(edges.path)
        path[spans(edges.start[:-1][lost], count[lost])] = np.repeat(
            self.q[to[lost]], count[lost], axis=0
        )
        return replace(edges, source=np.where(lost, -1, edges.source), path=path)

    def at(self, v: int) -> StartState:
        """Tell where the arm stands at a target, if it stops there."""
        row = np.arange(v, min(v + 1, len(self.q)))
        return StartState(self.q[row], self.flange[row], self.slot[row])


def trace(arm: Arm, targets: Targets, known: FixedTargets | None = None) -> Trace:
    """Find the joint angles at all targets and along all paths.

    Args:
        arm: The arm.
        targets: The moves.
        known: Targets whose joint angles are known beforehand.
    """
    work = PathSolver(arm, targets, known)
    settled = _from_strings(work) | work.given
    work.told = ~np.isnan(work.q[:, 0])
    settled |= trace_stretches(work, work.single & ~settled)
    work.solve(settled)
    _in_order(work, np.flatnonzero(~settled), work.single & ~settled)
    return _finish(work)


def _from_strings(work: PathSolver) -> Bools:
    """Settle what does not depend on where the arm comes from; tell which."""
    t, rows = work.targets, np.flatnonzero(work.by_string)
    work.reason[t.kind == TargetKind.UNKNOWN] = CODE[NO_TARGET]
    slot = t.slot[rows]
    q = work.arm.into_range(work.arm.on_branch(work.flange[rows], slot))
    work.q[rows] = on_written_turns(q, t.turns[rows])
    work.slot[rows] = slot
    missing = rows[np.isnan(q[:, 0])]
    work.reason[missing] = CODE[NO_BRANCH]
    nowhere = np.isnan(work.arm.inverse(work.flange[missing]).q[..., 0]).all(axis=1)
    work.reason[missing[nowhere]] = CODE[OUT_OF_REACH]
    joints = (t.move == Motion.JOINT) & (t.kind == TargetKind.JOINTS)
    return np.asarray(work.by_string | (t.kind == TargetKind.UNKNOWN) | joints)


def _in_order(work: PathSolver, visits: Ints, smooth: Bools) -> None:
    """Go through targets in program order, smooth stretches at once."""
    late: list[int] = []
    poses = smooth & (work.targets.kind == TargetKind.POSE)
    i, followed = 0, -1
    while i < len(visits):
        v = int(visits[i])
        if smooth[v] and work.is_known(v - 1):
            breaks = ~smooth[v : v + WINDOW]
            count = int(np.argmax(breaks)) if breaks.any() else len(breaks)
            goes_on = followed == v or bool(work.single[v - 1] and ~smooth[v - 1])
            done = _stretch(work, v, count, goes_on)
            i += done
            if done == count:
                followed = v + count
                continue
        elif poses[v]:
            i += _without_pasts(work, v, poses)
            continue
        late += _one(work, int(visits[i]))
        i += 1
    for edge in late:
        _check_late(work, edge)


def _stretch(work: PathSolver, v: int, count: int, goes_on: bool) -> int:
    """Follow `count` targets from v on; return how many could be followed.

    Args:
        work: The workspace.
        v: The first target.
        count: How many.
        goes_on: The path has been followed up to there: it keeps its branch.
    """
    first = int(work.targets.pred_start[v])
    start = work.samples.start
    span = slice(int(start[first]), int(start[first + count]))
    slot = int(work.slot[v - 1]) if goes_on else -1
    done = follow(work.q[v - 1], work.ways(span), slot)
    ends = start[first + 1 : first + count + 1] - span.start
    reached = int(np.searchsorted(ends, len(done.q), side="right"))
    at = ends[:reached] - 1
    work.q[v : v + reached] = done.q[at]
    work.slot[v : v + reached] = done.slot[at]
    work.path[span.start : span.start + len(done.q)] = done.q
    before = np.append(work.branch_at(v - 1), done.slot[:-1])
    flips = np.flatnonzero((before >= 0) & (before != done.slot))
    flipped = np.searchsorted(ends, flips, side="right")
    work.reason[v + flipped[flipped < reached]] = CODE[PATH_JUMP]
    return reached


def _without_pasts(work: PathSolver, v: int, poses: Bools) -> int:
    """Go on from an unknown place up to one that is known; count the targets."""
    ahead = poses[v : v + FEW]
    ends = np.flatnonzero(~ahead)
    rows = np.arange(v, v + (int(ends[0]) if len(ends) else len(ahead)))
    slot, branches = work.targets.slot[rows], work.all_solutions(rows)
    own = branches[np.arange(len(rows)), slot]
    own[slot < 0] = np.nan
    found = np.flatnonzero(~np.isnan(own).any(axis=1))
    count = int(found[0]) + 1 if len(found) else len(rows)
    nowhere = np.isnan(branches.max(axis=2)).all(axis=1)
    reason = np.where(slot < 0, CODE[NO_START], CODE[NO_BRANCH])
    reason[nowhere], reason[found] = CODE[OUT_OF_REACH], 0
    own = on_written_turns(own, work.targets.turns[rows])
    work.q[rows[found[:1]]] = own[found[:1]]
    work.slot[rows[:count]] = np.where(nowhere, -1, slot)[:count]
    work.reason[rows[:count]] = reason[:count]
    return count


def _one(work: PathSolver, v: int) -> list[int]:
    """Settle one target from its predecessors; return the edges to look at later."""
    t = work.targets
    edges = range(int(t.pred_start[v]), int(t.pred_start[v + 1]))
    known = [e for e in edges if work.is_known_before(v, int(work.source[e]))]
    later = [e for e in edges if e not in known and work.source[e] >= v]
    step = t.kind[v] in STEPS and not work.placed[v]
    if (t.kind[v] in PARTIAL or step) and len(known) < len(edges):
        known = later = []  # it leads elsewhere from wherever else it may begin
    arrivals = [arrive(work, v, e) for e in known]
    for edge, arrival in zip(known, arrivals, strict=True):
        _record(work, edge, arrival)
    if not arrivals:
        arrivals = [_without_past(work, v)]
    first = arrivals[0]
    reason = next((a.reason for a in arrivals if a.reason), 0)
    work.q[v], work.flange[v], work.slot[v] = first.q, first.flange, first.slot
    if any(np.abs(a.q - first.q).max() > AGREE for a in arrivals[1:]):
        work.q[v], reason = np.nan, CODE[AMBIGUOUS]
    work.reason[v] = reason
    return later


def _without_past(work: PathSolver, v: int) -> EdgeEnd:
    """Arrive from an unknown place."""
    t = work.targets
    nothing = np.empty((0, 6))
    if t.kind[v] == TargetKind.JOINTS:
        return EdgeEnd(work.q[v], work.flange[v], -1, nothing, 0)
    if t.kind[v] != TargetKind.POSE:
        return EdgeEnd(np.full(6, np.nan), work.flange[v], -1, nothing, CODE[NO_TARGET])
    return choose(work, v, work.flange[v], None)


def _record(work: PathSolver, edge: int, arrival: EdgeEnd) -> None:
    """Write the path of an edge, or forget where the edge comes from."""
    if len(arrival.path) == len(work.path[work.span(edge)]):
        work.path[work.span(edge)] = arrival.path
    else:
        work.source[edge] = -1


def _check_late(work: PathSolver, edge: int) -> None:
    """Go over an edge from a target later in the text."""
    v, source = int(work.samples.visit[edge]), int(work.source[edge])
    if not (work.is_known(v) and work.is_known(source)):
        work.source[edge] = -1
        return
    arrival = arrive(work, v, edge)
    _record(work, edge, arrival)
    if not np.abs(arrival.q - work.q[v]).max() <= AGREE:
        work.source[edge] = -1
        work.reason[v] = work.reason[v] or CODE[AMBIGUOUS]


def _finish(work: PathSolver) -> Trace:
    """Complete the paths and look for limits and overruled strings."""
    samples, t = work.samples, work.targets
    last = samples.start[1:] - 1
    work.path[last] = work.q[samples.visit]
    edge_of = np.repeat(np.arange(len(last)), np.diff(samples.start))
    holes = np.isnan(work.path[:, 0])
    work.source[edge_of[holes]] = -1
    work.path[holes] = work.q[samples.visit[edge_of[holes]]]
    _limits(work, edge_of)
    # Ends of arcs on whose way the arm strands already strand with it.
    via = np.flatnonzero(work.targets.via[:-1])
    via = via[STRANDS[work.reason[via]] & (work.reason[via + 1] == 0)]
    work.reason[via + 1] = work.reason[via]
    written = (t.slot >= 0) & (t.move != Motion.JOINT) & (work.slot >= 0)
    turned = on_other_turns(work.q, t.turns)
    other = (work.slot != t.slot) | (turned & ~t.nearest_turn)
    edges = Edges(t.pred_start, work.source, work.path, samples.start)
    share = 1.0 / np.diff(samples.start)[edge_of]
    aside = np.zeros((len(t), 3))
    aside[is_unknown(work.flange) | is_unknown(t.tool)] = np.nan
    return Trace(
        work.q, work.flange, work.slot, edges, samples.length, samples.turning, share,
        work.reason, np.asarray(written & other), aside, np.zeros((len(t), 7)), t.stops,
    )  # fmt: skip


def _limits(work: PathSolver, edge_of: Ints) -> None:
    """Note targets and paths beyond the joint limits."""
    for q, visit, text in (
        (work.q, np.arange(len(work.q)), LIMITS),
        (work.path, work.samples.visit[edge_of], PATH_LIMITS),
    ):
        over = (q < work.arm.lower - SLACK) | (q > work.arm.upper + SLACK)
        rows = np.flatnonzero(any_in_rows(over))
        for row in rows[work.reason[visit[rows]] == 0][::-1]:
            work.reason[visit[row]] = CODE[text[int(np.argmax(over[row]))]]


# Where the arm stands somewhere: enough to go on.


@dataclass(frozen=True)
class StartState:
    """One place, or none: arrays of k = 1 or 0 rows.

    Attributes:
        q: Joint angles, (k, 6) [rad].
        flange: (k, 4, 4) [m].
        slot: Branch, (k,).
    """

    q: Floats
    flange: Floats
    slot: Ints

    def __len__(self) -> int:
        """Return 1 at a place, 0 where nothing is known."""
        return len(self.q)

    @property
    def known(self) -> FixedTargets:
        """Return it as the first targets of a program, whatever leads to them."""
        return FixedTargets(np.arange(len(self)), self.q, self.flange, self.slot)


NOWHERE = StartState(np.empty((0, 6)), np.empty((0, 4, 4)), np.empty(0, dtype=np.int64))
