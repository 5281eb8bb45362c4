"""The virtual arm's own Denavit-Hartenberg chain and the numbers of its nominal arm."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from postproc.virtual.rotation import pose

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Chain:
    """A serial arm with six turning joints in standard D-H form.

    Joint i turns about z of frame i-1 by the D-H angle
    ``offset + sense * (q + shift)``, q being the angle the controller shows; then
    d along z, a along the new x, alpha about it, and at last beta about the new y
    (the fifth number that two nearly parallel axes need).

    Attributes:
        a, d: Lengths, (6,) or (n, 6) [m].
        alpha, offset, shift, beta: Angles, (6,) [rad].
        sense: +1 or -1, (6,).
        mass: Link masses, (6,) [kg].
        centre: Centres of mass in the D-H link frames, (6, 3) [m].
        speed: Highest joint speeds, (6,) [rad/s].
        lower, upper: Joint range, (6,) [rad].
    """

    a: Array
    d: Array
    alpha: Array
    offset: Array
    sense: Array
    shift: Array
    beta: Array
    mass: Array
    centre: Array
    speed: Array
    lower: Array
    upper: Array

    def dh_angles(self, q: Array) -> Array:
        """Convert controller angles (n, 6) to D-H angles (n, 6) [rad]."""
        return np.asarray(self.offset + self.sense * (q + self.shift))

    def controller_angles(self, theta: Array) -> Array:
        """Convert D-H angles (n, 6) to controller angles (n, 6) [rad]."""
        return np.asarray((theta - self.offset) / self.sense - self.shift)

    def frames(self, q: Array) -> Array:
        """Return all frames (n, 7, 4, 4), arm base to flange, in the arm base.

        Args:
            q: Controller joint angles, (n, 6) [rad].
        """
        theta = self.dh_angles(np.asarray(q, dtype=float))
        a, d = (np.broadcast_to(x, theta.shape) for x in (self.a, self.d))
        out = np.empty((len(theta), 7, 4, 4))
        out[:, 0] = np.eye(4)
        for i in range(6):
            link = link_transform(
                theta[:, i], d[:, i], a[:, i], self.alpha[i], self.beta[i]
            )
            out[:, i + 1] = out[:, i] @ link
        return out

    def flange(self, q: Array) -> Array:
        """Return the flange poses (n, 4, 4) in the arm base [m]."""
        return np.asarray(self.frames(q)[:, 6])

    def bent(self, growth: Array) -> Chain:
        """Return a chain whose lengths grew by the relative amounts (n, 6)."""
        return replace(self, a=self.a * (1 + growth), d=self.d * (1 + growth))


def link_transform(
    theta: Array, d: Array, a: Array, alpha: float, beta: float
) -> Array:
    """Return Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta) as poses (n, 4, 4)."""
    ct, st = np.cos(theta), np.sin(theta)
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    twist = np.array([[cb, 0, sb], [sa * sb, ca, -sa * cb], [-ca * sb, sa, ca * cb]])
    turn = np.zeros((len(theta), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = ct
    turn[:, 0, 1], turn[:, 1, 0], turn[:, 2, 2] = -st, st, 1.0
    return pose(turn @ twist, np.stack([a * ct, a * st, d], axis=-1))


def _nj220() -> Chain:
    degrees = np.radians
    return Chain(
        a=np.array([400.0, 1175.0, 250.0, 0.0, 0.0, 0.0]) * 1e-3,
        d=np.array([830.0, 0.0, 0.0, 1125.3, 0.0, 230.0]) * 1e-3,
        alpha=degrees([-90.0, 0.0, -90.0, 90.0, -90.0, 0.0]),
        offset=degrees([0.0, -90.0, 0.0, 0.0, 0.0, 180.0]),
        sense=np.array([-1.0, 1.0, -1.0, -1.0, 1.0, -1.0]),
        shift=degrees([0.0, 0.0, 90.0, 0.0, 0.0, 0.0]),
        beta=np.zeros(6),
        mass=np.array([420.0, 120.0, 304.0, 91.0, 51.0, 5.0]),
        centre=np.array([
            [-86.0, 121.0, 25.0], [-661.0, 18.0, -3.0], [-40.0, -19.0, -42.0],
            [0.0, -308.0, -26.0], [0.0, -15.0, 94.0], [0.0, -1.0, -16.0],
        ]) * 1e-3,
        speed=degrees([100.0, 90.0, 110.0, 130.0, 130.0, 195.0]),
        lower=degrees([-180.0, -75.0, -256.0, -2700.0, -125.0, -2700.0]),
        upper=degrees([180.0, 95.0, 10.0, 2700.0, 125.0, 2700.0]),
    )  # fmt: skip


NJ220 = _nj220()
