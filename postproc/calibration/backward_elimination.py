"""Whether effects are needed: the evidence with them and without."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.calibration.evidence import Normal, highest
from postproc.calibration.regression import Fit, beside
from postproc.model.effects.effect import Effect

ENOUGH = 3.0  # nats that an effect must be worth: 20 to 1
SURE = 6.0  # nats that what is looked for last must be worth: 400 to 1
STEPS = 12  # of the search for prior scales, which start near their best


def keep_needed(
    fitted: Fit,
    always: tuple[Effect, ...],
    aside: tuple[Effect, ...] = (),
    enough: float = ENOUGH,
) -> tuple[Effect, ...]:
    """Drop effects one after the other until each that is left is needed.

    Args:
        fitted: A fit of all effects in question.
        always: Effects that are not in question.
        aside: Others that are not, and whose prior scales are not chosen anew.
        enough: Evidence that each must be worth [nats], besides what the effect asks.
    """
    weighing = _Weighing.of(fitted, aside)
    kept = [e for e in fitted.combination.effects if e not in aside]
    asked = [e for e in kept if e not in always]
    present = np.ones(len(weighing.owner), dtype=bool)
    now = weighing.evidence(present)
    while found := weighing.least_needed(asked, present, now, enough):
        effect, present, now = found
        kept.remove(effect)
        asked.remove(effect)
    return tuple(e for e in fitted.combination.effects if e in kept or e in aside)


@dataclass(frozen=True, eq=False)
class _Weighing:
    """A regression of which columns may go.

    Attributes:
        normal: Its sums, linearised at a fit.
        group: Prior group of every column, (p,).
        log_scale: Log factors on the prior scales of all groups, to begin with.
        owner: Effect of every column, (p,).
    """

    normal: Normal
    group: Ints
    log_scale: Floats
    owner: tuple[Effect, ...]

    @classmethod
    def of(cls, fitted: Fit, aside: tuple[Effect, ...]) -> _Weighing:
        """Take a fit; the columns of effects `aside` keep their prior scales."""
        c, normal, group = fitted.combination, fitted.normal(), fitted.group
        owner = tuple(e for e in c.effects for _ in e.parameters())
        out = np.array([e in aside for e in owner], dtype=bool)
        if not out.any():
            return cls(normal, group, fitted.log_scale, owner)
        s = np.exp(fitted.log_scale)[group[out]]
        rest = normal.marginalise(out, s)
        owner = tuple(e for e in owner if e not in aside)
        return cls(rest, group[~out], fitted.log_scale, owner)

    def least_needed(
        self, asked: list[Effect], present: Bools, now: float, enough: float
    ) -> tuple[Effect, Bools, float] | None:
        """Find the effect that is missed least, what is left, and the evidence then.

        Returns:
            None where each is worth enough.
        """
        best, most = None, 0.0  # by how much evidence one is worth too little
        for effect in asked:
            without = present & np.array([e is not effect for e in self.owner])
            required = enough + effect.least_evidence()
            found = self.evidence(without, now - required + most)
            if found > now - required + most:
                best, most = (effect, without, found), found - now + required
        return best

    def evidence(self, present: Bools, least: float = -np.inf) -> float:
        """Log evidence of some of the columns, prior scales chosen anew.

        It is found only roughly where it is far below `least`.
        """
        part = Normal(
            self.normal.gram[np.ix_(present, present)],
            self.normal.moment[present],
            self.normal.square,
            self.normal.log_noise,
            self.normal.rows,
        )
        used, group = np.unique(self.group[present], return_inverse=True)
        return highest(part, group, self.log_scale[used], STEPS, least)


def worth(found: Fit, kept: tuple[Effect, ...]) -> float:
    """Weigh the effects of a fit against others on the same rows [nats]."""
    own = found.combination.effects
    both = beside(found, (*own, *(e for e in kept if e not in own)))
    weighing = _Weighing.of(both, ())
    with_, instead = (
        weighing.evidence(np.array([e in some for e in weighing.owner]))
        for some in (own, kept)
    )
    return with_ - instead
