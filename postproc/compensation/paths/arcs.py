"""Arcs cut into arcs: where pieces lie, what they bend, and how they are rounded.

An arc is cut at the point on its way, which becomes the end of a piece, and anywhere
before and behind it. Each piece has a point on its own way, in its middle; one that
hardly bends is a chord. What the program says of the arc, from then on says its last
piece.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.paths.insertion_report import Points
from postproc.language.insert_moves import ArcPiece
from postproc.language.visits import Visits
from postproc.motion.blending import zones
from postproc.motion.cycle_time import ProgramCycle
from postproc.motion.path import Segments, arcs, circles, shares_before_via
from postproc.motion.targets import Fly, Targets
from postproc.robot.arm import Arm
from postproc.robot.pose import MM, lengths, rotation_from_vector, rotation_vector
from postproc.robot.trajectory import Motion

FLAT = 1e-5  # [m] sagitta of a piece that is a chord: ten of the digits written
BENT = 5.0  # of what its corrections bend it by: the least sagitta of an arc
STRAIGHT = 0.3  # of the tolerance: the largest sagitta of a chord
UNEVEN = 2e-5  # [rad] that the tool may turn otherwise than evenly along an arc

Cut = tuple[int, float]  # the visit of an arc's half, and the share of its way
Chords = Collection[Cut]  # where pieces end that are chords


def hindrances_of_arcs(v: Visits, alike: Bools) -> list[tuple[Bools, str]]:
    """Say what forbids to cut arcs, at the point on the way and at the end of each.

    Args:
        v: The program.
        alike: Visits that have frames and flags of the ones before them, (n,).
    """
    via = np.flatnonzero(v.motion.via)
    own = v.target.name[via] == 0
    told = np.array([bool(v.place.measure_id[k]) for k in via.tolist()], dtype=bool)
    rows = (
        (~np.isnan(v.motion.arc_angle[via + 1]), "it ends at an angle"),
        (~own, "its middle point is a variable: write its numbers in the move"),
        (told, "its middle point is measured"),
        (~(alike[via] & alike[via + 1]), "its frames or configuration flags change"),
        (_uneven(v, via), "it is uncertain how the tool turns along it"),
    )
    found = []
    for bad, why in rows:
        marked = np.zeros(len(v), dtype=bool)
        marked[via[bad]] = marked[via[bad] + 1] = True
        found.append((marked, why))
    return found


def _uneven(v: Visits, via: Ints) -> Bools:
    """Tell on which arcs (k,) the tool does not turn evenly about one axis."""
    start = np.maximum(v.graph.before[via], 0)
    poses = [v.dialect.poses(v.target.values[rows]) for rows in (start, via, via + 1)]
    share = shares_before_via(poses[0], poses[1], poses[2])
    base = np.swapaxes(poses[0][:, :3, :3], 1, 2)
    turns = [rotation_vector(base @ pose[:, :3, :3]) for pose in poses[1:]]
    off = turns[0] - turns[1] * share[:, None]
    return np.asarray(~(lengths(off) < UNEVEN))


@dataclass(frozen=True)
class CutArc:
    """An arc and where it is cut.

    Attributes:
        numbers: Those of its start, (w,).
        visits: The program.
        halves: The arc up to the point on its way, and behind it.
        cuts: Shares of either half, ascending; those of the first end with 1.
        via: The visit of the point on its way.
        chords: Which pieces are chords whatever they bend.
        turns: What the tool turns by at the cuts in its own frame, (k, 3) [rad]; at
            the end of the arc it stays what the source wrote.
        joints: Joint angles (k, 6) [rad] at shares (k,) of the ways to visits (k,);
            None: points have the flags of the arc's start.
    """

    numbers: Floats
    visits: Visits
    halves: tuple[Segments, Segments]
    cuts: tuple[Sequence[float], Sequence[float]]
    via: int
    chords: Chords
    turns: tuple[Floats, Floats]
    joints: Callable[[Ints, Floats], Floats] | None = None

    @classmethod
    def of(
        cls,
        visits: Visits,
        points: Points,
        via: int,
        chords: Chords,
        turns: Mapping[int, Floats] = MappingProxyType({}),
        joints: Callable[[Ints, Floats], Floats] | None = None,
    ) -> CutArc:
        """Look at the arc with the point `via` on its way."""
        rows = [int(visits.graph.before[via]), via, via + 1]
        poses = visits.dialect.poses(visits.target.values[rows])
        halves = arcs(poses[0:1], poses[1:2], poses[2:3])
        cuts = points.get(via, ()), points.get(via + 1, ())
        still = [np.zeros((len(own), 3)) for own in cuts]
        turned = turns.get(via, still[0]), turns.get(via + 1, still[1])
        start = visits.target.values[rows[0]]
        return cls(start, visits, halves, cuts, via, chords, turned, joints)

    def pieces(self) -> tuple[list[ArcPiece], Floats]:
        """Return the pieces but the last, and the point on that one's way, (w,)."""
        found = []
        for half, cuts in enumerate(self.cuts):
            for begin, end in pairwise([0.0, *cuts]):
                at_via = half == 0 and end == 1.0
                kept = at_via and not self._turn(half, end).any()
                place = None if kept else self._at(half, end)
                chord = (self.via + half, end) in self.chords or bool(
                    self.sagitta(half, begin, end) < FLAT
                )
                via = None if chord else self._at(half, (begin + end) / 2)
                found.append(ArcPiece(place, via, at_via))
        return found, self._at(1, (1.0 + max(self.cuts[1], default=0.0)) / 2)

    def sagitta(self, half: int, begin: float, end: float) -> float:
        """Return how far a piece bends away from its chord [m]."""
        part = self.halves[half]
        angle = float(part.angle[0]) * (end - begin)
        radius = float(np.linalg.norm(part.radius[0]))
        return float(radius * (1.0 - np.cos(min(angle, np.pi) / 2)))

    def _at(self, half: int, share: float) -> Floats:
        """Write the point at a share of a half, (w,)."""
        part = self.halves[half]
        pose = part.poses(np.zeros(1, dtype=int), np.array([share]))[0]
        out = self.numbers[None].copy()
        out[0, :3] = pose[:3, 3] / MM
        own = rotation_from_vector(self._turn(half, share)[None])[0]
        turned = pose[:3, :3] @ own @ self.halves[0].rotation[0].T
        out = self.visits.dialect.rotate(out, turned[None])
        if self.joints is not None:
            q = self.joints(np.array([self.via + half]), np.array([share]))
            out = self.visits.dialect.count_flags(out, q)
        return np.asarray(out[0])

    def _turn(self, half: int, share: float) -> Floats:
        """Return what the tool turns by at a share of a half, (3,) [rad]."""
        (first, second), none = self.turns, np.zeros((1, 3))
        at, found = np.append(0.0, self.cuts[half]), np.concatenate([none, first])
        if half:
            at = np.append(at, 1.0)
            found = np.concatenate([first[-1:], second, none])
        return np.array([np.interp(share, at, x) for x in found.T])


