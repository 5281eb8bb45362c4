from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.diagnosis.investigate import trace
from postproc.calibration.orientations import _without, judge, student_weights
from postproc.calibration.regression import fit_effects
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.kinematics import ArmStates
from postproc.simulation import Planted, stream, virtual_arm
from tests.calibration.planted import ARM, BASE, TRACKER, states_of, survey
from tests.calibration.simulator import NJ, random_states

STATES = random_states(300, np.random.default_rng(0))
J = ArmStates(NJ, STATES).jacobian
NOISE = 3e-5


def judged(residual: np.ndarray):  # type: ignore[no-untyped-def]
    distance = np.linalg.norm(residual, axis=1) / NOISE
    return judge(distance, residual, STATES.q, J, np.arange(len(J)))


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


@pytest.mark.parametrize("end", [0, -1])
@pytest.mark.parametrize("joint", range(6))
def test_a_lone_row_at_the_end_of_a_range_is_dropped(joint: int, end: int) -> None:
    row = np.argsort(STATES.q[:, joint])[end]
    residual = noise(2)
    residual[row] = 3e-3 * J[row, :, joint] / np.linalg.norm(J[row, :, joint])
    found = judged(residual)
    assert found.weight[row] == 0 and not found.spared[row]


def test_a_row_is_no_neighbour_of_its_own_where_poses_repeat() -> None:
    """The second of many readings of one pose is not the first one found there."""
    twice = np.arange(300)
    twice[100:110] = 100
    residual = noise(3)[twice]
    residual[105] = [3e-3, 0, 0]
    distance = np.linalg.norm(residual, axis=1) / NOISE
    found = judge(distance, residual, STATES.q[twice], J[twice], twice)
    assert found.weight[105] == 0
    nearest = _without(np.array([5, 7]), np.array([[4, 5, 6], [1, 2, 3]]))
    assert nearest.tolist() == [[4, 6], [1, 2]]


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


@pytest.mark.slow
def test_a_worn_spot_survives_beside_a_broken_beam() -> None:
    """Both are some thirty sigma; only the row without neighbours is dropped."""
    spot = Planted("worn_spot", 2, peak_mm=1.5)
    arm = virtual_arm(370, (*map(Planted, BASE), spot))
    arrivals = survey(arm, 370, 300)
    position = arm.measure(arrivals, TRACKER, stream(370, "tracker"))
    law = arm.laws[-1]
    away = np.abs(arrivals.q[:, 1] - law.parameters["centre"])
    worn = away < law.parameters["width"]
    broken = np.flatnonzero(away > 5 * law.parameters["width"])[:3]
    position[broken] += np.array([1e-3, -1e-3, 1e-3])
    states = states_of(arrivals)
    base = fit_effects(
        ArmStates(ARM, states),
        position,
        propose(BASE_EFFECTS, ARM, states),
        tuple(TRACKER),
    )
    found = trace(base, seed=0).search
    assert found.additions[0].candidate.family.effect == "joint_map"
    assert found.additions[0].candidate.family.joint == 2
    weight = found.fit.rows.weight
    assert (weight[broken] < 0.2).all()
    assert (weight[worn] == 1).mean() > 0.95
