"""Effects that rows leave open: they are in the stated variance, and nowhere else."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from postproc.calibration.doubt import Alternative, _apart, doubt_of
from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.evidence import posterior
from postproc.calibration.fit import fit_measurements
from postproc.calibration.measurements import Measurements
from postproc.calibration.regression import Fit, beside
from postproc.model.effects.compliance import Compliance
from postproc.model.kinematics import ArmStates
from postproc.robot.state import States
from tests.calibration.simulator import NJ, random_arm
from tests.campaign_files import FLOOR, Setup, write_cell
from tests.campaign_rows import Habit, as_mounted, measure, unseen
from tests.slow import slow

WALL, CEILING = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
SOFT, STIFF = (8e-8, 3e-7, 2e-6), (0.0, 0.0, 0.0)
PLAIN = ("geometry", "backlash")
ONE_DECIMAL, EXACT = 1, 5
Case = tuple[Fit, Measurements, States, np.ndarray]


@cache
def campaign(
    seed: int,
    soft: tuple[float, float, float],
    decimals: int,
    weight: tuple[float, float, float] = FLOOR,
    poses: int = 120,
) -> Case:
    """Measure an arm and fit geometry and backlash, as if it stood on a floor."""
    rng = np.random.default_rng([20261127, seed])
    arm = random_arm(rng)
    arm.backlash[:, 1:] = 0.0
    arm = as_mounted(arm, Setup(weight=weight, soft=soft), rng)
    habit = Habit(poses, 1, 1, 1, 2, decimals, 5e-6, 1e-5, 2e-5, clock=False)
    survey = measure(arm, habit, rng)
    return fit_survey(survey, NJ, PLAIN, None), survey, *unseen(arm, rng)


def cases(soft: tuple[float, float, float], **how: object) -> Iterator[Case]:
    """Yield campaigns of one kind."""
    for seed in range(5):
        yield campaign(seed, soft, ONE_DECIMAL, **how)  # type: ignore[arg-type]


def held(case: Case, *, doubted: bool, mounted: bool = True) -> float:
    """Return the share of true errors at other poses in the stated intervals."""
    fitted, survey, states, true = case
    doubt = doubt_of(fitted, mounted) if doubted else None
    told = model_of(fitted, survey, doubt=doubt).predict(NJ, states)
    return float((np.abs(told.error - true) < 1.96 * told.std_model).mean())


def test_intervals_hold_what_coarse_angles_hide() -> None:
    # Five arms that yield, 1.6 mm at the most; 0.8 mm of rounding hide it.
    some = list(cases(SOFT))
    before = [held(case, doubted=False) for case in some]
    after = [held(case, doubted=True) for case in some]
    assert np.mean(before) < 0.85
    assert 0.92 <= np.mean(after) <= 0.99
    assert min(after) > 0.85


@pytest.mark.parametrize("weight", [WALL, *slow([(CEILING,)])])
def test_intervals_hold_weight_whose_direction_is_not_stated(
    weight: tuple[float, float, float],
) -> None:
    some = list(cases(SOFT, weight=weight))
    stated = np.mean([held(case, doubted=True) for case in some])
    unstated = np.mean([held(case, doubted=True, mounted=False) for case in some])
    assert unstated > stated
    assert 0.91 <= unstated <= 0.995


def test_a_stiff_arm_that_rows_show_to_be_stiff_is_no_less_sure() -> None:
    fitted, survey, states, _ = campaign(1, STIFF, EXACT)
    doubt = doubt_of(fitted, mounted=False)
    without, with_ = (
        model_of(fitted, survey, doubt=d).std_error(NJ, states) for d in (None, doubt)
    )
    assert np.mean(with_) < 1.03 * np.mean(without)


def test_a_fit_names_what_is_left_open(tmp_path: Path) -> None:
    survey = campaign(1, SOFT, ONE_DECIMAL, poses=30)[1]
    told = {}
    for said in ("", "mounting"):
        cell = write_cell(tmp_path / f"cell{said}.toml", FLOOR, said)
        found = fit_measurements(survey, cell, validate=False)
        assert found.model.doubt is not None
        told[said] = [w for w in found.report.warnings if "do not show whether" in w]
    (free,), (stated,) = told[""], told["mounting"]
    assert "compliance: it is not corrected" in free
    assert free.endswith("state mounting under [robot]")
    assert "mounting" not in stated


def test_the_correction_stays() -> None:
    fitted, survey, states, _ = campaign(2, SOFT, ONE_DECIMAL)
    doubt = doubt_of(fitted)
    assert doubt is not None
    without, with_ = (model_of(fitted, survey, doubt=d) for d in (None, doubt))
    np.testing.assert_array_equal(without.error(NJ, states), with_.error(NJ, states))
    more = with_.std_error(NJ, states) - without.std_error(NJ, states)
    assert more.min() >= 0.0
    assert more.mean() > 0.0


def test_a_certain_effect_is_as_unsure_as_its_own_fit() -> None:
    # By blocks: the covariance of all is that without, and what the effect moves.
    fitted, *_ = campaign(3, SOFT, ONE_DECIMAL)
    effect = Compliance.on(fitted.batch)
    laid = beside(fitted, (*fitted.combination.effects, effect))
    normal, taken = _apart(laid, len(fitted.values))
    own = posterior(normal, np.zeros(len(normal.moment), dtype=np.int64), np.zeros(1))
    whole = posterior(laid.normal(), laid.group, laid.log_scale)
    way = np.concatenate([-taken, np.eye(len(own.mean))])
    alone = posterior(fitted.normal(), fitted.group, fitted.log_scale)
    expected = way @ own.covariance @ way.T
    p = len(fitted.values)
    expected[:p, :p] += alone.covariance
    np.testing.assert_allclose(whole.covariance, expected, rtol=1e-6, atol=1e-9)
    moved = way @ own.mean
    moved[:p] += alone.mean
    np.testing.assert_allclose(whole.mean, moved, rtol=1e-6, atol=1e-6)


def test_weight_along_a_direction_is_a_mix_of_the_axes() -> None:
    fitted, *_ = campaign(4, SOFT, ONE_DECIMAL, poses=30)
    states, along = fitted.batch.states, np.array([0.6, 0.0, -0.8])
    axes = Compliance.along_axes(fitted.batch)
    mix = Alternative.of(axes[0], along=along).way
    tilted = ArmStates(NJ.mount(along), states).loads
    turned = np.concatenate([e.basis(fitted.batch) for e in axes], axis=1) @ mix
    own = (tilted.gravity + tilted.payload)[:, np.array(axes[0].joints) - 1]
    np.testing.assert_allclose(turned, own, rtol=1e-9, atol=1e-6)
