"""Links that ran on at fast stops, and where the arm stops fast."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from postproc.compensation.paths.path_samples import PathSamples
from postproc.compensation.paths.path_states import AlongWays, find_fast_stops
from postproc.robot.arm import Arm
from postproc.robot.cell import Cell
from postproc.robot.trajectory import Motion


def ran(arm: Arm, q: np.ndarray, override: float, move: Motion = Motion.JOINT) -> Any:
    """A move from visit 0 to 1, and a line from there to 2."""
    moves = np.array([Motion.JOINT, move, Motion.LINEAR])
    return SimpleNamespace(
        arm=arm, path=SimpleNamespace(q=q), ways=(np.arange(3) - 1, np.arange(3) - 1),
        targets=SimpleNamespace(
            move=moves, fly=np.zeros(3, dtype=bool), override=np.full(3, override)
        ),
    )  # fmt: skip


def places(arm: Arm, *turned: float) -> np.ndarray:
    """Joint angles after joint 1 turned at full speed [s], joint 2 half as much."""
    q = np.zeros((3, 6))
    q[1:, 0] = np.cumsum(turned) * arm.velocity[0]
    q[1:, 1] = np.cumsum(turned) * arm.velocity[1] / 2
    return np.asarray(np.linalg.solve(arm.coupling, q.T).T)


@pytest.mark.parametrize(
    ("override", "move", "fast"),
    [
        (1.0, Motion.JOINT, [1, 2]),
        (0.3, Motion.JOINT, [1]),
        (0.15, Motion.JOINT, []),
        (1.0, Motion.LINEAR, []),
    ],
)
def test_joints_arrive_fast_where_a_joint_move_stops(
    bench_cell: Cell, override: float, move: Motion, fast: list[int]
) -> None:
    arm = bench_cell.arm
    found = find_fast_stops(ran(arm, places(arm, 0.5, 0.1), override, move))
    assert (np.flatnonzero(found[1]) + 1).tolist() == fast
    assert not found[[0, 2]].any()


@pytest.mark.parametrize(("override", "runs_on"), [(1.0, True), (0.1, False)])
def test_a_link_that_ran_on_rests_until_its_drive_has_crossed(
    bench_cell: Cell, override: float, runs_on: bool
) -> None:
    arm, half = bench_cell.arm, np.full(6, 1e-4)
    cycle = ran(arm, places(arm, 0.5, 1e-6), override)
    driven = np.zeros((6, 6))
    driven[:, 0] = np.arange(6) * half[0]  # joint 1 goes on as it came
    q = cycle.path.q[1] + np.linalg.solve(arm.coupling, driven.T).T
    ways = PathSamples(np.array([2]), np.array([1]), q, np.array([0, 6]))
    side = np.ones((6, 6))
    run = AlongWays(cycle, ways, np.tile(half, (6, 1)), side, side)
    found = run.run_on(bench_cell, np.ones(6))
    crossing = [-1.0, 0.0, 1.0, 1.0, 1.0, 1.0] if runs_on else [1.0] * 6
    np.testing.assert_allclose(found[:, 0], crossing, atol=1e-6)
    np.testing.assert_array_equal(found[:, 3:], side[:, 3:])  # they did not move
