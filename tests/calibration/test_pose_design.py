from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.pose_design import (
    AROUND,
    TYPICAL_NOISE,
    Design,
    design_survey,
    joint_box,
    short_order,
    usable,
)
from postproc.exceptions import PostprocError
from postproc.model.effect_sum import Combination
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.kinematics import ArmStates
from postproc.robot.state import States, make_states
from tests.calibration.simulator import NJ, PLATE, TOOL


def test_poses_respect_limits_and_points_take_turns() -> None:
    d = design_survey(NJ, PLATE, 60, seed=1)
    low, high = joint_box(NJ)
    assert d.q.shape == (60, 6)
    assert (d.q >= low).all() and (d.q <= high).all()
    assert NJ.within_limits(d.q + 0.05).all() and NJ.within_limits(d.q - 0.05).all()
    assert d.probe.tolist() == [k % 3 for k in range(60)]
    assert (np.abs(d.side) == 1).all() and (d.side.sum(axis=0) == 0).all()
    assert usable(NJ, d.q, PLATE[d.probe], None).all()
    again = design_survey(NJ, PLATE, 60, seed=1)
    np.testing.assert_array_equal(d.q, again.q)


def test_each_joint_covers_its_range() -> None:
    d = design_survey(NJ, TOOL[None], 300)
    low, high = joint_box(NJ)
    for j in range(6):
        count, _ = np.histogram(d.q[:, j], 5, (low[j], high[j]))
        assert count.min() > 15, j


def test_the_tracker_sees_every_pose() -> None:
    tracker = np.array([4.0, 1.0, 1.2])
    d = design_survey(NJ, TOOL[None], 40, tracker=tracker)
    T = NJ.flange(d.q)
    tcp = T[:, :3, 3] + T[:, :3, :3] @ TOOL
    beam = tracker - tcp
    beam /= np.linalg.norm(beam, axis=1)[:, None]
    assert np.einsum("ni,ni->n", T[:, :3, 2], beam).min() > 0.25


def test_optimal_poses_tell_more() -> None:
    lhs = design_survey(NJ, TOOL[None], 25, "lhs", seed=3).observability
    for mode in ("optimal", "d-optimal"):
        best = design_survey(NJ, TOOL[None], 25, mode, seed=3).observability
        assert best.rank >= lhs.rank
        assert best.o1 > lhs.o1
    assert "condition number" in design_survey(NJ, TOOL[None], 20).summary()


def test_poses_of_a_job_are_round_its_arrivals_and_tell_most_there() -> None:
    rng = np.random.default_rng(5)
    q = np.deg2rad([10.0, 15.0, -110.0, 20.0, 60.0, -30.0]) + rng.normal(
        0, 0.1, (40, 6)
    )
    job = make_states(q, np.sign(rng.normal(size=(40, 6))), TOOL)
    near, far = (
        design_survey(NJ, PLATE, 24, "optimal", seed=2, job=arrivals)
        for arrivals in (job, None)
    )
    apart = np.abs(near.q[:, None] - q).max(axis=2).min(axis=1)
    assert (apart <= AROUND + 1e-9).all()
    assert expected_mm(near, job) < 0.8 * expected_mm(far, job)


def expected_mm(design: Design, job: States) -> float:
    """Compute what a design leaves unknown of the base model at a job's arrivals."""
    states = make_states(
        design.q, design.side, PLATE[design.probe], tool_id=design.probe
    )
    base = Combination(propose(BASE_EFFECTS, NJ, states))
    sides = (states, states.with_(direction=-states.direction))
    X, at = (
        np.concatenate([base.columns(ArmStates(NJ, s)) for s in some]) * base.scales
        for some in (sides, (job,))
    )
    flat, there = (x.reshape(-1, x.shape[2]) / TYPICAL_NOISE for x in (X, at))
    covariance = np.linalg.inv(np.eye(flat.shape[1]) + flat.T @ flat)
    return float(np.sqrt(((there @ covariance) * there).sum(axis=1).mean()))


def test_wrong_wishes_are_refused() -> None:
    with pytest.raises(PostprocError, match="no survey mode 'best'"):
        design_survey(NJ, TOOL[None], 10, "best")
    with pytest.raises(PostprocError, match="0 poses"):
        design_survey(NJ, TOOL[None], 0)


def test_a_short_order_saves_travel_and_keeps_probe_points_together() -> None:
    d = design_survey(NJ, PLATE, 60, seed=1)
    order = short_order(d.q, d.probe, NJ.velocity)
    assert sorted(order.tolist()) == [*range(60)]
    assert (np.diff(d.probe[order]) != 0).sum() == 2
    drawn = np.argsort(d.probe, kind="stable")
    travel = [
        np.abs(np.diff(d.q[rows], axis=0) / NJ.velocity).max(axis=1).sum()
        for rows in (order, drawn)
    ]
    assert travel[0] < 0.75 * travel[1]
