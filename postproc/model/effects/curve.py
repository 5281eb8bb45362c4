"""Curve: a free smooth function of any covariates, in any one direction."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product
from typing import ClassVar, Self

import numpy as np
from numpy.polynomial.legendre import legvander

from postproc.arrays import Floats
from postproc.model.covariate import JOINTS, PLAIN, carrying, covariate, varies
from postproc.model.effects.effect import (
    FREE,
    Candidate,
    Effect,
    Family,
    Origin,
    Parameter,
    fade,
)
from postproc.model.kinematics import Batch

TURN, SHIFT = 1e-4, 1e-4  # [rad], [m]
TERMS_ALONE, TERMS_OF_TWO, TERMS_OF_WHOLE = 8, 3, 5
ANGLES = tuple(f"joint {j}" for j in JOINTS)
FRAMES = tuple(f"{frame} {axis}" for frame in ("base", "tool") for axis in "xyz")


@dataclass(frozen=True)
class Curve(Effect):
    """Error along one direction, a penalised curve of one or two covariates.

    The curve is a sum of Legendre polynomials over the covariate's range, whose prior
    falls with the square of their degree, as a penalty on curvature makes it.
    Of two covariates only what is no sum of two curves belongs to it, unless it is
    whole.

    Attributes:
        direction: "joint 3" turns joint 3; "base x" and "tool x" shift the TCP along
            an axis.
        source: Names of one or two covariates.
        lower, upper: Their ranges; outside, the curve fades to zero.
        signed: Whether it is multiplied by the joint's arrival direction.
        whole: Whether functions of each of two covariates alone belong to it.
    """

    name: ClassVar[str] = "curve"
    nameless: ClassVar[bool] = True
    free: ClassVar[bool] = True

    direction: str = "joint 1"
    source: tuple[str, ...] = ("joint 1",)
    lower: tuple[float, ...] = (-np.pi,)
    upper: tuple[float, ...] = (np.pi,)
    signed: bool = False
    whole: bool = False

    @classmethod
    def candidates(cls, batch: Batch) -> list[Candidate]:
        """Try every covariate and pair of joints, along every joint and frame axis."""
        passing = [name for name in PLAIN if varies(covariate(batch, name))]
        if "time" in passing and "order" in passing:
            passing.remove("order")  # they tell the same
        out = []
        for j in JOINTS:
            out += cls._plain_of_joint(batch, j, passing)
            out += cls._signed_of_joint(batch, j, passing)
            pairs = combinations(ANGLES, 2)
            out += [cls._candidate(batch, f"joint {j}", pair) for pair in pairs]
        for axis in FRAMES:
            out += [
                cls._candidate(batch, axis, (name,)) for name in (*passing, *ANGLES)
            ]
        return out

    @classmethod
    def _plain_of_joint(
        cls, batch: Batch, joint: int, passing: list[str]
    ) -> list[Candidate]:
        """Turn a joint whatever side it comes from."""
        torques = [f"torque {k}" for k in carrying(batch)]
        alone = [name for name in ANGLES if name != f"joint {joint}"]
        return [
            cls._candidate(batch, f"joint {joint}", (name,))
            for name in (*alone, *passing, *torques)
        ]

    @classmethod
    def _signed_of_joint(
        cls, batch: Batch, joint: int, passing: list[str]
    ) -> list[Candidate]:
        """Turn a joint this way or that with its side, or with what was before."""
        where, out = f"joint {joint}", []
        names = ["speed"] if "speed" in passing else []
        names += [f"torque {joint}"] if joint in carrying(batch) else []
        if varies(covariate(batch, f"travel {joint}")):
            names.append(f"travel {joint}")
            both = (f"travel {joint}", f"loop {joint}")  # the last two reversals
            if not np.isnan(covariate(batch, both[1])).all():
                out.append(cls._candidate(batch, where, both, signed=True, whole=True))
        names += [name for name in ANGLES if name != where]
        out += [cls._candidate(batch, where, (name,), signed=True) for name in names]
        before = (f"before {joint}",)
        known = covariate(batch, before[0])
        if len(np.unique(known[~np.isnan(known)])) > 1:
            out += [
                cls._candidate(batch, where, before, side) for side in (False, True)
            ]
        return out

    @classmethod
    def _candidate(
        cls,
        batch: Batch,
        direction: str,
        source: tuple[str, ...],
        signed: bool = False,
        whole: bool = False,
    ) -> Candidate:
        """Make the candidate of some covariates in one direction."""
        effect = cls.over(batch, direction, source, signed, whole)
        kind, _, which = direction.partition(" ")
        joint = int(which) if kind == "joint" else None
        driver = " x ".join(source)
        label = f"lambda x {driver}" if signed else driver
        along = direction if joint is None else None
        family = Family(cls.name, joint, label, FREE, along)
        return Candidate(family, effect, driver, 0.0)

    @classmethod
    def over(
        cls,
        batch: Batch,
        direction: str,
        source: tuple[str, ...],
        signed: bool,
        whole: bool,
    ) -> Self:
        """Make the curve over the surveyed ranges of its covariates."""
        values = [covariate(batch, name) for name in source]
        lower = tuple(float(np.nanmin(v)) for v in values)
        upper = tuple(float(np.nanmax(v)) for v in values)
        return cls(direction, source, lower, upper, signed, whole)

    def belongs_to(self) -> Origin:
        """Follow the covariate: what only a survey has is never compensated.

        Nor is what lives along an axis of the base: the tracker stands in that frame,
        and nobody knows whether the arm or the tracker errs.
        """
        passes = any(name in ("time", "order") for name in self.source)
        if passes or self.direction.startswith("base"):
            return "setup"
        states = any(name in ("temperature", "payload") for name in self.source)
        return "state" if states else "arm"

    def requires(self) -> tuple[str, ...]:
        """Need the covariates that a program does not tell."""
        told = ("temperature", "payload", "speed")
        return tuple(name for name in self.source if name in told)

    def _orders(self) -> list[tuple[int, ...]]:
        """List the degrees of every term."""
        if len(self.source) == 1:
            return [(k,) for k in range(1, TERMS_ALONE + 1)]
        if not self.whole:
            return list(product(range(1, TERMS_OF_TWO + 1), repeat=2))
        pairs = product(range(TERMS_OF_WHOLE + 1), repeat=2)
        return [k for k in pairs if 0 < sum(k) <= TERMS_OF_WHOLE]

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the terms by their degrees."""
        kind, _, which = self.direction.partition(" ")
        turns = kind == "joint"
        scale, unit = (TURN, "rad") if turns else (SHIFT, "m")
        what = f"{self.direction} by {' x '.join(self.source)}"
        what += " signed" if self.signed else ""
        return tuple(
            Parameter(
                f"{what} {'.'.join(map(str, k))}", unit,
                scale / sum(i * i for i in k), what, int(which) if turns else None,
            )
            for k in self._orders()
        )  # fmt: skip

    def shape(self, batch: Batch) -> Floats:
        """Evaluate the terms without their direction in space, (n, p)."""
        value, inside = np.ones((len(batch), len(self._orders()))), np.ones(len(batch))
        order = np.array(self._orders())
        for k, name in enumerate(self.source):
            low, high = self.lower[k], self.upper[k]
            x = covariate(batch, name)
            inside *= np.nan_to_num(fade(x, np.array(low), np.array(high)))
            u = np.clip((np.nan_to_num(x) - low) / max(high - low, 1e-12), 0, 1)
            terms = legvander(2.0 * u - 1.0, int(order[:, k].max()))
            value *= terms[:, order[:, k]]
        return np.asarray(value * inside[:, None])

    def has_mean(self) -> bool:
        """Return True for a curve of a joint's error."""
        return self.only_joint() is not None

    def only_joint(self) -> int | None:
        """Tell from the direction."""
        kind, _, which = self.direction.partition(" ")
        return int(which) - 1 if kind == "joint" else None

    def turning(self, batch: Batch) -> Floats:
        """Evaluate the terms, with the joint's arrival direction if signed, (n, p)."""
        shape, joint = self.shape(batch), self.only_joint()
        if self.signed and joint is not None:
            shape *= batch.states.direction[:, joint, None]
        return shape

    def columns(self, batch: Batch) -> Floats:
        """Differentiate the TCP position, (n, 3, p)."""
        return self._along(batch, self._axis(batch))

    def rotation_columns(self, batch: Batch) -> Floats | None:
        """Differentiate the tool's rotation, (n, 3, p)."""
        kind, _, which = self.direction.partition(" ")
        if kind != "joint":
            return None
        return self._along(batch, batch.angular[:, :, int(which) - 1])

    def _along(self, batch: Batch, axis: Floats) -> Floats:
        """Multiply a direction per unit (n, 3) by the terms, (n, 3, p)."""
        columns: Floats = axis[:, :, None] * self.turning(batch)[:, None, :]
        return columns

    def _axis(self, batch: Batch) -> Floats:
        """Return the direction's displacement per unit, (n, 3)."""
        kind, _, which = self.direction.partition(" ")
        if kind == "joint":
            return np.asarray(batch.jacobian[:, :, int(which) - 1])
        k = "xyz".index(which)
        if kind == "tool":
            return np.asarray(batch.walk.flange[:, :, k])
        return np.tile(np.eye(3)[k], (len(batch), 1))
