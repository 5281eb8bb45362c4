"""Lines are straight, arcs are round, samples are close."""

import numpy as np
import pytest

from postproc.exceptions import PlanError
from postproc.simulation.controller import STEP, TURN_STEP, arc, straight
from postproc.simulation.kinematics import exponential, logarithm, pose


def make_pose(x: float, y: float, z: float, *turn: float) -> np.ndarray:
    return pose(exponential(np.array(turn or (0.0, 0.0, 0.0))), np.array([x, y, z]))


def test_a_line_is_straight_and_turns_about_one_axis() -> None:
    start, end = make_pose(1, 0, 1, 0.1, 0.2, 0.3), make_pose(1.2, 0.1, 0.9, 0.5, 0, 0)
    way = straight(start, end)
    p = np.vstack([start[:3, 3], way[:, :3, 3]])
    step = np.diff(p, axis=0)
    assert np.linalg.norm(step, axis=1).max() <= STEP + 1e-12
    np.testing.assert_allclose(step, np.tile(step[0], (len(step), 1)), atol=1e-12)
    np.testing.assert_array_equal(way[-1], end)
    whole = logarithm(start[:3, :3].T @ end[:3, :3])
    half = logarithm(start[:3, :3].T @ way[len(way) // 2 - 1, :3, :3])
    np.testing.assert_allclose(half, whole * (len(way) // 2) / len(way), atol=1e-12)


def test_a_turn_on_the_spot_is_sampled_by_angle() -> None:
    way = straight(make_pose(1, 0, 1), make_pose(1, 0, 1, 0, 0, 1.0))
    assert len(way) >= 1.0 / TURN_STEP


def test_an_arc_is_round_and_passes_its_via_point() -> None:
    corners = [np.array([np.cos(a), 0.3, np.sin(a)]) * 0.2 for a in (0.3, 1.0, 4.0)]
    for p in corners:
        p[1] = 0.3
    start, via, end = (pose(np.eye(3), p) for p in corners)
    first, second = arc(start, via, end)
    way = np.concatenate([first, second])[:, :3, 3]
    np.testing.assert_allclose(np.hypot(way[:, 0], way[:, 2]), 0.2, atol=1e-12)
    np.testing.assert_allclose(way[:, 1], 0.3, atol=1e-12)
    np.testing.assert_allclose(first[-1], via)
    np.testing.assert_allclose(second[-1], end)
    angle = np.unwrap(np.arctan2(way[:, 2], way[:, 0]))
    assert (np.diff(angle) > 0).all()  # never back
    length = np.linalg.norm(np.diff(way, axis=0), axis=1).sum()
    assert length == pytest.approx(0.2 * 3.7, rel=0.02)


def test_an_arc_through_a_line_is_refused() -> None:
    with pytest.raises(PlanError, match="on a line"):
        arc(make_pose(0, 0, 0), make_pose(1, 0, 0), make_pose(2, 0, 0))
    with pytest.raises(PlanError, match="on a line"):
        arc(make_pose(0, 0, 0), make_pose(0, 0, 0), make_pose(2, 0, 0))
