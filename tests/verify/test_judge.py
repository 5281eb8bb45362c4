"""How long a second opinion takes, and what it says where the time is up."""

from __future__ import annotations

from postproc.compensation.findings.second_opinion import facts_of
from postproc.verify import positions
from postproc.verify.judge import judge
from postproc.verify.opinion import TIME_UP, Allowance
from tests.verify.faults import Case
from tests.verify.judged import row, shipped


def test_what_time_does_not_reach_is_counted(models, monkeypatch) -> None:
    one = Case.of(shipped("spot.pdl", models))
    facts = facts_of(one.job.cell)
    none = judge("spot.pdl", facts, *one.right, Allowance(-1.0, -1.0))
    assert none.agrees
    for what in ("place", "singular value", "gravity torque"):
        found = row(none, f"output: {what}")
        assert found.compared == 0 and found.skipped[TIME_UP] > 100
    assert row(none, "output: approach directions").compared == 0
    ways = row(none, "output: end of the way")
    assert ways.compared == 0 and sum(ways.skipped.values()) == 109
    whole = judge("spot.pdl", facts, *one.right)
    assert not any(TIME_UP in r.skipped for r in whole.rows)


def test_the_output_comes_first_where_time_is_short(models, monkeypatch) -> None:
    one = Case.of(shipped("spot.pdl", models))
    clock = iter(range(10_000))
    monkeypatch.setattr(positions, "OFTEN", 1)
    monkeypatch.setattr(positions, "monotonic", lambda: next(clock))
    monkeypatch.setattr("postproc.verify.judge.monotonic", lambda: 0.0)
    half = judge("spot.pdl", facts_of(one.job.cell), *one.right, Allowance(150.0, 60.0))
    assert row(half, "output: place").compared == 107
    source = row(half, "source: place")
    assert 0 < source.compared < 60
    assert source.compared + source.skipped[TIME_UP] == 107
    swing = row(half, "swing of the elbow")
    assert swing.compared + swing.skipped[TIME_UP] == 109


def test_what_one_program_takes_the_next_has_not(models) -> None:
    one = Case.of(shipped("handling.pdl", models))
    opinion = one.weigh_rows(one.right)
    left = Allowance(60.0, 60.0).less(opinion)
    assert 59.0 < left.positions < 60.0 and 50.0 < left.ways < 60.0
    spent = 120.0 - left.positions - left.ways
    assert abs(spent - opinion.seconds) < 1e-9
