"""Where points may harm, a later stop or a later first point is one more plan."""

from __future__ import annotations

from dataclasses import replace
from typing import Any
from unittest.mock import Mock

import pytest

from postproc.compensation.paths import prune
from postproc.compensation.paths.backlash_preload import TAKEN
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.compensation.paths.plan_outcomes import BEGINS, Objection

LENGTH = 0.5  # [m] of a line
PIECE = 2.5e-3  # [m] the shortest of it


def line(*shares: float, length: float = LENGTH) -> Any:
    """A line to visit 7 with points."""
    plan = InsertionPlan(points={7: shares}, open={7: (PIECE, PIECE, PIECE)})
    now = Mock(plan=plan)
    now.length_of.return_value = length
    return now


def stopped(*shares: float, length: float = LENGTH) -> Any:
    """A line to visit 7 whose first point is a stop."""
    now = line(*shares, length=length)
    now.plan = replace(now.plan, stops=frozenset({7}))
    return now


def outcome(harms: bool, place: float = 0.5) -> Any:
    found = Objection(1e-4, place, None) if harms else None
    return Mock(objection=lambda _: found)


def test_a_later_stop_is_looked_at_where_an_early_one_may_harm() -> None:
    now, early = stopped(4e-5, 0.3), TAKEN[0] / 0.5
    assert early == pytest.approx(4e-5)
    later = prune._stop_later(now, {(7,): outcome(harms=True)})
    assert later == {7: (pytest.approx(TAKEN[-1] / 0.5), 0.3)}
    assert now.plan.put_all(later).points == later
    assert not prune._stop_later(now, {(7,): outcome(harms=False)})


def test_no_later_stop_is_looked_at_where_none_has_room() -> None:
    harms = outcome(harms=True)
    latest = TAKEN[-1] / 0.5
    assert not prune._stop_later(stopped(latest, 0.3), {(7,): harms})
    assert not prune._stop_later(stopped(4e-5, latest / 2), {(7,): harms})
    assert not prune._stop_later(stopped(4e-5, length=TAKEN[-1]), {(7,): harms})


def test_arcs_keep_their_stops() -> None:
    now = stopped(4e-5, 0.3)
    assert not prune._stop_later(now, {(7, 8): outcome(harms=True)})


@pytest.mark.parametrize(
    ("place", "points", "later"),
    [
        (0.004, (0.005, 0.3), (0.01, 0.3)),
        (0.004, (0.005, 0.012, 0.3), (0.01, 0.3)),  # the next piece would be too short
        (0.02, (0.005, 0.3), None),  # it harms elsewhere
        (0.004, (0.02, 0.3), None),  # the first point is late
    ],
)
def test_a_later_first_point_is_looked_at_where_one_may_harm_at_the_begin(
    place: float, points: tuple[float, ...], later: tuple[float, ...] | None
) -> None:
    assert BEGINS == 0.01 * LENGTH
    found = prune._begin_later(line(*points), {(7,): outcome(True, place)}, 1)
    assert found == ({} if later is None else {7: later})
    assert not prune._begin_later(line(*points), {(7,): outcome(False)}, 1)
    assert not prune._begin_later(line(*points), {(7, 8): outcome(True, place)}, 1)


def test_a_line_has_to_be_longer_than_where_it_begins() -> None:
    short = line(0.5, length=BEGINS)
    assert not prune._begin_later(short, {(7,): outcome(True, 0.2)}, 1)
