"""A step lies in the middle of where the rows let it be."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.score import rank_some
from postproc.calibration.diagnosis.search import refine, with_effects
from postproc.calibration.diagnosis.step_places import Sides, find_middle
from postproc.calibration.regression import Fit
from postproc.model.carrier import carrier
from postproc.model.covariate import covariate
from postproc.model.effects.effect import Candidate
from postproc.model.effects.part_motion import PartMotion, family_of
from postproc.model.kinematics import ArmStates
from tests.calibration.planted import campaign, states_of, survey

BY_JOINT = "rotation:link4:x by joint 2 sign"
BY_LOAD = "rotation:link4:x by torque 3 sign"
FRESH = 2000
SURE = 50.0  # nats by which a row speaks for its side


def with_step(fit: Fit, source: str, middle: float) -> Fit:
    half = float(np.ptp(covariate(fit.batch, source))) / 2
    step = PartMotion(
        "link 4 turn x", source=source, law="step", middle=middle, half=half
    )
    return with_effects(fit, [*fit.combination.effects, step])


def test_a_step_at_an_angle_lies_midway_between_two_rows() -> None:
    fit = campaign(171201, (BY_JOINT,), 3.0, rows=120).base_fit()
    x = np.sort(covariate(fit.batch, "joint 2"))
    places = (x[1:] + x[:-1]) / 2
    best = max(places[30:90], key=lambda m: with_step(fit, "joint 2", m).log_evidence)
    low, high = x[x < best].max(), x[x > best].min()
    for place in (low + 0.01 * (high - low), high):
        fitted = with_step(fit, "joint 2", place)
        found = find_middle(fitted, len(fitted.combination.effects) - 1)
        assert found.middle == pytest.approx(best, abs=0.1 * (high - low))
        assert found.heavier == ()


def test_what_no_row_asks_for_is_as_it_is_beforehand() -> None:
    """Rows on either side of a place, and none that a moment moves."""
    rows = np.array([-0.7, -0.3, 0.1, 0.9])
    slopes = np.column_stack([-np.ones(4), np.zeros(4)])
    pull = SURE * np.sign(rows)
    found = Sides(rows, slopes, pull).find_mean(np.array([0.05, 1.0]))
    assert found[0] == pytest.approx(-0.1, abs=0.02)
    assert found[1] == pytest.approx(0.0, abs=0.15)


def test_a_moment_is_the_mean_of_what_is_left_of_its_prior() -> None:
    """A row that is above a step only with a moment beyond 1."""
    rows = np.array([-0.01, 0.01, -1.0])
    slopes = np.array([[-1.0, 0.0], [-1.0, 0.0], [-1.0, 1.0]])
    pull = SURE * np.array([-1.0, 1.0, 1.0])
    found = Sides(rows, slopes, pull).find_mean(np.array([0.0, 3.0]))
    assert found[1] == pytest.approx(norm.pdf(1.0) / norm.sf(1.0), abs=0.1)


def test_rows_that_hardly_speak_leave_a_place_where_others_have_it() -> None:
    rows = np.array([-0.5, 0.0, 0.5])
    slopes = -np.ones((3, 1))
    pull = np.array([-SURE, 0.01, SURE])
    found = Sides(rows, slopes, pull).find_mean(np.array([0.4]))
    assert found[0] == pytest.approx(0.0, abs=0.05)


def test_few_poses_are_on_the_wrong_side_of_a_step_at_a_load() -> None:
    c = campaign(171213, (BY_LOAD,), 3.0, rows=300)
    base = c.base_fit()
    fit = with_effects(base, [*base.combination.effects, best_step(base)])
    moved = find_middle(fit, len(fit.combination.effects) - 1)
    fresh = survey(c.arm, 1_171_213, FRESH)
    law = c.arm.laws[-1].shape(fresh)
    side = np.sign(law[np.arange(FRESH), np.abs(law).argmax(axis=1)])
    told = moved.law_values(ArmStates(fit.batch.arm, states_of(fresh)))[:, 0]
    assert min(np.mean(told == side), np.mean(told != side)) < 0.01


def best_step(base: Fit) -> PartMotion:
    """Find the step with the best weights of links, as a search does."""
    projection = Projection.of(base)
    x = covariate(projection.at, "torque 3")
    half, places = float(np.ptp(x)) / 2, np.quantile(x, np.linspace(0.05, 0.95, 40))
    family = family_of(carrier("link 4 turn x"), "torque 3")
    some = [
        PartMotion("link 4 turn x", source="torque 3", law="step", middle=m, half=half)
        for m in places
    ]
    tried = [Candidate(family, step, "torque 3", 0.0) for step in some]
    found = refine(projection, rank_some(projection, tried)[0]).best.effect
    assert isinstance(found, PartMotion)
    return found


def test_the_place_is_the_same_wherever_it_is_sought_from() -> None:
    """The moment about x of a link that turns about the vertical is all alike."""
    c = campaign(171220, ("shift:tool:z by moment 2x sign",), 3.0, rows=200)
    base = c.base_fit()
    step = PartMotion("tool shift z", source="moment 2x", law="step", half=500.0)
    fit = with_effects(base, [*base.combination.effects, step])
    found = find_middle(fit, len(fit.combination.effects) - 1)
    fit = with_effects(base, [*base.combination.effects, found])
    again = find_middle(fit, len(fit.combination.effects) - 1)
    assert again.middle == pytest.approx(found.middle, abs=0.05 * step.half)
