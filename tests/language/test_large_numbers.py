"""Numbers that no controller holds leave what they tell, and stop nothing."""

from __future__ import annotations

import numpy as np
import pytest

from tests.language.krl.test_visits import job
from tests.language.rapid.test_visits import L, once

LOOPS = [
    ("1", "1E999"), ("1", "-1E999"), ("1E999", "2"), ("-1E999", "1E999"),
    ("1", "1E999 STEP 1E999"), ("1", "5 STEP 1E-320"), ("1", "1E308"),
    ("-1E308", "1E308"), ("1", "99999999999"), ("1", "1E999-1E999"),
]  # fmt: skip


@pytest.mark.parametrize(("first", "last"), LOOPS)
def test_loops_without_an_end_are_not_followed_round_by_round(first, last):
    head = f"FOR i FROM {first} TO {last} DO"
    rapid = once(head, L.format("list{i}"), "ENDFOR", L.format("p1")).visits
    krl = job(f"FOR N2={first} TO {last}", "LIN XS[N2]", "ENDFOR", "LIN XP1").visits
    for visits in (rapid, krl):
        assert len(visits) == 2 and visits.reason[0] > 0


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "goal",
    [
        "list{1E999}", "Offs(p1,0,0,1E999)", "Offs(p1,1E308*10,0,1)",
        "RelTool(p1,0,0,1\\Rz:=1E999)", "[[1E999,0,0],[1,0,0,0],[0,0,0,0],"
        "[9E9,9E9,9E9,9E9,9E9,9E9]]",
    ],
)  # fmt: skip
def test_targets_of_rapid_that_are_infinitely_far_are_left(goal):
    visits = once(L.format(goal), L.format("p1")).visits
    assert visits.reason[0] > 0 and np.isnan(visits.target.values[0, 0])


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "goal",
    [
        "XS[1E999]", "XP1:{X 0,Y 0,Z 1E999,A 0,B 0,C 0}",
        "{X 1E999,Y 0,Z 0,A 0,B 0,C 0}:XP1", "{X 1E999,Y 0,Z 0,A 0,B 0,C 0}",
    ],
)  # fmt: skip
def test_targets_of_krl_that_are_infinitely_far_are_left(goal):
    visits = job(f"LIN {goal}", "LIN XP1").visits
    assert visits.reason[0] > 0 and np.isnan(visits.target.values[0, 0])
