"""A recalled path has the bits of one that is solved."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.robot import recall
from postproc.robot.arm import load_arm
from postproc.robot.recall import Recall


@pytest.fixture(scope="module")
def arm():
    return load_arm("nj220-2.7")


@pytest.fixture
def poses(arm):
    rng = np.random.default_rng(3)
    q = np.radians([0.0, 10.0, -90.0, 0.0, 60.0, 0.0]) + rng.uniform(-0.3, 0.3, (80, 6))
    return arm.flange(q)


class Counted:
    """Solves, and counts what it was asked for."""

    def __init__(self, arm):
        self.arm, self.asked = arm, []

    def __call__(self, poses):
        self.asked.append(len(poses))
        return self.arm.inverse(poses).q


def test_only_poses_that_changed_are_solved_again(arm, poses):
    solve = Counted(arm)
    recalled = Recall(solve)
    moved = np.concatenate([poses[40:], poses[:39]])  # elsewhere, and one is gone
    moved[[3, 50], 0, 3] += 1e-12
    for path in (poses, poses, moved):
        np.testing.assert_array_equal(recalled(path), arm.inverse(path).q)
    assert solve.asked == [80, 0, 2]


def test_poses_that_look_alike_are_not_mixed_up(arm, poses, monkeypatch):
    monkeypatch.setattr(recall, "_WEIGHTS", np.zeros((3, 4)))
    recalled = Recall(Counted(arm))
    for path in (poses, poses[::-1], np.repeat(poses[:5], 3, axis=0)):
        np.testing.assert_array_equal(recalled(path), arm.inverse(path).q)


def test_long_paths_and_empty_ones_are_not_kept(arm, poses, monkeypatch):
    monkeypatch.setattr(recall, "MOST", 50)
    solve = Counted(arm)
    recalled = Recall(solve)
    for path in (poses, poses, poses[:0]):
        assert recalled(path).shape == (len(path), 8, 6)
    assert solve.asked == [80, 80, 0]