# What pieces of arcs bend, against what their corrections differ by.


def flat_pieces(visits: Visits, moved: Floats, rows: Ints) -> list[tuple[int, float]]:
    """Find arcs that bend too little for what their corrections differ by.

    What differs is that at the point on the way from the mean of both ends: what
    changes evenly from one end to the other moves an arc and bends none.

    Args:
        visits: The program with points, not corrected.
        moved: What its numbers are corrected by, (n, 3) [m].
        rows: Points on the ways of arcs, (k,).

    Returns:
        The ends of those, and what they bend [m].
    """
    found = []
    for via in rows.tolist():
        points = np.array([visits.graph.before[via], via, via + 1])
        own, place = moved[points], visits.target.values[points, :3] * MM
        differ = float(np.linalg.norm(own[1] - (own[0] + own[2]) / 2))
        chord = place[2] - place[0]
        aside = np.cross(place[1] - place[0], chord / np.linalg.norm(chord))
        sagitta = float(np.linalg.norm(aside))
        if sagitta < max(FLAT, BENT * differ):
            found.append((via + 1, sagitta))
    return found


# How points on arcs are rounded, by whatever law.


def largest_zones(arm: Arm, cycle: ProgramCycle) -> Floats:
    """Return how much of the way fly points may be rounded on, (n,) [m].

    The larger of a zone of the distance that is set, or assumed, and of one that is
    overlapped at 100 %.

    Args:
        arm: The arm; its limits are used.
        cycle: The program, in time.
    """
    n, targets = len(cycle), cycle.targets
    laws = [
        replace(targets, rounding=np.full(n, law), overlap=np.ones(n))
        for law in (Fly.FROM, Fly.OVERLAP)
    ]
    return np.maximum(*(zone_sizes(arm, cycle, told) for told in laws))


