"""Inverse kinematics of an arm: all branches or one, on turns within its range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.robot.arm_file import OpwSection
from postproc.robot.closed_form import ClosedForm


@dataclass(frozen=True)
class Branches:
    """All closed-form solutions of n flange poses, in stable slots 4 W + 2 S + E.

    Attributes:
        q: (n, 8, 6) [rad], NaN where a branch does not exist. Axes lie in the arm's
            range where a turn of 360 deg can bring them there, else in (-pi, pi].
    """

    q: Floats


def wrap(angle: Floats) -> Floats:
    """Wrap angles into [-pi, pi)."""
    wrapped: Floats = np.mod(angle + np.pi, 2 * np.pi) - np.pi
    return wrapped


class Inverse:
    """The inverse kinematics of one arm."""

    def __init__(
        self, parameters: OpwSection, mix: Floats, lower: Floats, upper: Floats
    ) -> None:
        """Build it from the arm file's section, angle mixing and joint limits [rad]."""
        self._closed = ClosedForm(parameters)
        self._mix, self._unmix = mix, np.linalg.inv(mix)
        self._lower, self._upper = lower, upper

    def branches(self, flange: Floats) -> Branches:
        """Solve for all branches of flange poses (n, 4, 4) [m]."""
        q = self._closed.branches(flange) @ self._unmix.T
        return Branches(self.into_range(q))

    def branch(self, flange: Floats, slot: Ints) -> Floats:
        """Solve for one branch each of flange poses (n, 4, 4) [m], on any turn.

        Returns:
            (n, 6) [rad], NaN where the branch does not exist.
        """
        q: Floats = self._closed.branch(flange, slot) @ self._unmix.T
        return q

    def slot(self, q: Floats) -> Ints:
        """Name the branch (slot 4 W + 2 S + E) of joint angles (n, 6) [rad]."""
        return self._closed.slot(q @ self._mix.T)

    def into_range(self, q: Floats) -> Floats:
        """Shift angles by whole turns into the joint range where that is possible."""
        turn = 2 * np.pi
        below = np.pi - q
        around = np.flatnonzero((below < 0) | (below >= turn))
        if len(around):
            below.flat[around] = np.mod(below.flat[around], turn)
        q = np.pi - below
        low, high = np.nonzero(q < self._lower), np.nonzero(q > self._upper)
        if len(low[0]):
            up = q[low] + turn
            q[low] = np.where(up <= self._upper[low[-1]], up, q[low])
        if len(high[0]):
            down = q[high] - turn
            q[high] = np.where(down >= self._lower[high[-1]], down, q[high])
        return q
