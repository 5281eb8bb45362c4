"""Tracker drift: the tracker's stand moves slowly while it measures."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, Self

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.base_shift import AXES, rigid_columns, rigid_rotations
from postproc.model.effects.effect import (
    Candidate,
    Cells,
    Effect,
    Origin,
    Parameter,
    alternatives,
    cells_in_time,
)
from postproc.model.effects.policies import FitPolicy, SearchPolicy
from postproc.model.effects.step import moments
from postproc.model.kinematics import ArmStates
from postproc.robot.arm import Arm
from postproc.robot.state import States

SHIFT, TURN = 3e-5, 1e-5  # [m], [rad]
TERMS = 3
Clock = Literal["time", "order", "unknown"]


@dataclass(frozen=True)
class TrackerDrift(Effect):
    """A slow rigid motion of the tracker's frame, 0 when it was registered.

    Motion is a polynomial in the share u of the campaign that has passed, u and
    u (1 - u) and so on, later terms expected to be smaller.

    Attributes:
        start: When the tracker was registered, [s] or rows.
        duration: Length of the campaign, [s] or rows.
        clock: "time", or "order" where no time was recorded; "unknown" of rows whose
            moment is: then the motion is its mean over the campaign.
    """

    name: ClassVar[str] = "tracker_drift"
    search_policy: ClassVar[SearchPolicy] = SearchPolicy.ALWAYS
    driven_by: ClassVar[str] = "time"
    fit_policy: ClassVar[FitPolicy] = FitPolicy.IF_EVIDENT
    cells: ClassVar[Cells] = cells_in_time("base", "linear", "curve")

    start: float = 0.0
    duration: float = 1.0
    clock: Clock = "time"

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Take the recorded time, or else the visit order."""
        clock: Clock = "order" if np.isnan(states.time).any() else "time"
        passed = getattr(states, clock)
        if len(passed) == 0:
            return cls()
        return cls(float(passed.min()), max(float(np.ptp(passed)), 1e-9), clock)

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try it where the campaign is long enough to tell it from a step."""
        drift = cls.propose(batch.arm, batch.states)
        return alternatives([(drift, drift.clock)]) if len(moments(batch)) else []

    def belongs_to(self) -> Origin:
        """Say that it is the set-up's."""
        return "setup"

    def refers_to(self) -> str:
        """Name the start, when the tracker was registered."""
        return (
            "the tracker as it stood at the first row, readings without a clock for "
            "its mean over the survey. If it is the arm that passes, rows on fixed "
            "points (column reference) tell"
        )

    def parameters(self) -> tuple[Parameter, ...]:
        """Name shift and turn of every term."""
        out = []
        for term in range(TERMS):
            part = 0.5**term
            for a in AXES:
                out.append(Parameter(f"{a}_{term + 1}", "m", SHIFT * part, "drift"))
            for a in AXES:
                out.append(Parameter(f"r{a}_{term + 1}", "rad", TURN * part, "drift"))
        return tuple(out)

    def without_clock(self, known: Collection[str]) -> Self:
        """Take its mean over the campaign where the rows lack its clock."""
        return self if self.clock in known else replace(self, clock="unknown")

    def moment_variance(self, batch: ArmStates, p: Floats) -> Floats | None:
        """Sum the spread of its terms over the campaign, (n, 3) [m^2]."""
        if self.clock != "unknown":
            return None
        spread = np.cov(_terms(MOMENTS), bias=True)
        moved = rigid_columns(batch) @ p.reshape(TERMS, 6).T  # (n, 3, terms)
        return np.asarray(np.einsum("nik,kl,nil->ni", moved, spread, moved))

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the TCP position, (n, 3, p)."""
        return self.in_time(self._read_clock(batch), rigid_columns(batch))

    def rotation_columns(self, batch: ArmStates) -> Floats:
        """Differentiate the tool's rotation, (n, 3, p)."""
        return self.in_time(self._read_clock(batch), rigid_rotations(batch))

    def _read_clock(self, batch: ArmStates) -> Floats:
        """Return what the clock shows, (n,) [s] or rows, NaN where it is unknown."""
        if self.clock == "unknown":
            return np.full(len(batch), np.nan)
        passed: Floats = getattr(batch.states, self.clock)
        return passed

    def in_time(self, passed: Floats, moved: Floats) -> Floats:
        """Multiply six motions (n, 3, 6) by every term, (n, 3, p).

        Args:
            passed: What the clock shows, (n,) [s] or rows; NaN: the mean.
            moved: The motions.
        """
        u = np.clip((passed - self.start) / self.duration, 0.0, 1.0)
        mean = _terms(MOMENTS).mean(axis=1)
        terms = np.where(np.isnan(u), mean[:, None], _terms(u))
        return np.concatenate([moved * t[:, None, None] for t in terms], axis=2)


MOMENTS = np.linspace(0.0, 1.0, 101)  # of a campaign, as shares of it


def _terms(u: Floats) -> Floats:
    """Evaluate the terms of the motion at shares u (n,) of the campaign, (3, n)."""
    bow = 4.0 * u * (1.0 - u)
    return np.stack([u, bow, bow * (1.0 - 2.0 * u) * 1.5])
