"""Effects that may be there, and that a model does not have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.model.effect_sum import Combination
from postproc.model.kinematics import ArmStates
from postproc.model.variance import parameter_covariance


@dataclass(frozen=True, eq=False)
class Doubt:
    """What effects add to the variance that may be there and are not compensated.

    Attributes:
        effects: The effects, of q parameters.
        covariance: Of the model's p parameters, and then of theirs, (p + q, p + q):
            the model's own share of it is what they have taken up of the effects.
    """

    effects: Combination
    covariance: Floats

    def get_settings(self, own: Bools) -> Doubt:
        """Return it for a model of some of the parameters, (p,)."""
        both = np.append(own, np.ones(len(self.effects.parameters), dtype=bool))
        return Doubt(self.effects, self.covariance[np.ix_(both, both)])

    def among(self, old: tuple[str, ...], new: tuple[str, ...]) -> Doubt:
        """Return it for a model of other parameters, by the names of both."""
        place = {name: k for k, name in enumerate(old)}
        more = len(self.effects.parameters)
        own = [place.get(name, -1) for name in new]
        at = np.array([*own, *range(len(old), len(old) + more)])
        known = np.outer(at >= 0, at >= 0)
        return Doubt(
            self.effects, np.where(known, self.covariance[np.ix_(at, at)], 0.0)
        )

    def rescale(self, factor: float) -> Doubt:
        """Multiply the covariance by a factor."""
        return Doubt(self.effects, factor * self.covariance)

    def error_covariance(self, own: Combination, at: ArmStates) -> Floats:
        """Return the covariance of the error, (n, 6) [m^2].

        Args:
            own: The model's effects, of p parameters.
            at: n states, with the kinematics taken at the parameters.
        """
        both = Combination((*own.effects, *self.effects.effects))
        return parameter_covariance(both, at, self.covariance)

    def variance(self, own: Combination, at: ArmStates) -> Floats:
        """Return the variance of the error, (n, 3) [m^2], see above."""
        return self.error_covariance(own, at)[:, :3]
