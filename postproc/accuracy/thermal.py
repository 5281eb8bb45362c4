"""Thermal growth: warm links are longer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.batch import Batch
from postproc.accuracy.effect import Effect, Origin, Parameter
from postproc.robot.arm import Arm
from postproc.robot.state import States

Array = NDArray[np.float64]

STEEL = 12e-6  # [1/K] linear expansion
WARM_UP = 10.0  # [K] usual rise inside an arm that starts cold
UNSURE = 0.4  # share by which links differ from the common growth
SHORT = 1e-3  # [m] a link without length does not grow


@dataclass(frozen=True)
class Thermal(Effect):
    """Every link grows in proportion to its lengths, with the temperature or in time.

    Attributes:
        links: Links that have a length.
        form: "temperature": growth alpha * (T - reference). "time": growth
            g * (1 - exp(-t / time_constant)) - g, 0 when the arm is warm.
        reference: [deg C].
        time_constant: [s].
    """

    name: ClassVar[str] = "thermal"
    origin: ClassVar[Origin] = "state"

    links: tuple[int, ...] = (1, 2, 3, 4, 6)
    form: Literal["temperature", "time"] = "temperature"
    reference: float = 20.0
    time_constant: float = 3600.0

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Grow with the recorded temperature, or else in time."""
        links = links_with_length(arm)
        if not np.isnan(states.temperature).all():
            return cls(links, reference=float(np.nanmean(states.temperature)))
        last = float(np.nanmax(states.time, initial=1.0))
        return cls(links, form="time", time_constant=last / 4)

    def requires(self) -> tuple[str, ...]:
        """Need the temperature; a warm-up of unknown time is over."""
        return ("temperature",) if self.form == "temperature" else ()

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the common growth and every link's deviation from it."""
        if self.form == "temperature":
            name, unit, scale = "alpha", "1/K", STEEL
        else:
            name, unit, scale = "growth", "m/m", STEEL * WARM_UP
        group = "expansion" if name == "alpha" else f"over {self.time_constant:.4g}"
        each = [
            Parameter(f"{name}{k}", unit, UNSURE * scale, group) for k in self.links
        ]
        return (Parameter(name, unit, scale, group), *each)

    def warmth(self, batch: Batch) -> Array:
        """Return temperature above the reference [K], or share of the warm-up, (n,)."""
        if self.form == "temperature":
            return np.nan_to_num(batch.states.temperature - self.reference)
        warm = -np.exp(-np.maximum(batch.states.time, 0.0) / self.time_constant)
        return np.nan_to_num(warm)

    def columns(self, batch: Batch) -> Array:
        """Differentiate the TCP position, (n, 3, p)."""
        w, dh = batch.walk, batch.arm.dh
        lengths = [
            dh.a[k - 1] * w.link[:, k - 1] + dh.d[k - 1] * w.turn[:, k - 1]
            for k in self.links
        ]
        each = np.stack(lengths, axis=2)
        all_links = each.sum(axis=2, keepdims=True)
        warmth = self.warmth(batch)[:, None, None]
        return np.concatenate([all_links, each], axis=2) * warmth


def links_with_length(arm: Arm) -> tuple[int, ...]:
    """List the links that can grow."""
    size = np.hypot(arm.dh.a, arm.dh.d)
    return tuple(int(k) + 1 for k in np.flatnonzero(size > SHORT))
