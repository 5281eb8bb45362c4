"""What visits are corrected for, and the shares of effects in that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation import outcome as outcome_module
from postproc.compensation.compensate import compensate
from postproc.compensation.outcome import Status
from postproc.compensation.scale import windowing as cuts
from postproc.model.effect_sum import INTERACTION
from postproc.report.json import report_text, target_rows
from postproc.robot.pose import MM
from tests.bench import made
from tests.written import FIRST, NEXT, POSE, program

LOST = "MOVE LINEAR TO POS(9000.0, 0.0, 0.0, 0.0, 175.0, 0.0, '')"


@pytest.fixture
def outcome(job_cell, job_model):
    lines = (FIRST, POSE, LOST, NEXT, "MOVE TO $HOME")
    return compensate(program(*lines), job_cell, job_model, name="job.pdl")


def test_shares_sum_to_what_is_corrected(outcome, job_cell, job_model):
    arrivals = outcome.arrivals
    rows = np.flatnonzero(outcome.decisions.status == Status.CORRECTED)
    assert len(rows) == 2
    whole = arrivals.shares(rows).sum(axis=1)
    error = job_model.error(job_cell.arm, arrivals.states(rows))
    np.testing.assert_allclose(whole, error, rtol=0, atol=1e-12)
    off = np.linalg.norm(outcome.decisions.correction[rows] + whole, axis=1)
    assert (off < 0.01 * np.linalg.norm(whole, axis=1)).all()  # the command moves too


def test_only_what_is_compensated_has_a_share(outcome, job_model):
    names = {e.name for e in job_model.effects.effects}
    assert "probe" in names
    assert {*outcome.arrivals.effects} == (names - {"probe"}) | {INTERACTION}


def test_what_is_not_known_has_no_share(outcome):
    rows = np.arange(len(outcome.visits))
    known = np.isfinite(outcome.decisions.q).all(axis=1)
    sizes = outcome.arrivals.sizes(rows)
    assert known.tolist() == [True, True, False, True, True]
    np.testing.assert_array_equal(np.isfinite(sizes), known[:, None] & (sizes == sizes))
    assert np.isfinite(sizes[known]).all()
    told = list(target_rows(outcome, rows))
    assert list(told[1]["share_mm"]) == list(outcome.arrivals.effects)
    assert set(told[2]["share_mm"].values()) == {None}
    wanted = np.round(sizes[1] / MM, 5)
    np.testing.assert_allclose(list(told[1]["share_mm"].values()), wanted, atol=2e-5)


def test_what_free_forms_predict_is_told_beside_its_error(job_cell, free_model):
    source = program(FIRST, POSE, LOST, NEXT)
    outcome = compensate(source, job_cell, free_model, name="job.pdl")
    rows = np.arange(len(outcome.visits))
    told = list(target_rows(outcome, rows))
    part = free_model.free_part(job_cell.arm, outcome.arrivals.states(rows[:2]))
    for i in (0, 1):
        wanted = np.array([part.error[i], part.std[i]]) / MM
        given = [told[i]["nonparametric_mm"], told[i]["nonparametric_std_mm"]]
        np.testing.assert_allclose(given, wanted, atol=1e-5)
        shares = told[i]["share_mm"]
        size = np.linalg.norm(told[i]["nonparametric_mm"])
        assert abs(shares["joint_map"] - shares["elm"]) <= size + 1e-4
        assert size <= shares["joint_map"] + shares["elm"] + 1e-4
    assert told[2]["nonparametric_mm"] == told[2]["nonparametric_std_mm"] == [None] * 3


def test_without_free_forms_nothing_is_told_of_them(outcome):
    assert '"free_' not in report_text(outcome)


def test_some_visits_are_told_as_among_all(outcome):
    whole = outcome.arrivals.shares(np.arange(len(outcome.visits)))
    rows = np.array([1, 3])
    np.testing.assert_array_equal(outcome.arrivals.shares(rows), whole[rows])


def test_windows_hand_on_how_the_arm_arrives(bench_cell, bench_model, monkeypatch):
    job = made.drilling(400)
    whole = compensate(job.source, bench_cell, bench_model)
    monkeypatch.setattr(cuts, "LEAST", 60)
    parts = compensate(job.source, bench_cell, bench_model)
    a, b = whole.arrivals, parts.arrivals
    assert len(a.travel) == len(a.speed) == len(whole.visits)
    np.testing.assert_allclose(a.travel, b.travel, rtol=0, atol=1e-9)
    rows = np.arange(len(whole.visits))
    np.testing.assert_allclose(a.sizes(rows), b.sizes(rows), rtol=0, atol=1e-8)


def test_long_reports_leave_shares_out(outcome, monkeypatch):
    assert '"share_mm"' in report_text(outcome)
    monkeypatch.setattr(outcome_module, "SHARED", len(outcome.visits) - 1)
    bare = report_text(outcome)
    assert '"share_mm"' not in bare
    assert bare == report_text(replace(outcome, arrivals=None))
