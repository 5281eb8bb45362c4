"""A candidate: one effect, with all its settings, that a residual may be due to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import covariate
from postproc.model.effects.effect import Effect
from postproc.model.kinematics import Batch

NAMED, FREE = 0, 1


@dataclass(frozen=True)
class Family:
    """What a person calls one cause: candidates of a family differ in settings only.

    Attributes:
        effect: Name of the effect.
        joint: Joint 1 to 6 that it acts on, or None.
        driver: What drives it where that is part of the name (``joint 5`` of a
            coupling, the covariates of a curve), or None.
        tier: NAMED for physics, FREE for functions that may have any shape.
    """

    effect: str
    joint: int | None
    driver: str | None
    tier: int

    def __str__(self) -> str:
        where = "" if self.joint is None else f" of joint {self.joint}"
        by = "" if self.driver is None else f" by {self.driver}"
        return f"{self.effect}{where}{by}"


@dataclass(frozen=True)
class Candidate:
    """One effect to try.

    Attributes:
        family: Its family.
        effect: The effect with its settings.
        source: Covariate that reveals it, for the report.
        log_prior: Log of its share of the family: a grid shares what the family has.
    """

    family: Family
    effect: Effect
    source: str
    log_prior: float

    @cached_property
    def width(self) -> int:
        """Number of columns."""
        return len(self.effect.parameters())

    @cached_property
    def names(self) -> frozenset[str]:
        """Names of its parameters in a model."""
        effect = self.effect
        return frozenset(f"{effect.name}.{p.name}" for p in effect.parameters())

    @property
    def in_time(self) -> bool:
        """Whether what drives it passes with time rather than from pose to pose."""
        return self.source in ("order", "time", "temperature")

    def driver(self, batch: Batch) -> Floats:
        """Return the covariate along which the candidate varies, (n,)."""
        name = "order" if self.in_time else self.source.split(" x ")[0]
        return np.nan_to_num(covariate(batch, name))


def shared(members: list[tuple[Effect, str]], family: Family) -> list[Candidate]:
    """Make the candidates of a family, each with an equal share of its prior."""
    share = -float(np.log(max(len(members), 1)))
    return [Candidate(family, effect, source, share) for effect, source in members]
