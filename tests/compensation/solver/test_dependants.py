"""Targets computed from others: they move along, or both are left alone."""

from __future__ import annotations

import re

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.outcome import Status
from postproc.compensation.program import plan_visits, read_program
from tests.written import FIRST, program

SET = "p := POS(100.0, 200.0, 150.0, 0.0, 175.0, 0.0, '')"
TO_P = "MOVE LINEAR TO p"


def run(job, *lines):
    cell, model = job
    return compensate(program(FIRST, SET, *lines), cell, model, name="job.pdl")


@pytest.fixture
def job(job_cell, job_model):
    return job_cell, job_model


def literal(outcome) -> list[float]:
    """Return the numbers that `p` is given in the output."""
    found = re.search(rb"p := POS\(([^']*),", outcome.outputs["job.pdl"])
    assert found
    return [float(number) for number in found[1].split(b",")]


@pytest.mark.parametrize(
    "computed",
    [
        "MOVE LINEAR TO POS_SHIFT(p, VEC(0, 0, 20))",
        "MOVE LINEAR NEAR p BY 20",
        "MOVE LINEAR TO POS(p.X, p.Y, p.Z + 20, p.A, p.E, p.R, '')",
        "p.Z := p.Z + 20\r\n  MOVE LINEAR TO p",
        "r := p\r\n  r.Z += 20\r\n  MOVE LINEAR TO r",
    ],
)
def test_a_computed_target_moves_along(job, computed):
    outcome = run(job, TO_P, computed)
    status = outcome.decisions.status.tolist()
    assert Status(status[1]) is Status.CORRECTED
    assert Status(status[2]) is not Status.CORRECTED
    moved = np.subtract(literal(outcome), [100.0, 200.0, 150.0, 0.0, 175.0, 0.0])
    assert np.linalg.norm(moved) > 0.5
    again = read_program(dict(outcome.outputs), job[0]).visits
    change = again.target.values[2] - outcome.visits.target.values[2]
    assert change == pytest.approx(moved, abs=1e-6)
    planned = [plan_visits(v, job[0]).plan.tcp[2] for v in (outcome.visits, again)]
    step = np.linalg.norm(planned[1][:3, 3] - planned[0][:3, 3])
    assert step == pytest.approx(1e-3 * np.linalg.norm(moved[:3]), abs=1e-8)


@pytest.mark.parametrize(
    ("other", "why"),
    [
        ("$UFRAME := p", r"\$UFRAME is set to it"),
        ("$TOOL := POS_INV(p)", "POS_INV computes with it"),
        ("r := p : POS(1, 2, 3, 4, 5, 6, '')", "composes it with a frame"),
        ("IF p.Z > 10 THEN\r\n  ENDIF", "computes with a part of it"),
        ("MOVE LINEAR TO POS(p.X, 2, 300, 0, 175, 0, '')", "computed from a part"),
        ("POS_TO_JNTP(p, j, e)", "POS_TO_JNTP computes with it"),
    ],
)
def test_what_else_depends_on_a_target_keeps_it(job, other, why):
    outcome = run(job, TO_P, other)
    d = outcome.decisions
    assert Status(d.status[1]) is Status.CONFLICT
    assert re.search(why, d.reasons[d.why[1]].text)
    assert literal(outcome) == [100.0, 200.0, 150.0, 0.0, 175.0, 0.0]
    assert outcome.exit_code == 1


def test_a_target_is_not_made_worse_by_one_that_it_is_computed_from(job):
    far = "MOVE JOINT TO POS_SHIFT(p, VEC(-1500, 400, -200))"
    outcome = run(job, TO_P, far)
    d = outcome.decisions
    assert "farther off" in d.reasons[d.why[1]].text
    assert literal(outcome) == [100.0, 200.0, 150.0, 0.0, 175.0, 0.0]


@pytest.mark.parametrize("call", ["f()", "f"])
def test_a_function_that_is_not_followed_keeps_what_it_reads(job, call):
    cell, model = job
    routine = (
        "PROGRAM job\r\nVAR p : POSITION\r\n  n : INTEGER\r\n"
        "ROUTINE f : INTEGER\r\nBEGIN\r\n"
        "  $TOOL := p\r\n  RETURN(1)\r\nEND f\r\nBEGIN\r\n"
        f"  {FIRST}\r\n  {SET}\r\n  {TO_P}\r\n  n := {call}\r\nEND job\r\n"
    )
    outcome = compensate(routine.encode(), cell, model)
    d = outcome.decisions
    assert "f may compute with it" in d.reasons[d.why[1]].text
