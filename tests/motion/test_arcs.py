"""Arcs as a whole: which make no sure circle, and how far corrections bend them."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.motion.path import Arcs, arcs, arcs_of
from postproc.motion.targets import TargetKind
from postproc.robot.pose import pose_from_record
from tests.made_targets import make_targets


def of(*points: tuple[float, float, float]) -> Arcs:
    """One arc through points [m]."""
    return Arcs(np.array([[0, 1, 2]]), np.array([points], dtype=float))


def on_circle(*degrees: float, radius: float = 0.1) -> Arcs:
    angle = np.deg2rad(degrees)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    return of(*zip(x, y, np.zeros(3), strict=True))


def test_points_on_a_line_or_in_one_place_make_no_circle() -> None:
    good = on_circle(0, 90, 180)
    assert not good.on_a_line[0] and not good.too_near[0]
    line = of((0, 0, 0), (0.1, 0, 0), (0.2, 0, 0))
    assert line.on_a_line[0] and not line.too_near[0]
    for degrees in ((0, 0, 90), (0, 90, 90), (0, 90, 0)):
        assert on_circle(*degrees).on_a_line[0] and on_circle(*degrees).too_near[0]
    assert on_circle(0, 180, 359.9).too_near[0] == (0.1 * np.deg2rad(0.1) < 1e-4)
    assert on_circle(0, 180, 359.95).too_near[0]


@pytest.mark.parametrize("twice", [(0, 1), (1, 2), (0, 2)])
def test_rounding_makes_no_circle_of_two_points(twice: tuple[int, int]) -> None:
    points = np.array([[1.0, 0.2, 0.3], [0.9, -0.4, 0.1], [1.1, 0.1, -0.5]])
    points[twice[1]] = points[twice[0]] + [1e-13, -2e-13, 3e-13]
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, :3, 3] = points
    assert not arcs(*poses[:, None])[0].valid[0]


def test_the_path_moves_with_points_that_lie_well() -> None:
    same = np.tile([1e-3, 2e-3, -1e-3], (1, 3, 1))
    np.testing.assert_allclose(on_circle(0, 120, 240).strays(same), 0.0, atol=1e-12)
    for k in range(3):
        shift = np.zeros((1, 3, 3))
        shift[0, k] = [1e-3, -5e-4, 1e-3]
        assert on_circle(0, 90, 180).strays(shift)[0] < 0.2e-3


def test_the_path_strays_where_two_points_lie_close() -> None:
    shift = np.zeros((1, 3, 3))
    shift[0, 0] = [0.0, 0.0, 1e-3]
    # The plane turns about VIA and end: what is 2 mm from them moves by 1 mm.
    assert on_circle(0, 180, 358.9).strays(shift)[0] > 20e-3
    shift[0] = [0.0, 0.0, 1e-3]
    np.testing.assert_allclose(on_circle(0, 180, 358.9).strays(shift), 0.0, atol=1e-9)


def test_no_circle_left_is_as_far_off_as_can_be() -> None:
    arc = of((0, 0, 0), (0.1, 1e-3, 0), (0.2, 0, 0))
    shift = np.zeros((1, 3, 3))
    shift[0, 1, 1] = -1e-3
    assert np.isinf(arc.strays(shift))[0]
    assert np.isnan(of((np.nan, 0, 0), (1, 1, 0), (2, 0, 0)).strays(shift))[0]


def test_every_start_of_an_arc_makes_one_with_the_tool_of_the_arc() -> None:
    tool = np.tile(np.eye(4), (4, 1, 1))
    tool[:2, 2, 3] = 0.1
    tool[2:, 2, 3] = 0.3
    tcp = pose_from_record(np.array([[1000.0 * k, 0, 0, 0, 0, 0] for k in range(4)]))
    targets = make_targets(
        np.full(4, TargetKind.POSE), tcp, tool=tool, move=np.array([0, 0, 2, 2]),
        via=np.array([False, False, True, False]),
        pred_start=np.array([0, 0, 1, 3, 4]), pred=np.array([0, 0, 1, 2]),
    )  # fmt: skip
    aside = np.zeros((4, 3))
    aside[0, 0] = 0.01
    found = arcs_of(targets, tcp, aside)
    assert found.visit.tolist() == [[0, 2, 3], [1, 2, 3]]
    np.testing.assert_allclose(found.points[:, 0], [[-0.01, 0, 0.2], [1, 0, 0.2]])
    np.testing.assert_allclose(found.points[:, 1:, 2], 0.0)