def zone_sizes(arm: Arm, cycle: ProgramCycle, targets: Targets) -> Floats:
    """Return how much of the way fly points are rounded on, (n,) [m], 0: not at all.

    Args:
        arm: The arm; its limits are used.
        cycle: The program, in time.
        targets: Its targets, with the laws by which they are rounded.
    """
    size, found = np.zeros(len(cycle)), zones(arm, targets, cycle.path)
    length = cycle.path.length
    size[found.visit] = np.maximum(
        found.before * length[found.into], found.behind * length[found.out]
    )
    return size


def measure_passing(zone: Floats, radius: Floats) -> Floats:
    """Say how far a rounded point of an arc is passed because the arc bends [m].

    Two moves that are superposed are at a quarter of the zone from the point each.
    """
    return np.asarray(zone**2 / (16.0 * radius))


@dataclass(frozen=True)
class WantedArcs:
    """The arcs of the source that are cut, to compare the pieces with.

    Attributes:
        owner: Visits of the source at the ends of their halves, ascending, (k,).
        centre, normal, radius: Their circles in the base of the arm, (k, 3), (k, 3) and
            (k,) [m].
    """

    owner: Ints
    centre: Floats
    normal: Floats
    radius: Floats

    @classmethod
    def of(cls, cycle: ProgramCycle, before: Ints, via: Sequence[int]) -> WantedArcs:
        """Take the arcs with some points on their ways.

        Args:
            cycle: The source, in time.
            before: The visit that leads to each, (n,).
            via: Those points.
        """
        rows, p = np.array(via, dtype=np.int64), cycle.targets.tcp[:, :3, 3]
        start = p[before[rows]]
        centre, normal, _ = circles(start, p[rows], p[rows + 1])
        owner = np.stack([rows, rows + 1], axis=1).ravel()
        both = np.repeat(np.arange(len(rows)), 2)
        radius = lengths(start - centre)
        return cls(owner, centre[both], normal[both], radius[both])

    def __len__(self) -> int:
        """Return the number of their halves."""
        return len(self.owner)

    def radius_of(self, visits: Ints) -> Floats:
        """Return the radii of the arcs that visits of the source are of, (k,) [m]."""
        return np.asarray(self.radius[np.searchsorted(self.owner, visits)])

    def off(self, place: Floats, owner: Ints, rows: Bools) -> Floats:
        """Return how far places are from their arcs, (s, 3) [m].

        Args:
            place: (s, 3) [m].
            owner: Visit of the source that each belongs to, (s,).
            rows: Which of them to look at, (s,).
        """
        out = np.zeros_like(place)
        if not len(self.owner):
            return out
        at = np.minimum(np.searchsorted(self.owner, owner), len(self.owner) - 1)
        on = np.flatnonzero(rows & (self.owner[at] == owner))
        arc = at[on]
        rel = place[on] - self.centre[arc]
        height = np.einsum("ki,ki->k", rel, self.normal[arc])[:, None]
        flat = rel - height * self.normal[arc]
        size = np.maximum(lengths(flat), 1e-12)[:, None]
        out[on] = rel - flat * (self.radius[arc][:, None] / size)
        return out

    def pieces(self, owner: Ints, fly: Bools) -> Bools:
        """Tell at which visits (m,) of a program with points its path is the arc.

        A rounded corner between two moves of the source is to stay.

        Args:
            owner: Visit of the source that each visit belongs to, (m,).
            fly: Visits that are passed without stopping, (m,).
        """
        own = owner != np.append(owner[1:], -1)
        return np.asarray(~(own & fly) | np.isin(owner, self.owner[::2]))


NO_ARCS = WantedArcs(
    np.empty(0, dtype=np.int64), np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
)


_CIRCULAR = int(Motion.CIRCULAR)  # looked up for every move in every round


def is_arc(visits: Visits, visit: int) -> bool:
    """Tell whether a visit is the point on the way of an arc, or its end."""
    return bool(visits.motion.kind[visit] == _CIRCULAR)


def halves(visits: Visits, visit: int) -> tuple[int, ...]:
    """Return the visits that a move leads to: of an arc, which is one move, both."""
    if not is_arc(visits, visit):
        return (visit,)
    via = point_on_way(visits, visit)
    return via, via + 1


def point_on_way(visits: Visits, visit: int) -> int:
    """Return the visit of the point on the way of the arc that a visit is of."""
    return visit if visits.motion.via[visit] else visit - 1
