"""Base tilt: the foundation, or the table, leans with the weight that hangs over it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from postproc.arrays import Floats
from postproc.model.carrier import carrier
from postproc.model.covariate import TILTING, varies
from postproc.model.effects.base_shift import rigid_columns, rigid_rotations
from postproc.model.effects.effect import (
    Candidate,
    Effect,
    Parameter,
    alternatives,
)
from postproc.model.effects.policies import SearchPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Driver, Term, Terms, about_axis, linear, move, weight
from postproc.robot.arm import GRAVITY, Arm
from postproc.robot.state import States

SCALE = 1e-8  # [rad/(N m)] softness of a usual foundation
LEAST = 1.0  # [kg] of an arm whose links are not known
DEEP = 0.5  # [m] below the base's origin that a table may turn about
PLACES = ("", "_elbow", "_wrist")  # of the moment, and of what is unsure of it


@dataclass(frozen=True)
class BaseTilt(Effect):
    """The base turns about its axes x and y by tilting moment / stiffness.

    The moment is that of the nominal links and of the payload; what is unsure of the
    links is taken to hang at the elbow and at the wrist. Of an arm that does not stand
    on a floor weight has a moment about z too, and the base may turn about it.

    Attributes:
        skew: Whether the stiff directions may lie askew of the base's axes, and what
            it turns about below its origin.
        unsure: Mass that may hang elsewhere [kg].
        twist: Whether the base turns about z too.
    """

    name: ClassVar[str] = "base_tilt"
    acts: ClassVar[tuple[tuple[str, str], ...]] = (("base turn", "moment"),)
    search_policy: ClassVar[SearchPolicy] = SearchPolicy.ALWAYS
    driven_by: ClassVar[str] = "torque"

    skew: bool = False
    unsure: float = 10.0
    twist: bool = False

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Take what is unsure of the arm's own weight."""
        return cls(unsure=uncertain_mass(arm), twist=not arm.stands)

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try a foundation along the base's axes, and any other, where weight moves."""
        if not any(map(varies, batch.loads.tilting.T)):
            return []
        unsure, twist = uncertain_mass(batch.arm), not batch.arm.stands
        members = [(cls(skew, unsure, twist), TILTING) for skew in (False, True)]
        return alternatives(members)

    def parameters(self) -> tuple[Parameter, ...]:
        """Name softness about the axes, and softness times unsure mass."""
        names, out = ["kx", "ky"], []
        names += ["kz"] if self.twist else []
        names += ["kxy"] if self.skew else []
        for name in names:
            out.append(Parameter(name, "rad/(N m)", SCALE, name, None, name != "kxy"))
            scale = SCALE * self.unsure
            out += [
                Parameter(name + place, "rad kg/(N m)", scale, name)
                for place in PLACES[1:]
            ]
        if self.skew:
            unit, scale = "m/(N m)", SCALE * DEEP
            out += [Parameter(f"h{a}", unit, scale, "pivot") for a in "xy"]
        return tuple(out)

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn the base by moments of weights that are scaled and moved."""
        sizes, turns = [float(k) for k in p], [f"base turn {a}" for a in "xyz"]
        count, out = len(PLACES), []
        for axis, turned in enumerate(turns if self.twist else turns[:2]):
            about, sizes = _moment(arm, sizes[:count], axis), sizes[count:]
            out.append(Term(move(carrier(turned)), linear(1.0), (about,)))
        if self.skew:
            both, (hx, hy) = sizes[:count], sizes[count:]
            for k, (shifted, h) in enumerate((("x", hx), ("y", -hy))):
                about, alone = (_moment(arm, s, 1 - k) for s in (both, (1.0, 0.0, 0.0)))
                out.append(Term(move(carrier(turns[k])), linear(1.0), (about,)))
                shift = move(carrier(f"base shift {shifted}"))
                out.append(Term(shift, linear(h), (alone,)))
        return out

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the TCP position, (n, 3, p)."""
        return self._leaning(batch, rigid_columns(batch))

    def rotation_columns(self, batch: ArmStates) -> Floats:
        """Differentiate the tool's rotation, (n, 3, p)."""
        return self._leaning(batch, rigid_rotations(batch))

    def _leaning(self, batch: ArmStates, moved: Floats) -> Floats:
        """Multiply six motions of the base (n, 3, 6) by the moments, (n, 3, p)."""
        about = _moments(batch)
        by = moved[:, :, 3:, None]
        axes = range(3 if self.twist else 2)
        out = [by[:, :, k] * about[:, None, k] for k in axes]
        if self.skew:
            about_x, about_y = about[:, None, 0], about[:, None, 1]
            out.append(by[:, :, 0] * about_y + by[:, :, 1] * about_x)
            out.append(moved[:, :, 0, None] * about_y[..., :1])
            out.append(-moved[:, :, 1, None] * about_x[..., :1])
        return np.concatenate(out, axis=2)


def uncertain_mass(arm: Arm) -> float:
    """Say how much of an arm's mass may hang elsewhere than its file says [kg]."""
    links = arm.file.links
    return LEAST if links is None else max(links.spread * arm.mass, LEAST)


def _moment(arm: Arm, sizes: Sequence[float], axis: int) -> Driver:
    """Return a moment of weight, and of what may hang at elbow and wrist, by sizes."""
    whole, elbow, wrist = sizes
    links = whole * arm.lumps
    links[1, 0] += elbow  # at the origins of D-H frames 2 and 4
    links[3, 0] += wrist
    return weight(arm, about_axis(0, axis), links, whole)


def _moments(batch: ArmStates) -> Floats:
    """Give the moments about x, y, z, and those of 1 kg at each place, (n, 3, 3)."""
    at = batch.arm.landmarks(batch.states.q, batch.states.tool)[:, :2]
    places = np.cross(at, GRAVITY * batch.arm.weight)  # (n, place, axis)
    own = batch.loads.tilting[:, None]
    return np.swapaxes(np.concatenate([own, places], axis=1), 1, 2)
