"""Which effects a survey gives evidence for.

An effect stays only if the marginal likelihood falls without it, all prior scales being
chosen anew. Named effects are weighed first; free forms must then explain what is left.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.evidence import LOG_SPREAD, Normal, maximise
from postproc.accuracy.fit import fit_effects
from postproc.accuracy.fitted import Fit
from postproc.accuracy.tool_groups import find_groups
from postproc.accuracy.turns import Turns
from postproc.arrays import Bools, Floats
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.effects.effect import Effect
from postproc.model.effects.tool_shift import ToolShift
from postproc.model.kinematics import Batch
from postproc.robot.arm import Arm
from postproc.robot.state import States

ENOUGH = 3.0  # nats that an effect must be worth: 20 to 1
NAMED = (
    "compliance",
    "load_backlash",
    "counterbalance",
    "transmission",
    "scale",
    "coupling",
    "windup",
    "tracker_drift",
)
STEPS = 12  # of the search for prior scales, which start near their best
LONG = 600  # rows from which a joint spline resolves more than a joint map
VARIES = {"thermal": ("temperature", 1.0), "payload": ("payload", 1.0)}  # [K], [kg]
FASTER = 0.05  # [m/s] speeds must differ by so much to show a lag


def candidates(states: States) -> tuple[str, ...]:
    """Name the effects whose covariates vary in a survey."""
    names = list(NAMED)
    for name, (covariate, least) in VARIES.items():
        if _span(getattr(states, covariate)) > least:
            names.append(name)
    if _span(states.speed) > FASTER:
        names.append("lag")
    return tuple(names)


def fit_best(
    arm: Arm,
    states: States,
    position: Floats,
    origin: tuple[float, float, float] | None,
    setup: tuple[str, ...] = (),
    turns: Turns | None = None,
) -> Fit:
    """Fit the base effects and all others that a survey gives evidence for.

    Args:
        arm: The arm.
        states: States of the rows.
        position: Measured positions in the base frame, (n, 3) [m].
        origin: Tracker position, where it is known.
        setup: Effects of the set-up that are always fitted.
        turns: Measured orientations, where the survey has them.
    """
    batch = Batch(arm, states)
    base = propose((*BASE_EFFECTS, *setup), arm, states)
    free = ("joint_spline",) if len(states) >= LONG else ("joint_map", "elm")
    kept = base
    fitted = fit_effects(batch, position, base, origin, turns=turns)
    for names in (candidates(states), *((name,) for name in free)):
        tried = (*kept, *propose(names, arm, states), *slipped(fitted))
        fitted = fit_effects(batch, position, tried, origin, fitted)
        kept = keep_needed(fitted, always=base)
    if kept != fitted.combination.effects:
        fitted = fit_effects(batch, position, kept, origin, fitted)
    return fitted


def slipped(fitted: Fit) -> tuple[Effect, ...]:
    """Propose a step of the tool where what is left falls in two heaps in its order."""
    found = find_groups(fitted.residual, fitted.batch.walk.flange)
    if found is None or found.step is None:
        return ()
    return (ToolShift(row=float(fitted.batch.states.order[found.step])),)


def keep_needed(fitted: Fit, always: tuple[Effect, ...]) -> tuple[Effect, ...]:
    """Drop effects one after the other until each that is left is needed.

    Args:
        fitted: A fit of all effects in question.
        always: Effects that are not in question.
    """
    kept = list(fitted.combination.effects)
    normal, group = fitted.normal(), fitted.group
    present = np.ones(len(fitted.values), dtype=bool)
    now = _evidence(fitted, normal, group, present)
    while True:
        found = [
            (_evidence(fitted, normal, group, present & ~columns), effect, columns)
            for effect, columns in _in_question(fitted, kept, always)
        ]
        if not found:
            break
        best, effect, columns = max(found, key=lambda trial: trial[0])
        if now - best > ENOUGH:
            break
        kept.remove(effect)
        present &= ~columns
        now = best
    return tuple(kept)


def _in_question(
    fitted: Fit, kept: list[Effect], always: tuple[Effect, ...]
) -> Iterator[tuple[Effect, Bools]]:
    """List effects that may go, with their columns."""
    c = fitted.combination
    for effect, part in zip(c.effects, c.slices, strict=True):
        if effect in kept and effect not in always:
            columns = np.zeros(len(fitted.values), dtype=bool)
            columns[part] = True
            yield effect, columns


def _evidence(
    fitted: Fit, normal: Normal, group: NDArray[np.int64], present: Bools
) -> float:
    """Log evidence of some of the columns, prior scales chosen anew."""
    part = Normal(
        normal.gram[np.ix_(present, present)],
        normal.moment[present],
        normal.square,
        normal.log_noise,
        normal.rows,
    )
    used, group = np.unique(group[present], return_inverse=True)
    start = fitted.log_scale[used]
    best = maximise(part, group, start, STEPS)
    return best.log_evidence - 0.5 * float((best.log_scale**2).sum()) / LOG_SPREAD**2


def _span(values: Floats) -> float:
    """Range of the known values."""
    known = values[~np.isnan(values)]
    return float(np.ptp(known)) if len(known) else 0.0
