"""What moves along with corrected targets: foretold as another plan finds it."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.program import plan_visits, read_program
from postproc.compensation.solver.dependants import with_dependants, with_origins
from tests.written import FIRST, program

LINES = (
    "p := POS(300.0, 100.0, 220.0, 0.0, 175.0, 0.0, '')",
    "MOVE LINEAR TO p",
    "MOVE LINEAR TO POS_SHIFT(p, VEC(0, 0, -20))",
    "MOVE LINEAR NEAR p BY 15",
    "MOVE LINEAR RELATIVE VEC(0, 10, -10) IN BASE",
    "MOVE LINEAR AWAY 5",
    "MOVE LINEAR TO POS(250.0, 150.0, 250.0, 0.0, 175.0, 0.0, '')",
    "MOVE LINEAR FOR 30 TO p",
)
P = (1, 2, 3, 7)  # visits with the numbers of p
MOVED_MM = np.array([0.5, -0.3, 0.8])


@pytest.fixture
def planned(job_cell):
    visits = read_program({"job.pdl": program(FIRST, *LINES)}, job_cell).visits
    return visits, plan_visits(visits, job_cell)


def test_all_that_moves_along_is_foretold(job_cell, planned) -> None:
    visits, before = planned
    assert visits.target.follows.tolist() == [-1, -1, 1, 1, -1, -1, -1, 1]
    values = np.array(visits.target.values)
    values[[*P], :3] += MOVED_MM
    after = plan_visits(visits.with_columns(values=values), job_cell)
    real = (after.plan.tcp - before.plan.tcp)[:, :3, 3]
    shift = np.where(np.arange(len(visits))[:, None] == P[0], real, 0.0)
    found = with_dependants(visits, before, job_cell, values, shift)
    assert np.linalg.norm(real[[2, 3, 4, 5, 7]], axis=1).min() > 1e-4
    assert np.abs(found - real).max() < 2e-5


def test_those_that_are_moved_along_with_are_found(planned) -> None:
    visits, before = planned
    for asked, wanted in ((5, {1, 3, 4, 5}), (7, {1, 6, 7}), (6, {6})):
        found = with_origins(visits, before, np.arange(len(visits)) == asked)
        assert set(np.flatnonzero(found).tolist()) == wanted
