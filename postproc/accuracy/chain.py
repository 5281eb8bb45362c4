"""A Denavit-Hartenberg chain with deviations, for many poses at once.

The arm's own kinematics are nominal. A calibrated chain differs in every placement, and
its derivatives are wanted at the deviated place: both fall out of one walk along the
chain that keeps the axes and points of every elementary motion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Floats
from postproc.robot.arm import DH


@dataclass(frozen=True)
class Deviation:
    """What a real chain's placements differ by from the nominal ones.

    Attributes:
        base: Shift x, y, z [m] of the base, then rotations about x, y, z [rad], (6,).
        link: Per joint a [m], d [m], alpha, theta, beta [rad], (6, 5); beta is Hayati's
            rotation about the y axis of the link frame, after alpha.
        tool: Shift of the TCP in the flange frame [m], (3,).
    """

    base: Floats
    link: Floats
    tool: Floats


NOMINAL = Deviation(np.zeros(6), np.zeros((6, 5)), np.zeros(3))


@dataclass(frozen=True)
class Walk:
    """Axes and points met along the chain, base frame; n poses.

    Poses lie next to each other in memory: long passes are faster than short ones.

    Attributes:
        turn, pivot: Axis z of every joint and a point on it, (n, 6, 3).
        link, corner: Axis x of a and alpha and a point on it, (n, 6, 3).
        bend: Axis y of beta, through `corner`, (n, 6, 3).
        base_axes: Axes of the three base rotations, (3, 3), through `base_point`.
        flange: Rotation of the flange, (n, 3, 3).
        tcp: Tool centre point, (n, 3) [m].
    """

    turn: Floats
    pivot: Floats
    link: Floats
    corner: Floats
    bend: Floats
    base_axes: Floats
    base_point: Floats
    flange: Floats
    tcp: Floats


def _turned(a: Floats, b: Floats, cos: Floats | float, sin: Floats | float) -> tuple:  # type: ignore[type-arg]
    """Turn the orthogonal axes a towards b by an angle, about a x b."""
    return cos * a + sin * b, cos * b - sin * a


def _base(deviation: Deviation) -> tuple[Floats, Floats]:
    """Give the base's axes as columns, and the axes of its three rotations as rows."""
    axes, about = np.eye(3), np.eye(3)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        angle = deviation.base[3 + k]
        about[k] = axes[:, k]
        axes[:, i], axes[:, j] = _turned(
            axes[:, i].copy(), axes[:, j].copy(), np.cos(angle), np.sin(angle)
        )
    return axes, about


def base_of(deviation: Deviation) -> Floats:
    """Give the base's axes, the axes of its three rotations and its point, (7, 3)."""
    axes, about = _base(deviation)
    return np.concatenate([axes.T, about, deviation.base[None, :3]])


def deviated(dh: DH, deviation: Deviation) -> DH:
    """Return the real parameters, but for base, tool and Hayati's rotations."""
    da, dd, dalpha, dtheta, _ = deviation.link.T
    return replace(
        dh, a=dh.a + da, d=dh.d + dd, alpha=dh.alpha + dalpha, offset=dh.offset + dtheta
    )


def walk(dh: DH, q: Floats, tool: Floats, deviation: Deviation = NOMINAL) -> Walk:
    """Walk along the chain from the base to the tool centre point.

    Args:
        dh: Nominal parameters.
        q: Joint angles, (n, 6) [rad].
        tool: TCP in the flange frame, (n, 3) [m].
        deviation: Deviations of the placements.
    """
    shape = (3, len(q))
    theta = np.ascontiguousarray((dh.angles(q) + deviation.link[:, 3]).T)
    cos, sin = np.cos(theta), np.sin(theta)
    axes, about = _base(deviation)
    x, y, z = (np.broadcast_to(axis[:, None], shape) for axis in axes.T)
    p: Floats = np.broadcast_to(deviation.base[:3, None], shape)
    turn, pivot, link, corner, bend = (np.empty((6, *shape)) for _ in range(5))
    for i in range(6):
        da, dd, dalpha, _, beta = deviation.link[i]
        alpha = dh.alpha[i] + dalpha
        turn[i], pivot[i] = z, p
        x, y = _turned(x, y, cos[i], sin[i])
        p = p + (dh.d[i] + dd) * z + (dh.a[i] + da) * x
        y, z = _turned(y, z, np.cos(alpha), np.sin(alpha))
        link[i], corner[i], bend[i] = x, p, y
        if beta != 0.0:
            z, x = _turned(z, x, np.cos(beta), np.sin(beta))
    flange, (tx, ty, tz) = np.stack([x, y, z]), (tool + deviation.tool).T
    tcp = p + (x * tx + y * ty + z * tz)
    point = np.array(deviation.base[:3])
    turn, pivot, link, corner, bend = (
        np.moveaxis(a, 2, 0) for a in (turn, pivot, link, corner, bend)
    )
    return Walk(turn, pivot, link, corner, bend, about, point, flange.T, tcp.T)


def tcp(dh: DH, q: Floats, tool: Floats, deviation: Deviation = NOMINAL) -> Floats:
    """Place the tool centre point alone, (n, 3) [m]: `Walk.tcp` at a third of the cost.

    Args:
        dh: Nominal parameters.
        q: Joint angles, (n, 6) [rad].
        tool: TCP in the flange frame, (n, 3) [m].
        deviation: Deviations of the placements.
    """
    axes, _ = _base(deviation)
    real, beta = deviated(dh, deviation), deviation.link[:, 4]
    placed = real.placed(q, tool + deviation.tool, beta)
    moved: Floats = placed @ axes.T + deviation.base[:3]
    return moved
