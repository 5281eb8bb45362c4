"""The design matrix against its columns written out."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.design_matrix import DesignMatrix
from postproc.model.effect_sum import Combination
from postproc.model.effects import propose
from postproc.model.kinematics import ArmStates
from tests.calibration.simulator import NJ, random_states

EFFECTS = (
    ("geometry", "backlash", "transmission", "compliance", "joint_spline"),
    ("geometry",),
    ("backlash",),
)


@pytest.fixture(params=EFFECTS, ids=lambda names: names[-1])
def case(request: pytest.FixtureRequest) -> tuple[Combination, ArmStates, DesignMatrix]:
    """Effects at deviated kinematics of 80 random states."""
    rng = np.random.default_rng(3)
    batch = ArmStates(NJ, random_states(80, rng))
    combination = Combination(propose(request.param, NJ, batch.states))
    values = combination.scales * rng.standard_normal(len(combination.scales))
    at = combination.at(batch, values)
    return combination, at, DesignMatrix.of(combination, at)


def test_columns_are_those_of_the_effects(
    case: tuple[Combination, ArmStates, DesignMatrix],
) -> None:
    combination, at, design = case
    assert design.size == len(combination.parameters)
    np.testing.assert_allclose(design.dense(), combination.columns(at), rtol=1e-13)


def test_sums_over_rows_are_those_of_the_columns(
    case: tuple[Combination, ArmStates, DesignMatrix],
) -> None:
    combination, at, design = case
    rng = np.random.default_rng(4)
    X, p = combination.columns(at), len(combination.parameters)
    values, rows = rng.standard_normal(p), rng.standard_normal((len(at), 3))
    by = rng.standard_normal((len(at), 3, 3))
    close = np.testing.assert_allclose
    close(design.times(values), X @ values, rtol=1e-9, atol=1e-9)
    close(design.moment(rows), np.einsum("nip,ni->p", X, rows), rtol=1e-9, atol=1e-9)
    turned = (by @ X).reshape(-1, p)
    close(design.rotate(by).gram(), turned.T @ turned, rtol=1e-9, atol=1e-9)


def test_variance_is_that_of_uncertain_parameters(
    case: tuple[Combination, ArmStates, DesignMatrix],
) -> None:
    combination, at, design = case
    rng = np.random.default_rng(5)
    X, p = combination.columns(at), len(combination.parameters)
    factor = rng.standard_normal((p, p))
    meant = np.einsum("nip,pq,niq->ni", X, factor @ factor.T, X, optimize=True)
    found = design.variance(factor @ factor.T)
    np.testing.assert_allclose(found, meant, rtol=1e-9)


def test_joints_turn_as_the_effects_turn_them(
    case: tuple[Combination, ArmStates, DesignMatrix],
) -> None:
    combination, at, design = case
    values = np.random.default_rng(6).standard_normal(design.size)
    np.testing.assert_allclose(
        design.shift(values), combination.shift(at, values), atol=1e-10
    )
