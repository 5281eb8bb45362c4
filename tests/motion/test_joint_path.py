from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.diagnostics import NO_REASON, Reason
from postproc.motion import joint_path as trace_module
from postproc.motion.joint_path import PathSolver, Trace, trace
from postproc.motion.planner import plan
from postproc.motion.replan import replan_all
from postproc.motion.targets import (
    AMBIGUOUS,
    LIMITS,
    NO_BRANCH,
    NO_CIRCLE,
    NO_START,
    NO_TARGET,
    OTHER_BRANCH,
    OUT_OF_REACH,
    PATH_JUMP,
    PATH_REACH,
    REASONS,
    TargetKind,
    Targets,
)
from postproc.robot.arm import Arm
from postproc.robot.trajectory import Motion
from tests.made_targets import make_targets


def shifted(T: np.ndarray, xyz: tuple[float, float, float]) -> np.ndarray:
    out = T.copy()
    out[:3, 3] += xyz
    return out


def lines_from(
    arm: Arm,
    tool: np.ndarray,
    home: np.ndarray,
    poses: list[np.ndarray],
    **more: object,
) -> Targets:
    """Reach `home` by a JOINT move, then the poses by LINEAR ones."""
    n = len(poses) + 1
    joints = np.full((n, 6), np.nan)
    joints[0] = home
    tcp = np.concatenate([np.full((1, 4, 4), np.nan), np.array(poses)])
    kind = np.array([TargetKind.JOINTS] + [TargetKind.POSE] * len(poses))
    move = np.array([Motion.JOINT] + [Motion.LINEAR] * len(poses))
    given: dict[str, object] = {"move": move, "tool": np.tile(tool, (n, 1, 1))}
    return make_targets(kind, tcp, joints, **(given | more))


def at(arm: Arm, tool: np.ndarray, q: np.ndarray) -> np.ndarray:
    return (arm.flange(q[None]) @ tool)[0]


def reason(traced: Trace, v: int) -> Reason:
    return REASONS[traced.reason[v]]


