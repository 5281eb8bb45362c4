from __future__ import annotations

import numpy as np

from postproc.accuracy.batch import Batch
from postproc.accuracy.outliers import judge, student_weights
from tests.accuracy.simulator import NJ, random_states

STATES = random_states(300, np.random.default_rng(0))
J = Batch(NJ, STATES).jacobian
NOISE = 3e-5


def judged(residual: np.ndarray):  # type: ignore[no-untyped-def]
    distance = np.linalg.norm(residual, axis=1) / NOISE
    return judge(distance, residual, STATES.q, J)


def noise(seed: int = 1) -> np.ndarray:
    return NOISE * np.random.default_rng(seed).standard_normal((300, 3))


def test_good_rows_keep_their_weight() -> None:
    touched = [(judged(noise(k)).weight < 1).any() for k in range(40)]
    assert np.mean(touched) < 0.1


def test_a_lone_row_is_dropped_and_a_mild_one_weighed() -> None:
    residual = noise()
    residual[10] = [3e-3, 0, 0]
    residual[20] = [0, 1.8e-4, 0]
    weight = judged(residual).weight
    assert weight[10] == 0
    assert 0 < weight[20] < 1
    assert (np.delete(weight, [10, 20]) == 1).all()


def test_rows_at_one_angle_of_a_joint_are_spared() -> None:
    worn = np.abs(STATES.q[:, 1]) < 0.1
    assert 5 < worn.sum() < 60
    residual = noise() + J[:, :, 1] * np.where(worn, 4e-4, 0.0)[:, None]
    found = judged(residual)
    assert found.spared[worn].mean() > 0.7
    assert (found.weight[worn] == 1).mean() > 0.9


def test_heavy_tails_fall_with_the_distance() -> None:
    w = student_weights(np.array([0.0, 1.0, 5.0, 100.0]))
    assert (np.diff(w) < 0).all() and w[-1] < 1e-3
