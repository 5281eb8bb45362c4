"""Empirical Bayes against brute force."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import approx_fprime
from scipy.stats import multivariate_normal

from postproc.calibration.diagnosis.held_out import Folds
from postproc.calibration.evidence import Normal, Solved, highest, maximise, posterior
from tests.calibration.planted import plain_design


def problem(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, Normal]:
    rng = np.random.default_rng(seed)
    X = rng.standard_normal((40, 5))
    group = np.array([0, 0, 0, 1, 1])
    y = X @ np.array([2.0, -1.0, 1.5, 0.0, 0.0]) + rng.standard_normal(40)
    return X, y, group, Normal(X.T @ X, X.T @ y, float(y @ y), 0.0, 40.0)


def test_evidence_is_the_density_of_the_data() -> None:
    X, y, group, normal = problem()
    log_scale = np.array([0.3, -0.8])
    s2 = np.exp(2 * log_scale)[group]
    found = posterior(normal, group, log_scale)
    covariance = np.eye(40) + X * s2 @ X.T
    direct = multivariate_normal(np.zeros(40), covariance).logpdf(y)
    assert found.log_evidence == pytest.approx(direct, rel=1e-10)
    A = X.T @ X + np.diag(1 / s2)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(A), rtol=1e-8)
    np.testing.assert_allclose(found.mean, np.linalg.solve(A, X.T @ y), rtol=1e-8)


def test_the_scales_maximise_the_evidence() -> None:
    _, _, group, normal = problem()
    found = maximise(normal, group, np.zeros(2))

    def cost(u: np.ndarray) -> float:
        return (
            0.5 * float((u**2).sum()) / 9.0 - posterior(normal, group, u).log_evidence
        )

    slope = approx_fprime(found.log_scale, cost, 1e-6)
    inside = found.log_scale > -7.9
    assert np.abs(slope[inside]).max() < 1e-3
    assert found.log_scale[0] > -1.0 > found.log_scale[1]
    assert 2.5 < found.effective < 4.0


def test_a_group_without_effect_is_shut() -> None:
    rng = np.random.default_rng(1)
    X = rng.standard_normal((400, 40))
    y = rng.standard_normal(400)
    normal = Normal(X.T @ X, X.T @ y, float(y @ y), 0.0, 400.0)
    found = maximise(normal, np.zeros(40, dtype=int), np.zeros(1))
    assert found.effective < 8  # of 40


@pytest.mark.parametrize("apart", [0.0, 1e-12, 1e-9, 1e-6])
def test_columns_that_are_nearly_the_same_are_no_problem(apart: float) -> None:
    """Well determined together, on scales of a thousand, they leave only rounding."""
    rng = np.random.default_rng(2)
    one = rng.standard_normal(2500)
    X = 1e4 * np.stack([one + apart * rng.standard_normal(2500) for _ in range(6)], 1)
    y = 1e-4 * X.sum(axis=1) + rng.standard_normal(2500)
    normal = Normal(X.T @ X, X.T @ y, float(y @ y), 0.0, 2500.0)
    group = np.array([0, 0, 1, 1, 2, 2])
    at = posterior(normal, group, np.full(3, 7.0))
    assert np.isfinite(at.log_evidence) and (np.diag(at.covariance) >= 0).all()
    found = maximise(normal, group, np.full(3, 6.0))
    fitted = X @ found.mean
    assert np.sqrt(np.mean((fitted - 1e-4 * X.sum(axis=1)) ** 2)) < 0.1


def test_folds_of_columns_that_are_the_same_are_predicted() -> None:
    rng = np.random.default_rng(3)
    X = 1e9 * np.repeat(rng.standard_normal((300, 1)), 4, axis=1)
    y = 1e-9 * X[:, 0] + 1e-3 * rng.standard_normal(300)
    folds = Folds.of(plain_design(X), np.ones(4), y, np.arange(100) % 5)
    errors, less = folds.errors(slice(0, 1))
    assert np.sqrt(np.mean(less**2)) < 2e-3
    assert np.sqrt(np.mean(errors**2)) < 2e-3


def test_few_solutions_find_the_scales(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each costs as much as all else: its slopes and curvature lead to the next."""
    _, _, group, normal = problem()
    solved = []

    def counted(of: type[Solved], *given: Any) -> Solved:
        solved.append(given)
        return solve(*given)

    solve = Solved.at
    monkeypatch.setattr(Solved, "at", classmethod(counted))
    count = int(group.max()) + 1
    found = maximise(normal, group, np.zeros(count))
    assert len(solved) <= 10
    maximise(normal, group, found.log_scale)
    assert len(solved) <= 12


def test_no_groups_no_search() -> None:
    none = np.zeros(0)
    found = maximise(
        Normal(np.zeros((0, 0)), none, 3.0, 0.0, 4.0), none.astype(int), none
    )
    assert found.mean.shape == (0,) and found.effective == 0


def test_a_search_gives_up_only_below_what_is_asked_for() -> None:
    _, _, group, normal = problem()
    best = highest(normal, group, np.zeros(2), 60, -np.inf)
    for least in best + np.array([-50.0, -1.0, -1e-3]):
        assert highest(normal, group, np.zeros(2), 60, least) == best
    for least in best + np.array([1e-3, 1.0, 50.0]):
        assert highest(normal, group, np.zeros(2), 60, least) <= best


def test_parameters_left_to_their_prior_are_integrated_over() -> None:
    X, _, group, normal = problem()
    aside = np.arange(X.shape[1]) % 3 == 0
    u = np.array([0.3, -0.4])[: group.max() + 1]
    whole = posterior(normal, group, u)
    rest = normal.marginalise(aside, np.exp(u)[group[aside]])
    part = posterior(rest, group[~aside], u)
    assert np.isclose(part.log_evidence, whole.log_evidence, rtol=1e-10)
    assert np.allclose(part.mean, whole.mean[~aside])
    assert np.allclose(part.covariance, whole.covariance[np.ix_(~aside, ~aside)])
