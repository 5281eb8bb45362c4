"""An arc from every place that it may begin at."""

from __future__ import annotations

import numpy as np

from postproc.motion.joint_path import trace
from postproc.motion.path import arc_per_start
from postproc.motion.replan import replan_all
from postproc.motion.targets import ARC_END, CODE, TargetKind, Targets
from postproc.robot.arm import Arm
from postproc.robot.trajectory import Motion
from tests.made_targets import make_targets

MOVE = np.array([Motion.JOINT, Motion.JOINT, Motion.CIRCULAR, Motion.CIRCULAR])
VIA = np.array([False, False, True, False])
FROM = {
    "both": (np.array([0, 1, 2, 4, 5]), np.array([-1, -1, 0, 1, 2])),
    "first": (np.array([0, 1, 2, 3, 4]), np.array([-1, -1, 0, 2])),
    "second": (np.array([0, 1, 2, 3, 4]), np.array([-1, -1, 1, 2])),
}


def arc_from(
    which: str, arm: Arm, tool: np.ndarray, home: np.ndarray, **more: object
) -> Targets:
    """Two places to begin at, then an arc."""
    begin = arm.flange(home[None])[0] @ tool
    tcp = np.tile(begin, (4, 1, 1))
    tcp[:, :3, 3] += [[0, 0, 0.1], [0, 0, 0], [0, 0.1, 0.05], [0, 0.2, 0.05]]
    first, pred = arc_per_start(MOVE, VIA, *FROM[which])
    given = {
        "move": MOVE, "via": VIA, "tool": np.tile(tool, (4, 1, 1)),
        "slot": np.array([0, 0, -1, -1]), "pred_start": first, "pred": pred,
    }  # fmt: skip
    kind = more.pop("kind", np.full(4, TargetKind.POSE))
    return make_targets(kind, tcp, **(given | more))


def test_vias_end_is_reached_once_for_every_start() -> None:
    first, pred = arc_per_start(MOVE, VIA, *FROM["both"])
    assert first.tolist() == [0, 1, 2, 4, 6] and pred.tolist() == [-1, -1, 0, 1, 2, 2]
    first, pred = arc_per_start(MOVE, VIA, *FROM["first"])
    assert pred.tolist() == [-1, -1, 0, 2]
    first, pred = arc_per_start(MOVE[:1], VIA[:1], np.array([0, 1]), np.array([-2]))
    assert first.tolist() == [0, 1] and pred.tolist() == [-2]


def test_every_start_has_a_circle_of_its_own(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    both = trace(arm, arc_from("both", arm, tool, home)).edges
    for which, name in enumerate(("first", "second")):
        alone = trace(arm, arc_from(name, arm, tool, home)).edges
        for edge, own in ((2 + which, 2), (4 + which, 3)):
            np.testing.assert_allclose(
                both.path[both.start[edge] : both.start[edge + 1]],
                alone.path[alone.start[own] : alone.start[own + 1]],
                atol=1e-9,
            )


def test_a_side_is_sure_where_all_circles_agree(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    sides = [
        replan_all(arm, arc_from(name, arm, tool, home)).side[3]
        for name in ("both", "first", "second")
    ]
    both, first, second = sides
    other = np.sign(first) != np.sign(second)
    assert other.any() and not other.all()
    assert (np.abs(both[other]) < 0.5).all()
    sure = np.abs(both) > 0.5
    assert sure.sum() >= 3
    np.testing.assert_allclose(both[sure], first[sure])


def test_an_arc_from_where_a_step_led_is_followed(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    step = np.array([0.02, -0.03, 0.01, 0.05, 0.02, -0.04])
    joints = np.full((4, 6), np.nan)
    joints[1] = step
    kind = np.array(
        [TargetKind.POSE, TargetKind.JOINT_STEP, TargetKind.POSE, TargetKind.POSE]
    )
    first, pred = np.array([0, 1, 2, 3, 4]), np.array([-1, 0, 1, 2])
    late = arc_from(
        "second", arm, tool, home, kind=kind, joints=joints, pred_start=first, pred=pred
    )
    found = replan_all(arm, late)
    place = trace(arm, late).q[1]
    joints = np.full((4, 6), np.nan)
    joints[1] = place
    kind = np.array(
        [TargetKind.POSE, TargetKind.JOINTS, TargetKind.POSE, TargetKind.POSE]
    )
    same = arc_from(
        "second", arm, tool, home, kind=kind, joints=joints, pred_start=first, pred=pred
    )
    wanted = replan_all(arm, same)
    assert (np.abs(found.side[2:]) > 0.5).all(axis=1).any()
    np.testing.assert_allclose(found.side, wanted.side, atol=1e-6)


def test_an_arc_to_nowhere_says_so(
    arm: Arm, tool: np.ndarray, home: np.ndarray
) -> None:
    kind = np.array(
        [TargetKind.POSE, TargetKind.POSE, TargetKind.POSE, TargetKind.UNKNOWN]
    )
    found = trace(arm, arc_from("second", arm, tool, home, kind=kind))
    assert found.reason[2] == CODE[ARC_END]
