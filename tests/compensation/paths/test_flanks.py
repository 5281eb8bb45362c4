"""Steps of joints that change their flanks are measured, and their absence is seen."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.in_time import verified
from postproc.compensation.paths.flanks import in_motion, measured_steps
from postproc.compensation.paths.measured import align
from tests.compensation.paths.measured_ways import MOVES, STEP, made_ways, read
from tests.compensation.paths.test_measured import STOPS


def told(share: float, later: int, scatter: float = 2e-5):
    ways = made_ways()
    track = read(ways, scatter, share, later)
    found = align(track, ways, STOPS)
    steps = measured_steps(ways, found.on_the_way, track.scatter)
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
    steps = measured_steps(ways, found.on_the_way, track.scatter)
    assert all(j.verdict == "not sure" for j in in_motion(steps))


def test_the_standard_error_is_that_of_repetition():
    ways = made_ways()
    track = read(ways, 2e-5)
    found = align(track, ways, STOPS)
    steps = measured_steps(ways, found.on_the_way, track.scatter)
    off = (steps.share - 1.0) / steps.error
    assert np.abs(off).max() < 4.0


def test_what_a_measured_path_says_is_said_where_points_are_put():
    assert "unverified" in verified({})
    told = verified({"1": "confirmed", "3": "confirmed", "2": "not sure"})
    assert told.endswith("flanks of joint 1, 3, not those of 2")
    assert verified({"1": "confirmed"}).endswith("joint 1")
