"""The programs of the bench are what they claim to be; the loop agrees with ours."""

import numpy as np
import pytest

from postproc.compensation.program import plan_visits, read_program, states_of
from postproc.compensation.solver.inverse_model import solve
from postproc.robot.cell import load_cell
from tests.bench.__main__ import CELL
from tests.bench.beside import _one
from tests.bench.made import KINDS, milling


@pytest.mark.parametrize("kind", KINDS)
def test_made_programs_are_planned_without_trouble(kind):
    made, cell = KINDS[kind](200), load_cell(CELL)
    files = {made.name: made.source}
    if made.variables is not None:
        files["spot.lsv"] = made.variables
    reading = read_program(files, cell)
    held = reading.visits.target.literal >= 0
    assert 199 <= held.sum() <= 204
    planned = plan_visits(reading.visits, cell, timed=False)
    assert (planned.reasons.index[held] == 0).all()


def test_the_loop_gives_the_commands_of_the_arrays(job_model):
    made, cell = milling(12), load_cell(CELL)
    plan = plan_visits(read_program({made.name: made.source}, cell).visits, cell).plan
    states = states_of(plan, cell, cell.temperature)
    ours = solve(job_model, cell.arm, plan.tcp, plan.tool, states).command[:, :3, 3]
    for i in range(len(states)):
        one = _one(job_model, cell.arm, plan.tcp[i], plan.tool[i], states[i : i + 1])
        assert np.linalg.norm(one - ours[i]) < 1e-6
