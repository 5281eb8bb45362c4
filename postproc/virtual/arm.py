"""The virtual arm: where the tool really goes, and what a laser tracker reads there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Floats
from postproc.virtual.arrivals import Arrivals
from postproc.virtual.as_built import AsBuilt
from postproc.virtual.gears import Gears
from postproc.virtual.kinematics import Chain
from postproc.virtual.law import Law, Where, total
from postproc.virtual.rotation import small_motion


@dataclass(frozen=True)
class VirtualArm:
    """One arm with its own errors; all lengths in metres, in the arm base frame.

    Attributes:
        seed: What it was drawn from.
        nominal: The arm that its controller believes in.
        as_built: The arm that it is.
        laws: Its further imperfections, with sizes: the truth to score against.
        gears: Gaps that the direction comes from.
        joint_noise: Repeatability of every joint, (6,) [rad].
        tracker_noise: Constant [m] and per metre of range, one axis.
        warming: Rise [K] and time constant [s] of the arm's own temperature.
    """

    seed: int
    nominal: Chain
    as_built: AsBuilt
    laws: tuple[Law, ...]
    gears: Gears
    joint_noise: Floats
    tracker_noise: tuple[float, float]
    warming: tuple[float, float]

    def nominal_pose(self, arrivals: Arrivals) -> Floats:
        """Return where the drawing puts the tool, (n, 4, 4)."""
        return np.asarray(self.nominal.flange(arrivals.q) @ arrivals.tool)

    def nominal_tcp(self, arrivals: Arrivals) -> Floats:
        """Return where the drawing puts the TCP, (n, 3)."""
        return np.asarray(self.nominal_pose(arrivals)[:, :3, 3])

    def tcp(self, arrivals: Arrivals, joint_noise: Floats | float = 0.0) -> Floats:
        """Return where the TCP really is, (n, 3), without noise unless some is given.

        Args:
            arrivals: Commanded joints and all they depend on.
            joint_noise: Added to the joints, (n, 6) [rad].
        """
        return np.asarray(self.pose(arrivals, joint_noise)[:, :3, 3])

    def pose(self, arrivals: Arrivals, joint_noise: Floats | float = 0.0) -> Floats:
        """Return where the tool really is, (n, 4, 4).

        Args:
            arrivals: Commanded joints and all they depend on.
            joint_noise: Added to the joints, (n, 6) [rad].
        """
        angles = arrivals.q + total(self.laws, Where.JOINTS, arrivals) + joint_noise
        growth = total(self.laws, Where.LENGTHS, arrivals)
        base = self.as_built.base + total(self.laws, Where.BASE, arrivals)
        mount = self.as_built.mount + total(self.laws, Where.TOOL, arrivals)
        flange = self.as_built.chain.bent(growth).flange(angles)
        return np.asarray(
            small_motion(base) @ flange @ small_motion(mount) @ arrivals.tool
        )

    def error(self, arrivals: Arrivals) -> Floats:
        """Return the true error, actual minus nominal TCP, (n, 3), without noise."""
        return self.tcp(arrivals) - self.nominal_tcp(arrivals)

    def seen(self, arrivals: Arrivals, tcp: Floats) -> Floats:
        """Return what a tracker whose stand moves would read at TCPs (n, 3)."""
        motion = small_motion(total(self.laws, Where.TRACKER, arrivals))
        turned = np.einsum("nij,nj->ni", motion[:, :3, :3], tcp)
        return np.asarray(turned + motion[:, :3, 3])

    def measure(
        self, arrivals: Arrivals, tracker: Floats, rng: np.random.Generator
    ) -> Floats:
        """Return noisy tracker readings (n, 3) in the arm base frame.

        Args:
            arrivals: What is measured.
            tracker: Where the tracker stands, (3,).
            rng: Random numbers of this campaign.
        """
        joints = rng.normal(size=arrivals.q.shape) * self.joint_noise
        readings = self.seen(arrivals, self.tcp(arrivals, joints))
        span = np.linalg.norm(readings - tracker, axis=1)
        sigma = self.tracker_noise[0] + self.tracker_noise[1] * span
        return np.asarray(readings + rng.normal(size=readings.shape) * sigma[:, None])

    def temperature(self, time: Floats, start: float) -> Floats:
        """Return the arm's temperature (n,) [deg C] at times (n,) [s]."""
        rise, constant = self.warming
        return np.asarray(start + rise * (1 - np.exp(-time / constant)))

    def without_noise(self) -> VirtualArm:
        """Return the same arm with perfect repeatability and a perfect tracker."""
        return replace(self, joint_noise=np.zeros(6), tracker_noise=(0.0, 0.0))
