"""What `predict` says of repeated readings and of strays."""

from __future__ import annotations

import numpy as np

from postproc.calibration.residuals import beside_all
from tests.calibration.simulator import random_states, survey_of


def rows_of(poses: int, repeats: int):  # type: ignore[no-untyped-def]
    states = random_states(poses, np.random.default_rng(0))
    rows = states[np.repeat(np.arange(poses), repeats)]
    rows = rows.with_(order=np.arange(len(rows), dtype=float))
    return survey_of(rows, np.zeros((len(rows), 3)))


def scatter(n: int, size: float = 1e-5) -> np.ndarray:
    return size * np.random.default_rng(1).standard_normal((n, 3))


def test_single_rows_without_strays_have_nothing_to_add() -> None:
    assert beside_all(rows_of(60, 1), scatter(60)) == ""
    assert beside_all(rows_of(0, 1), scatter(0)) == ""


def test_means_over_readings_are_given_beside_the_rows() -> None:
    left = 1e-4 + scatter(120)
    said = beside_all(rows_of(30, 4), left)
    mean = np.linalg.norm(left.reshape(30, 4, 3).mean(axis=1), axis=1).mean() * 1e3
    assert "120 readings, 30 means" in said
    assert f"means is {mean:.4f} mm on average" in said and "far off" not in said


def test_strays_are_named_the_worst_first_and_taken_off() -> None:
    left = scatter(60)
    left[[4, 30]] += [[0.0, 1e-3, 0.0], [2e-3, 0.0, 0.0]]
    said = beside_all(rows_of(60, 1), left)
    assert "2 of 60 rows are far off the others (31 in line 32: 2.0" in said
    assert "5 in line 6: 0.99" in said
    usual = np.linalg.norm(scatter(60), axis=1)
    usual = np.delete(usual, [4, 30]).mean() * 1e3
    assert f"without them {usual:.4f} mm" in said


def test_many_strays_are_counted() -> None:
    left = scatter(100)
    left[::10] += 1e-3
    said = beside_all(rows_of(100, 1), left)
    assert "10 of 100 rows" in said and "and 5 more" in said
