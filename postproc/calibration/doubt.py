"""What rows leave open: effects that may be there are in the stated variance.

An effect that is worth little by its evidence is not taken: it may be chance. It may be
there as well, and new poses then have an error of which the effects of the fit state
nothing. With w the probability that it is there, and m and C the mean and covariance
that the rows give its parameters if it is, these have the variance w (C + m m') about
the 0 that the model has them at. What the fit has taken up of the effect goes with it.

Where the cell does not state the mounting, weight may pull along any direction. Each is
an alternative, and one of them is true at the most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import log_ndtr, softmax

from postproc.arrays import Bools, Floats, Ints
from postproc.calibration.evidence import (
    LOG_SPREAD,
    Normal,
    invert_information,
    maximise,
    widen_covariance,
)
from postproc.calibration.regression import Fit, beside
from postproc.calibration.weight_direction import (
    SAME,
    degrees_between,
    unit_directions,
)
from postproc.model.doubt import Doubt
from postproc.model.effect_sum import Combination
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.effects.compliance import Compliance
from postproc.model.effects.effect import Effect
from postproc.model.kinematics import ArmStates

TILTED = float(np.log(0.02))  # odds of another direction of weight than the cell's
YIELDS = float(np.log(3.0))  # odds of joints that yield: most joints of most arms do
NEGLIGIBLE = 0.01  # of the variance at the surveyed poses: less is no doubt


@dataclass(frozen=True, eq=False)
class Alternative:
    """What may be there, in parameters of its own.

    Attributes:
        way: Parameters in doubt per own one, (q, k).
        group: Prior group of the own ones, (k,).
        positive: Which of them are not negative, (k,).
        odds: Log odds of it against nothing, before the rows are seen.
    """

    way: Floats
    group: Ints
    positive: Bools
    odds: float = 0.0

    @classmethod
    def of(
        cls, *effects: Effect, along: Floats | None = None, odds: float = 0.0
    ) -> Alternative:
        """Take effects; with `along`, (3,), a mix of three like them, one an axis."""
        c = Combination(effects)
        _, group = np.unique(c.groups, return_inverse=True)
        positive = np.array([p.positive for p in c.parameters], dtype=bool)
        way: Floats = np.eye(len(group))
        if along is not None:
            way = np.concatenate([part * way for part in along])
        return cls(way, group.reshape(-1), positive, odds)

    def vary_masses(self, normal: Normal) -> tuple[float, Floats]:
        """Weigh it against nothing.

        Args:
            normal: Of the parameters in doubt, all others left to their priors.

        Returns:
            Its evidence with the odds [nats], and the second moments of the parameters
            in doubt if it is there, (q, q).
        """
        way = self.way
        own = replace(
            normal, gram=way.T @ normal.gram @ way, moment=way.T @ normal.moment
        )
        found = maximise(own, self.group, np.zeros(int(self.group.max()) + 1))
        none = normal.log_noise + normal.square + normal.rows * np.log(2 * np.pi)
        gain = found.log_evidence + 0.5 * none + self.odds
        gain -= 0.5 * float((found.log_scale**2).sum()) / LOG_SPREAD**2
        std = np.sqrt(np.diag(found.covariance)[self.positive])
        above = found.mean[self.positive] / np.maximum(std, 1e-300)
        gain += float((log_ndtr(above) + np.log(2.0)).sum())
        moments = widen_covariance(own, self.group, found) + np.outer(
            found.mean, found.mean
        )
        return gain, way @ moments @ way.T


Rivals = tuple[tuple[Effect, ...], tuple[Alternative, ...]]  # one is there at most


def doubt_of(fitted: Fit, mounted: bool = True) -> Doubt | None:
    """Weigh the usual effects that a fit does not have.

    Args:
        fitted: The fit.
        mounted: Whether the cell states the direction of weight.

    Returns:
        None where new poses are hardly less sure for them.
    """
    batch, have = fitted.batch, {e.name for e in fitted.combination.effects}
    names = [n for n in BASE_EFFECTS if n not in have]
    lacking = propose(names, batch.arm, batch.states)
    shown = [e for e in lacking if e.may_show(batch.states)]
    asked: list[Rivals] = [((e,), (Alternative.of(e),)) for e in shown]
    asked += _of_weight(fitted, mounted)
    effects = tuple(e for more, _ in asked for e in more)
    if not effects:
        return None
    laid = beside(fitted, (*fitted.combination.effects, *effects))
    normal, taken = _apart(laid, len(fitted.values))
    moments = _second_moments(normal, asked)
    way = np.concatenate([-taken, np.eye(len(moments))])
    way *= laid.combination.scales[:, None]
    doubt = Doubt(Combination(effects), way @ moments @ way.T)
    known = fitted.design.variance(fitted.stated)
    known = known + fitted.noise.pose_variance(fitted.design.jacobian)
    more = laid.design.variance(doubt.covariance)
    return doubt if more.mean() > NEGLIGIBLE * known.mean() else None


def _of_weight(fitted: Fit, mounted: bool) -> list[Rivals]:
    """List what joints may yield by under weight, where a fit does not have it."""
    own = [e for e in fitted.combination.effects if e.name == Compliance.name]
    if not mounted:
        return [_along_any(fitted.batch, yields=bool(own))]
    have = {p.joint for e in own for p in e.parameters()}
    every = Compliance.on(fitted.batch).pieces()
    lacking = tuple(e for e in every if not have & set(e.joints))
    rivals = (Alternative.of(*lacking, odds=YIELDS),) if lacking else ()
    return [(lacking, rivals)] if lacking else []


def _along_any(batch: ArmStates, yields: bool) -> Rivals:
    """List the directions of weight, each a mix of those along the base's axes.

    Args:
        batch: States of the survey.
        yields: Whether joints of the fit yield already to weight as the cell has it.
    """
    axes, stated = Compliance.along_axes(batch), batch.arm.weight
    others = [
        Alternative.of(axes[0], along=along, odds=YIELDS + TILTED)
        for _, along in unit_directions()
        if degrees_between(along, stated) > SAME
    ]
    if yields:
        return axes, tuple(others)
    return axes, (Alternative.of(axes[0], along=stated, odds=YIELDS), *others)


def _second_moments(normal: Normal, asked: Sequence[Rivals]) -> Floats:
    """Average second moments of all parameters in doubt, (q, q)."""
    moments, first = np.zeros(normal.gram.shape), 0
    for effects, rivals in asked:
        part = slice(first, first + len(Combination(effects).parameters))
        own = replace(normal, gram=normal.gram[part, part], moment=normal.moment[part])
        gains, own_moments = zip(*(r.vary_masses(own) for r in rivals), strict=True)
        probable = softmax(np.array([0.0, *gains]))[1:]  # perhaps none is there
        moments[part, part] = np.tensordot(probable, np.stack(own_moments), axes=1)
        first = part.stop
    return moments


def _apart(laid: Fit, count: int) -> tuple[Normal, Floats]:
    """Leave the first parameters of a fit to their priors, of known scales.

    Returns:
        The regression of the others, (q,), and by how much less of the first ones is
        found per unit of each, (count, q), all in units of the prior scales.
    """
    normal = laid.normal()
    own = np.arange(len(laid.values)) < count
    s = np.exp(laid.log_scale)[laid.group[own]]
    gram = normal.gram[np.ix_(own, own)]
    _, inverse, told = invert_information(np.eye(count) + gram * np.outer(s, s))
    inside = inverse if told is None else told
    across = normal.gram[np.ix_(own, ~own)]
    taken = s[:, None] * (inside @ (s[:, None] * across))
    return normal.marginalise(own, s), taken
