"""Refraction: air of uneven or unknown temperature bends and stretches the beam."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import varies
from postproc.model.effects.effect import Candidate, Parameter, alternatives
from postproc.model.effects.sighting import Sighting
from postproc.model.kinematics import ArmStates

BEND = 1e-6  # [1/m] 1 K a metre of height
STRETCH = 1e-6  # [1/K] of the air's refractive index
AWAY = 3.0  # [m] that a tracker usually stands from the base


@dataclass(frozen=True)
class Refraction(Sighting):
    """A beam that sags with the square of the range, or a range that is scaled.

    Attributes:
        form: "bend": the beam is bent downwards, so that its elevation errs by bend
            times its level way. "stretch": range error stretch * (T - reference) *
            range, where the temperature was recorded.
        reference: [deg C].
    """

    name: ClassVar[str] = "refraction"
    acts: ClassVar[tuple[tuple[str, str], ...]] = (("base turn", "joint"),)

    form: Literal["bend", "stretch"] = "bend"
    reference: float = 20.0

    @classmethod
    def propose_sighted(
        cls, batch: ArmStates, tracker: tuple[float, float, float] | None
    ) -> list[Candidate]:
        """Try a bend, and a range that follows a recorded temperature."""
        seen = cls(tracker) if tracker else cls(told=False)
        members, degrees = [(seen, "joint 2")], batch.states.temperature
        if varies(degrees):
            middle = float(np.mean(degrees))
            stretched = replace(seen, form="stretch", reference=middle)
            members.append((stretched, "temperature"))
        return alternatives(members)

    def requires(self) -> tuple[str, ...]:
        """Need the temperature that a range follows."""
        return ("temperature",) if self.form == "stretch" else ()

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the size; and where nobody told it, size times place of the tracker."""
        unit, scale = ("1/m", BEND) if self.form == "bend" else ("1/K", STRETCH)
        size = Parameter(self.form, unit, scale, self.form)
        unit = "1" if self.form == "bend" else "m/K"
        places = [
            Parameter(f"{self.form}_{a}", unit, scale * AWAY, "place") for a in "xyz"
        ]
        return (size,) if self.told else (size, *places)

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the reading, (n, 3, 1) or (n, 3, 4).

        What does not depend on where the arm is, or turns all of it, is left out of
        the columns of an unknown place: the tracker's registration holds it.
        """
        beam = self.beam(batch)
        none = np.zeros(len(beam))
        x, y, z = beam.T
        if self.form == "bend":
            own = np.column_stack([-x * z, -y * z, x * x + y * y])
            places = [(z, none, -2 * x), (none, z, -2 * y), (x, y, none)]
        else:
            warmer = np.nan_to_num(batch.states.temperature - self.reference)
            own, back = warmer[:, None] * beam, -warmer
            places = [(back, none, none), (none, back, none), (none, none, back)]
        if self.told:
            return own[:, :, None]
        return np.stack([own, *(np.column_stack(p) for p in places)], axis=2)
