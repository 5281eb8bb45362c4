"""Thermal growth: warm links are longer."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, Self

import numpy as np

from postproc.arrays import Floats
from postproc.model.carrier import carrier
from postproc.model.covariate import varies, varies_enough
from postproc.model.effects.effect import (
    Candidate,
    Effect,
    Origin,
    Parameter,
    alternatives,
)
from postproc.model.effects.policies import FitPolicy, SearchPolicy
from postproc.model.effects.step import moments
from postproc.model.effects.tracker_drift import TrackerDrift
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Term, Terms, law, linear, move, state_value
from postproc.robot.arm import Arm
from postproc.robot.state import States

STEEL = 12e-6  # [1/K] linear expansion
WARM_UP = 10.0  # [K] usual rise inside an arm that starts cold
UNSURE = 0.7  # share by which a length differs from the common growth
SHORT = 1e-3  # [m] what has no length does not grow
SOON = 1200.0  # [s] in which no arm warms up enough to show
WARM_UPS = (0.1, 0.2, 0.4, 0.8)  # of the campaign's length: time constants tried
DOUBT = (
    ": it may be tracker_drift, so it is not compensated. Rows on monuments (column "
    "reference) would separate the two"
)


@dataclass(frozen=True)
class Thermal(Effect):
    """Every link grows in proportion to its lengths, with the temperature or in time.

    Attributes:
        lengths: Names a1 .. d6 of the D-H lengths that grow.
        form: "temperature": growth alpha * (T - reference). "time": growth
            g * (level - exp(-(t - start) / time_constant)).
        reference: [deg C].
        time_constant: [s], or rows.
        start: When the arm was cold [s], or the row.
        clock: What t is: "order" where no time was recorded.
        told: Whether readings of fixed points say that it is not the tracker's drift.
        level: Share of the warm-up that is still to come in the state that predictions
            are for: 0 is the warm arm.
    """

    name: ClassVar[str] = "thermal"
    acts: ClassVar[tuple[tuple[str, str], ...]] = (
        ("link shift", "temperature"),
        ("link shift", "time"),
    )
    search_policy: ClassVar[SearchPolicy] = SearchPolicy.ALWAYS
    driven_by: ClassVar[str] = "temperature"
    fit_policy: ClassVar[FitPolicy] = FitPolicy.IF_EVIDENT

    lengths: tuple[str, ...] = ("a1", "d1", "a2", "a3", "d4", "d6")
    form: Literal["temperature", "time"] = "temperature"
    reference: float = 20.0
    time_constant: float = 3600.0
    start: float = 0.0
    clock: Literal["time", "order", "unknown"] = "time"
    told: bool = False
    level: float = 0.0

    @classmethod
    def may_show(cls, states: States) -> bool:
        """Tell whether a temperature varies, or else a time long enough to warm up."""
        if not np.isnan(states.temperature).all():
            return varies_enough(states, cls.driven_by)
        return varies(states.time) and float(np.ptp(states.time)) > SOON

    @classmethod
    def may_be_searched(cls, states: States) -> bool:
        """Tell it of rows without times, too: their order tells what passes."""
        return cls.may_show(states) or not varies(states.time)

    @classmethod
    def may_show_alone(cls, states: States) -> bool:
        """Tell it of shorter times, too: what passes with them is the arm's."""
        return bool(cls.may_show(states) or np.isnan(states.temperature).all())

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Grow with the recorded temperature, or else in time."""
        lengths = growing(arm)
        if not np.isnan(states.temperature).all():
            return cls._by_temperature(lengths, states)
        return cls._warming(lengths, states, WARM_UPS[1])

    @classmethod
    def _by_temperature(cls, lengths: tuple[str, ...], states: States) -> Self:
        """Grow with the temperature, from the survey's mean."""
        return cls(lengths, reference=float(np.nanmean(states.temperature)))

    @classmethod
    def _warming(cls, lengths: tuple[str, ...], states: States, part: float) -> Self:
        """Warm up in time over a part of the campaign, in rows where none is known."""
        clock: Literal["time", "order", "unknown"] = (
            "time" if varies(states.time) else "order"
        )
        passed = getattr(states, clock)
        span = max(float(np.ptp(passed)), 1.0) if len(passed) else 1.0
        start = float(passed.min()) if len(passed) else 0.0
        return cls(
            lengths, form="time", time_constant=part * span, start=start, clock=clock
        )

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try growth with the recorded temperature, and along a warm-up."""
        lengths, states = growing(batch.arm), batch.states
        members: list[tuple[Effect, str]] = []
        if varies(states.temperature):
            members.append((cls._by_temperature(lengths, states), "temperature"))
        if len(moments(batch)):
            warm = [cls._warming(lengths, states, part) for part in WARM_UPS]
            members += [(effect, effect.clock) for effect in warm]
        return alternatives(members)

    def refine(self, offsets: Floats, batch: ArmStates) -> list[Effect]:
        """Change how fast the arm warms up."""
        if self.form == "temperature":
            return []
        each = [float(self.time_constant * 2.0**x) for x in offsets]
        return [replace(self, time_constant=c) for c in each]

    def readable(
        self, batch: ArmStates, without: Collection[str]
    ) -> tuple[Effect, str] | None:
        """Follow the temperature where that was recorded and the tracker may drift."""
        if self.form == "temperature" or not varies(batch.states.temperature):
            return None
        if TrackerDrift.name in without:
            return None
        return self._by_temperature(self.lengths, batch.states), "temperature"

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """Tell how fast the arm warms up."""
        if self.form == "temperature":
            return {}
        unit = "s" if self.clock == "time" else "rows"
        return {"time_constant": (float(self.time_constant), unit)}

    def attribute_drift(self, told: bool, batch: ArmStates) -> Effect:
        """Refer to the end of the survey where it is the arm's, else to its mean.

        Nothing was measured of a warmer arm than at the end. What may as well be the
        tracker's moves no prediction away from the mean of the rows, which is where
        they are without it.
        """
        if self.form == "temperature":
            return self
        warmth = replace(self, level=0.0).warmth(batch)
        level = -float(warmth.max() if told else warmth.mean())
        return replace(self, told=told, level=level)

    def without_clock(self, known: Collection[str]) -> Self:
        """Take the state that it refers to where the rows lack its clock."""
        if self.clock in known or self.belongs_to() != "setup":
            return self
        return replace(self, clock="unknown")

    def moment_variance(self, batch: ArmStates, p: Floats) -> Floats | None:
        """Spread it between cold and warm, (n, 3) [m^2], where it is the survey's."""
        if self.clock != "unknown":
            return None
        return np.square(self._grow(batch) @ p) / 12.0  # uniform between 0 and 1

    def belongs_to(self) -> Origin:
        """Say that it is of the state: the cell declares the temperature.

        A warm-up that only the order of rows tells is the survey's: programs run warm.
        One in time may be the tracker's drift where no fixed point tells.
        """
        if self.form == "temperature" or (self.told and self.clock == "time"):
            return "state"
        return "setup"

    def refers_to(self) -> str:
        """Name the state between cold and warm of a warm-up in time."""
        if self.form == "temperature":
            return ""
        if self.told:
            return "the arm as warm as at the end"
        return ("the warm arm" if self.level == 0.0 else "the survey's mean") + DOUBT

    def requires(self) -> tuple[str, ...]:
        """Need the temperature; a warm-up of unknown time is over."""
        return ("temperature",) if self.form == "temperature" else ()

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the common growth and every length's deviation from it."""
        if self.form == "temperature":
            name, unit, scale = "alpha", "1/K", STEEL
        else:
            name, unit, scale = "growth", "m/m", STEEL * WARM_UP
        group = "expansion" if name == "alpha" else f"over {self.time_constant:.4g}"
        each = [
            Parameter(f"{name}_{length}", unit, UNSURE * scale, group)
            for length in self.lengths
        ]
        return (Parameter(name, unit, scale, group, positive=True), *each)

    def warmth(self, batch: ArmStates) -> Floats:
        """Return temperature above the reference [K], or share of the warm-up, (n,)."""
        if self.form == "temperature":
            return np.nan_to_num(batch.states.temperature - self.reference)
        if self.clock == "unknown":
            return np.zeros(len(batch))
        passed: Floats = getattr(batch.states, self.clock)
        since = np.maximum(passed - self.start, 0.0)
        warm = self.level - np.exp(-since / self.time_constant)
        return np.nan_to_num(warm)

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Let every length grow with what drives it."""
        each = zip(self.lengths, p[1:], strict=True)
        return [self._grow_one(arm, name, float(p[0] + own)) for name, own in each]

    def _grow_one(self, arm: Arm, name: str, by: float) -> Term:
        """Let a length grow, along the axis on which it lies."""
        kind, joint = name[0], int(name[1])
        if kind == "d":
            part = "base" if joint == 1 else f"link {joint}"
            along, length = carrier(f"{part} shift z"), arm.dh.d[joint - 1]
        else:
            part = "tool" if joint == 6 else f"link {joint + 1}"
            along, length = carrier(f"{part} shift x"), arm.dh.a[joint - 1]
        size = float(length * by)
        if self.form == "temperature":
            driver = state_value("temperature", unknown=self.reference)
            return Term(move(along), linear(size, self.reference), (driver,))
        warming = law("warming", size, self.level, self.start, self.time_constant)
        return Term(move(along), warming, (state_value(self.clock, unknown=np.nan),))

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the TCP position, (n, 3, p)."""
        return self._grow(batch) * self.warmth(batch)[:, None, None]

    def _grow(self, batch: ArmStates) -> Floats:
        """Differentiate the TCP position by whole growth, (n, 3, p)."""
        each = np.stack([self._length(batch, name) for name in self.lengths], axis=2)
        every = each.sum(axis=2, keepdims=True)
        return np.concatenate([every, each], axis=2)

    def _length(self, batch: ArmStates, name: str) -> Floats:
        """Differentiate the TCP position by the growth of one length, (n, 3) [m]."""
        kind, joint = name[0], int(name[1]) - 1
        if kind == "a":
            return np.asarray(batch.arm.dh.a[joint] * batch.walk.link[:, joint])
        return np.asarray(batch.arm.dh.d[joint] * batch.walk.turn[:, joint])


def growing(arm: Arm) -> tuple[str, ...]:
    """Name the D-H lengths that are long enough to grow."""
    sizes = {"a": np.abs(arm.dh.a), "d": np.abs(arm.dh.d)}
    return tuple(
        f"{kind}{j + 1}" for j in range(6) for kind in "ad" if sizes[kind][j] > SHORT
    )
