"""A next check is due when a drift is expected to pass the tolerance."""

from __future__ import annotations

from datetime import date, datetime, timedelta

from postproc.record.rows import VerdictRow
from postproc.record.schedule import next_check


def check(day: int, mean_mm: float, in_control: int = 1) -> VerdictRow:
    at = (datetime(2030, 1, 1) + timedelta(days=day)).isoformat()
    return VerdictRow(
        None, "R010", day, at, 10, mean_mm, mean_mm, mean_mm, in_control, 1.0, 2.0,
        1.0, 2.0, "", 0.0,
    )  # fmt: skip


def test_three_checks_tell_no_rate() -> None:
    assert next_check([check(30 * k, 0.04) for k in range(3)], 0.1) is None
    alarmed = [check(30 * k, 0.04, int(k < 3)) for k in range(6)]
    assert next_check(alarmed, 0.1) is None


def test_a_steady_drift_is_met_when_its_line_says() -> None:
    """The square grows by 0.0001 mm2 in 10 days from 0.0016: 0.01 is 840 days away."""
    told = [check(10 * k, (0.0016 + 0.0001 * k) ** 0.5) for k in range(30)]
    due = next_check(told, 0.1)
    last = date(2030, 1, 1) + timedelta(days=290)
    assert due == last + timedelta(days=365)  # never more than a year
    due = next_check(told, 0.08)
    assert due is not None
    assert abs((due - last).days - (0.0064 - 0.0045) / 1e-5) <= 2


def test_an_arm_beyond_the_tolerance_is_due_at_once() -> None:
    told = [check(30 * k, 0.05 + 0.02 * k) for k in range(5)]
    assert next_check(told, 0.1) == date(2030, 1, 1) + timedelta(days=120)