def test_poses_are_reached_on_straight_lines(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    T0 = at(arm, tool, home)
    ends = [shifted(T0, (0.1, -0.2, 0.05)), shifted(T0, (0.0, 0.3, 0.1))]
    ends[1][:3, :3] = ends[1][:3, :3] @ Rotation.from_rotvec([0.2, 0.1, 0]).as_matrix()
    found = trace(arm, lines_from(arm, tool, home, ends))
    assert (found.reason == 0).all()
    np.testing.assert_allclose(arm.flange(found.q[1:]) @ tool, ends, atol=1e-9)
    edges = found.edges
    path = edges.path[edges.start[2] : edges.start[3]]
    xyz = (arm.flange(path) @ tool)[:, :3, 3] - ends[0][:3, 3]
    way = ends[1][:3, 3] - ends[0][:3, 3]
    assert np.linalg.norm(np.cross(xyz, way / np.linalg.norm(way)), axis=1).max() < 1e-9
    share = xyz @ way / (way @ way)
    np.testing.assert_allclose(
        share, np.arange(1, len(path) + 1) / len(path), atol=1e-9
    )
    assert np.abs(np.diff(path, axis=0)).max() < 0.05


def turning_line(arm: Arm, tool: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find a line on which joint 4 turns back before the end, by dense sampling."""
    rng = np.random.default_rng(4)
    u = np.linspace(0, 1, 801)[:, None]
    for _ in range(200):
        q0 = np.deg2rad(
            rng.uniform([-20, -10, -110, -60, 20, -60], [20, 20, -80, 60, 60, 60])
        )
        T0 = at(arm, tool, q0)
        T = np.tile(T0, (801, 1, 1))
        T[:, :3, 3] += u * rng.uniform(-0.3, 0.3, 3)
        q = np.unwrap(arm.inverse(T @ np.linalg.inv(tool)).q[:, 0], axis=0)
        q4 = q[:, 3]
        if np.isnan(q4).any() or np.abs(q[0] - q0).max() > 1e-6:
            continue
        whole, back = q4[-1] - q4[0], q4[-1] - q4[np.argmax(np.abs(q4 - q4[0]))]
        if whole * back < 0 and abs(back) > 4 * arm.play[3] < abs(whole):
            return q0, T[-1]
    raise AssertionError("no such line among the trials")


def test_joint_4_turns_back_before_the_end_of_a_straight_line(
    arm: Arm, tool: np.ndarray
) -> None:
    home, end = turning_line(arm, tool)
    found = replan_all(arm, lines_from(arm, tool, home, [end]))
    q, side = found.passed, np.sign(found.side)
    assert side[1, 3] == -np.sign(q[1, 3] - q[0, 3]) != 0


def test_arcs_are_followed(arm: Arm, tool: np.ndarray, home: np.ndarray) -> None:
    T0 = at(arm, tool, home)
    via, end = shifted(T0, (0, 0.1, 0.1)), shifted(T0, (0, 0.2, 0))
    targets = lines_from(
        arm, tool, home, [via, end], move=np.array([0, 2, 2]),
        via=np.array([False, True, False]),
    )  # fmt: skip
    found = trace(arm, targets)
    assert (found.reason == 0).all()
    xyz = (arm.flange(found.edges.path[1:]) @ tool)[:, :3, 3]
    centre = T0[:3, 3] + [0, 0.1, 0]
    np.testing.assert_allclose(np.linalg.norm(xyz - centre, axis=1), 0.1, atol=1e-9)
    np.testing.assert_allclose(found.length[1:], 0.1 * np.pi / 2, rtol=1e-9)


def test_an_arc_through_points_on_a_line_is_reported(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    T0 = at(arm, tool, home)
    poses = [shifted(T0, (0, 0.1, 0)), shifted(T0, (0, 0.2, 0))]
    targets = lines_from(
        arm, tool, home, poses, move=np.array([0, 2, 2]),
        via=np.array([False, True, False]),
    )  # fmt: skip
    found = trace(arm, targets)
    assert reason(found, 1) == reason(found, 2) == NO_CIRCLE
    assert found.edges.source[1] == found.edges.source[2] == -1
    assert not np.isnan(found.q).any()


def test_branch_and_turns_of_joint_moves_come_from_the_string(arm: Arm) -> None:
    q = np.deg2rad([[10.0, 0, -90, 30, 40, 20], [10, 0, -90, -150, -40, 560]])
    slot = arm.branch(q)
    turns = np.array([[np.nan, np.nan, np.nan], [0.0, 2.0, np.nan]])
    targets = make_targets(
        np.zeros(2, int), arm.flange(q), slot=slot, turns=turns
    )  # fmt: skip
    found = trace(arm, targets)
    assert slot.tolist() == [0, 4]
    np.testing.assert_allclose(found.q, q, atol=1e-8)


def test_without_turn_care_the_nearest_turn_is_taken(arm: Arm) -> None:
    q = np.deg2rad([[10.0, 0, -90, 30, 40, 350], [10, 0, -90, 30, 40, 370]])
    joints = np.array([q[0], np.full(6, np.nan)])
    targets = make_targets(
        np.array([TargetKind.JOINTS, TargetKind.POSE]),
        np.array([np.full((4, 4), np.nan), arm.flange(q)[1]]), joints,
        slot=np.array([-1, 0]),
        nearest_turn=np.array([False, True]),
    )  # fmt: skip
    np.testing.assert_allclose(trace(arm, targets).q[1], q[1], atol=1e-8)


def test_continuity_overrules_the_string_on_lines(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    end = shifted(at(arm, tool, home), (0.1, 0, 0))
    found = trace(arm, lines_from(arm, tool, home, [end], slot=np.array([-1, 4])))
    assert found.slot[1] == 0 and found.overruled.tolist() == [False, True]


def test_out_of_reach_on_the_way_and_at_the_end(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    T0 = at(arm, tool, home)
    far = shifted(T0, (2.0, 0, 0))
    found = trace(arm, lines_from(arm, tool, home, [far, T0]))
    assert reason(found, 1) == OUT_OF_REACH
    assert np.isnan(found.q[1]).all() and reason(found, 2) == NO_START


def test_a_path_that_leaves_the_reach(arm: Arm) -> None:
    # The TCP rests while a long tool that points back at the arm swings round it: half
    # way the wrist would have to be farther out than the arm reaches.
    long = np.eye(4)
    long[2, 3] = 1.0
    tcp = np.tile(np.eye(4), (2, 1, 1))
    tcp[:, :3, 3] = [1.7, 0.0, 0.83]
    for k, side in enumerate((1, -1)):
        z = -np.array([np.cos(np.deg2rad(70)), side * np.sin(np.deg2rad(70)), 0])
        tcp[k, :3, :3] = np.column_stack([[0, 0, 1], np.cross(z, [0, 0, 1]), z])
    branches = arm.inverse(tcp @ np.linalg.inv(long)).q
    slot = int(np.flatnonzero(~np.isnan(branches[..., 0]).any(axis=0))[0])
    targets = make_targets(
        np.zeros(2, int), tcp, move=np.array([0, 1]), slot=np.full(2, slot),
        tool=np.tile(long, (2, 1, 1)),
    )  # fmt: skip
    found = trace(arm, targets)
    assert reason(found, 1) == PATH_REACH
    np.testing.assert_allclose(arm.flange(found.q) @ long, tcp, atol=1e-9)
    assert found.edges.source[1] == -1


def test_a_line_through_a_straight_wrist_is_reported(arm: Arm) -> None:
    q = np.deg2rad([[10.0, 0, -90, 0, 3, 0], [10, 0, -90, 0, -3, 0]])
    joints = np.array([q[0], np.full(6, np.nan)])
    tcp = np.full((2, 4, 4), np.nan)
    tcp[1] = arm.flange(q)[1]
    targets = make_targets(
        np.array([TargetKind.JOINTS, TargetKind.POSE]),
        tcp,
        joints,
        move=np.array([0, 1]),
    )
    found = trace(arm, targets)
    np.testing.assert_allclose(found.q[1], q[1], atol=1e-7)
    assert reason(found, 1) == PATH_JUMP


def test_no_branch_and_no_string(arm: Arm, home: np.ndarray) -> None:
    high = np.deg2rad([0.0, -60.0, -100.0, 0, 30, 0])
    poses = arm.flange(np.array([home, high]))
    branches = arm.inverse(poses).q
    slot = int(np.flatnonzero(np.isnan(branches[1, :, 0]))[0]) if np.isnan(
        branches[1, :, 0]).any() else -1  # fmt: skip
    if slot >= 0:
        found = trace(
            arm, make_targets(np.zeros(2, int), poses, slot=np.array([0, slot]))
        )
        assert reason(found, 1) == NO_BRANCH
    found = trace(arm, make_targets(np.zeros(1, int), poses[:1]))
    assert reason(found, 0) == NO_START


def test_a_first_line_takes_its_string(arm: Arm, home: np.ndarray) -> None:
    targets = make_targets(
        np.zeros(1, int), arm.flange(home[None]), slot=np.array([0]), move=np.array([1])
    )
    found = trace(arm, targets)
    np.testing.assert_allclose(found.q[0], home, atol=1e-8)
    assert found.reason[0] == 0


def test_limits_are_reported(arm: Arm, home: np.ndarray) -> None:
    q = home.copy()
    q[1] = arm.upper[1] + 0.01
    found = trace(arm, make_targets(np.array([TargetKind.JOINTS]), joints=q[None]))
    assert reason(found, 0) == LIMITS[1]


def test_steps_move_the_arm(arm: Arm, tool: np.ndarray, home: np.ndarray) -> None:
    T0 = at(arm, tool, home)
    step = np.eye(4)
    step[2, 3] = -0.1
    turned = np.eye(4)
    turned[:3, :3] = Rotation.from_rotvec([0, 0, 0.3]).as_matrix()
    kind = [
        TargetKind.JOINTS,
        TargetKind.TOOL_STEP,
        TargetKind.BASE_STEP,
        TargetKind.JOINT_STEP,
        TargetKind.TOOL_STEP,
    ]
    joints = np.full((5, 6), np.nan)
    joints[0], joints[3] = home, [0.1, 0, 0, 0, 0, 0.2]
    tcp = np.full((5, 4, 4), np.nan)
    tcp[1], tcp[2], tcp[4] = step, turned, step
    targets = make_targets(
        np.array(kind), tcp, joints, move=np.array([0, 1, 1, 0, 1]),
        tool=np.tile(tool, (5, 1, 1)),
    )  # fmt: skip
    found = trace(arm, targets)
    assert (found.reason == 0).all()
    where = arm.flange(found.q) @ tool
    np.testing.assert_allclose(where[1], T0 @ step, atol=1e-9)
    np.testing.assert_allclose(where[2][:3, 3], where[1][:3, 3], atol=1e-9)
    np.testing.assert_allclose(where[2][:3, :3], turned[:3, :3] @ T0[:3, :3], atol=1e-9)
    np.testing.assert_allclose(found.q[3] - found.q[2], joints[3], atol=1e-12)
    np.testing.assert_allclose(where[4], where[3] @ step, atol=1e-9)
    np.testing.assert_allclose(where, found.flange @ tool, atol=1e-9)


STEPS = (TargetKind.TOOL_STEP, TargetKind.BASE_STEP, TargetKind.JOINT_STEP)


@pytest.mark.parametrize("kind", STEPS)
@pytest.mark.parametrize("known", [True, False])
def test_a_step_leads_where_all_ways_to_it_lead(
    arm: Arm, home: np.ndarray, kind: TargetKind, known: bool
) -> None:
    """From a place, and maybe from one that is not known."""
    other = TargetKind.JOINTS if known else TargetKind.UNKNOWN
    kinds = np.array([TargetKind.JOINTS, other, kind, TargetKind.POSE])
    joints = np.full((4, 6), np.nan)
    joints[0], joints[2] = home, np.deg2rad(2.0)
    joints[1] = home if known else np.nan
    tcp = np.full((4, 4, 4), np.nan)
    tcp[2], tcp[3] = np.eye(4), arm.flange(home[None] + 0.05)[0]
    tcp[2, 2, 3] = -0.01
    targets = make_targets(
        kinds, tcp, joints, move=np.array([0, 0, 1, 1]),
        pred_start=np.array([0, 1, 2, 4, 5]), pred=np.array([-1, 0, 0, 1, 2]),
    )  # fmt: skip
    found = trace(arm, targets)
    assert np.isnan(found.q[2]).all() != known
    assert (found.edges.source[-1] == 2) == known


def test_after_an_unknown_move_a_joint_target_is_known_again(
    arm: Arm, home: np.ndarray
) -> None:
    joints = np.array([home, np.full(6, np.nan), home])
    kind = np.array([TargetKind.JOINTS, TargetKind.UNKNOWN, TargetKind.JOINTS])
    targets = make_targets(kind, joints=joints)
    found = trace(arm, targets)
    assert reason(found, 1) == NO_TARGET and np.isnan(found.q[1]).all()
    np.testing.assert_array_equal(found.q[2], home)
    assert (replan_all(arm, targets).side == 0).all()


def test_predecessors_that_lead_to_different_turns(arm: Arm, home: np.ndarray) -> None:
    # 0 and 1 show the same pose, one turn of axis 6 apart; the line starts from either.
    turn = np.array([0, 0, 0, 0, 0, 2 * np.pi])
    joints = np.array([home, home + turn, np.full(6, np.nan)])
    tcp = np.full((3, 4, 4), np.nan)
    tcp[2] = shifted(arm.flange(home[None])[0], (0.05, 0, 0))
    kind = np.array([TargetKind.JOINTS, TargetKind.JOINTS, TargetKind.POSE])
    either: dict[str, object] = {
        "move": np.array([0, 0, 1]), "pred_start": np.array([0, 1, 2, 4]),
        "pred": np.array([-1, 0, 0, 1]),
    }  # fmt: skip
    found = trace(arm, make_targets(kind, tcp, joints, **either))
    assert reason(found, 2) == AMBIGUOUS and np.isnan(found.q[2]).all()
    joints[1] = home + 0.02
    found = trace(arm, make_targets(kind, tcp, joints, **either))
    assert found.reason[2] == 0
    np.testing.assert_allclose(arm.flange(found.q[2:])[0], tcp[2], atol=1e-9)


def test_a_loop_back_is_checked(arm: Arm, home: np.ndarray) -> None:
    # 1 is reached from 0 and from 2, which lies after it in the text.
    tcp = np.full((3, 4, 4), np.nan)
    T0 = arm.flange(home[None])[0]
    tcp[1], tcp[2] = shifted(T0, (0.1, 0, 0)), shifted(T0, (0.2, 0.1, 0))
    joints = np.array([home, np.full(6, np.nan), np.full(6, np.nan)])
    targets = make_targets(
        np.array([TargetKind.JOINTS, TargetKind.POSE, TargetKind.POSE]), tcp, joints,
        move=np.array([0, 1, 1]), pred_start=np.array([0, 1, 3, 4]),
        pred=np.array([-1, 0, 2, 1]),
    )  # fmt: skip
    found = trace(arm, targets)
    assert (found.reason == 0).all() and found.edges.source.tolist() == [-1, 0, 2, 1]
    back = found.edges.path[found.edges.start[2] : found.edges.start[3]]
    xyz = arm.flange(back)[:, :3, 3] - tcp[2][:3, 3]
    way = tcp[1][:3, 3] - tcp[2][:3, 3]
    assert np.linalg.norm(np.cross(xyz, way), axis=1).max() < 1e-9


def test_lines_to_joint_targets(arm: Arm, tool: np.ndarray, home: np.ndarray) -> None:
    there = home + np.array([0.1, 0.05, 0, 0.1, 0, 0.1])
    other = arm.inverse(arm.flange(there[None])).q[0, 4]
    for end, expected in ((there, NO_REASON), (other, OTHER_BRANCH)):
        targets = make_targets(
            np.full(2, TargetKind.JOINTS), joints=np.array([home, end]),
            move=np.array([0, 1]), tool=np.tile(tool, (2, 1, 1)),
        )  # fmt: skip
        found = trace(arm, targets)
        np.testing.assert_array_equal(found.q[1], end)
        assert reason(found, 1) == expected


def test_wrist_interpolation_keeps_the_line(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    there = home + np.array([0.2, 0.05, 0.1, 0.5, 0.2, -0.4])
    targets = lines_from(
        arm, tool, home, [at(arm, tool, there)], slot=np.array([-1, 0]),
        wrist_joint=np.array([False, True]),
    )  # fmt: skip
    found = trace(arm, targets)
    assert found.reason[1] == 0
    np.testing.assert_allclose(found.q[1], there, atol=1e-8)
    path = np.vstack([home, found.edges.path[1:]])
    wrist = np.diff(path[:, 3:], axis=0)
    np.testing.assert_allclose(wrist, wrist[:1] * np.ones((len(wrist), 1)), atol=1e-9)
    xyz = (arm.flange(path) @ tool)[:, :3, 3]
    way = xyz[-1] - xyz[0]
    off = np.cross(xyz - xyz[0], way / np.linalg.norm(way))
    assert np.linalg.norm(off, axis=1).max() < 1e-8


@pytest.mark.parametrize("window", [3, 7])
def test_windows_change_nothing(
    arm: Arm,
    tool: np.ndarray,
    home: np.ndarray,
    window: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    T0 = at(arm, tool, home)
    rng = np.random.default_rng(2)
    ends = [shifted(T0, tuple(rng.uniform(-0.1, 0.1, 3))) for _ in range(20)]
    ends[11] = shifted(T0, (9.0, 0, 0))
    targets = lines_from(arm, tool, home, ends, slot=np.full(21, 0))
    whole = trace(arm, targets)
    monkeypatch.setattr("postproc.motion.joint_path.WINDOW", window)
    cut = trace(arm, targets)
    np.testing.assert_array_equal(whole.q, cut.q)
    np.testing.assert_array_equal(whole.edges.path, cut.edges.path)
    np.testing.assert_array_equal(whole.reason, cut.reason)


@pytest.mark.parametrize("move", [Motion.JOINT, Motion.LINEAR])
@pytest.mark.parametrize("before", [-1, -2])
def test_a_lone_move_from_anywhere(
    arm: Arm, tool: np.ndarray, home: np.ndarray, move: Motion, before: int
) -> None:
    targets = make_targets(
        np.array([TargetKind.POSE]),
        move=np.array([move]),
        tcp=(arm.flange(home[None])[0] @ tool)[None],
        tool=tool[None],
        slot=np.array([0]),
        pred_start=np.array([0, 1]),
        pred=np.array([before]),
    )
    found = plan(arm, targets, np.deg2rad(3.0))
    np.testing.assert_allclose(found.q[0, :3], home[:3], atol=1e-9)
    assert (found.direction == 0).all()


def test_long_paths_with_arcs_are_followed_on_demand(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    # Lines and arcs in turns, more of them than are solved beforehand.
    T0, poses = at(arm, tool, home), []
    move, via = [Motion.JOINT], [False]
    for k in range(60):
        x = 0.004 * k
        for xyz, kind, on_way in (
            ((x, 0.02, 0.0), Motion.LINEAR, False),
            ((x + 0.001, 0.03, 0.01), Motion.CIRCULAR, True),
            ((x + 0.002, 0.02, 0.02), Motion.CIRCULAR, False),
        ):
            poses.append(shifted(T0, xyz))
            move.append(kind)
            via.append(on_way)
    targets = lines_from(arm, tool, home, poses, move=np.array(move), via=np.array(via))
    found = trace(arm, targets)
    assert (found.reason == 0).all() and (found.edges.source[1:] >= 0).all()
    tcp = arm.flange(found.edges.path) @ tool
    ends = found.edges.start[2:] - 1
    np.testing.assert_allclose(
        tcp[ends][:, :3, 3], np.array(poses)[:, :3, 3], atol=1e-9
    )
    steps = np.linalg.norm(np.diff(tcp[:, :3, 3], axis=0), axis=1)
    assert steps[1:].max() < 0.03


@pytest.mark.parametrize("few", [1, 3, 256])
@pytest.mark.parametrize("seed", range(4))
def test_lines_without_a_start_are_found_as_one_by_one(
    arm: Arm,
    tool: np.ndarray,
    home: np.ndarray,
    seed: int,
    few: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng, n = np.random.default_rng(seed), 40
    T0 = at(arm, tool, home)
    ends = [shifted(T0, tuple(rng.uniform(-0.1, 0.1, 3))) for _ in range(n)]
    for i in np.flatnonzero(rng.random(n) < 0.3):
        ends[i] = shifted(T0, (9.0, 0, 0))
    slot = np.where(rng.random(n + 1) < 0.7, rng.integers(-1, 8, n + 1), 0)
    turns = np.where(rng.random((n + 1, 3)) < 0.2, 0.0, np.nan)
    targets = lines_from(arm, tool, home, ends, slot=slot, turns=turns)
    monkeypatch.setattr("postproc.motion.joint_path.FEW", few)
    together = trace(arm, targets)
    assert {NO_BRANCH, OUT_OF_REACH} < {reason(together, v) for v in range(n + 1)}

    def alone(work: PathSolver, v: int, poses: np.ndarray) -> int:
        trace_module._one(work, v)
        return 1

    monkeypatch.setattr(trace_module, "_without_pasts", alone)
    singly = trace(arm, targets)
    for name in ("q", "slot", "reason", "flange"):
        np.testing.assert_array_equal(getattr(together, name), getattr(singly, name))
    np.testing.assert_array_equal(together.edges.source, singly.edges.source)
    np.testing.assert_array_equal(together.edges.path, singly.edges.path)
