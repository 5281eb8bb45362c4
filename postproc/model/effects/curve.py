"""Curve: a free smooth function of any covariates, in any one direction."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product
from typing import ClassVar, Self

import numpy as np
from numpy.polynomial.legendre import legvander

from postproc.arrays import Floats
from postproc.model.carrier import carrier
from postproc.model.covariate import JOINTS, covariate
from postproc.model.effects.effect import (
    DRIVEN,
    FREE,
    Candidate,
    Effect,
    Family,
    Parameter,
    fade,
)
from postproc.model.effects.part_motion import CarriedEffect
from postproc.model.effects.policies import NamingPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Driver, TermLaw, law
from postproc.robot.arm import Arm

TERMS_ALONE, TERMS_OF_TWO, TERMS_OF_WHOLE = 16, 3, 5
LINEAR = ("temperature", "payload", "speed", "torque", "moment")  # beyond their ranges
WAYS = ("way",)
BEYOND = 0.3  # part of a range over which a curve goes on as a straight line
END = 0.05  # part of a range whose slope that is
HELD = ("temperature", "payload", "speed", "torque", "moment", "travel", "way")
ANGLES = tuple(f"joint {j}" for j in JOINTS)


@dataclass(frozen=True)
class Curve(CarriedEffect):
    """Error along one direction, a penalised curve of one or two covariates.

    The curve is a sum of Legendre polynomials over the covariate's range, whose prior
    falls with the square of their degree, as a penalty on curvature makes it.
    Of two covariates only what is no sum of two curves belongs to it, unless it is
    whole.

    Attributes:
        direction: The carrier that moves, see `carrier`.
        source: Names of one or two covariates.
        lower, upper: Their ranges, of a way 0 and its median. Outside, the curve of an
            angle fades to zero, and one of a load, a temperature or a speed goes on as
            a straight line.
        factor: Covariate that it is multiplied with, an arrival direction say, or "".
        whole: Whether functions of each of two covariates alone belong to it.
    """

    name: ClassVar[str] = "curve"
    renewed_by: ClassVar[frozenset[str]] = DRIVEN
    naming_policy: ClassVar[NamingPolicy] = NamingPolicy.UNEXPLAINED
    free: ClassVar[bool] = True

    source: tuple[str, ...] = ("joint 1",)
    lower: tuple[float, ...] = (-np.pi,)
    upper: tuple[float, ...] = (np.pi,)
    factor: str = ""
    whole: bool = False

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try pairs of joints, and what was before, at every joint.

        Curves of one covariate are cells of the table of causes, of any carrier.
        """
        pairs = list(combinations(ANGLES, 2))
        out = []
        for j in JOINTS:
            out += [cls._candidate(batch, f"joint {j}", pair) for pair in pairs]
            out += cls._by_what_was_before(batch, j)
        return out

    @classmethod
    def _by_what_was_before(cls, batch: ArmStates, joint: int) -> list[Candidate]:
        """Turn a joint by its last two reversals, or its side at the visit before."""
        where, out = f"joint {joint}", []
        both = (f"travel {joint}", f"loop {joint}")
        if all(not np.isnan(covariate(batch, name)).all() for name in both):
            out.append(cls._candidate(batch, where, both, signed=True, whole=True))
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
        batch: ArmStates,
        direction: str,
        source: tuple[str, ...],
        signed: bool = False,
        whole: bool = False,
    ) -> Candidate:
        """Make the candidate of some covariates in one direction."""
        moved = carrier(direction)
        factor = f"lambda {moved.link}" if signed else ""
        effect = cls.over(batch, direction, source, factor, whole)
        driver = " x ".join(source)
        label = f"lambda x {driver}" if signed else driver
        along = direction if moved.joint is None else None
        family = Family(cls.name, moved.joint, label, FREE, along)
        return Candidate(family, effect, driver, 0.0)

    @classmethod
    def over(
        cls,
        batch: ArmStates,
        direction: str,
        source: tuple[str, ...],
        factor: str,
        whole: bool,
    ) -> Self:
        """Make the curve over the surveyed ranges of its covariates."""
        values = [covariate(batch, name) for name in source]
        ends = [_ends(n, v) for n, v in zip(source, values, strict=True)]
        lower, upper = (tuple(e[k] for e in ends) for k in (0, 1))
        return cls(direction, source, lower, upper, factor, whole)

    def covariates(self) -> tuple[str, ...]:
        """Name the sources and the factor."""
        return (*self.source, self.factor) if self.factor else self.source

    def refine(self, offsets: Floats, batch: ArmStates) -> list[Effect]:
        """Make links heavier or lighter where a load drives it."""
        return [*self.vary_masses(offsets, batch)]

    def sentence(self, p: Floats, covariance: Floats) -> str:
        """Say place and drivers."""
        return f"{self.carrier.sentence()} by {self.driver()}, a curve"

    def _orders(self) -> list[tuple[int, ...]]:
        """List the degrees of every term."""
        if len(self.source) == 1:
            return [(k,) for k in range(1, TERMS_ALONE + 1)]
        if not self.whole:
            return list(product(range(1, TERMS_OF_TWO + 1), repeat=2))
        pairs = product(range(TERMS_OF_WHOLE + 1), repeat=2)
        return [k for k in pairs if 0 < sum(k) <= TERMS_OF_WHOLE]

    def law_parameters(self) -> tuple[Parameter, ...]:
        """Name the terms by their degrees."""
        return self._parameters

    @cached_property
    def _parameters(self) -> tuple[Parameter, ...]:
        """Name them once: a search asks for their number again and again."""
        si, scale = self.own_unit()
        what = f"{self.direction} by {' x '.join(self.source)}"
        what += f" times {self.factor}" if self.factor else ""
        return tuple(
            Parameter(
                f"{what} {'.'.join(map(str, k))}", si,
                scale / sum(i * i for i in k), what, self.carrier.joint,
            )
            for k in self._orders()
        )  # fmt: skip

    def write_law(
        self, arm: Arm, p: Floats
    ) -> tuple[TermLaw, tuple[Driver, ...], tuple[Driver, ...]]:
        """Write the curve as the core evaluates it, what drives it, and factors."""
        numbers = [float(len(self.source))]
        for name, low, high in zip(self.source, self.lower, self.upper, strict=True):
            beyond = BEYOND * name.startswith(LINEAR)
            kinds = name.startswith(WAYS), not name.startswith(HELD)
            numbers += [low, high, *kinds, beyond]
        for order, size in zip(self._orders(), p, strict=True):
            numbers += [*(*order, 0)[:2], size]
        by = tuple(self.drive(arm, name, unknown=np.nan) for name in self.source)
        times = (self.drive(arm, self.factor),) if self.factor else ()
        return law("curve", *numbers), by, times

    def shape(self, batch: ArmStates) -> Floats:
        """Evaluate the terms without their direction in space, (n, p)."""
        value, inside = np.ones((len(batch), len(self._orders()))), np.ones(len(batch))
        order = np.array(self._orders())
        for k, name in enumerate(self.source):
            low, high = self.lower[k], self.upper[k]
            x = self.look_up_driver(batch, name)
            if not name.startswith(HELD):
                inside *= np.nan_to_num(fade(x, np.array(low), np.array(high)))
            u = _place(name, np.nan_to_num(x), low, high)
            terms = _terms(u, int(order[:, k].max()), BEYOND * name.startswith(LINEAR))
            value *= terms[:, order[:, k]]
        return np.asarray(value * inside[:, None])

    def law_values(self, batch: ArmStates) -> Floats:
        """Evaluate the terms, with the factor if there is one, (n, p)."""
        shape = self.shape(batch)
        if self.factor:
            shape *= np.nan_to_num(self.look_up_driver(batch, self.factor))[:, None]
        return shape


