"""Times between stops and joint limits, against the planner's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.robot.trajectory import Motion
from postproc.verify.opinion import Claim, Opinion, OpinionRow
from tests.verify.faults import Case
from tests.verify.judged import SHIPPED, row, shipped

MOVES, RUNS, ARCS, FLY = (
    f"output: time {what}"
    for what in ("of JOINT moves", "of lines", "of arcs", "over fly points")
)
LIMITS = "output: joint limits"


@pytest.fixture(scope="module")
def cases(models) -> dict[str, Case]:
    """Shipped programs with their right claims."""
    return {n: Case.of(shipped(n, models)) for n in SHIPPED if n != "milling.pdl"}


def told(one: Case, **changes: object) -> Opinion:
    """Judge what the planner says otherwise of the output."""
    return one.weigh_rows((one.source, replace(one.output, **changes)))


def slower(claim: Claim, rows: np.ndarray, by: float) -> np.ndarray:
    """Return times if some moves took longer by a factor."""
    lasts = np.diff(claim.time, prepend=claim.time[:1])
    return np.cumsum(np.where(rows, by * lasts, lasts))


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("drilling.pdl", (7, 678, 0, 0)),
        ("spot.pdl", (58, 0, 0, 22)),
        ("facing/Milling.src", (3, 9, 1, 4)),
    ],
)
def test_every_stop_is_compared_once(cases, name, counts) -> None:
    opinion = cases[name].weigh_rows(cases[name].right)
    rows = [row(opinion, what) for what in (MOVES, RUNS, ARCS, FLY)]
    v = cases[name].output.visits
    lost = sum(rows[3].skipped.values())
    stops = ~(v.motion.fly | v.motion.via)
    assert sum(r.compared for r in rows) + lost == int(stops.sum())
    for found, expected in zip(rows, counts, strict=True):
        assert abs(found.compared - expected) <= 2
    assert rows[0].largest < 1e-8 and rows[1].largest < 1.0  # [s] and [%]


@pytest.mark.parametrize(
    ("name", "motion", "what", "by"),
    [
        ("handling.pdl", Motion.JOINT, MOVES, 1.001),
        ("drilling.pdl", Motion.LINEAR, RUNS, 1.03),
        ("drilling.pdl", Motion.LINEAR, RUNS, 0.97),
        ("spot.pdl", Motion.JOINT, FLY, 2.5),
        ("facing/Milling.src", Motion.LINEAR, FLY, 0.01),
        ("facing/Milling.src", Motion.CIRCULAR, ARCS, 1.3),
        ("facing/Milling.src", Motion.CIRCULAR, ARCS, 0.7),
    ],
)
def test_another_time_disagrees(cases, name, motion, what, by) -> None:
    one = cases[name]
    time = slower(one.output, one.output.visits.motion.kind == motion, by)
    assert row(told(one, time=time), what).beyond > 0


def test_a_time_that_nobody_says_is_counted(cases) -> None:
    one = cases["handling.pdl"]
    found = told(one, time=np.full(len(one.output), np.nan))
    assert found.agrees
    assert sum(row(found, what).compared for what in (MOVES, RUNS, ARCS, FLY)) == 0
    assert row(found, FLY).skipped["the planner has no time law"] == 93


@pytest.mark.parametrize("within", [-1, 1])
def test_joint_limits_disagree_either_way(cases, within) -> None:
    """One target is said to be beyond its limits, or another arm has narrower ones."""
    one = cases["drilling.pdl"]
    right = row(one.weigh_rows(one.right), LIMITS)
    assert right.compared == len(one.output) and right.largest == 0.0
    if within < 0:
        said = np.array(one.output.within)
        said[100] = -1
        found: OpinionRow = row(told(one, within=said), LIMITS)
        assert found.beyond == 1 and found.largest > 0.1  # [rad]
        return
    q = np.array(one.output.q)
    q[100, 3] += 100.0
    assert row(told(one, q=q), "output: place").beyond or not told(one, q=q).agrees


def test_an_arm_without_speeds_has_no_times(cases) -> None:
    from postproc.compensation.findings.second_opinion import facts_of
    from postproc.verify.judge import judge

    one = cases["handling.pdl"]
    facts = facts_of(one.job.cell)
    joints = facts.file.joints.model_copy(update={"velocity_deg_s": None})
    file = facts.file.model_copy(update={"joints": joints})
    found = judge("job", replace(facts, file=file), *one.right)
    assert found.agrees, found.to_dict()
    assert not [r.what for r in found.rows if ": time " in r.what]
    assert row(found, "output: approach directions").compared > 300
