"""How the virtual controller rounds a fly point.

While the first of two moves is braked, the second one starts: between Cartesian moves
with FLY_CART their motions are added up in space, else joint by joint. Both motions
grow with the square of the time, so that the corner of two straight moves is a
parabola. How long that lasts is in `zone`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.virtual.controller import joints_along
from postproc.virtual.kinematics import Chain
from postproc.virtual.moves import Way
from postproc.virtual.rotation import pose, undo

MOMENTS = np.linspace(0.0, 1.0, 33)  # of a corner, from its begin to its end
STRAIGHT = 1e-12  # [m^2] distances that differ less make no parabola


@dataclass(frozen=True)
class Corner:
    """The way round one point.

    Attributes:
        before: Part of the first move that is left out, 0 .. 1/2.
        behind: Part of the second move that is left out.
        to: Joints from the begin of the corner to the place nearest to the point,
            (k, 6) [rad].
        off: Joints from there to the end of the corner, (m, 6).
    """

    before: float
    behind: float
    to: Floats
    off: Floats


def round_corner(
    chain: Chain,
    tool: Floats,
    ways: tuple[Way, Way],
    shares: tuple[float, float],
    in_space: bool,
) -> Corner:
    """Round the point between two ways.

    Args:
        chain: Nominal arm.
        tool: Flange to TCP, (4, 4).
        ways: To the point, and on from it.
        shares: Parts of them that belong to the corner.
        in_space: Add up motions of the tool instead of motions of the joints.

    Raises:
        PlanError: The corner leaves the reach of the arm.
    """
    first = progress(ways[0], 1.0 - shares[0] * (1.0 - MOMENTS) ** 2)
    second = progress(ways[1], shares[1] * MOMENTS**2)
    point = ways[0].joints[-1]
    if in_space:
        added = _added(*(chain.flange(q) @ tool for q in (first, second, point[None])))
        joints = joints_along(chain, added @ undo(tool), first[0])
    else:
        joints = first + second - point
    tcp = (chain.flange(np.vstack([joints, point])) @ tool)[:, :3, 3]
    passing, k = _nearest(joints, np.sum((tcp[:-1] - tcp[-1]) ** 2, axis=1))
    return Corner(
        shares[0],
        shares[1],
        np.vstack([joints[: k + 1], passing]),
        np.vstack([passing, joints[k + 1 :]]),
    )


def progress(way: Way, part: Floats) -> Floats:
    """Return the joints (k, 6) at parts (k,) of a way that is sampled evenly."""
    marks = np.linspace(0.0, 1.0, len(way.joints))
    return np.stack([np.interp(part, marks, q) for q in way.joints.T], axis=1)


def _added(first: Floats, second: Floats, point: Floats) -> Floats:
    """Add the motion from the point to the second poses to the first poses."""
    turn = first[:, :3, :3] @ np.swapaxes(point[:, :3, :3], 1, 2) @ second[:, :3, :3]
    return pose(turn, first[:, :3, 3] + second[:, :3, 3] - point[:, :3, 3])


def _nearest(joints: Floats, distance: Floats) -> tuple[Floats, int]:
    """Return the joints where a squared distance is least, and the moment before.

    By parabolas through the three moments around the least one.
    """
    i = int(np.clip(np.argmin(distance), 1, len(distance) - 2))
    a, b, c = distance[i - 1 : i + 2]
    bend = a - 2 * b + c
    t = float(np.clip(0.5 * (a - c) / bend, -1, 1)) if bend > STRAIGHT else 0.0
    before, here, after = joints[i - 1 : i + 2]
    passing = (
        here + 0.5 * t * (after - before) + 0.5 * t**2 * (after - 2 * here + before)
    )
    return passing, i if t > 0 else i - 1
