from __future__ import annotations

import numpy as np
import pytest

from postproc.motion.planner import Plan, plan
from postproc.motion.ruckig import JointMoves
from postproc.motion.targets import Fly, TargetKind
from postproc.robot.arm import Arm
from tests.made_targets import make_targets

WRIST = np.deg2rad(3.0)


def milling(
    arm: Arm, tool: np.ndarray, home: np.ndarray, speed: float, **more: object
) -> Plan:
    """A fly run of 200 points on a smooth curve, from and to a stop at `home`."""
    n = 201
    tcp = np.tile((arm.flange(home[None]) @ tool)[0], (n, 1, 1))
    u = np.linspace(0, 2 * np.pi, n)
    tcp[:, 0, 3] += 0.1 * (1 - np.cos(u))
    tcp[:, 1, 3] += 0.2 * np.sin(u)
    kind = np.full(n, int(TargetKind.POSE))
    fly = np.full(n, True)
    fly[[0, -1]] = False
    move = np.ones(n, dtype=int)
    move[0] = 0
    return plan(
        arm,
        make_targets(
            kind, tcp, move=move, fly=fly, slot=np.zeros(n, dtype=int),
            tool=np.tile(tool, (n, 1, 1)), linear_speed=np.full(n, speed), **more,
        ),
        WRIST,
    )  # fmt: skip


