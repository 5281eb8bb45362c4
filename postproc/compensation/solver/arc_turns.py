"""Arcs on which the tool turns from start to end, whatever the point between says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.language.visits import Meaning, OrientationLaw, Visits
from postproc.motion.path import shares_before_via
from postproc.robot.pose import lengths, rotation_from_vector, rotation_vector
from postproc.robot.trajectory import Motion

HALF = np.deg2rad(170.0)  # from here on the shorter way round is uncertain


@dataclass(frozen=True)
class ArcTurns:
    """k arcs that begin at a single pose, and turn the tool in proportion to the way.

    Attributes:
        start, via, end: Their visits, (k,).
    """

    start: Ints
    via: Ints
    end: Ints

    @classmethod
    def of(cls, visits: Visits) -> ArcTurns:
        """Find them."""
        law = visits.motion.orientation_law == OrientationLaw.START_TO_END
        via = np.flatnonzero(visits.motion.via & law)
        start, end = visits.graph.before[via], via + 1
        poses, tool = visits.target.meaning == Meaning.POSE, visits.frame.tool
        known = (start >= 0) & poses[start] & poses[via] & poses[end]
        known &= (tool[start] == tool[via]) & (tool[via] == tool[end])
        return cls(start[known], via[known], end[known])

    def __len__(self) -> int:
        """Return the number of such arcs."""
        return len(self.via)

    def among(self, rows: Bools) -> ArcTurns:
        """Return some of them, (k,)."""
        return ArcTurns(self.start[rows], self.via[rows], self.end[rows])

    def find_moved(self, moved: Bools) -> Bools:
        """Tell which points between turn as some of n visits move, (n,)."""
        out = np.zeros(len(moved), dtype=bool)
        ways = np.stack([self.start, self.via, self.end])
        out[self.via] = moved[ways].any(axis=0)
        return out

    def turn(self, tcp: Floats) -> Floats:
        """Turn the points between, (k, 4, 4) [m]; NaN where that is uncertain.

        Args:
            tcp: TCP poses of all visits, (n, 4, 4) [m].
        """
        begin, out, last = (np.array(tcp[k]) for k in (self.start, self.via, self.end))
        share = shares_before_via(begin, out, last)
        turn = rotation_vector(np.swapaxes(begin[:, :3, :3], 1, 2) @ last[:, :3, :3])
        part = rotation_from_vector(share[:, None] * turn)
        out[:, :3, :3] = begin[:, :3, :3] @ part
        out[~(lengths(turn) < HALF)] = np.nan
        return out


def turn_between(visits: Visits, tcp: Floats) -> Bools:
    """Turn the points between on arcs whose turn is known, in place.

    Args:
        visits: n visits.
        tcp: TCP poses as they are written, (n, 4, 4) [m], NaN where not known.

    Returns:
        Points of arcs on which it is not known how the tool turns, (n,).
    """
    law = visits.motion.orientation_law
    laws = (OrientationLaw.ALONG_PATH, OrientationLaw.START_TO_END)
    unsure: Bools = np.isin(law, laws) & (visits.motion.kind == Motion.CIRCULAR)
    arcs = ArcTurns.of(visits)
    if len(arcs) == 0:
        return unsure
    turned = arcs.turn(tcp)
    sure = np.asarray(~np.isnan(turned).any(axis=(1, 2)))
    arcs, turned = arcs.among(sure), turned[sure]
    tcp[arcs.via] = turned
    unsure[arcs.via] = unsure[arcs.end] = False
    return unsure
