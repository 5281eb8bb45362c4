"""The Denavit-Hartenberg chain: frames and points along it, for many poses at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.kernels import floats, native

Frame = tuple[
    Floats, Floats, Floats, Floats
]  # axes x, y, z and origin [m], (3, n) each


@dataclass(frozen=True)
class DH:
    """Standard D-H parameters; D-H angle = offset + sense * (mix @ q), each (6,)."""

    a: Floats  # [m]
    d: Floats  # [m]
    alpha: Floats  # [rad]
    offset: Floats  # [rad]
    sense: Floats
    mix: Floats  # (6, 6): geometric joint angles from the controller's

    def angles(self, q: Floats) -> Floats:
        """Convert controller angles (n, 6) to D-H angles (n, 6) [rad]."""
        theta: Floats = self.offset + self.sense * (q @ self.mix.T)
        return theta

    def packed(self, beta: Floats | None = None) -> Floats:
        """Return what the native kernels know of the chain, (12, 6).

        Args:
            beta: Hayati's rotations of the links, (6,) [rad].
        """
        beta = np.zeros(6) if beta is None else beta
        rows = self.a, self.d, self.alpha, self.offset, self.sense, beta, *self.mix.T
        return np.array(rows)

    def frames(self, q: Floats) -> Iterator[Frame]:
        """Walk along the link frames 0 (base) to 6 (flange) for angles (n, 6) [rad].

        Every frame is the one before, turned and shifted along its z, then its new x.
        """
        theta = np.ascontiguousarray(self.angles(q).T)
        cos, sin = np.cos(theta), np.sin(theta)
        shape = (3, len(q))
        x, y, z = (np.broadcast_to(axis[:, None], shape) for axis in np.eye(3))
        p: Floats = np.zeros(shape)
        yield x, y, z, p
        for i in range(6):
            ca, sa = np.cos(self.alpha[i]), np.sin(self.alpha[i])
            p = p + self.d[i] * z
            x, across = cos[i] * x + sin[i] * y, cos[i] * y - sin[i] * x
            y, z = ca * across + sa * z, ca * z - sa * across
            p = p + self.a[i] * x
            yield x, y, z, p

    def flange(self, q: Floats) -> Floats:
        """Place the flange for angles (n, 6) [rad]: (n, 4, 4) [m]."""
        if native is not None:
            placed: Floats = native.flange(self.packed(), floats(q))
            return placed
        *_, last = self.frames(q)
        return pose_of(last)

    def placed(self, q: Floats, point: Floats, beta: Floats | None = None) -> Floats:
        """Express points of the flange frame in the base frame, (n, 3) [m].

        Going back along the chain, T_i = Rot_z(theta) Trans(a, 0, d) Rot_x(alpha)
        Rot_y(beta).

        Args:
            q: Controller angles, (n, 6) [rad].
            point: Flange frame, (n, 3) [m].
            beta: Hayati's rotations of the links, (6,) [rad].
        """
        if native is not None:
            q, points = floats(q), np.array(point, float, ndmin=2, order="C")
            native_placed: Floats = native.placed(self.packed(beta), q, points)
            return native_placed
        theta = np.ascontiguousarray(self.angles(q).T)
        cos, sin = np.cos(theta), np.sin(theta)
        x, y, z = np.array(np.broadcast_to(point, (len(q), 3)).T)
        for i in reversed(range(6)):
            if beta is not None and beta[i] != 0.0:
                cb, sb = np.cos(beta[i]), np.sin(beta[i])
                x, z = cb * x + sb * z, cb * z - sb * x
            ca, sa = np.cos(self.alpha[i]), np.sin(self.alpha[i])
            x += self.a[i]
            y, z = ca * y - sa * z, sa * y + ca * z
            z += self.d[i]
            x, y = cos[i] * x - sin[i] * y, sin[i] * x + cos[i] * y
        return np.stack([x, y, z], axis=1)


def pose_of(frame: Frame) -> Floats:
    """Write frames as poses, (n, 4, 4) [m]."""
    pose = np.zeros((frame[3].shape[1], 4, 4))
    for column, values in enumerate(frame):
        pose[:, :3, column] = values.T
    pose[:, 3, 3] = 1.0
    return pose
