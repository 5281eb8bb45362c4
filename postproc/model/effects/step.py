"""Steps: something changes at one moment of a campaign, found on a grid of moments."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.model.effects.effect import Effect, Origin
from postproc.model.kinematics import ArmStates

STEPS = 48  # moments at which a step is tried
EDGE = 10  # rows before and after a step that must show it


def moments(batch: ArmStates) -> Floats:
    """List the places in the visit order at which a step is tried; none of few rows."""
    order = np.sort(batch.states.order)
    if len(order) < 3 * EDGE:
        return np.zeros(0)
    places = np.unique(np.linspace(EDGE, len(order) - EDGE, STEPS).astype(int))
    return np.asarray(order[places])


def moments_near(row: float, offsets: Floats, batch: ArmStates) -> Floats:
    """List the places near one, offsets (k,) in steps of `moments`.

    None is so near to an end that next to no row shows the step: what all rows but a
    few are off by was there before.
    """
    order = np.sort(batch.states.order)
    half = max(len(order) / STEPS, 1.0)
    near = np.searchsorted(order, row) + np.round(half * offsets).astype(int)
    return np.asarray(order[np.unique(np.clip(near, EDGE, len(order) - EDGE))])


@dataclass(frozen=True)
class CampaignStep(Effect):
    """Something that changes once, at one row.

    The rows after the step show the cell as it is now, so the step counts backwards:
    it moves the rows before it, and what is compensated is the state after it.

    Attributes:
        row: Place in the visit order of the first row after the step.
    """

    driven_by: ClassVar[str] = "order"
    at_one_row: ClassVar[bool] = True

    row: float = 0.0

    def refine(self, offsets: Floats, batch: ArmStates) -> list[Effect]:
        """Move the moment."""
        return [self.at_row(r) for r in moments_near(self.row, offsets, batch)]

    def at_row(self, row: float) -> Self:
        """Return the same step at another moment."""
        return replace(self, row=float(row))

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """Tell the moment."""
        return {"row": (float(self.row), "rows")}

    def belongs_to(self) -> Origin:
        """Say that it is the survey's: no program runs before the step."""
        return "setup"

    def before(self, batch: ArmStates) -> Bools:
        """Tell which rows come before the step, (n,)."""
        return np.asarray(batch.states.order < self.row)
