"""Part motion: any small motion of a part by any law of what drives it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from postproc.arrays import Floats
from postproc.model.carrier import Carrier, carrier
from postproc.model.covariate import JOINTS, by_weight, covariate, unit
from postproc.model.effects.compliance import moments
from postproc.model.effects.effect import (
    DRIVEN,
    FREE,
    PART_MOTION,
    Effect,
    Family,
    Origin,
    Parameter,
)
from postproc.model.kinematics import ArmStates
from postproc.model.terms import (
    Driver,
    Term,
    TermLaw,
    Terms,
    constant,
    driver,
    law,
    move,
)
from postproc.robot.arm import Arm

TURN, SHIFT = 1e-4, 1e-4  # [rad], [m] prior size of a motion
ANEW = 3e-4  # [rad], [m] by which a part may sit otherwise than a model has it
PASSING = ("time", "order")
OF_STATE = ("temperature", "payload", "speed")
LOADS = ("torque", "moment")
CHARGED = 3.0  # nats for a moment of a link: odds of 20 to 1
UNSURE = 2.0  # times what is unsure of a link's moment that is tried at most
ARMS_OWN = ("torque", "moment", "lambda", "way", "payload", "speed")


def family_of(moved: Carrier, driver: str) -> Family:
    """Return the family of all that moves a part by a driver: no name has it."""
    along = None if moved.joint is not None else str(moved)
    return Family(PART_MOTION, moved.joint, driver, FREE, along)


@dataclass(frozen=True)
class CarriedEffect(Effect):
    """One carrier, moved by functions of covariates.

    Attributes:
        direction: The carrier, see `carrier`.
        loose: Whether its mean is fitted too: beside a given model, whose geometry
            holds what the mean was when that was made.
        heavier: Links whose first moments are others than in the arm file, where a
            load drives it: (link, by how much in its own frame [kg m]).
    """

    direction: str = "joint 1"
    loose: bool = field(default=False, kw_only=True)
    heavier: tuple[tuple[int, tuple[float, ...]], ...] = field(default=(), kw_only=True)

    @property
    def carrier(self) -> Carrier:
        """What moves."""
        return carrier(self.direction)

    @abstractmethod
    def covariates(self) -> tuple[str, ...]:
        """Name all covariates that it depends on."""

    @abstractmethod
    def law_parameters(self) -> tuple[Parameter, ...]:
        """Name the unknowns of its law."""

    @abstractmethod
    def law_values(self, batch: ArmStates) -> Floats:
        """Evaluate by how much each of them moves the carrier, (n, p)."""

    def look_up_driver(self, batch: ArmStates, name: str) -> Floats:
        """Look up what drives it, (n,): a load as the weights of the links make it."""
        value = covariate(batch, name)
        for link, more in self.heavier:
            per_moment = by_weight(batch, name)
            if per_moment is not None:
                value = value + per_moment[:, link - 1] @ np.array(more)
        return value

    def vary_masses(self, offsets: Floats, batch: ArmStates) -> list[Self]:
        """Make links heavier or lighter, in parts of what is unsure of their moments.

        Masses and centres of an arm file are known to a tenth or so, and a jump at a
        load shows where they are wrong.
        """
        load = next((n for n in self.covariates() if n.startswith(LOADS)), None)
        if load is None:
            return []
        return [
            self._heavier(link, axis, float(offset) * UNSURE * spread)
            for link in range(int(load.split()[1][0]), len(JOINTS) + 1)
            for _, spread in moments(batch.arm, link)[:1]
            for axis in range(3)
            for offset in offsets[::2]
            if offset
        ]

    def doubt(self) -> float:
        """Charge for every moment of a link that is another than in the arm file."""
        return CHARGED * sum(bool(m) for _, moment in self.heavier for m in moment)

    def _heavier(self, link: int, axis: int, more: float) -> Self:
        """Add to one first moment of a link [kg m]."""
        every = {own: list(old) for own, old in self.heavier}
        every.setdefault(link, [0.0, 0.0, 0.0])[axis] += more
        heavier = tuple((own, tuple(m)) for own, m in sorted(every.items()))
        return replace(self, heavier=heavier)

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the unknowns of its law, and its mean where that is fitted too."""
        own = self.law_parameters()
        if not self.loose:
            return own
        group = f"{own[0].group} mean"
        si = self.own_unit()[0]
        return (*own, Parameter(group, si, ANEW, group, self.carrier.joint))

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Move the carrier by the law, and by its mean where that is fitted."""
        moves = move(self.carrier)
        own = Term(moves, *self.write_law(arm, p[: len(p) - self.loose]))
        return [own, Term(moves, constant(p[-1]))] if self.loose else [own]

    @abstractmethod
    def write_law(
        self, arm: Arm, p: Floats
    ) -> tuple[TermLaw, tuple[Driver, ...], tuple[Driver, ...]]:
        """Write the law as the core evaluates it, what drives it, and factors."""

    def drive(self, arm: Arm, name: str, unknown: float = 0.0) -> Driver:
        """Return what a covariate is in the core, with other weights of links."""
        more = {link: np.array(by) for link, by in self.heavier}
        return driver(arm, name, more, unknown)

    def turning(self, batch: ArmStates) -> Floats:
        """Evaluate by how much each column moves the carrier, (n, p)."""
        values = self.law_values(batch)
        if not self.loose:
            return values
        return np.concatenate([values, np.ones((len(values), 1))], axis=1)

    def belongs_to(self) -> Origin:
        """Follow the covariates: what only a survey has is never compensated.

        Nor is what moves the base by anything that a tracker may follow too: it stands
        in that frame, and nobody knows which of the two moves. What the arm's load or
        direction drives is the arm's.
        """
        kinds = {name.partition(" ")[0] for name in self.covariates()}
        if not kinds.isdisjoint(PASSING):
            return "setup"
        if self.carrier.part == "base" and kinds.isdisjoint(ARMS_OWN):
            return "setup"
        return "arm" if kinds.isdisjoint(("temperature", "payload")) else "state"

    def requires(self) -> tuple[str, ...]:
        """Need the covariates that a program does not tell."""
        return tuple(name for name in self.covariates() if name in OF_STATE)

    def list_nonlinear_drivers(self) -> tuple[str, ...]:
        """List what drives it: its law may be any."""
        return self.requires()

    def has_mean(self) -> bool:
        """Return True for a joint's error."""
        return self.carrier.joint is not None

    def only_joint(self) -> int | None:
        """Tell from the carrier."""
        joint = self.carrier.joint
        return None if joint is None else joint - 1

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the TCP position, (n, 3, p)."""
        return self._along(self.carrier.move(batch), batch)

    def rotation_columns(self, batch: ArmStates) -> Floats | None:
        """Differentiate the tool's rotation, (n, 3, p)."""
        turned = self.carrier.turn(batch)
        return None if turned is None else self._along(turned, batch)

    def _along(self, axis: Floats, batch: ArmStates) -> Floats:
        """Multiply a direction per unit (n, 3) by what moves it, (n, 3, p)."""
        columns: Floats = axis[:, :, None] * self.turning(batch)[:, None, :]
        return columns

    def direction_slopes(self, batch: ArmStates, p: Floats) -> Floats | None:
        """Give the position error per unit of the direction that drives it."""
        sides = [n for n in self.covariates() if n.startswith("lambda")]
        if len(sides) != 1:
            return None
        ones = np.ones_like(batch.states.q)
        there, back = (self.displacement(batch.arriving(s), p) for s in (ones, -ones))
        slopes = np.zeros((len(batch), 3, 6))
        slopes[:, :, int(sides[0][-1]) - 1] = (there - back) / 2
        return slopes

    def driver(self) -> str:
        """Name all covariates, those before the last as its factors."""
        return " x ".join(reversed(self.covariates()))

    def own_unit(self) -> tuple[str, float]:
        """Return the unit of its motion, and its prior size."""
        turns = self.carrier.motion == "turn"
        return ("rad", TURN) if turns else ("m", SHIFT)


