"""Cartesian paths, densely sampled."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.exceptions import PlanError
from postproc.virtual.rotation import exponential, logarithm, pose

# A joint that turns between two samples is missed by about step^2 / (8 m): 1 urad.
STEP = 3e-3  # [m]
TURN_STEP = np.radians(1.0)
FEWEST = 4
APART = 1e-6  # [m] points nearer than this are one: they make no circle with a third


def straight(start: Floats, end: Floats) -> Floats:
    """Sample a straight line from one pose to another, without its first point.

    The orientation turns about one fixed axis.

    Args:
        start: Pose (4, 4) [m].
        end: Likewise.

    Returns:
        (m, 4, 4), the last one is `end`.
    """
    turn = logarithm(start[:3, :3].T @ end[:3, :3])
    way = end[:3, 3] - start[:3, 3]
    s = _progress(float(np.linalg.norm(way)), float(np.linalg.norm(turn)))
    samples = pose(
        start[:3, :3] @ exponential(s[:, None] * turn),
        start[:3, 3] + s[:, None] * way,
    )
    samples[-1] = end
    return samples


def arc(start: Floats, via: Floats, end: Floats) -> tuple[Floats, Floats]:
    """Sample the arc from `start` through `via` to `end`.

    The orientation turns steadily from each pose to the next.

    Args:
        start: Pose (4, 4) [m].
        via: Likewise.
        end: Likewise.

    Returns:
        The samples up to `via` and those up to `end`, as in `straight`.

    Raises:
        PlanError: The three points lie on a line.
    """
    centre, normal = _circle(start[:3, 3], via[:3, 3], end[:3, 3])
    first = _angle(start[:3, 3] - centre, via[:3, 3] - centre, normal)
    whole = _angle(start[:3, 3] - centre, end[:3, 3] - centre, normal)
    return (
        _turned(start, via, centre, normal * first),
        _turned(via, end, centre, normal * (whole - first)),
    )


def _turned(start: Floats, end: Floats, centre: Floats, sweep: Floats) -> Floats:
    """Sample a piece of a circle that sweeps a rotation vector about its centre."""
    turn = logarithm(start[:3, :3].T @ end[:3, :3])
    radius = start[:3, 3] - centre
    length = float(np.linalg.norm(sweep) * np.linalg.norm(radius))
    s = _progress(length, float(np.linalg.norm(turn)))
    samples = pose(
        start[:3, :3] @ exponential(s[:, None] * turn),
        centre + exponential(s[:, None] * sweep) @ radius,
    )
    samples[-1] = end
    return samples


def _progress(length: float, angle: float) -> Floats:
    count = max(FEWEST, int(np.ceil(max(length / STEP, angle / TURN_STEP))))
    return np.arange(1, count + 1) / count


def _circle(p: Floats, q: Floats, r: Floats) -> tuple[Floats, Floats]:
    """Return the centre and the unit normal of the circle through three points."""
    u, v = q - p, r - p
    normal = np.cross(u, v)
    area = float(np.linalg.norm(normal))
    sides = [float(np.linalg.norm(side)) for side in (u, v, r - q)]
    if area < 1e-6 * sides[0] * sides[1] or min(sides) < APART:
        raise PlanError("the three points of the arc lie on a line")
    to_centre = np.cross(u @ u * v - v @ v * u, normal) / (2 * area**2)
    return p + to_centre, normal / area


def _angle(a: Floats, b: Floats, normal: Floats) -> float:
    """Return the angle in (0, 2 pi] from a to b about a normal."""
    angle = np.arctan2(np.cross(a, b) @ normal, a @ b)
    return float(angle if angle > 0 else angle + 2 * np.pi)
