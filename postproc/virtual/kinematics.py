"""The virtual arm's own Denavit-Hartenberg chain and the numbers of its nominal arm."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from postproc.arrays import Floats


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

    a: Floats
    d: Floats
    alpha: Floats
    offset: Floats
    sense: Floats
    shift: Floats
    beta: Floats
    mass: Floats
    centre: Floats
    speed: Floats
    lower: Floats
    upper: Floats

    def dh_angles(self, q: Floats) -> Floats:
        """Convert controller angles (n, 6) to D-H angles (n, 6) [rad]."""
        return np.asarray(self.offset + self.sense * (q + self.shift))

    def controller_angles(self, theta: Floats) -> Floats:
        """Convert D-H angles (n, 6) to controller angles (n, 6) [rad]."""
        return np.asarray((theta - self.offset) / self.sense - self.shift)

    @cached_property
    def twists(self) -> Floats:
        """Return Rx(alpha) Ry(beta) of every link, (6, 3, 3)."""
        ca, sa = np.cos(self.alpha), np.sin(self.alpha)
        cb, sb = np.cos(self.beta), np.sin(self.beta)
        zero = np.zeros(6)
        rows = [[cb, zero, sb], [sa * sb, ca, -sa * cb], [-ca * sb, sa, ca * cb]]
        return np.moveaxis(np.array(rows), -1, 0)

    def links(self, q: Floats) -> Floats:
        """Return Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta), (n, 6, 4, 4).

        Args:
            q: Controller joint angles, (n, 6) [rad].
        """
        theta = self.dh_angles(q)
        turn, out = np.zeros((*theta.shape, 3, 3)), np.zeros((*theta.shape, 4, 4))
        ct, st = np.cos(theta), np.sin(theta)
        turn[..., 0, 0] = turn[..., 1, 1] = ct
        turn[..., 0, 1], turn[..., 1, 0], turn[..., 2, 2] = -st, st, 1.0
        out[..., :3, :3] = turn @ self.twists
        out[..., 0, 3], out[..., 1, 3] = self.a * ct, self.a * st
        out[..., 2, 3], out[..., 3, 3] = self.d, 1.0
        return out

    def frames(self, q: Floats) -> Floats:
        """Return all frames (n, 7, 4, 4), arm base to flange, in the arm base.

        Args:
            q: Controller joint angles, (n, 6) [rad].
        """
        links = self.links(np.asarray(q, dtype=float))
        out = np.empty((len(links), 7, 4, 4))
        out[:, 0] = np.eye(4)
        for i in range(6):
            np.matmul(out[:, i], links[:, i], out=out[:, i + 1])
        return out

    def flange(self, q: Floats) -> Floats:
        """Return the flange poses (n, 4, 4) in the arm base [m]."""
        return np.asarray(self.frames(q)[:, 6])

    def bent(self, growth: Floats) -> Chain:
        """Return a chain whose lengths grew by the relative amounts (n, 6)."""
        return replace(self, a=self.a * (1 + growth), d=self.d * (1 + growth))


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
