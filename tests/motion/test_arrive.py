"""Going a part of the way towards a pose."""

import numpy as np

from postproc.motion.planner import plan
from postproc.motion.targets import CODE, NO_START, NO_TARGET, TargetKind
from postproc.robot.arm import Arm
from postproc.robot.trajectory import Motion
from tests.made_targets import make_targets


def test_a_part_of_the_way_ends_on_the_line_and_turns_in_proportion(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    goal = arm.flange((home + 0.1)[None])[0] @ tool
    begin = arm.flange(home[None])[0] @ tool
    length = float(np.linalg.norm(goal[:3, 3] - begin[:3, 3]))
    tcp = np.full((4, 4, 4), np.nan)
    tcp[1], tcp[2], tcp[3] = goal, goal, goal
    kind = np.array(
        [TargetKind.JOINTS, TargetKind.TOWARDS, TargetKind.TOWARDS, TargetKind.POSE]
    )
    joints = np.full((4, 6), np.nan)
    joints[0] = home
    targets = make_targets(
        kind, tcp, joints,
        move=np.where(kind == TargetKind.JOINTS, Motion.JOINT, Motion.LINEAR),
        distance=np.array([np.nan, 0.25 * length, 0.25 * length, np.nan]),
        tool=np.tile(tool, (4, 1, 1)), slot=np.full(4, -1),
    )  # fmt: skip
    found = plan(arm, targets, 0.0)
    assert (found.reason == 0).all()
    share = [0.0, 0.25, 0.5, 1.0]
    way = begin[:3, 3] + np.outer(share, goal[:3, 3] - begin[:3, 3])
    np.testing.assert_allclose(found.tcp[:, :3, 3], way, atol=1e-9)
    angles = np.arccos(
        (np.einsum("nij,ij->n", found.tcp[:, :3, :3], begin[:3, :3]) - 1) / 2
    )
    np.testing.assert_allclose(angles, np.array(share) * angles[-1], atol=1e-6)


def test_a_distance_beyond_the_pose_leads_to_an_unknown_place(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    goal = arm.flange((home + 0.1)[None])[0] @ tool
    tcp = np.full((5, 4, 4), np.nan)
    tcp[1:] = goal
    tcp[3] = np.eye(4)
    kind = np.array(
        [
            TargetKind.JOINTS,
            TargetKind.TOWARDS,
            TargetKind.POSE,
            TargetKind.BASE_STEP,
            TargetKind.TOWARDS,
        ]
    )
    joints = np.full((5, 6), np.nan)
    joints[0] = home
    targets = make_targets(
        kind, tcp, joints,
        move=np.where(kind == TargetKind.JOINTS, Motion.JOINT, Motion.LINEAR),
        distance=np.array([np.nan, 50.0, np.nan, np.nan, 0.0]),
        tool=np.tile(tool, (5, 1, 1)), slot=np.array([-1, -1, -1, -1, -1]),
    )  # fmt: skip
    found = plan(arm, targets, 0.0)
    reasons = [CODE[NO_TARGET], CODE[NO_START], CODE[NO_TARGET], CODE[NO_TARGET]]
    assert found.reason.tolist() == [0, *reasons]
    assert np.isnan(found.q[1:]).all()