def test_a_fly_run_passes_at_the_programmed_speed(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    found = milling(arm, tool, home, 0.1)
    assert (found.reason == 0).all()
    assert found.speed[[0, -1]].tolist() == [0, 0]
    np.testing.assert_allclose(found.speed[10:-10], 0.1, rtol=0.01)
    step = np.linalg.norm(np.diff(found.tcp[:, :3, 3], axis=0), axis=1)
    np.testing.assert_allclose(
        np.diff(found.time)[10:-10], step[10:-10] / 0.1, rtol=0.01
    )


def test_the_override_slows_it_down(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    found = milling(arm, tool, home, 0.1, override=np.full(201, 0.5))
    np.testing.assert_allclose(found.speed[20:-20], 0.05, rtol=0.01)


def test_an_unknown_speed_is_bounded_by_the_joints(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    found = milling(arm, tool, home, np.nan)
    rate = np.abs(np.diff(found.q, axis=0)) / np.diff(found.time)[:, None]
    assert (rate <= 1.01 * arm.velocity).all()
    assert found.speed.max() > 0.5


def test_joint_moves_add_up_along_first_predecessors(
    arm: Arm, home: np.ndarray
) -> None:
    q = np.array([home, home + 0.2, home - 0.1, home + 0.3])
    targets = make_targets(
        np.full(4, TargetKind.JOINTS), joints=q, pred=np.array([-1, 0, 0, 2])
    )
    time = plan(arm, targets, WRIST).time
    moves = JointMoves(arm)
    expected = [moves.move(q[a], q[b]).duration for a, b in ((0, 1), (0, 2), (2, 3))]
    assert time[0] == 0.0
    np.testing.assert_allclose(
        [time[1], time[2], time[3] - time[2]], expected, rtol=1e-12
    )


def test_joint_fly_runs_do_not_stop(arm: Arm, home: np.ndarray) -> None:
    q = home + np.linspace(0, 0.6, 4)[:, None] * np.array([1, 0.3, 0.2, 0.5, 0.1, 1])
    fly = np.array([False, True, True, False])
    found = plan(
        arm, make_targets(np.full(4, TargetKind.JOINTS), joints=q, fly=fly), WRIST
    )
    stop = plan(arm, make_targets(np.full(4, TargetKind.JOINTS), joints=q), WRIST)
    assert (found.speed[1:3] > 0.1).all() and (stop.speed == 0).all()
    assert found.time[-1] < stop.time[-1]


def test_a_target_reached_twice_in_a_row_takes_no_time(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    tcp = np.tile((arm.flange(home[None]) @ tool)[0], (4, 1, 1))
    tcp[3, 0, 3] += 0.1
    fly = np.array([False, True, True, False])
    found = plan(
        arm,
        make_targets(np.zeros(4, int), tcp, move=np.array([0, 1, 1, 1]), fly=fly,
                     slot=np.zeros(4, dtype=int), tool=np.tile(tool, (4, 1, 1))),
        WRIST,
    )  # fmt: skip
    assert found.time[:3].tolist() == [0, 0, 0] and found.time[3] > 0
    assert (found.reason == 0).all()


def test_one_short_move_that_flies_to_nowhere_has_a_time(
    arm: Arm, home: np.ndarray
) -> None:
    tcp = np.tile(arm.flange(home[None])[0], (2, 1, 1))
    tcp[1, 0, 3] += 0.002
    targets = make_targets(
        np.zeros(2, int), tcp, move=np.array([0, 1]), fly=np.array([False, True]),
        slot=np.zeros(2, dtype=int),
    )  # fmt: skip
    found = plan(arm, targets, WRIST)
    assert 0 < found.time[1] < 0.5 and not found.untimed.any()


def test_without_a_time_law_there_is_an_estimate(
    arm: Arm, tool: np.ndarray, home: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    timed = milling(arm, tool, home, 0.1)

    monkeypatch.setattr(
        "postproc._native.fastest", lambda _paths, step, *_: np.zeros(len(step))
    )
    found = milling(arm, tool, home, 0.1)
    assert found.untimed[1:].all() and not timed.untimed.any()
    np.testing.assert_allclose(found.time, timed.time, atol=0.2)
    np.testing.assert_allclose(found.speed[10:-10], 0.1, rtol=0.01)
    assert found.speed[-1] == 0 and (found.reason == 0).all()


@pytest.mark.parametrize("deg", [2.9, 3.1])
def test_the_wrist_singularity_is_a_reason(
    arm: Arm, home: np.ndarray, deg: float
) -> None:
    q = home.copy()
    q[4] = np.deg2rad(deg)
    found = plan(
        arm, make_targets(np.array([TargetKind.JOINTS]), joints=q[None]), WRIST
    )
    assert ("wrist singularity" in found.reasons[found.reason[0]].text) == (deg < 3)


def test_no_targets_are_no_trouble(arm: Arm) -> None:
    assert len(plan(arm, make_targets(np.empty(0, int)), WRIST)) == 0


def test_a_plan_without_times_is_the_same_path(arm: Arm, home: np.ndarray) -> None:
    tcp = np.tile(arm.flange(home[None])[0], (30, 1, 1))
    tcp[:, 0, 3] += 0.002 * np.arange(30)
    targets = make_targets(
        np.zeros(30, int), tcp, move=np.arange(30).clip(max=1), slot=np.zeros(30, int)
    )
    timed, untimed = plan(arm, targets, WRIST), plan(arm, targets, WRIST, timed=False)
    for name in ("q", "tcp", "side", "travel", "reason"):
        np.testing.assert_array_equal(getattr(timed, name), getattr(untimed, name))
    assert np.isfinite(timed.speed).all() and np.isnan(untimed.speed).all()


def test_windows_change_no_direction(
    arm: Arm, tool: np.ndarray, home: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = milling(arm, tool, home, 0.1)
    for place, size in (
        ("joint_path.WINDOW", 7), ("joint_path.LONG", 5), ("branches.FEW", 3),
    ):  # fmt: skip
        monkeypatch.setattr(f"postproc.motion.{place}", size)
    pieces = milling(arm, tool, home, 0.1)
    for name in ("direction", "slot", "reason"):
        np.testing.assert_array_equal(getattr(pieces, name), getattr(whole, name))
    assert set(np.unique(whole.direction)) >= {-1.0, 1.0}
    for name in ("q", "side", "travel"):
        ours, theirs = getattr(pieces, name), getattr(whole, name)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)
    np.testing.assert_allclose(pieces.speed, whole.speed, rtol=3e-4)
    np.testing.assert_allclose(pieces.time, whole.time, rtol=3e-4)


@pytest.mark.parametrize("turn", [0.05, 0.3, 1.5])
def test_a_rounded_joint_move_is_no_slower_than_stops(
    arm: Arm, home: np.ndarray, turn: float
) -> None:
    """From a corner to a stop it brakes at the end, not throughout."""
    q = home + np.array([[0.0] * 6, [0.1, *[0.0] * 5], [turn] * 6, [0.0] * 6])
    kind = np.full(len(q), int(TargetKind.JOINTS))
    times = []
    for flying in (False, True):
        fly = np.array([False, flying, flying, False])
        targets = make_targets(
            kind, joints=q, fly=fly, rounding=np.full(len(q), int(Fly.OVERLAP)),
            overlap=np.full(len(q), 0.7),
        )  # fmt: skip
        times.append(plan(arm, targets, WRIST).time[-1])
    assert 0.5 * times[0] < times[1] < 1.02 * times[0]


@pytest.mark.parametrize("length", [0.004, 0.01, 0.03, 0.2])
def test_a_short_line_takes_its_length_over_its_speed(
    arm: Arm, tool: np.ndarray, home: np.ndarray, length: float
) -> None:
    """And no more than the joints need to start and brake, by their acceleration."""
    tcp = np.tile((arm.flange(home[None]) @ tool)[0], (2, 1, 1))
    tcp[1, 0, 3] += length
    targets = make_targets(
        np.zeros(2, int), tcp, move=np.array([0, 1]), slot=np.zeros(2, int),
        tool=np.tile(tool, (2, 1, 1)), linear_speed=np.full(2, 0.05),
    )  # fmt: skip
    found = plan(arm, targets, WRIST)
    turned = np.abs(found.q[1] - found.q[0]).max()
    ramp = (turned / length * 0.05 / arm.acceleration).max()
    even = length / 0.05
    assert even < found.time[-1] < 1.02 * even + 2 * ramp
