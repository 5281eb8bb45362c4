"""The corner formula against its definition, densely evaluated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.motion import blending
from postproc.motion.blending import blend, corners
from postproc.motion.joint_path import trace
from postproc.motion.planner import plan
from postproc.motion.replan import replan_all
from postproc.motion.targets import Fly, TargetKind, Targets
from postproc.robot.arm import Arm
from postproc.robot.direction import arrivals
from postproc.robot.trajectory import Motion
from tests.made_targets import make_targets
from tests.reference.paths import on_corner

MM = 1e-3


def run(
    arm: Arm, tool: np.ndarray, home: np.ndarray, points: np.ndarray, **given: object
) -> Targets:
    """LINEAR moves through points (n, 3) [m] seen from where the arm stands first."""
    n = len(points) + 1
    first = (arm.flange(home[None]) @ tool)[0]
    tcp = np.tile(first, (n, 1, 1))
    tcp[1:, :3, 3] += points
    kind = np.full(n, int(TargetKind.POSE))
    kind[0] = TargetKind.JOINTS
    fly = np.full(n, True)
    fly[[0, -1]] = False
    move = np.full(n, int(Motion.LINEAR))
    move[0] = Motion.JOINT
    made: dict[str, object] = {
        "move": move, "tool": np.tile(tool, (n, 1, 1)), "fly": fly,
        "linear_speed": np.full(n, 0.1), "rounding": np.full(n, int(Fly.FROM)),
        "fly_distance": np.full(n, 10 * MM),
    }  # fmt: skip
    joints = np.full((n, 6), np.nan)
    joints[0] = home
    return make_targets(kind, tcp, joints, **(made | given))


def joint_run(turns_deg: np.ndarray, **given: object) -> Targets:
    """JOINT moves from (0, 0, -90, 0, 45, 0) by steps (n, 6), all but the last fly."""
    q = np.deg2rad([0.0, 0.0, -90.0, 0.0, 45.0, 0.0]) + np.deg2rad(
        np.vstack([np.zeros(6), np.cumsum(turns_deg, axis=0)])
    )
    n = len(q)
    made: dict[str, object] = {
        "fly": np.arange(n) < n - 1,
        "rounding": np.full(n, int(Fly.OVERLAP)),
        "overlap": np.ones(n),
    }
    return make_targets(np.full(n, int(TargetKind.JOINTS)), None, q, **(made | given))


SQUARE = np.array([[0, 0.1, 0], [0, 0.1, 0.1]])


def test_a_right_angle_is_cut_by_the_vertex_of_its_parabola(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    targets = run(arm, tool, home, SQUARE)
    done = plan(arm, targets, 0.0)
    away = np.linalg.norm(done.aside, axis=1)
    np.testing.assert_allclose(away, [0, 10 * MM * np.sqrt(2) / 4, 0], atol=0.03 * MM)
    np.testing.assert_allclose(done.tcp[1, :3, 3] - done.aside[1],
                               targets.tcp[1, :3, 3], atol=1e-9)  # fmt: skip
    assert done.speed[1] > 0 and not done.untimed.any()


def test_the_arm_passes_where_the_corner_is_nearest_and_leaves_it_tangentially(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    targets = run(arm, tool, home, SQUARE, fly_distance=np.full(3, 40 * MM))
    exact = trace(arm, targets)
    found = corners(arm, targets, exact)
    s = np.linspace(0, 1, 2001)
    q = np.array([on_corner(exact, found.zones, 0, at) for at in s])
    tcp = (arm.flange(q) @ tool)[:, :3, 3]
    away = np.linalg.norm(tcp - targets.tcp[1, :3, 3], axis=1)
    at = (arm.flange(found.q) @ tool)[0, :3, 3]
    nearest = np.linalg.norm(at - targets.tcp[1, :3, 3])
    assert nearest == pytest.approx(away.min(), abs=1e-6)
    ends = [tcp[1] - tcp[0], tcp[-1] - tcp[-2]]
    for step, along in zip(ends, ([0, 1, 0], [0, 0, 1]), strict=True):
        assert step @ np.array(along) / np.linalg.norm(step) > 1 - 1e-5


def test_a_tolerance_is_kept(arm: Arm, tool: np.ndarray, home: np.ndarray) -> None:
    given = {"rounding": np.full(3, int(Fly.WITHIN)), "fly_distance": np.full(3, MM)}
    aside = replan_all(arm, run(arm, tool, home, SQUARE, **given)).aside
    assert np.linalg.norm(aside[1]) == pytest.approx(MM, rel=0.02)


def test_a_zone_is_half_of_the_shorter_move_at_most(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    points = np.array([[0, 0.1, 0], [0, 0.1, 0.02], [0, 0.2, 0.02]])
    targets = run(arm, tool, home, points, fly_distance=np.full(4, 10.0))
    zones = corners(arm, targets, trace(arm, targets)).zones
    np.testing.assert_allclose(zones.before, [0.1, 0.5], rtol=1e-6)
    np.testing.assert_allclose(zones.behind, [0.5, 0.1], rtol=1e-6)


def test_exact_points_and_forks_are_passed_exactly(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    targets = run(arm, tool, home, SQUARE, rounding=np.full(3, int(Fly.EXACT)))
    exact = trace(arm, targets)
    assert blend(arm, targets, exact) is exact
    fork = replace(
        run(arm, tool, home, np.vstack([SQUARE, SQUARE[1:]])),
        pred_start=np.array([0, 1, 2, 3, 4]), pred=np.array([-1, 0, 1, 1]),
    )  # fmt: skip
    assert (replan_all(arm, fork).aside == 0).all()


def test_smooth_runs_hardly_change(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    """A circle of 100 mm in chords of 2 mm: the sagitta, no other directions."""
    angle = np.arange(1, 158) * 0.02
    points = 0.1 * np.column_stack([0 * angle, np.sin(angle), 1 - np.cos(angle)])
    n = len(points) + 1
    targets = run(arm, tool, home, points, fly_distance=np.full(n, MM))
    done = plan(arm, targets, 0.0)
    sharp = plan(arm, replace(targets, rounding=np.full(n, int(Fly.EXACT))), 0.0)
    away = np.linalg.norm(done.aside, axis=1)
    assert 4e-6 < away[1:-1].max() < 6e-6
    assert np.abs(done.side - sharp.side).max() < 0.05


def test_joint_moves_overlap_by_the_square_of_the_percentage(arm: Arm) -> None:
    turns = np.array([[40.0, 0, 0, 0, 0, 0], [0, 20.0, 0, 0, 0, 0]])
    whole, half = (
        corners(arm, targets, trace(arm, targets)).zones
        for targets in (joint_run(turns), joint_run(turns, overlap=np.full(3, 0.5)))
    )
    # 20 deg at 225 deg/s^2 never reach full speed: half of them is the start; for as
    # long, 40 deg are braked at 250 deg/s^2.
    np.testing.assert_allclose(whole.behind, 0.5)
    np.testing.assert_allclose(whole.before, 250 / 40 * (20 / 225) / 2)
    np.testing.assert_allclose(half.before, whole.before / 4)
    np.testing.assert_allclose(half.behind, whole.behind / 4)


@pytest.mark.parametrize("seed", range(5))
def test_few_samples_tell_the_sides_that_many_do(
    arm: Arm, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(seed)
    turns = rng.uniform(-8, 8, (60, 6))
    targets = joint_run(turns, overlap=rng.uniform(0.2, 1.0, 61))
    few = replan_all(arm, targets)
    monkeypatch.setattr(blending, "SAMPLES", 200)
    many = replan_all(arm, targets)
    np.testing.assert_allclose(few.side, many.side, atol=0.01)
    np.testing.assert_array_equal(few.aside, many.aside)
    assert np.linalg.norm(few.aside, axis=1).max() > 5 * MM


def test_sides_need_no_samples_where_nothing_turns(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    rng = np.random.default_rng(5)
    heading = np.cumsum(rng.normal(scale=0.2, size=(3, 400)), axis=1)
    points = np.cumsum(2 * MM * np.sin(heading.T), axis=0)
    targets = run(arm, tool, home, points)
    targets = replace(targets, fly_distance=rng.uniform(0.1, 1.5, 401) * MM)
    # Drives that turn although no joint does.
    coupling = np.eye(6) + 0.3 * np.eye(6, k=-1)
    arm, exact = replace(arm, coupling=coupling), trace(arm, targets)
    all_, few = (blend(arm, targets, exact, timed) for timed in (True, False))
    assert len(targets) < len(few.edges.path) < 0.8 * len(all_.edges.path)
    wanted, found = (arrivals(arm, one.q, one.edges) for one in (all_, few))
    np.testing.assert_allclose(found.side, wanted.side, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.travel, wanted.travel, rtol=0, atol=1e-12)
    assert (np.abs(wanted.side) < 1).any() and (wanted.travel > 0).any()
