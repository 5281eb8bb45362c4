from __future__ import annotations

import numpy as np
import pytest

from postproc.motion.branches import (
    Branched,
    BranchedLazily,
    SolvedBranches,
    follow,
    on_written_turns,
)
from postproc.robot.arm import Arm


@pytest.fixture(params=["beforehand", "on demand"])
def ways(request):
    """The solutions at joint angles (k, 6) [rad], found in one of both ways."""

    def solutions(arm: Arm, q: np.ndarray) -> Branched:
        flange = arm.flange(q)
        if request.param == "on demand":
            return BranchedLazily(arm, flange)
        return SolvedBranches(arm.inverse(flange).q)

    return solutions


def test_turns_come_from_the_string() -> None:
    q = np.deg2rad(np.tile([0.0, 0, -200, 170, 30, -170], (2, 1)))
    turns = np.array([[0.0, 0.0, np.nan], [1.0, -1.0, -1.0]])
    found = np.rad2deg(on_written_turns(q, turns))
    np.testing.assert_allclose(found[0, [2, 3, 5]], [-200, 170, -170], atol=1e-9)
    np.testing.assert_allclose(found[1, [2, 3, 5]], [-200, 530, -530], atol=1e-9)
    k = np.floor((found[1, [3, 5, 2]] + 180) / 360)
    np.testing.assert_array_equal(k, turns[1])


def test_a_path_through_a_straight_wrist_changes_the_branch(arm: Arm, ways) -> None:
    # Axes 4 and 6 rest while axis 5 passes zero: the sign of axis 5 is the W flag.
    q = np.tile(np.deg2rad([10.0, 0, -90, 0, 0, 0]), (41, 1))
    q[:, 4] = np.linspace(np.deg2rad(20.3), np.deg2rad(-20), 41)
    found = follow(q[0], ways(arm, q[1:]))
    np.testing.assert_allclose(found.q, q[1:], atol=1e-7)
    assert found.slot[0] == 0 and found.slot[-1] == 4


def test_turns_add_up_over_several_rounds(arm: Arm, ways) -> None:
    q = np.tile(np.deg2rad([10.0, 0, -90, 20, 40, 0]), (200, 1))
    q[:, 5] = np.linspace(0, np.deg2rad(1500), 200)
    found = follow(q[0], ways(arm, q[1:]))
    np.testing.assert_allclose(found.q, q[1:], atol=1e-7)


def test_it_stops_where_there_is_no_solution(arm: Arm) -> None:
    q = np.tile(np.deg2rad([10.0, 0, -90, 20, 40, 0]), (5, 1))
    branches = arm.inverse(arm.flange(q)).q.copy()
    branches[3] = np.nan
    found = follow(q[0], SolvedBranches(branches))
    assert len(found.q) == 3 and not found.reached


def test_it_stops_at_a_jump(arm: Arm, ways) -> None:
    q = np.tile(np.deg2rad([10.0, 0, -90, 20, 40, 0]), (4, 1))
    q[2:, 0] += 2.0
    found = follow(q[0], ways(arm, q))
    assert len(found.q) == 2 and found.reached
