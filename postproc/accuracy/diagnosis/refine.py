"""Finer settings around a candidate that a grid found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from postproc.accuracy.diagnosis.library import reduce_some
from postproc.accuracy.diagnosis.named import LAST_FREE, LONGEST_WINDUP, STEPS
from postproc.accuracy.diagnosis.projection import Projection
from postproc.accuracy.diagnosis.score import Score, rank
from postproc.arrays import Floats
from postproc.model.effects.base_shift import BaseShift
from postproc.model.effects.counterbalance import Counterbalance
from postproc.model.effects.effect import Effect
from postproc.model.effects.joint_map import SPACING, JointMap
from postproc.model.effects.load_backlash import LoadBacklash
from postproc.model.effects.thermal import Thermal
from postproc.model.effects.tool_shift import ToolShift
from postproc.model.effects.transmission import Transmission
from postproc.model.effects.windup import Windup
from postproc.model.kinematics import Batch

HARDLY = 2.0  # nats
OFFSETS = np.linspace(-1.0, 1.0, 9)
LEVELS = tuple(0.5**k for k in range(9))  # widths tried, in steps of the grid
SETTLED = 0.3  # nats: finer settings no longer matter


def finer(effect: Effect, width: float, batch: Batch) -> list[Effect]:
    """Vary the settings of an effect.

    Args:
        effect: The effect.
        width: How far, in steps of the grid that it comes from.
        batch: The states, for ranges.
    """
    for kind, vary in VARIATIONS.items():
        if isinstance(effect, kind):
            return [effect, *vary(effect, width * OFFSETS, batch)]
    return [effect]


def refine(projection: Projection, score: Score) -> Score:
    """Improve the settings of a score's best candidate by its evidence.

    The evidence of the family becomes that of the finer points, averaged over the part
    of the grid that they stand for: a sharp peak between two points of the grid counts,
    but only as much of the prior as it covers.
    """
    square = float(projection.rest @ projection.rest)
    share = score.best.log_prior
    for width in LEVELS:
        effects = finer(score.best.effect, width, projection.at)
        if len(effects) == 1:
            return score
        tries = [replace(score.best, effect=e, log_prior=0.0) for e in effects]
        blocks = reduce_some(projection, tries, projection.rest[:, None])
        found = rank(blocks, square, projection.rows)[0]
        gained = found.best_evidence - score.best_evidence
        if gained > 0.0:
            covered = share + float(np.log(2.0 * width / len(tries)))
            best = replace(found.best, log_prior=share)
            evidence = max(score.evidence, found.evidence + covered)
            score = replace(found, best=best, evidence=evidence)
        if gained < SETTLED and width < 1.0:
            break
    return _plainer(projection, score)


def _plainer(projection: Projection, score: Score) -> Score:
    """Take a whole order of a gear where it does hardly worse than a broken one."""
    effect = score.best.effect
    if not isinstance(effect, Transmission):
        return score
    ((joint, order),) = effect.waves
    whole = replace(score.best, effect=Transmission(((joint, float(round(order))),)))
    square = float(projection.rest @ projection.rest)
    blocks = reduce_some(projection, [whole], projection.rest[:, None])
    found = rank(blocks, square, projection.rows)[0]
    if found.best_evidence < score.best_evidence - HARDLY:
        return score
    return replace(found, evidence=score.evidence)


def _waves(effect: Effect, offsets: Floats, batch: Batch) -> list[Effect]:
    assert isinstance(effect, Transmission)
    ((joint, order),) = effect.waves
    if order <= 2:
        return []  # the orders of eccentricity are what they are
    step = np.pi / max(float(np.ptp(batch.states.q[:, joint - 1])), 0.1)
    tries = np.unique(np.clip(order + step * offsets, 2.5, LAST_FREE))
    return [Transmission(((joint, float(k)),)) for k in tries]


def _rows(effect: Effect, offsets: Floats, batch: Batch) -> list[Effect]:
    assert isinstance(effect, BaseShift | ToolShift)
    order = np.sort(batch.states.order)
    half = max(len(order) / STEPS, 1.0)
    near = np.searchsorted(order, effect.row) + np.round(half * offsets).astype(int)
    rows = order[np.unique(np.clip(near, 1, len(order) - 1))]
    return [replace(effect, row=float(r)) for r in rows]


def _way(effect: Effect, offsets: Floats, batch: Batch) -> list[Effect]:
    assert isinstance(effect, Windup)
    ways = np.unique(np.minimum(effect.d0 * 2.0**offsets, LONGEST_WINDUP))
    return [replace(effect, d0=float(way)) for way in ways]


def _threshold(effect: Effect, offsets: Floats, batch: Batch) -> list[Effect]:
    assert isinstance(effect, LoadBacklash)
    if effect.form == "load":
        return []
    return [replace(effect, t0=float(effect.t0 * 3.0**x)) for x in offsets]


def _time_constant(effect: Effect, offsets: Floats, batch: Batch) -> list[Effect]:
    assert isinstance(effect, Thermal)
    if effect.form == "temperature":
        return []
    each = [float(effect.time_constant * 2.0**x) for x in offsets]
    return [replace(effect, time_constant=c) for c in each]


def _spring(effect: Effect, offsets: Floats, batch: Batch) -> list[Effect]:
    assert isinstance(effect, Counterbalance)
    turned = [replace(effect, upright=float(effect.upright + 0.1 * x)) for x in offsets]
    ratio = [replace(effect, ratio=float(effect.ratio * 1.5**x)) for x in offsets]
    ratio = [e for e in ratio if 0.1 < e.ratio < 0.9]
    loaded = [replace(effect, preload=float(effect.preload * 3.0**x)) for x in offsets]
    return [*turned, *ratio, *loaded]


def _bump(effect: Effect, offsets: Floats, batch: Batch) -> list[Effect]:
    assert isinstance(effect, JointMap)
    if len(effect.bumps) > 1:
        return []
    ((joint, centre),) = effect.bumps
    each = effect.width * 2.0 ** np.array([-0.5, -0.25, 0.0, 0.25, 0.5])
    moved = centre + effect.width * offsets
    single: list[Effect] = [
        JointMap(((joint, float(c)),), float(w)) for c in moved for w in each
    ]
    narrow = [_local_map(joint, centre, effect.width, half) for half in (2, 4)]
    return [*single, *narrow]


def _local_map(joint: int, centre: float, width: float, half: int) -> JointMap:
    """Give a spot a shape of its own: narrower bumps over the same place."""
    reach = 2.0 * width
    places = centre + reach * np.arange(-half, half + 1) / half
    bumps = tuple((joint, float(c)) for c in places)
    return JointMap(bumps, float(reach / half / SPACING))


VARIATIONS: dict[type[Effect], Callable[[Effect, Floats, Batch], list[Effect]]] = {
    Transmission: _waves,
    BaseShift: _rows,
    ToolShift: _rows,
    Windup: _way,
    LoadBacklash: _threshold,
    Thermal: _time_constant,
    Counterbalance: _spring,
    JointMap: _bump,
}
