"""Designs by their definitions: gains are differences of what they are to improve."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from postproc.calibration.pose_design import Gain, choose, gain_d, gain_i

RNG = np.random.default_rng(0)
X = RNG.standard_normal((14, 3, 5)) * [3.0, 2.0, 1.0, 0.5, 0.2]
EVERYWHERE = RNG.standard_normal((40, 3, 5)) * [0.1, 0.2, 0.5, 1.0, 3.0]


def covariance(chosen: tuple[int, ...]) -> np.ndarray:
    rows = X[list(chosen)].reshape(-1, 5)
    return np.linalg.inv(np.eye(5) + rows.T @ rows)


def volume(chosen: tuple[int, ...]) -> float:
    return -float(np.linalg.slogdet(covariance(chosen)).logabsdet)


def mean_variance(chosen: tuple[int, ...]) -> float:
    flat = EVERYWHERE.reshape(-1, 5)
    return -float(np.einsum("ip,pq,iq->i", flat, covariance(chosen), flat).mean())


CRITERIA = [(gain_d, volume), (gain_i(EVERYWHERE), mean_variance)]


@pytest.mark.parametrize(("gain", "value"), CRITERIA, ids=["D", "I"])
def test_a_gain_is_what_the_criterion_rises_by(gain: Gain, value) -> None:  # type: ignore[no-untyped-def]
    at = (2, 7)
    rises = [value((*at, k)) - value(at) for k in range(len(X))]
    np.testing.assert_allclose(gain(X, covariance(at)), rises, rtol=1e-9)


@pytest.mark.parametrize(("gain", "value"), CRITERIA, ids=["D", "I"])
def test_the_exchange_comes_near_the_best_of_all_designs(gain: Gain, value) -> None:  # type: ignore[no-untyped-def]
    every = [value(c) for c in combinations(range(len(X)), 4)]
    found = choose(X, 4, gain)
    assert len(set(found.tolist())) == 4
    assert np.mean(np.array(every) > value(tuple(found))) < 0.01
