"""A program that is corrected window by window comes out as if it were corrected whole.

Two things differ. Rounds for rounded corners end when those of the window are hit to
`CLOSE`, while those of a whole program go on as long as any is not: that is bounded
here. And a window begins from where the one before has settled: where the first move
behind a cut is so short that joints stay within their play, the sides there are found
on another way, and a target that never settles may come out elsewhere within the play.
"""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest

from postproc.compensation import compensate as compensate_module
from postproc.compensation import windows as cuts
from postproc.compensation.compensate import compensate
from postproc.compensation.iterate import CLOSE
from postproc.compensation.outcome import Outcome, Status
from postproc.compensation.program import read_program
from postproc.compensation.windows import windows
from postproc.robot.pose import MM
from tests.bench import made

LEAST = 60
SLACK = 1e-9  # [m] what summing in blocks rounds off, once a model has seen it


@pytest.fixture
def job(bench_cell, bench_model, monkeypatch):
    def run(program: made.Made, least: int = LEAST) -> Outcome:
        monkeypatch.setattr(cuts, "LEAST", least)
        return compensate(
            program.source,
            bench_cell,
            bench_model,
            name=program.name,
            variables=program.variables,
        )

    return run


def many(outcome: Outcome) -> None:
    """Make sure that there was something to show."""
    assert len(windows(outcome.visits, LEAST)) > 4
    assert outcome.decisions.count(Status.SAFE) > 300


def assert_same_decisions(a: Outcome, b: Outcome) -> None:
    d, e = a.decisions, b.decisions
    np.testing.assert_array_equal(d.status, e.status)
    np.testing.assert_array_equal(d.direction, e.direction)
    assert [d.reasons[k] for k in d.why] == [e.reasons[k] for k in e.why]
    np.testing.assert_allclose(d.q, e.q, rtol=0, atol=SLACK)
    np.testing.assert_allclose(a.position, b.position, rtol=0, atol=SLACK)
    assert list(map(str, a.diagnostics)) == list(map(str, b.diagnostics))


@pytest.mark.parametrize("kind", ["spot", "drilling", "handling"])
def test_between_stops_windows_change_no_byte(job, kind: str) -> None:
    program = made.KINDS[kind](400)
    whole, cut = job(program, 10_000), job(program)
    many(cut)
    assert cut.outputs == whole.outputs
    assert_same_decisions(cut, whole)
    for name in ("correction", "std_error", "side"):
        a, b = getattr(cut.decisions, name), getattr(whole.decisions, name)
        np.testing.assert_allclose(a, b, rtol=0, atol=SLACK / MM)
    assert cut.before.max_mm == pytest.approx(whole.before.max_mm, abs=SLACK / MM)
    assert cut.after.max_mm == pytest.approx(whole.after.max_mm, abs=SLACK / MM)


def test_in_runs_they_change_less_than_how_well_corners_are_hit(
    job, monkeypatch
) -> None:
    monkeypatch.setattr(made, "ROW", 40)
    monkeypatch.setattr(made, "ROWS", 5)
    program = made.milling(1500)
    whole, cut = job(program, 10_000), job(program)
    many(cut)
    assert_same_decisions(cut, whole)
    apart = np.abs(cut.decisions.corrected - whole.decisions.corrected)[:, :3]
    assert np.nanmax(apart) * MM <= 2 * CLOSE
    off = np.abs(cut.decisions.correction - whole.decisions.correction)
    assert off.max() <= CLOSE


def test_doubt_about_a_branch_goes_on_behind_a_cut(job) -> None:
    program = made.drilling(300)
    # The program asks, at a target in the first window, not to check its branch.
    source = program.source.replace(b"'T1:0 T2:0')", b"'W T1:0 T2:0')")
    source = source.replace(b"BEGIN\n", b"BEGIN\n  $CNFG_CARE := FALSE\n", 1)
    assert source != program.source
    program = made.Made(program.name, source)
    whole, cut = job(program, 10_000), job(program)
    assert len(windows(cut.visits, LEAST)) > 4
    assert_same_decisions(cut, whole)
    behind = cut.decisions.why[200:]
    assert (behind > 0).all()
    assert "not sure" in cut.decisions.reasons[behind[0]]


def test_one_window_is_in_memory_at_a_time(job, monkeypatch) -> None:
    original, plans, alive = compensate_module.plan_visits, [], []

    def watched(*given):
        gc.collect()
        alive.append(sum(plan() is not None for plan in plans))
        planned = original(*given)
        plans.extend(map(weakref.ref, (planned, planned.plan, planned.targets)))
        return planned

    monkeypatch.setattr(compensate_module, "plan_visits", watched)
    many(job(made.drilling(400)))
    assert len(alive) > 4 and not any(alive)


def test_what_was_looked_at_last_is_what_is_read_from_the_output(
    job, bench_cell
) -> None:
    outcome = job(made.drilling(400))
    again = read_program(dict(outcome.outputs), bench_cell).visits
    np.testing.assert_array_equal(again.values, outcome.decisions.corrected)
