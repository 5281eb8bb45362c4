import numpy as np
import pytest

from postproc.robot.state import make_states
from postproc.simulation import (
    arrivals_of_states,
    follow_rows,
    make_arrivals,
    sample_survey,
    virtual_arm,
)

ARM = virtual_arm(1)


def test_rows_without_sides_take_them_from_the_way_between_rows() -> None:
    q = np.cumsum(np.random.default_rng(0).normal(size=(30, 6)), axis=0)
    a = follow_rows(ARM, q)
    np.testing.assert_array_equal(a.side[1:], np.sign(np.diff(q, axis=0)))
    assert set(np.abs(a.side[0])) == {1.0}


def test_a_joint_that_stands_keeps_its_side() -> None:
    q = np.zeros((4, 6))
    q[:, 0] = [0.0, 0.1, 0.1, 0.05]
    a = follow_rows(ARM, q)
    np.testing.assert_array_equal(a.side[1:, 0], [1, 1, -1])
    np.testing.assert_array_equal(a.side[:, 1], a.side[0, 1])


def test_rows_with_sides_are_approached_from_them() -> None:
    rng = np.random.default_rng(1)
    q, side = rng.uniform(-1, 1, (50, 6)), rng.choice([-1.0, 0.0, 1.0], (50, 6))
    a = follow_rows(ARM, q, side, 0.02)
    np.testing.assert_array_equal(a.side, side)
    reversed_ = np.zeros((50, 6), dtype=bool)
    approach = q - side * 0.02
    reversed_[1:] = np.sign(approach[1:] - q[:-1]) == -side[1:]
    np.testing.assert_allclose(a.travel[reversed_], 0.02)


def test_recorded_travel_replaces_the_followed_one() -> None:
    q = np.random.default_rng(1).uniform(-1, 1, (5, 6))
    travel = np.full((5, 6), np.nan)
    travel[2] = 0.3
    a, free = follow_rows(ARM, q, travel=travel), follow_rows(ARM, q)
    np.testing.assert_array_equal(a.travel[2], 0.3)
    np.testing.assert_array_equal(a.travel[3], free.travel[3])


def test_survey_sides_are_balanced_and_full() -> None:
    a = sample_survey(ARM, 300, seed=5)
    np.testing.assert_array_equal(np.abs(a.side), 1.0)
    assert (np.abs(a.side.mean(axis=0)) < 0.2).all()
    assert len(np.unique(np.round(a.travel[:, 1], 6))) > 200
    assert (np.diff(a.time) > 0).all() and (np.diff(a.temperature) > 0).all()
    again = sample_survey(ARM, 300, seed=5)
    np.testing.assert_array_equal(a.q, again.q)
    assert np.abs(sample_survey(ARM, 300, seed=6).q - a.q).max() > 0.1


def test_states_of_the_model_become_arrivals() -> None:
    q = np.random.default_rng(0).uniform(-1, 1, (4, 6))
    states = make_states(q, np.ones((4, 6)), np.array([0.1, 0.0, 0.2]), speed=0.3)
    a = arrivals_of_states(states)
    np.testing.assert_array_equal(a.q, q)
    np.testing.assert_array_equal(a.side, 1.0)
    np.testing.assert_allclose(a.tool[:, :3, 3], [[0.1, 0.0, 0.2]] * 4)
    np.testing.assert_array_equal(a.speed, 0.3)
    assert not np.isnan(a.temperature).any() and not np.isnan(a.travel).any()


def test_an_unknown_covariate_is_refused() -> None:
    with pytest.raises(TypeError, match="humidity"):
        make_arrivals(np.zeros((1, 6)), humidity=0.5)


def test_arrivals_cannot_be_changed() -> None:
    a = sample_survey(ARM, 3)
    with pytest.raises(ValueError, match="read-only"):
        a.q[0, 0] = 1.0
    assert len(a[:2]) == 2
