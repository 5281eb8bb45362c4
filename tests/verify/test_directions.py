"""Directions read off trajectories of toppra and ruckig."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.options import Options
from postproc.language.visits import Meaning
from postproc.verify import directions
from postproc.verify.cycle import NOT_DRAWN
from postproc.verify.directions import MOVES, draw
from postproc.verify.ruckig_move import move_in_time
from postproc.verify.toppra_run import run_in_time
from tests.made_visits import visits as made_visits
from tests.verify.judged import SHIPPED, row, shipped

LIMITS = np.array([[2.0] * 6, [5.0] * 6, [50.0] * 6])


FREE = np.zeros(40)  # [s] what the programmed speed asks for: nothing


def test_a_run_is_timed_and_goes_its_way() -> None:
    u = np.linspace(0.0, 1.0, 40)[:, None]
    way = np.sin(u * np.arange(1, 7))
    found = run_in_time(way, LIMITS[0], LIMITS[1], FREE)
    assert found is not None
    np.testing.assert_allclose(found.q[[0, -1]], way[[0, -1]], atol=1e-6)
    apart = np.abs(found.q[:, None] - way).max(axis=2).min(axis=1)
    assert apart.max() < np.abs(np.diff(way, axis=0)).max()
    longest = np.abs(np.diff(way, axis=0)).sum(axis=0).max()
    assert longest / 2.0 < found.seconds < longest / 2.0 + 5.0


def test_a_run_takes_what_the_programmed_speed_asks_for() -> None:
    """A straight way of 10 s at the programmed speed; the joints could do it in 1 s."""
    way = np.linspace(0.0, 1.0, 40)[:, None] * np.ones(6)
    found = run_in_time(way, LIMITS[0], LIMITS[1], np.linspace(0.0, 10.0, 40))
    assert found is not None
    ramps = 0.1 / 5.0  # [s] speed over acceleration
    assert found.seconds == pytest.approx(10.0 + ramps, rel=0.02)


def test_a_run_of_no_length_needs_no_time() -> None:
    still = run_in_time(np.zeros((5, 6)), LIMITS[0], LIMITS[1], FREE[:5])
    assert still is not None and still.seconds == 0.0
    assert np.abs(still.q).max() == 0.0


def test_toppra_may_fail() -> None:
    way = np.linspace(0.0, 1.0, 9)[:, None] * np.ones(6)
    way[4] = np.nan
    assert run_in_time(way, LIMITS[0], LIMITS[1], FREE[:9]) is None


def test_a_joint_move_is_timed() -> None:
    end = np.arange(1.0, 7.0)
    found = move_in_time(np.zeros(6), end, LIMITS)
    assert found is not None
    np.testing.assert_allclose(found.q[[0, -1]], [np.zeros(6), end], atol=1e-9)
    v, a, j = 2.0, 5.0, 50.0  # of the axis that goes farthest: 6 rad
    assert found.seconds == pytest.approx(6.0 / v + v / a + a / j)
    assert move_in_time(np.zeros(6), end, 0 * LIMITS) is None


@pytest.mark.parametrize("name", SHIPPED)
def test_the_shipped_programs_agree(name: str, models) -> None:
    job = shipped(name, models)
    opinion = job.opinion()
    assert opinion.agrees, opinion.to_dict()
    ends = row(opinion, "output: end of the way")
    assert 0.9 < ends.compared / min(len(job.outcome.visits), MOVES)
    assert ends.largest < 1e-8  # [rad]
    found = row(opinion, "output: approach directions")
    stops = 6 * int(
        (~job.outcome.visits.motion.fly & ~job.outcome.visits.motion.via).sum()
    )
    skipped = {why: n for why, n in found.skipped.items() if "blend" not in why}
    assert found.compared + sum(skipped.values()) == stops
    assert found.compared > 0.7 * stops


def test_long_programs_are_drawn_from_in_blocks(models) -> None:
    opinion = shipped("milling.pdl", models).opinion()
    ends = row(opinion, "output: end of the way")
    assert ends.compared + sum(ends.skipped.values()) == 5171
    assert MOVES - 250 < ends.compared <= MOVES
    assert opinion.seconds < 60


def test_stops_that_are_not_drawn_are_counted_as_such(models, monkeypatch) -> None:
    monkeypatch.setattr(directions, "MOVES", 100)
    monkeypatch.setattr(directions, "BLOCK", 10)
    opinion = shipped("drilling.pdl", models).opinion()
    ends = row(opinion, "output: end of the way")
    away = ends.skipped[NOT_DRAWN]
    assert away > 500
    for what, times in (("approach directions", 6), ("time over fly points", 1)):
        found = row(opinion, f"output: {what}")
        assert found.skipped[NOT_DRAWN] == times * away


def test_the_same_program_is_drawn_from_alike(models) -> None:
    class Long:
        def __init__(self, seed: int) -> None:
            values = np.random.default_rng(seed).random((20_000, 6))
            self.visits = made_visits([Meaning.POSE] * 20_000, values.tolist())

        def __len__(self) -> int:
            return 20_000

    rows = [draw(Long(seed)) for seed in (1, 1, 2)]  # type: ignore[arg-type]
    assert len(rows[0]) == MOVES
    assert np.array_equal(rows[0], rows[1]) and not np.array_equal(rows[0], rows[2])


def test_clones_are_judged_by_what_they_are_corrected_for(models) -> None:
    opinion = shipped("handling.pdl", models, Options(shared_points="clone")).opinion()
    assert opinion.agrees, opinion.to_dict()
    assert row(opinion, "output: approach directions").compared > 400


def test_points_on_ways_are_visits_of_the_output_alone(models) -> None:
    options = Options(path_tolerance_mm=0.05, max_inserted=50)
    job = shipped("drilling.pdl", models, options)
    opinion = job.opinion()
    assert opinion.agrees, opinion.to_dict()
    before, after = (row(opinion, f"{k}: place").compared for k in ("source", "output"))
    assert before < after <= before + 50
    swung = [r for r in opinion.rows if "swing" in r.what or "by correction" in r.what]
    counts = [(r.compared, sum(r.skipped.values())) for r in swung]
    assert counts == [(0, before + 3)] * 3  # three are joint targets
