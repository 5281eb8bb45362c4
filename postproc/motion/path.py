"""Cartesian paths: straight lines and arcs of the TCP, sampled.

Orientation turns about one fixed axis at a constant rate from start to end (on an arc,
from start to VIA to end), as $ORNT_TYPE RS_WORLD does.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.robot.pose import rotation_from_vector, rotation_vector

STEP = 5e-3  # [m] between samples
TURN = np.deg2rad(1.0)  # [rad] between samples
MOST = 2000  # samples of one path
COLLINEAR = 1e-6  # sine of the angle at VIA below which three points make no circle
APART = 1e-6  # [m] nor do they where two are nearer: rounding alone would place it


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
        arc = np.linalg.norm(self.radius, axis=1) * self.angle
        length: Floats = np.linalg.norm(self.chord, axis=1) + arc
        return length

    @cached_property
    def turning(self) -> Floats:
        """Angles of reorientation, (m,) [rad]."""
        return np.asarray(np.linalg.norm(self.turn, axis=1))

    def intervals(self, least: Ints) -> Ints:
        """Choose how many intervals to cut each path into, at least those given."""
        steps = np.maximum(self.length / STEP, self.turning / TURN)
        steps = np.nan_to_num(steps, nan=0.0)
        wanted = np.clip(np.ceil(steps - 1e-9), least, MOST)
        return np.asarray(wanted, dtype=np.int64)

    def poses(self, path: Ints, u: Floats) -> Floats:
        """Place the TCP on paths `path` (s,) at fractions u (s,): (s, 4, 4)."""
        phi = (u * self.angle[path])[:, None]
        T = np.zeros((len(u), 4, 4))
        T[:, :3, 3] = self.centre[path] + u[:, None] * self.chord[path]
        T[:, :3, 3] += (
            np.cos(phi) * self.radius[path] + np.sin(phi) * self.tangent[path]
        )
        turned = rotation_from_vector(u[:, None] * self.turn[path])
        T[:, :3, :3] = self.rotation[path] @ turned
        T[:, 3, 3] = 1.0
        return T


def lines(begin: Floats, end: Floats) -> Segments:
    """Build straight paths between TCP poses (m, 4, 4) [m]."""
    m = len(begin)
    nothing = np.zeros((m, 3))
    return Segments(
        rotation=begin[:, :3, :3], turn=_turn(begin, end), centre=begin[:, :3, 3],
        radius=nothing, tangent=nothing, chord=end[:, :3, 3] - begin[:, :3, 3],
        angle=np.zeros(m), valid=np.ones(m, dtype=bool),
    )  # fmt: skip


def arcs(begin: Floats, via: Floats, end: Floats) -> tuple[Segments, Segments]:
    """Build arcs through three TCP poses (m, 4, 4) [m]: start to VIA, VIA to end."""
    centre, normal, valid = _circles(
        begin[:, :3, 3], via[:, :3, 3], end[:, :3, 3]
    )  # fmt: skip
    return (
        _arc(begin, via, centre, normal, valid),
        _arc(via, end, centre, normal, valid),
    )


def _circles(a: Floats, b: Floats, c: Floats) -> tuple[Floats, Floats, Bools]:
    """Find the circles through points (m, 3): centres, unit normals, which exist.

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


def joined(parts: list[Segments]) -> Segments:
    """Put segments one after the other."""
    names = [f.name for f in fields(Segments)]
    return Segments(
        *(np.concatenate([getattr(p, name) for p in parts]) for name in names)
    )
