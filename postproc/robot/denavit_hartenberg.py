"""Standard Denavit-Hartenberg parameters of any six axes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from postproc.arrays import Floats

PARALLEL = 1e-9  # sine of the angle between axes that count as parallel
TIE = 1e-9  # [rad], [m] by which a choice is no choice


class DhParameters(NamedTuple):
    """Standard D-H parameters; D-H angle = offset + sense * q, each (6,).

    Attributes:
        a, d: Lengths [m].
        alpha, offset: Angles [rad].
        sense: +1 or -1.
    """

    a: Floats
    d: Floats
    alpha: Floats
    offset: Floats
    sense: Floats


class _Link(NamedTuple):
    """One row, and the x axis and origin of the frame at its end."""

    theta: float
    d: float
    a: float
    alpha: float
    x: Floats
    origin: Floats


def dh_parameters(axes: Floats, points: Floats, flange: Floats) -> DhParameters:
    """Compute the D-H parameters of six axes.

    Where D-H leaves a choice, it is made so that small changes of the arm change the
    parameters little:

    - parallel axes turn the same way (alpha is 0), with d = 0;
    - an axis that is parallel to no neighbour turns as given (its sense is 1), but for
      axis 1, which is the base's z, and axis 6, which is the flange's z;
    - the D-H angle where the joint is at 0 is from -90 to 90 deg, so lengths may be
      negative; at a right angle a is positive.

    Args:
        axes: Unit vectors where all joints are at 0, in the base frame, (6, 3). The
            first is along the base's z, the last along the flange's.
        points: A point on every axis [m], (6, 3). The first axis passes through the
            base's origin, the last through the flange's.
        flange: Pose of the flange, (4, 4) [m].
    """
    z = _directions(axes, flange)
    x, origin = np.array([1.0, 0.0, 0.0]), np.zeros(3)
    links = []
    for k in range(5):
        link = _link(x, origin, z[k], z[k + 1], points[k + 1])
        x, origin = link.x, link.origin
        links.append(link)
    d = float((flange[:3, 3] - origin) @ z[5])
    theta = _angle(x, flange[:3, 0], z[5])
    links.append(_Link(theta, d, 0.0, 0.0, flange[:3, 0], flange[:3, 3]))
    return DhParameters(
        a=np.array([link.a for link in links]),
        d=np.array([link.d for link in links]),
        alpha=np.array([link.alpha for link in links]),
        offset=np.array([link.theta for link in links]),
        sense=np.sign(np.sum(axes * z, axis=1)),
    )


def _directions(axes: Floats, flange: Floats) -> Floats:
    """Choose the way along every axis that is z of its D-H frame, (6, 3)."""
    z = np.array(axes)
    z[0], z[5] = [0.0, 0.0, 1.0], flange[:3, 2]
    for k in range(1, 5):
        parallel = np.linalg.norm(np.cross(z[k - 1], z[k])) < PARALLEL
        if parallel and z[k - 1] @ z[k] < 0:
            z[k] = -z[k]
    return z


def _angle(start: Floats, end: Floats, about: Floats) -> float:
    """Return the angle from a unit vector to another about a third [rad]."""
    return math.atan2(float(np.cross(start, end) @ about), float(start @ end))


def _link(x: Floats, origin: Floats, z: Floats, end: Floats, point: Floats) -> _Link:
    """Go from one axis to the next along their common normal.

    Args:
        x: Of the frame before, (3,).
        origin: Of the frame before, a point on its z axis [m], (3,).
        z: Of the frame before, (3,).
        end: Direction of the next axis, (3,).
        point: A point on the next axis [m], (3,).
    """
    gap, across = point - origin, np.cross(z, end)
    sine = float(np.linalg.norm(across))
    if sine < PARALLEL:
        d, beside = 0.0, gap - (gap @ z) * z
        a = float(np.linalg.norm(beside))
        normal = beside / a if a > TIE else x
    else:
        normal = across / sine
        a = float(gap @ normal)
        d = float(np.cross(gap - a * normal, end) @ normal) / sine
    theta = _angle(x, normal, z)
    back = abs(theta) - math.pi / 2
    if back > TIE or (abs(back) <= TIE and (a < -TIE or (a <= TIE and theta < 0))):
        theta -= math.copysign(math.pi, theta)
        normal, a = -normal, -a
    place = origin + d * z + a * normal
    return _Link(theta, d, a, _angle(z, end, normal), normal, place)
