"""What is solved anew, and what is kept from before."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.program import plan_visits, read_program, states_of
from postproc.compensation.solver.inverse_model import (
    foresee,
    predict_arrivals,
    solve_again,
    solve_visits,
)
from tests.written import FIRST, program

POINTS = [
    f"MOVE LINEAR TO POS({100 + 40 * k}.0, {200 - 30 * k}.0, {150 + 25 * (k % 3)}.0, "
    f"0.0, 175.0, {5 * k}.0, '')"
    for k in range(8)
]
LOST = "MOVE LINEAR TO p"  # that nobody has given a value


@pytest.fixture
def solving(job_cell, job_model):
    """Model, cell, plan and states of a program: what visits are solved with."""
    reading = read_program({"job.pdl": program(FIRST, *POINTS, LOST)}, job_cell)
    planned = plan_visits(reading.visits, job_cell)
    return job_model, job_cell, planned, states_of(planned.plan, job_cell, 20.0)


@pytest.mark.parametrize("orientation", [False, True])
def test_visits_solved_anew_are_as_if_solved_so_at_once(solving, orientation):
    model, cell, planned, states = solving
    first = solve_visits(*solving, orientation)
    direction, rows = np.array(states.direction), np.zeros(len(states), dtype=bool)
    direction[3:6], direction[6] = -direction[3:6], 0.3
    rows[3:7] = True
    aimed = states.with_(direction=direction)
    again = solve_again(first, rows, model, cell, planned, aimed, orientation)
    at_once = solve_visits(model, cell, planned, aimed, orientation)
    for name in ("direction", "q", "command", "turn", "residual"):
        found, wanted = getattr(again, name), getattr(at_once, name)
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)
    assert np.abs(again.q - first.q)[rows].max() > 1e-5
    assert (np.nanmax(np.abs(again.turn)) > 1e-5) == orientation


def test_standard_errors_are_those_of_the_sides_that_were_solved_for(solving):
    model, cell, planned, states = solving
    first = solve_visits(*solving)
    direction, rows = np.array(states.direction), np.zeros(len(states), dtype=bool)
    direction[3:6, 1], direction[6] = -direction[3:6, 1], 0.3
    rows[3:7] = True
    aimed = states.with_(direction=direction)
    again = solve_again(first, rows, model, cell, planned, aimed)
    foreseen = foresee(model, cell, states, again)
    found = foreseen.std_error
    known = ~np.isnan(planned.plan.q).any(axis=1)
    assert known.sum() == len(POINTS) + 1 and np.isnan(found[~known]).all()
    wanted = model.std_error(cell.arm, aimed[known])
    np.testing.assert_allclose(found[known], wanted, rtol=1e-9)
    told = predict_arrivals(model, cell, states, foreseen)
    direct = model.predict(cell.arm, aimed[known])
    for name in ("error", "std_model", "covariance"):
        np.testing.assert_array_equal(getattr(told, name)[known], getattr(direct, name))
    np.testing.assert_array_equal(told.any_outside[known], direct.any_outside)
    before = foresee(model, cell, states, first).std_error
    assert np.abs(found - before)[6].max() > 1e-6