@dataclass(frozen=True)
class PartMotion(CarriedEffect):
    """A carrier moves by a law of one covariate, perhaps times another one.

    "linear": k (x - middle) / half; "harmonic n": a cos(n x) + b sin(n x); "step": -k
    below the middle, k from there on; "saturating": k tanh((x - middle) / half);
    "constant": k.

    Attributes:
        source: The covariate x.
        factor: Covariate that it is multiplied with, or "".
        law: As above.
        middle, half: Middle and half of the surveyed range of x; of a step where it
            is, of a saturating law where and over which way it bends.
        size: Largest value of the factor in the survey.
    """

    name: ClassVar[str] = PART_MOTION
    renewed_by: ClassVar[frozenset[str]] = DRIVEN

    source: str = "joint 1"
    factor: str = ""
    law: str = "linear"
    middle: float = 0.0
    half: float = 1.0
    size: float = 1.0

    @property
    def at_one_row(self) -> bool:  # type: ignore[override]
        """Whether it is a step in time, not one of what varies smoothly."""
        return self.law == "step" and self.source in PASSING

    def covariates(self) -> tuple[str, ...]:
        """Name the source and the factor."""
        own = () if self.law == "constant" else (self.source,)
        return (*own, self.factor) if self.factor else own

    def list_nonlinear_drivers(self) -> tuple[str, ...]:
        """List what drives it, but for what drives it along a line."""
        if self.law == "linear":
            return ()
        return tuple(name for name in (self.source,) if name in OF_STATE)

    def law_parameters(self) -> tuple[Parameter, ...]:
        """Name the size, of a harmonic those of cosine and sine."""
        si, scale = self.own_unit()
        what, joint = self.what(), self.carrier.joint
        names = (f"{what} cos", f"{what} sin") if self.order else (what,)
        return tuple(Parameter(n, si, scale, what, joint) for n in names)

    def what(self) -> str:
        """Say place, driver and law."""
        by = f"{self.factor} x {self.source}" if self.factor else self.source
        return f"{self.direction} by {by} {self.law}"

    @property
    def order(self) -> int:
        """Waves per radian of a harmonic, 0 of other laws."""
        kind, _, order = self.law.partition(" ")
        return int(order) if kind == "harmonic" else 0

    def law_values(self, batch: ArmStates) -> Floats:
        """Evaluate the law, (n, 1), of a harmonic (n, 2)."""
        value = self._law(np.nan_to_num(self.look_up_driver(batch, self.source)))
        if self.factor:
            value = (
                value * np.nan_to_num(self.look_up_driver(batch, self.factor))[:, None]
            )
            value /= self.size
        return value

    def write_law(
        self, arm: Arm, p: Floats
    ) -> tuple[TermLaw, tuple[Driver, ...], tuple[Driver, ...]]:
        """Write the law as the core evaluates it, what drives it, and factors."""
        sizes = (p / self.size if self.factor else p).tolist()
        times = (self.drive(arm, self.factor),) if self.factor else ()
        if self.law == "constant":
            return constant(sizes[0]), (), times
        by = (self.drive(arm, self.source),)
        if self.order:
            return law("wave", self.order, sizes[1], sizes[0]), by, times
        if self.law == "saturating":
            return law("bend", sizes[0], 0.0, self.middle, self.half), by, times
        return law(self.law, sizes[0], self.middle, self.half), by, times

    def _law(self, x: Floats) -> Floats:
        """Evaluate it at values of its covariate."""
        if self.order:
            turned = self.order * x
            return np.stack([np.cos(turned), np.sin(turned)], axis=1)
        return LAWS[self.law]((x - self.middle) / self.half)[:, None]

    def refine(self, offsets: Floats, batch: ArmStates) -> list[Effect]:
        """Move the place of a step or a bend, in parts of the range, and its width.

        Where a load drives it the weights of links are others, too, but for a linear
        law, which is hardly another one then.
        """
        weighed = [] if self.law == "linear" else self.vary_masses(offsets, batch)
        return [*self._move_place(offsets, batch), *weighed]

    def _move_place(self, offsets: Floats, batch: ArmStates) -> list[PartMotion]:
        """Move the place of a step or a bend, and its width."""
        if self.law not in PLACED:
            return []
        x = covariate(batch, self.source)
        step = float(np.ptp(x)) / (STEPS + 1)
        moved = [replace(self, middle=self.middle + float(o) * step) for o in offsets]
        if self.law == "step":
            return [*moved]
        wide = float(np.abs(offsets).max(initial=0.0))
        bends = [
            replace(cell, half=cell.half * 2.0**by)
            for cell in moved
            for by in (-wide, 0.0, wide)
        ]
        return [*bends, *(replace(cell, law="step") for cell in moved)]

    def amplitude(self, p: Floats, covariance: Floats) -> tuple[float, float] | None:
        """Return the size of a harmonic that turns, None of others."""
        return self._wave(p, covariance) if self.carrier.motion == "turn" else None

    def sentence(self, p: Floats, covariance: Floats) -> str:
        """Say it with its size, "link 3 turns about the x of its frame by .."."""
        told = self.carrier.sentence()
        if self.covariates():
            told += f" by {self.driver()}"
        shown, factor = SHOWN[self.own_unit()[0]]
        wave = self._wave(p, covariance)
        if wave is not None:
            size, error = wave[0] * factor, wave[1] * factor
            return f"{told}, a wave of order {self.order} of " + _size(
                size, error, shown
            )
        size, error = float(p[0]) * factor, float(covariance[0, 0]) ** 0.5 * factor
        if self.law in PLACED:
            at = f"{self.middle:.3g} {unit(self.source)}"
            return f"{told}, {PLACED[self.law]} at {at} of " + _size(
                2 * size, 2 * error, shown
            )
        if self.law == "linear":
            per = self.half * self.size
            shown += _per(self.factor, self.source)
            size, error = size / per, error / per
        return f"{told}, {_size(size, error, shown)}"

    def _wave(self, p: Floats, covariance: Floats) -> tuple[float, float] | None:
        """Return amplitude and standard error of a harmonic, None of other laws."""
        if not self.order:
            return None
        size = float(np.hypot(*p[:2]))
        along = p[:2] / max(size, 1e-300)
        return size, max(float(along @ covariance[:2, :2] @ along), 0.0) ** 0.5

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """Tell where a step is, and per how much of the covariate a size is."""
        what = unit(self.source)
        if self.law in PLACED:
            return {f"{self.law} at": (self.middle, what)}
        return {"per": (self.half, what)} if self.law == "linear" else {}


def _per(*drivers: str) -> str:
    """Say per what a size is, "/(N m rad)" of two drivers, nothing of numbers."""
    units = [unit(name) for name in drivers if name and unit(name) != "1"]
    text = " ".join(units)
    return f"/({text})" if len(units) > 1 else f"/{text}" if text else ""


LAWS: Mapping[str, Callable[[Floats], Floats]] = {
    "linear": lambda away: away,
    "step": lambda away: np.where(away < 0.0, -1.0, 1.0),
    "saturating": lambda away: np.tanh(away),
    "constant": lambda away: np.ones_like(away),
}  # of where a covariate is, in parts of half its range from the middle
PLACED = {"step": "a step", "saturating": "a bend"}  # laws of one place
SHOWN = {"rad": ("urad", 1e6), "m": ("um", 1e6)}  # units people read


def _size(value: float, error: float, unit_: str) -> str:
    """Write a size with its standard error."""
    return f"{value:.3g} +- {error:.2g} {unit_}"


STEPS = 15  # places of a step that are tried over a covariate's range