def _terms(u: Floats, degree: int, beyond: float) -> Floats:
    """Evaluate Legendre polynomials over [0, 1], (n, degree + 1).

    Args:
        u: Where, (n,).
        degree: Of the last one.
        beyond: How far outside they go on as straight lines; from there on they keep
            their values.
    """
    inside = np.clip(u, 0.0, 1.0)
    terms = legvander(2.0 * inside - 1.0, degree)
    if beyond == 0.0:
        return np.asarray(terms)
    out = np.clip(u - inside, -beyond, beyond)[:, None]
    ends = legvander(np.array([-1.0, 2.0 * END - 1.0, 1.0 - 2.0 * END, 1.0]), degree)
    slope = np.where(out < 0.0, ends[1] - ends[0], ends[3] - ends[2]) / END
    values: Floats = terms + slope * out
    return values


def _ends(name: str, x: Floats) -> tuple[float, float]:
    """Return the range of a covariate, of a way 0 and its median."""
    if name.startswith(WAYS):
        return 0.0, float(np.nanmedian(x))
    return float(np.nanmin(x)), float(np.nanmax(x))


def _place(name: str, x: Floats, low: float, high: float) -> Floats:
    """Tell where in its range a covariate is, 0 to 1.

    Most ways since a reversal are short and a few are long: half of them lie below the
    middle.
    """
    if name.startswith(WAYS):
        return x / (x + max(high, 1e-12))
    return (x - low) / max(high - low, 1e-12)
