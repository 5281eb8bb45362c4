"""Awkward campaigns: a few of those of `make awkward`, and what they found."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest

from postproc.calibration.registration import register
from postproc.calibration.survey_checks import check_survey
from postproc.exceptions import MeasurementError
from postproc.model.effect_sum import Combination
from postproc.model.effects.curve import Curve
from postproc.model.kinematics import ArmStates
from tests.awkward import draw, run
from tests.calibration.simulator import NJ, random_states, survey_of
from tests.slow import slow

LONG = [0, 3, 6, 9, 10]
SHORT = [seed for seed in range(14) if seed not in LONG]


@pytest.mark.parametrize("seed", [*SHORT, *slow(LONG)])
def test_a_campaign_is_fitted_or_refused_in_words(seed: int) -> None:
    end = run(seed, diagnosed=False)
    assert re.match(r"fitted|refused: .*\S\. \S", end), end


@pytest.mark.parametrize("seed", [31, *slow([54])])
def test_a_campaign_is_diagnosed(seed: int) -> None:
    assert re.match("fitted, (noise|effect|unexplained)", run(seed))


def test_campaigns_are_those_of_their_seed() -> None:
    np.testing.assert_array_equal(draw(8).position, draw(8).position)
    assert draw(8).position.shape != draw(9).position.shape or (
        not np.allclose(draw(8).position, draw(9).position)
    )


def test_no_curve_over_ways_that_are_not_known() -> None:
    """Without directions no reversal is known, nor the way between two of them."""
    rng = np.random.default_rng(0)
    states = random_states(40, rng)
    states = states.with_(
        travel=rng.uniform(0, 1, (40, 6)), direction=np.zeros((40, 6))
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = Curve.candidates(ArmStates(NJ, states))
    assert not any("loop" in name for c in found for name in c.effect.source)  # type: ignore[attr-defined]


def test_readings_of_one_place_are_refused_as_such() -> None:
    states = random_states(100, np.random.default_rng(0))
    position = ArmStates(NJ, states).walk.tcp
    frozen = survey_of(states, np.repeat(position[:1], 100, axis=0))
    with pytest.raises(MeasurementError, match="all 100 positions lie within"):
        check_survey(frozen, NJ)


def test_points_on_a_line_register_without_a_warning() -> None:
    states = random_states(30, np.random.default_rng(0))
    line = np.linspace(0, 1, 30)[:, None] * [1.0, 2.0, 3.0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = register(NJ, states, line, Combination(()), np.zeros(0))
    assert np.isfinite(found.transforms[0]).all()
