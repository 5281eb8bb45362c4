"""Where points may harm, a later stop is one more plan."""

from __future__ import annotations

from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from postproc.compensation.paths import prune
from postproc.compensation.paths.backlash_preload import TAKEN
from postproc.compensation.paths.insertion_plan import InsertionPlan


def stopped(*shares: float, length: float = 0.5) -> Any:
    """A line to visit 7 whose first point is a stop."""
    now = Mock(plan=InsertionPlan(points={7: shares}, stops=frozenset({7})))
    paths = Mock(way=np.array([0.0, length]))
    paths.samples.return_value = slice(0, 2)
    now.path_to.return_value = paths, 0
    return now


def outcome(harms: bool) -> Any:
    return Mock(objection=lambda _: "it would be worse" if harms else None)


def test_a_later_stop_is_looked_at_where_an_early_one_may_harm() -> None:
    now, early = stopped(4e-5, 0.3), TAKEN[0] / 0.5
    assert early == pytest.approx(4e-5)
    later = prune._stop_later(now, {(7,): outcome(harms=True)})
    assert later == {7: pytest.approx(TAKEN[-1] / 0.5)}
    assert now.plan.move_stops(later).points == {7: (TAKEN[-1] / 0.5, 0.3)}
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
