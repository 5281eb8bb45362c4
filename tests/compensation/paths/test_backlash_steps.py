"""Steps of joints that change their flanks are measured, and their absence is seen."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.findings.timing_comparison import describe_verification
from postproc.compensation.paths.backlash_steps import (
    FlankSteps,
    in_motion,
    measure_steps,
)
from postproc.compensation.paths.track_alignment import align
from tests.compensation.paths.measured_ways import MOVES, STEP, made_ways, read
from tests.compensation.paths.test_track_alignment import STOPS


def told(share: float, later: int, scatter: float = 2e-5):
    ways = made_ways()
    track = read(ways, scatter, share, later)
    found = align(track, ways, STOPS)
    steps = measure_steps(ways, found.on_the_way, track.scatter)
    assert len(steps) == MOVES and (steps.joint == 1).all()
    np.testing.assert_allclose(steps.predicted, np.linalg.norm(STEP), rtol=1e-3)
    (joint,) = in_motion(steps)
    return joint


@pytest.mark.parametrize(
    ("share", "later", "verdict"),
    [
        (1.0, 0, "confirmed"),
        (1.1, 4, "confirmed"),
        (0.0, 0, "refuted"),
        (0.5, 0, "refuted"),
        (1.6, 0, "refuted"),
        (1.0, 20, "elsewhere"),
    ],
)
def test_size_and_place_of_steps(share, later, verdict):
    joint = told(share, later)
    assert joint.verdict == verdict
    assert joint.share == pytest.approx(share, abs=3 * joint.error + 0.03)
    if share > 0.9:
        assert joint.later == pytest.approx(1e-3 * later, abs=3e-3)


def test_steps_within_the_scatter_say_nothing():
    ways = made_ways()
    track = read(ways, 1e-3)
    found = align(track, ways, STOPS)
    steps = measure_steps(ways, found.on_the_way, track.scatter)
    assert all(j.verdict == "uncertain" for j in in_motion(steps))


def test_the_standard_error_is_that_of_repetition():
    ways = made_ways()
    track = read(ways, 2e-5)
    found = align(track, ways, STOPS)
    steps = measure_steps(ways, found.on_the_way, track.scatter)
    off = (steps.share - 1.0) / steps.error
    assert np.abs(off).max() < 4.0


def test_what_a_measured_path_says_is_said_where_points_are_put():
    assert "unverified" in describe_verification({})
    told = describe_verification({"1": "confirmed", "3": "confirmed", "2": "uncertain"})
    assert told.endswith("flanks of joint 1, 3, not those of 2")
    assert describe_verification({"1": "confirmed"}).endswith("joint 1")


def steps_of(share, later=0.0, error=0.1):
    m = len(share)
    each = np.full(m, 6), np.arange(m), np.full(m, 2e-5), np.array(share)
    return FlankSteps(*each, np.full(m, error), np.broadcast_to(later, m))


@pytest.mark.parametrize(
    ("share", "later", "verdict"),
    [
        ([0.1, 0.3, 0.55, 0.8], 0.0, "uncertain"),  # few, and alike by chance
        ([0.35, 0.4, 0.45, 0.5] * 4, 0.0, "refuted"),
        ([0.9, 1.1, 1.2], 0.0, "uncertain"),
        ([0.9, 1.1, 1.2] * 3, 0.0, "confirmed"),
        ([0.9, 1.1, 1.2] * 3, [-0.02, 0.011, 0.03] * 3, "uncertain"),
        ([0.9, 1.1, 1.2] * 3, [0.015, 0.016, 0.018] * 3, "elsewhere"),
    ],
)
def test_few_steps_that_scatter_leave_it_open(share, later, verdict):
    (joint,) = in_motion(steps_of(share, later))
    assert joint.verdict == verdict


def test_no_joint_is_refuted_by_scatter_alone():
    rng = np.random.default_rng(5)
    told = [
        in_motion(steps_of(rng.normal(1.0, 0.4, n), rng.normal(0.0, 0.01, n), 0.4))
        for n in (3, 4, 6, 10)
        for _ in range(200)
    ]
    wrong = sum(joint.verdict in ("refuted", "elsewhere") for (joint,) in told)
    assert wrong <= 12  # of 800; 1.5 %
