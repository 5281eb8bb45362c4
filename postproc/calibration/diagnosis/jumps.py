"""Jumps: what a step at one row may be as well, where the arm passed a value there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.score import Score, rank_some
from postproc.model.carrier import every_carrier
from postproc.model.covariate import covariate, varies, varies_enough
from postproc.model.effects.effect import Candidate
from postproc.model.effects.part_motion import OF_STATE, PartMotion, family_of
from postproc.model.effects.step import CampaignStep
from postproc.model.kinematics import ArmStates

ALIKE = 0.98  # part of the rows that a value parts as the step does


def jumps(step: Score, projection: Projection) -> list[Score]:
    """Score all parts as if they jumped at a temperature, say, instead of at a row.

    Args:
        step: The score of a step at one row; of any other effect there are none.
        projection: The fit without it.

    Returns:
        The best first, each charged for its place as the step is; none where nothing
        passes one value at that row alone.
    """
    effect = step.best.effect
    if not isinstance(effect, CampaignStep):
        return []
    found = rank_some(projection, list(_candidates(effect, projection.at)))
    charge = step.best_evidence - step.evidence
    return [replace(s, evidence=s.evidence - charge) for s in found]


def _candidates(step: CampaignStep, batch: ArmStates) -> Iterator[Candidate]:
    """List the parts by the values that are passed."""
    for driver, value in _list_crossed_values(step, batch):
        half = float(np.ptp(covariate(batch, driver))) / 2
        for moved in every_carrier():
            family = family_of(moved, driver)
            jump = PartMotion(
                str(moved), source=driver, law="step", middle=value, half=half
            )
            yield Candidate(family, jump, driver, 0.0)


def _list_crossed_values(
    step: CampaignStep, batch: ArmStates
) -> Iterator[tuple[str, float]]:
    """List what is below a value before the step and above it after, or the reverse."""
    before = step.before(batch)
    for driver in OF_STATE:
        x = covariate(batch, driver)
        if not varies(x) or not varies_enough(batch.states, driver):
            continue
        rows = np.argsort(batch.states.order)
        at = int(before.sum())
        value = float(x[rows[at - 1 : at + 1]].mean())
        if abs(np.mean((x < value) == before) - 0.5) >= ALIKE - 0.5:
            yield driver, value
