"""Refraction: air of uneven or unknown temperature bends and stretches the beam."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import varies
from postproc.model.effects.effect import Candidate, Parameter, alternatives
from postproc.model.effects.sighting import Sighting
from postproc.model.kinematics import Batch

BEND = 1e-6  # [1/m] 1 K a metre of height
STRETCH = 1e-6  # [1/K] of the air's refractive index


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

    form: Literal["bend", "stretch"] = "bend"
    reference: float = 20.0

    @classmethod
    def sighted(
        cls, batch: Batch, tracker: tuple[float, float, float]
    ) -> list[Candidate]:
        """Try a bend, and a range that follows a recorded temperature."""
        members, degrees = [(cls(tracker), "joint 2")], batch.states.temperature
        if varies(degrees):
            middle = float(np.mean(degrees))
            members.append((cls(tracker, "stretch", middle), "temperature"))
        return alternatives(members)

    def requires(self) -> tuple[str, ...]:
        """Need the temperature that a range follows."""
        return ("temperature",) if self.form == "stretch" else ()

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the one size."""
        if self.form == "bend":
            return (Parameter("bend", "1/m", BEND, "bend"),)
        return (Parameter("stretch", "1/K", STRETCH, "stretch"),)

    def columns(self, batch: Batch) -> Floats:
        """Differentiate the reading, (n, 3, 1)."""
        beam = self.beam(batch)
        if self.form == "bend":
            x, y, z = beam.T
            return np.column_stack([-x * z, -y * z, x * x + y * y])[:, :, None]
        warmer = np.nan_to_num(batch.states.temperature - self.reference)
        return np.asarray((warmer[:, None] * beam)[:, :, None])
