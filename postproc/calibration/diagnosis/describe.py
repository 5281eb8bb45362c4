"""Putting what a search added into words and numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.calibration.diagnosis.result import Finding
from postproc.calibration.diagnosis.search import Addition, JudgedAddition, Search
from postproc.calibration.regression import Fit
from postproc.calibration.report import SHOWN_UNITS, impossible
from postproc.model.covariate import varies_enough
from postproc.model.effects.effect import PART_MOTION, Effect
from postproc.model.effects.policies import NamingPolicy
from postproc.robot.pose import MM
from postproc.robot.state import States


def describe(found: Search, standings: Sequence[JudgedAddition]) -> tuple[Finding, ...]:
    """Describe every addition of a search."""
    shares = _shares(found)
    return tuple(
        _describe(found, number, addition, standing, float(shares[number]))
        for number, (addition, standing) in enumerate(
            zip(found.additions, standings, strict=True)
        )
    )


def _describe(
    found: Search,
    number: int,
    addition: Addition,
    standing: JudgedAddition,
    share: float,
) -> Finding:
    fit, family = found.fit, addition.candidate.family
    effect = fit.combination.effects[found.place(number)]
    part = fit.combination.slices[found.place(number)]
    moved = np.linalg.norm(fit.move(part), axis=1)
    rivals = tuple(s.family for s in standing.confusable)
    confusable = [(r.effect, r.joint) for r in rivals if r.effect != PART_MOTION]
    tied = [
        name for name in effect.list_tied(fit.batch) if name not in found.causes.without
    ]
    named = {name for name, _ in confusable}
    confusable += [(name, None) for name in tied if name not in named]
    own = family.effect == PART_MOTION
    source = family.driver if own else addition.candidate.source
    return Finding(
        effect=family.effect,
        joint=family.joint,
        nameless=effect.naming_policy == NamingPolicy.UNEXPLAINED,
        of_setup=effect.belongs_to() == "setup",
        source=source,
        p_value=standing.p_value,
        evidence=standing.evidence,
        share=share,
        peak_mm=float(moved.max(initial=0.0) / MM),
        parameters=_parameters(effect, fit.values[part], fit.covariance[part, part]),
        confusable_with=tuple(confusable),
        settings=effect.settings(),
        held_out_gain=(addition.gain.mean, addition.gain.std_error),
        impossible=impossible(fit, _own(fit, part)),
        family=family,
        told=story(fit, effect, part),
        rivals=rivals,
    )


def story(fit: Fit, effect: Effect, part: slice) -> str:
    """Say place, driver, law and size of what has no name, and what may be its driver.

    Args:
        fit: The fit.
        effect: One of its effects.
        part: Its parameters.
    """
    sentence = effect.sentence(fit.values[part], fit.covariance[part, part])
    if effect.name != PART_MOTION or effect.settings()["law"] != "constant":
        return sentence
    doubt = unseen_drivers(fit.batch.states)
    return f"{sentence} ({doubt})" if doubt else sentence


STATES = ("temperature", "payload")  # that hold a whole survey at another value


def unseen_drivers(states: States) -> str:
    """Say what may move a part that stands elsewhere at all rows, "" without a doubt.

    What hardly varies over the rows moves a part by the same at each of them.

    Args:
        states: Of the rows.
    """
    names = [name for name in STATES if not varies_enough(states, name)]
    if not names:
        return ""
    return (
        f"perhaps by the {' or the '.join(names)}, which the rows hardly vary in or "
        "do not record"
    )


def _own(fit: Fit, part: slice) -> Bools:
    """Tell which parameters of a fit are of one part, (p,)."""
    own = np.zeros(len(fit.values), dtype=bool)
    own[part] = True
    return own


def _parameters(
    effect: Effect, values: Floats, covariance: Floats
) -> dict[str, tuple[float, float, str]]:
    """List value, standard error and unit of every parameter, and a wave's size."""
    out = {}
    if (wave := effect.amplitude(values, covariance)) is not None:
        out["amplitude"] = (wave[0] * 1e3, wave[1] * 1e3, "mrad")
    std = np.sqrt(np.diag(covariance))
    for p, value, error in zip(effect.parameters(), values, std, strict=True):
        unit, factor = SHOWN_UNITS.get(p.unit, (p.unit, 1.0))
        out[p.name] = (float(value * factor), float(error * factor), unit)
    for name, (number, unit) in effect.nonlinear().items():
        out[name] = (number, 0.0, unit)
    return out


def _shares(found: Search) -> Floats:
    """Part of the given model's residual variance that each addition explains."""
    fit = found.fit
    first = found.place(0)
    start = fit.combination.slices[first].start if found.additions else 0
    base = _first_columns(fit, start)
    target = fit.whiten(fit.residual + fit.move(slice(start, None)))
    left = target - base @ (base.T @ target)
    total = max(float(left @ left), 1e-300)
    out = []
    for number in range(len(found.additions)):
        part = fit.combination.slices[found.place(number)]
        moved = fit.whiten(fit.move(part))
        out.append(float(left @ (moved - base @ (base.T @ moved))) / total)
    shares: Floats = np.clip(np.array(out), 0.0, 1.0)
    return shares


def _first_columns(fit: Fit, count: int) -> Floats:
    """Give an orthonormal basis of what the first columns determine, (rows, rank)."""
    whitened, std = fit.whitened, fit.prior_std[:count]
    gram = whitened.gram()[:count, :count] * np.outer(std, std)
    size, axes = np.linalg.eigh(gram)
    told = size > 1.0
    mix = np.zeros((len(fit.values), int(told.sum())))
    mix[:count] = std[:, None] * axes[:, told] / np.sqrt(size[told])
    return whitened.combine(mix)
