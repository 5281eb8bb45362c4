"""What may happen to a robot, and what of its model that leaves open."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.model.effect_sum import Combination
from postproc.model.effects.effect import Effect
from postproc.model.effects.geometry import Geometry
from postproc.model.model import Model

REDRAWN = 2.0  # variances of its kind by which an old and a new value differ
OF_JOINTS = frozenset({"remastered", "motor", "gear"})
"""Events that happen to joints, which are named."""
REFITTED = frozenset({"motor", "gear", "crash", "arm"})
"""Events after which what no effect describes of a pose is another one."""


@dataclass(frozen=True)
class Event:
    """Something that happened to a robot.

    Attributes:
        kind: One of `postproc.model.effects.effect.EVENTS`.
        joints: From 1, of events that happen to joints; none: all of them.
    """

    kind: str
    joints: tuple[int, ...] = ()

    def __str__(self) -> str:
        if not self.joints:
            return self.kind
        word = "joint" if len(self.joints) == 1 else "joints"
        return f"{self.kind}, {word} {', '.join(map(str, self.joints))}"

    def frees(self, effects: Combination) -> Bools:
        """Return which parameters of a model may be others since, (p,)."""
        renewals = [r for e in effects.effects for r in e.list_renewals()]
        joints = self.joints if self.kind in OF_JOINTS else ()
        return np.array(
            [
                self.kind in renewed and (not joints or p.joint in joints)
                for renewed, p in zip(renewals, effects.parameters, strict=True)
            ],
            dtype=bool,
        )

    def widening(self, model: Model) -> Floats:
        """Return by how much the variance of each parameter grows, (p,).

        The new value is drawn as the old one was, from a normal law of the size of its
        kind, so that the two differ by twice its variance.
        """
        return np.where(self.frees(model.effects), REDRAWN * sizes_of(model) ** 2, 0.0)


def sizes_of(model: Model) -> Floats:
    """Return of what size each parameter of a model is by its kind, (p,).

    Of geometry that is the prior scale of a new arm, which covers a mastering by marks;
    of all else what the survey found.
    """
    parts = zip(model.effects.effects, model.effects.slices, strict=True)
    own = [
        [p.scale for p in e.parameters()] if isinstance(e, Geometry)
        else model.prior_std[part]
        for e, part in parts
    ]  # fmt: skip
    return np.concatenate([np.zeros(0), *own])


def open_base(model: Model) -> Model:
    """Return a model in which the base may be misplaced.

    Where a survey was read in the tracker's frame, the base frame is known through the
    arm alone, and nothing of the base is fitted. Fixed points remember that frame: the
    base can be found beside it later. It begins at zero there, and is known.
    """
    effects = Combination(tuple(map(_open, model.effects.effects)))
    if effects.effects == model.effects.effects:
        return model
    names = model.effects.names
    new = np.array([n not in names for n in effects.names], dtype=bool)
    old = np.array([names.index(n) for n, is_new in zip(effects.names, new, strict=True)
                    if not is_new])  # fmt: skip
    values, prior_std = np.zeros(len(new)), effects.scales.copy()
    covariance = np.zeros((len(new), len(new)))
    values[~new], prior_std[~new] = model.values[old], model.prior_std[old]
    covariance[np.ix_(~new, ~new)] = model.covariance[np.ix_(old, old)]
    doubt = model.doubt
    return replace(
        model, effects=effects, values=values, covariance=covariance,
        prior_std=prior_std,
        doubt=None if doubt is None else doubt.among(names, effects.names),
    )  # fmt: skip


def _open(effect: Effect) -> Effect:
    is_placed = isinstance(effect, Geometry) and not effect.base
    return replace(effect, base=True) if is_placed else effect  # type: ignore[call-arg]
