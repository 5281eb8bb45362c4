"""Whether the base of the cell fits a program: its joints and poses tell.

Where a JOINT move to joint angles stands beside a move to a pose, the tool is not far
from that pose, and points about the same way: approaches are written so. Under a base
that is not the program's none of them fits, and under the right one they do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.solver.targets import few_frames
from postproc.diagnostics import Code
from postproc.language.visits import Diagnostic, Meaning, Visits
from postproc.robot.cell import Cell
from postproc.robot.pose import (
    MM,
    inverse,
    is_unknown,
    lengths,
    pose_from_record,
    rotation_vector,
)

NEAR = 0.3  # [m] from an approach to its target at most
ALIKE = np.deg2rad(30.0)  # between the orientations of the tool there
MOST = 1000  # pairs that are looked at
TURNS = (90.0, 180.0, -90.0)  # of a base about its z axis, as cells are built


@dataclass(frozen=True)
class PosePairs:
    """k poses with the joint angles beside them.

    Attributes:
        visits: The visits of the poses, (k,); one with two neighbours is there twice.
        reached: The TCP at the joint angles, in the arm's base frame, (k, 4, 4) [m].
        wanted: The poses, in the world, (k, 4, 4) [m].
    """

    visits: Ints
    reached: Floats
    wanted: Floats

    def fit(self, bases: Floats) -> tuple[Bools, Floats]:
        """Tell which of m poses fit each of b bases (b, 4, 4) with any neighbour.

        Returns:
            Whether each pose fits, (b, m), and the distance to its nearest neighbour
            [m], (b, m).
        """
        place = inverse(bases)[:, None] @ self.wanted
        far = lengths(place[..., :3, 3] - self.reached[:, :3, 3])
        between = np.swapaxes(self.reached[:, :3, :3], 1, 2) @ place[..., :3, :3]
        angle = lengths(rotation_vector(between))
        _, which = np.unique(self.visits, return_inverse=True)
        shape = which.max(initial=-1) + 1, len(bases)
        fits, least = np.zeros(shape, dtype=bool), np.full(shape, np.inf)
        np.logical_or.at(fits, which, ((far <= NEAR) & (angle <= ALIKE)).T)
        np.minimum.at(least, which, far.T)
        return fits.T, least.T


def check_base(visits: Visits, cell: Cell) -> list[Diagnostic]:
    """Warn where a program was made for another base than the cell's.

    It is told only where no pair fits the base of the cell, and most fit the identity,
    or a quarter or half turn of either: no chance brings that about.

    Args:
        visits: Every arrival.
        cell: The base at the start of the program; where the program sets another one,
            it is its own judge.
    """
    pairs = _pairs(visits, cell)
    if len(pairs.visits) == 0:
        return []
    (fits,), (far,) = pairs.fit(cell.base.pose[None])
    if fits.any():
        return []
    others = dict(_others(cell.base.pose))
    bases = np.stack([*others.values()])
    for name, fitting, near in zip(others, *pairs.fit(bases), strict=True):
        if fitting.sum() * 2 > len(fitting):
            first = int(np.unique(pairs.visits)[np.argmax(fitting)])
            text = (
                f"the base of the cell does not fit the program: at {len(fitting)} "
                "Cartesian targets, the first here, the joint angles beside them place "
                f"the tool {_mm(far)} mm away, and {_mm(near)} mm with {name}. If the "
                "post writes no $BASE, write the frame that the program was made with "
                "into [base] of the cell"
            )
            file, line = (
                visits.file_name(first),
                int(visits.place.line[first]),
            )
            return [Diagnostic(file, line, Code.BASE_FRAME_MISMATCH, text)]
    return []


def _mm(distances: Floats) -> str:
    return f"{np.median(distances) / MM:.0f}"


def _others(base: Floats) -> Iterator[tuple[str, Floats]]:
    """Yield what else a base may be, and its name."""
    identity: Floats = np.eye(4)
    turned = "the base of the cell"
    if not np.allclose(base, identity):
        yield "the identity as base", identity
    for name, start in ((turned, base), ("the identity", identity)):
        for degrees in TURNS:
            turn = pose_from_record(np.array([0.0, 0.0, 0.0, degrees, 0.0, 0.0]))
            yield f"{name} turned by {degrees:g} degrees about z", start @ turn


def _pairs(visits: Visits, cell: Cell) -> PosePairs:
    """Find poses with joint angles beside them, under the base of the cell."""
    frames = few_frames(visits)
    pose, joints = _beside(visits)
    apart = np.abs(frames - cell.base.pose).reshape(-1, 16)
    same: Bools = apart.max(axis=1) < 1e-9
    own, known = same[visits.frame.base[pose]], ~is_unknown(frames)
    known = known[visits.frame.uframe[pose]] & known[visits.frame.tool[pose]]
    some = np.flatnonzero(own & known & ~visits.frame.tool_remote[pose])[:MOST]
    pose, joints = pose[some], joints[some]
    flange = cell.arm.flange(np.deg2rad(visits.target.values[joints, :6]))
    numbers = visits.dialect.poses(visits.target.values[pose])
    return PosePairs(
        pose,
        flange @ frames[visits.frame.tool[pose]],
        frames[visits.frame.uframe[pose]] @ numbers,
    )


def _beside(visits: Visits) -> tuple[Ints, Ints]:
    """Return visits of poses, and those of joint angles just before or behind, (k,)."""
    known = ~np.isnan(visits.target.values).any(axis=1)
    pose = known & (visits.target.meaning == Meaning.POSE)
    joints = known & (visits.target.meaning == Meaning.JOINTS)
    after = visits.graph.before == np.arange(len(visits)) - 1
    into = np.flatnonzero(after[1:] & pose[1:] & joints[:-1]) + 1
    out = np.flatnonzero(after[1:] & joints[1:] & pose[:-1])
    return np.concatenate([into, out]), np.concatenate([into - 1, out + 1])
