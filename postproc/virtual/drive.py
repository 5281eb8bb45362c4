"""All ways of a program, with its fly points rounded, before any gear turns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Floats
from postproc.exceptions import PlanError
from postproc.language.visits import START, Motion, Visits
from postproc.virtual.corner import Corner, round_corner
from postproc.virtual.moves import Way, frames_at, way_to
from postproc.virtual.setup import Setup
from postproc.virtual.zone import in_space, shares

NOWHERE = Way(np.zeros((1, 6)), np.zeros((1, 3)))


@dataclass(frozen=True)
class Drive:
    """How the controller drives to one visit.

    Attributes:
        came_from: The visit before, or START.
        stands_there: The program starts at this visit, for want of a home.
        begin: Joints where the arm would stand before without rounding, (6,) [rad].
        way: The way without rounding; nowhere where the visit cannot be reached.
        path: Joints on the rounded way, (m, 6); the last are the arrival's.
        why: Why the visit cannot be reached, or "".
    """

    came_from: int
    stands_there: bool
    begin: Floats
    way: Way
    path: Floats
    why: str = ""

    @property
    def end(self) -> Floats:
        """Joints at the target, (6,) [rad]."""
        return np.asarray(self.begin if self.why else self.way.joints[-1])


def plan_drives(
    setup: Setup, visits: Visits, poses: Floats, start: Floats
) -> list[Drive]:
    """Find the way to every visit.

    Args:
        setup: The cell.
        visits: The program.
        poses: `visits.frames` as poses, (k, 4, 4).
        start: Joints before the program, (6,) [rad].
    """
    drives: list[Drive] = []
    for i in range(len(visits)):
        came_from = _predecessor(visits, i)
        begin = start if came_from < 0 else drives[came_from].end
        before = start if came_from < 0 else drives[came_from].begin
        stands_there = came_from < 0 and setup.home is None
        if stands_there:
            begin = before = _first_joints(setup, visits, i, poses, start)
        drive = Drive(came_from, stands_there, begin, NOWHERE, NOWHERE.joints)
        try:
            frames = frames_at(visits, i, poses)
            way = way_to(setup, visits, i, frames, begin, before)
            drives.append(replace(drive, way=way, path=way.joints))
        except PlanError as error:
            drives.append(replace(drive, why=str(error)))
    return _rounded(setup, visits, poses, drives)


def _predecessor(visits: Visits, i: int) -> int:
    """Return the visit that the arm comes from, or START."""
    known = [int(p) for p in visits.predecessors(i) if 0 <= p < i]
    return known[0] if known else START


def _first_joints(
    setup: Setup, visits: Visits, i: int, poses: Floats, start: Floats
) -> Floats:
    """Return the joints at the first target, for a cell without a home."""
    try:
        frames = frames_at(visits, i, poses)
        one = replace(visits, motion=np.full_like(visits.motion, Motion.JOINT))
        return np.asarray(way_to(setup, one, i, frames, start, start).joints[-1])
    except PlanError:
        return start


def _rounded(
    setup: Setup, visits: Visits, poses: Floats, drives: list[Drive]
) -> list[Drive]:
    """Round the fly points that have one way in and one way out."""
    ways_out = np.bincount(visits.pred[visits.pred >= 0], minlength=len(visits))
    corners: dict[int, Corner] = {}
    for j, drive in enumerate(drives):
        i = drive.came_from
        if i < 0 or drive.why or drives[i].why or ways_out[i] != 1:
            continue
        if len(visits.predecessors(i)) == 1 and drives[i].came_from >= 0:
            corner = _corner(setup, visits, poses, (i, j), (drives[i].way, drive.way))
            if corner is not None:
                corners[i] = corner
    return [
        replace(d, path=_joined(d.way, corners.get(d.came_from), corners.get(i)))
        if d.came_from in corners or i in corners
        else d
        for i, d in enumerate(drives)
    ]


def _corner(
    setup: Setup,
    visits: Visits,
    poses: Floats,
    moves: tuple[int, int],
    ways: tuple[Way, Way],
) -> Corner | None:
    """Round the point between two moves; None where the path goes through it."""
    i, j = moves
    parts = shares(setup.chain, visits, i, j, ways)
    if min(parts) <= 0.0:
        return None
    tool = frames_at(visits, i, poses).tool
    try:
        space = in_space(visits, i, j)
        return round_corner(setup.chain, tool, ways, parts, space)
    except PlanError:
        return None


def _joined(way: Way, begin: Corner | None, end: Corner | None) -> Floats:
    """Put together what a corner leaves of a way, (m, 6)."""
    marks = np.linspace(0.0, 1.0, len(way.joints))
    inside = np.ones(len(marks), dtype=bool)
    pieces = [way.joints]
    if begin is not None:
        inside &= marks > begin.behind
        pieces.insert(0, begin.off)
    if end is not None:
        inside &= marks < 1.0 - end.before
        pieces.append(end.to)
    pieces = [way.joints[inside] if piece is way.joints else piece for piece in pieces]
    return np.vstack(pieces)
