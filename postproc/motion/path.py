"""Cartesian paths: lines and arcs of the TCP, sampled; how fly points pull on them."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np

from postproc import _native
from postproc.arrays import Bools, Floats, Ints, few_rows, floats
from postproc.motion.targets import Targets
from postproc.robot.pose import (
    inverse,
    lengths,
    rotation_vector,
)
from postproc.robot.trajectory import Motion

# Cartesian paths: straight lines and arcs of the TCP, sampled.
#
# Orientation turns about one fixed axis at a constant rate from start to end (on an
# arc, from start to VIA to end), as $ORNT_TYPE RS_WORLD does.

STEP = 5e-3  # [m] between samples
TURN = np.deg2rad(1.0)  # [rad] between samples
MOST = 2000  # samples of one path
COLLINEAR = 1e-6  # sine of the angle at VIA below which three points make no circle
APART = 1e-6  # [m] nor do they where two are nearer: rounding alone would place it


NO_TOOLS, NO_TOOL = np.empty((0, 4, 4)), np.empty(0, dtype=np.int64)


@dataclass(frozen=True)
class Segments:
    """m Cartesian paths.

    A point at the fraction u of a path lies at
    centre + cos(u angle) radius + sin(u angle) tangent + u chord;
    a line has no radius, an arc no chord.

    Attributes:
        rotation: Orientation at the start, (m, 3, 3).
        turn: Rotation vector from start to end in the frame of the start, (m, 3) [rad].
        centre, radius, tangent, chord: (m, 3) [m].
        angle: (m,) [rad].
        valid: False where the points of an arc make no circle, (m,).
    """

    rotation: Floats
    turn: Floats
    centre: Floats
    radius: Floats
    tangent: Floats
    chord: Floats
    angle: Floats
    valid: Bools

    @cached_property
    def length(self) -> Floats:
        """Lengths of the paths, (m,) [m]."""
        arc = lengths(self.radius) * self.angle
        return lengths(self.chord) + arc

    @cached_property
    def turning(self) -> Floats:
        """Angles of reorientation, (m,) [rad]."""
        return lengths(self.turn)

    def intervals(self, least: Ints) -> Ints:
        """Choose how many intervals to cut each path into, at least those given."""
        steps = np.maximum(self.length / STEP, self.turning / TURN)
        steps = np.nan_to_num(steps, nan=0.0)
        wanted = np.clip(np.ceil(steps - 1e-9), least, MOST)
        return np.asarray(wanted, dtype=np.int64)

    def poses(self, path: Ints, u: Floats) -> Floats:
        """Place the TCP on paths `path` (s,) at fractions u (s,): (s, 4, 4)."""
        return self.flanges(path, u, NO_TOOLS, NO_TOOL)

    def flanges(self, path: Ints, u: Floats, tools: Floats, tool: Ints) -> Floats:
        """Place the flange on paths: (s, 4, 4).

        Args:
            path: Paths, (s,).
            u: Fractions of them, (s,).
            tools: In the flange frame, (t, 4, 4) [m].
            tool: The one of every path, (m,).
        """
        parts = (self.turn, self.centre, self.radius, self.tangent, self.chord)
        rotation = self.rotation.reshape(-1, 9)
        packed = np.column_stack([rotation, *parts, self.angle])
        return _native.poses_along(floats(packed), path, floats(u), tools, tool)


def lines(begin: Floats, end: Floats) -> Segments:
    """Build straight paths between TCP poses (m, 4, 4) [m]."""
    m = len(begin)
    nothing = np.zeros((m, 3))
    return Segments(
        rotation=begin[:, :3, :3], turn=_turn(begin, end), centre=begin[:, :3, 3],
        radius=nothing, tangent=nothing, chord=end[:, :3, 3] - begin[:, :3, 3],
        angle=np.zeros(m), valid=np.ones(m, dtype=bool),
    )  # fmt: skip


def arcs(
    begin: Floats, via: Floats, end: Floats, *, past_start: Bools | None = None
) -> tuple[Segments, Segments]:
    """Build arcs through three TCP poses (m, 4, 4) [m]: start to VIA, VIA to end.

    Those that go past their start, (m,), pass VIA and the start before they end;
    default: none does.
    """
    centre, normal, valid = circles(
        begin[:, :3, 3], via[:, :3, 3], end[:, :3, 3]
    )  # fmt: skip
    if past_start is not None:
        normal = np.where(past_start[:, None], -normal, normal)
    return (
        _arc(begin, via, centre, normal, valid),
        _arc(via, end, centre, normal, valid),
    )


def shares_before_via(begin: Floats, via: Floats, end: Floats) -> Floats:
    """Return how much of arcs lies before VIA, (m,); NaN where there is no circle.

    Args:
        begin: TCP poses at their starts, (m, 4, 4) [m].
        via: Those between, likewise.
        end: Those at their ends.
    """
    first, second = arcs(begin, via, end)
    whole = np.maximum(first.angle + second.angle, 1e-12)
    share: Floats = np.where(first.valid, first.angle / whole, np.nan)
    return share


def circles(a: Floats, b: Floats, c: Floats) -> tuple[Floats, Floats, Bools]:
    """Find the circles through points (m, 3) [m]: centres, unit normals, which exist.

    With u = b - a, v = c - a, w = u x v the centre is
    a + (|u|^2 v - |v|^2 u) x w / (2 |w|^2), and a, b, c follow each other
    counterclockwise about w.
    """
    u, v = b - a, c - a
    w = np.cross(u, v)
    size = np.linalg.norm(w, axis=1)
    sides = np.array([np.linalg.norm(side, axis=1) for side in (u, c - b, v)])
    valid = np.asarray(size > COLLINEAR * sides[0] * sides[1])
    valid &= (sides > APART).all(axis=0)
    size = np.where(valid, size, 1.0)[:, None]
    uu, vv = (u**2).sum(1)[:, None], (v**2).sum(1)[:, None]
    centre = a + np.cross(uu * v - vv * u, w) / (2 * size**2)
    return centre, w / size, valid


def _arc(
    begin: Floats, end: Floats, centre: Floats, normal: Floats, valid: Bools
) -> Segments:
    """Build the arcs from begin to end, counterclockwise about the normal."""
    radius = begin[:, :3, 3] - centre
    tangent = np.cross(normal, radius)
    to_end = end[:, :3, 3] - centre
    angle = np.arctan2((to_end * tangent).sum(1), (to_end * radius).sum(1))
    return Segments(
        rotation=begin[:, :3, :3], turn=_turn(begin, end), centre=centre, radius=radius,
        tangent=tangent, chord=np.zeros_like(centre), angle=np.mod(angle, 2 * np.pi),
        valid=valid,
    )  # fmt: skip


def _turn(begin: Floats, end: Floats) -> Floats:
    """Rotation vectors (m, 3) [rad] from begin to end, in the frame of begin."""
    R = np.swapaxes(begin[:, :3, :3], 1, 2) @ end[:, :3, :3]
    return rotation_vector(R) if len(R) else np.empty((0, 3))


def join_segments(parts: list[Segments]) -> Segments:
    """Put segments one after the other."""
    names = [f.name for f in fields(Segments)]
    return Segments(
        *(np.concatenate([getattr(p, name) for p in parts]) for name in names)
    )


# Samples of the Cartesian paths whose both ends are known before joint angles are.

LEAST = 4  # intervals of a path between stops, however short
BLIND = 32  # intervals of a path whose length is not known beforehand


@dataclass(frozen=True)
class Samples:
    """Where the samples of e edges (predecessor to move) stand.

    Attributes:
        visit: Move an edge leads to, (e,).
        source: Where it comes from, (e,), negative where that is not known.
        cartesian: The TCP's path is a line or an arc, (e,).
        ready: The poses of the samples are known, (e,).
        broken: The three points of an arc make no circle, (e,).
        begins: On both parts of an arc, the edge from its start to VIA, (e,); else -1.
        start: Samples start[i] .. start[i + 1] - 1 are those of edge i, the last of
            them the move's own target, (e + 1,).
        length: Length of the TCP's path, (e,) [m], 0 where it is not ready.
        turning: Reorientation on it, (e,) [rad], 0 where it is not ready.
        inner: Samples of ready edges that are no targets, (k,).
        flange: Their flange poses, (k, 4, 4) [m].
    """

    visit: Ints
    source: Ints
    cartesian: Bools
    ready: Bools
    broken: Bools
    begins: Ints
    start: Ints
    length: Floats
    turning: Floats
    inner: Ints
    flange: Floats

    def count(self, edge: int) -> int:
        """Return the number of samples of an edge."""
        return int(self.start[edge + 1] - self.start[edge])


def sample(targets: Targets, flange: Floats) -> Samples:
    """Place samples on all Cartesian paths between known flange poses.

    Args:
        targets: The moves.
        flange: Flange poses at the targets, (n, 4, 4) [m], NaN where not known yet.
    """
    ends = _Ends.of(targets, flange)
    edge, segments = ends.segments(flange)
    return ends.samples(edge, segments)


@dataclass(frozen=True)
class _Ends:
    """Both ends of e edges: which of them a Cartesian path joins.

    Attributes:
        targets: The moves.
        visit, source, cartesian, begins: As in `Samples`.
        known: The flange is known at both ends of a Cartesian path, (e,).
    """

    targets: Targets
    visit: Ints
    source: Ints
    cartesian: Bools
    begins: Ints
    known: Bools

    @classmethod
    def of(cls, targets: Targets, flange: Floats) -> _Ends:
        """Look at both ends of every edge."""
        visit = np.repeat(np.arange(len(targets)), np.diff(targets.pred_start))
        source = np.array(targets.pred)
        at = np.maximum(source, 0)  # no visit: looked up, and never used
        cartesian = targets.move[visit] != Motion.JOINT
        known = ~np.isnan(flange[:, 0, 0])
        tool_known = ~np.isnan(targets.tool[:, 0, 0])
        ready = cartesian & (source >= 0) & known[visit] & tool_known[visit]
        ready &= known[at] & ~targets.wrist_joint[visit]
        begins = _begins(targets, visit, source)
        return cls(targets, visit, source, cartesian, begins, ready)

    def segments(self, flange: Floats) -> tuple[Ints, Segments]:
        """Build the paths of edges (m,) whose ends are known; return both."""
        lines = self.known & (self.targets.move[self.visit] == Motion.LINEAR)
        edge = np.flatnonzero(lines)
        found = _lines(self.targets, flange, self.source[edge], self.visit[edge])
        if (self.begins >= 0).any():
            on_arc, arc = self._arcs(flange)
            found, edge = join_segments([found, arc]), np.append(edge, on_arc)
        return edge, found

    def samples(self, edge: Ints, segments: Segments) -> Samples:
        """Place the inner samples of the segments that belong to edges."""
        broken, ready, length, turning = self._flags(edge, segments)
        start = self._starts(edge, segments, ready, broken)
        intervals = np.diff(start)[edge]
        inner = np.where(segments.valid, intervals - 1, 0)
        path = np.repeat(np.arange(len(edge)), inner)
        first = np.concatenate([[0], np.cumsum(np.bincount(path, minlength=len(edge)))])
        nth = np.arange(len(path)) - first[path]
        tools = floats(few_rows(self.targets.tool))
        tool = self.visit[edge] if len(tools) > 1 else np.zeros(len(edge), dtype=int)
        flange = segments.flanges(path, (nth + 1) / intervals[path], tools, tool)
        return Samples(
            self.visit, self.source, self.cartesian, ready, broken, self.begins, start,
            length, turning, inner=start[edge[path]] + nth, flange=flange,
        )  # fmt: skip

    def _flags(
        self, edge: Ints, segments: Segments
    ) -> tuple[Bools, Bools, Floats, Floats]:
        """Spread what segments say over all edges: see `Samples`."""
        e = len(self.visit)
        broken, ready = np.zeros(e, dtype=bool), np.zeros(e, dtype=bool)
        length, turning = np.zeros(e), np.zeros(e)
        broken[edge], ready[edge] = ~segments.valid, segments.valid
        length[edge], turning[edge] = segments.length, segments.turning
        return broken, ready, length, turning

    def _starts(
        self, edge: Ints, segments: Segments, ready: Bools, broken: Bools
    ) -> Ints:
        """Count the samples of edges: where those of each begin, (e + 1,)."""
        passing = self.targets.fly | self.targets.via
        behind = (self.source >= 0) & passing[np.maximum(self.source, 0)]
        free = passing[self.visit] | behind
        blind = self.cartesian & (self.source >= 0) & ~ready & ~broken
        count = np.where(blind, BLIND, 1)
        count[edge] = segments.intervals(np.where(free[edge], 1, LEAST))
        count[broken] = 1
        return np.concatenate([[0], np.cumsum(count)])

    def _arcs(self, flange: Floats) -> tuple[Ints, Segments]:
        """Build both parts of every arc: edges (m,) and their segments."""
        visit, n = self.visit, len(self.targets)
        to_via = self.known & (self.begins == np.arange(len(visit)))
        to_via &= ~np.isnan(flange[np.minimum(visit + 1, n - 1), 0, 0])
        first = np.flatnonzero(to_via)
        tool = self.targets.tool[visit[first]]
        to, after = arcs(
            flange[self.source[first]] @ tool,
            flange[visit[first]] @ tool,
            flange[visit[first] + 1] @ tool,
            past_start=self.targets.past_start[visit[first]],
        )
        row = np.full(len(visit) + 1, -1)  # the last one is that of no edge
        row[first] = np.arange(len(first))
        from_via = self.known & ~self.targets.via[visit] & (row[self.begins] >= 0)
        second = np.flatnonzero(from_via)
        used = row[self.begins[second]]
        picked = Segments(
            *(getattr(after, name)[used] for name in Segments.__dataclass_fields__)
        )
        return np.append(first, second), join_segments([to, picked])


def _lines(targets: Targets, flange: Floats, begin: Ints, end: Ints) -> Segments:
    """Build the straight paths from targets (m,) to others."""
    m, nothing = len(end), np.zeros((len(end), 3))
    tool = few_rows(targets.tool)
    rotation, turn, centre, chord = _native.lines(flange, tool, begin, end)
    return Segments(
        rotation, turn, centre, nothing, nothing, chord,
        angle=np.zeros(m), valid=np.ones(m, dtype=bool),
    )  # fmt: skip


def _begins(targets: Targets, visit: Ints, source: Ints) -> Ints:
    """Find the edge on which the arc of every edge begins, (e,), -1 without one.

    The edges from VIA to the end are as many as those to VIA, and in their order.
    """
    n, begins = len(targets), np.full(len(visit), -1)
    arc = targets.move[visit] == Motion.CIRCULAR
    first = np.flatnonzero(arc & targets.via[visit] & (visit + 1 < n))
    begins[first] = first
    at = np.maximum(source, 0)
    second = np.flatnonzero(
        arc & ~targets.via[visit] & (source == visit - 1) & targets.via[at]
    )
    via = source[second]
    starts = np.diff(targets.pred_start)
    same = np.bincount(via, minlength=n)[via] == starts[via]
    nth = np.arange(len(second)) - np.searchsorted(via, via)
    begins[second[same]] = (targets.pred_start[via] + nth)[same]
    return begins


# Arcs as a whole: their three points, and how far a correction bends them between.
#
# Three points make a circle, and where they lie badly for that, moving one of them by a
# millimetre makes quite another one.

NEAR = 1e-4  # [m] points nearer than this do not tell where their circle goes
BETWEEN = (0.25, 0.5, 0.75)  # fractions of both parts of an arc that are looked at


@dataclass(frozen=True)
class Arcs:
    """k arcs: one for every place from which a CIRCULAR move may begin.

    Attributes:
        visit: Their start, VIA and end, (k, 3).
        points: The TCP there, in the frame of the arm's base, (k, 3, 3) [m]; NaN where
            not known.
    """

    visit: Ints
    points: Floats

    def __len__(self) -> int:
        """Return the number of arcs."""
        return len(self.visit)

    @property
    def on_a_line(self) -> Bools:
        """Tell which make no circle at all, (k,)."""
        known = ~np.isnan(self.points).any(axis=(1, 2))
        return np.asarray(known & ~_parts(self.points)[0].valid)

    @property
    def too_near(self) -> Bools:
        """Tell where two of the three points are nearly one, (k,)."""
        gap = self.points - np.roll(self.points, 1, axis=1)
        return np.asarray((np.linalg.norm(gap, axis=2) < NEAR).any(axis=1))

    def strays(self, shift: Floats) -> Floats:
        """Tell how much farther the path moves between its points than these do.

        Args:
            shift: What the points move by, (k, 3, 3) [m].

        Returns:
            (k,) [m]; infinite where no circle is left, NaN where nothing is known.
        """
        before, after = _parts(self.points), _parts(self.points + shift)
        moved = np.array([
            np.linalg.norm(_place(new, u) - _place(old, u), axis=1)
            for old, new in zip(before, after, strict=True)
            for u in BETWEEN
        ])  # fmt: skip
        extra = moved.max(axis=0) - np.linalg.norm(shift, axis=2).max(axis=1)
        known = ~np.isnan(self.points + shift).any(axis=(1, 2))
        return np.where(known & ~after[0].valid, np.inf, extra)


def arcs_of(targets: Targets, tcp: Floats, aside: Floats) -> Arcs:
    """Find the arcs of a program.

    Args:
        targets: Its n moves.
        tcp: TCP poses where the path passes them, each with its own tool,
            (n, 4, 4) [m].
        aside: From the targets to there, (n, 3) [m].
    """
    if not targets.via.any():
        return Arcs(np.empty((0, 3), dtype=np.int64), np.empty((0, 3, 3)))
    visit = np.repeat(np.arange(len(targets)), np.diff(targets.pred_start))
    source = targets.pred
    arc = (targets.move[visit] == Motion.CIRCULAR) & targets.via[visit]
    arc &= (source >= 0) & (visit + 1 < len(targets))
    start, via = source[arc], visit[arc]
    own = tcp[start] @ inverse(targets.tool[start]) @ targets.tool[via]
    points = np.stack([own, tcp[via], tcp[via + 1]], axis=1)[:, :, :3, 3]
    arcs_at = np.stack([start, via, via + 1], axis=1)
    return Arcs(arcs_at, points - aside[arcs_at])


def arc_per_start(
    move: Ints, via: Bools, pred_start: Ints, pred: Ints
) -> tuple[Ints, Ints]:
    """Let the end of an arc have VIA as its predecessor once for every start of it.

    From another start the same VIA and end make another circle.

    Args:
        move: `Motion` of n moves, (n,).
        via: True at the point on the way of an arc, (n,).
        pred_start: Predecessors of move v are pred[pred_start[v] : pred_start[v + 1]].
        pred: Predecessors; negative for a place that is not known.

    Returns:
        `pred_start` and `pred` with the repetitions.
    """
    visit = np.repeat(np.arange(len(move)), np.diff(pred_start))
    ends = (move[visit] == Motion.CIRCULAR) & ~via[visit]
    at = np.maximum(pred, 0)  # no move: looked up, and never used
    ends &= (pred >= 0) & (pred == visit - 1) & via[at]
    starts = np.diff(pred_start)[at]
    times = np.where(ends, np.maximum(starts, 1), 1)
    if (times == 1).all():
        return pred_start, pred
    before = np.concatenate([[0], np.cumsum(times)])
    return before[pred_start], np.repeat(pred, times)


def _parts(points: Floats) -> tuple[Segments, Segments]:
    """Build both parts of arcs through points (k, 3, 3) [m]."""
    poses = np.tile(np.eye(4), (*points.shape[:2], 1, 1))
    poses[:, :, :3, 3] = points
    return arcs(poses[:, 0], poses[:, 1], poses[:, 2])


def _place(part: Segments, u: float) -> Floats:
    """Place the TCP at a fraction of every arc, (k, 3) [m]."""
    k = len(part.angle)
    return part.poses(np.arange(k), np.full(k, u))[:, :3, 3]


# How the path at a sharp fly point moves with the points next to it.
#
# The corner superposes two moves, so that the place where the path passes a point moves
# by the share 1 - v - w of what the point moves, and by the shares v and w of what the
# points before and behind it move; see `blending`. Along the path it moves as the point
# does, next to which it lies. Exact for straight moves of the TCP.

ROUNDS = 12  # of Jacobi's method; v + w is 1/4 at most, each gains a factor of two


def _no_points() -> Ints:
    return np.empty(0, dtype=np.int64)


def _no_shares() -> Floats:
    return np.empty(0)


@dataclass(frozen=True)
class BlendCoupling:
    """c rounded fly points where the path really bends.

    Attributes:
        visit: The point, (c,).
        before, behind: The targets next to it, (c,).
        v, w: Their shares, (c,).
        along: Direction of the path at the point, (c, 3).
    """

    visit: Ints = field(default_factory=_no_points)
    before: Ints = field(default_factory=_no_points)
    behind: Ints = field(default_factory=_no_points)
    v: Floats = field(default_factory=_no_shares)
    w: Floats = field(default_factory=_no_shares)
    along: Floats = field(default_factory=lambda: np.empty((0, 3)))

    @classmethod
    def of(cls, rounded: Floats, first: Ints, source: Ints) -> BlendCoupling:
        """Tell how sharp corners move with the targets next to them.

        On a flat one the corrections of neighbours are alike but where a joint turns,
        and to sharpen that step would make the joint turn elsewhere.

        Args:
            rounded: The corners of n targets, (n, 7): the parts of the edges before and
                behind that belong to each, where on it the path passes the target, in s
                of `blending`, 1 where it is not flat, and the direction of the path
                there; 0 without a corner.
            first: Where the edges to every target begin, (n + 1,), as in `Edges`.
            source: Where every edge begins, (e,), likewise.
        """
        to = np.repeat(np.arange(len(rounded)), np.diff(first))
        behind = np.full(len(rounded), -1)
        behind[source[source >= 0]] = to[source >= 0]
        visit = np.flatnonzero(rounded[:, 3])
        before, behind = source[first[visit]], behind[visit]
        known = (before >= 0) & (behind >= 0)
        visit, before, behind = visit[known], before[known], behind[known]
        part, rest, s, _, *along = rounded[visit].T
        shares = part * (1.0 - s) ** 2, rest * s**2
        return cls(visit, before, behind, *shares, np.column_stack(along))

    def on(self, moved: Floats) -> Floats:
        """Tell how much farther than their targets points move, (n, 3).

        Args:
            moved: What all n targets move by, (n, 3).
        """
        here = moved.take(self.visit, axis=0)
        pulled = self.v[:, None] * (moved.take(self.before, axis=0) - here)
        pulled += self.w[:, None] * (moved.take(self.behind, axis=0) - here)
        pulled -= (pulled * self.along).sum(axis=1)[:, None] * self.along
        out = np.zeros_like(moved)
        out[self.visit] = pulled
        return out

    def to_move(self, wanted: Floats) -> Floats:
        """Move targets so that the path moves as wanted where it passes, (n, 3)."""
        corners, shares = (self.visit, self.before, self.behind), (self.v, self.w)
        along = floats(self.along)
        return _native.to_move(floats(wanted), corners, shares, along, ROUNDS)
