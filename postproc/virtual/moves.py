"""Where each move of a program goes: from six numbers to joints and the way there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.exceptions import PlanError
from postproc.language.visits import Motion, Target, Visits
from postproc.virtual.controller import flange_of, joints_along, joints_of_pose
from postproc.virtual.path import arc, straight
from postproc.virtual.rotation import exponential, logarithm, pose, pose_of_record, undo
from postproc.virtual.setup import Setup
from postproc.virtual.wrist import joints_with_wrist


@dataclass(frozen=True)
class Way:
    """How the arm gets to one visit.

    Attributes:
        joints: Joint angles on the way, (m, 6) [rad]; the last is the visit's.
        tcp: TCP there, (m, 3) [m] in the arm base.
    """

    joints: Floats
    tcp: Floats

    @property
    def length(self) -> float:
        """Way of the TCP [m]; a JOINT move's is its chord."""
        return float(np.linalg.norm(np.diff(self.tcp, axis=0), axis=1).sum())


@dataclass(frozen=True)
class Frames:
    """The frames that hold at one visit, (4, 4) each."""

    tool: Floats
    base: Floats
    uframe: Floats


def frames_at(visits: Visits, i: int, poses: Floats) -> Frames:
    """Return the frames of visit i.

    Args:
        visits: The program.
        i: Which visit.
        poses: `visits.frames` as poses, (k, 4, 4).

    Raises:
        PlanError: A frame is not known.
    """
    indices = [int(visits.tool[i]), int(visits.base[i]), int(visits.uframe[i])]
    if min(indices) < 0:
        raise PlanError("a frame is not known at this move")
    return Frames(*(poses[k] for k in indices))


def way_to(
    setup: Setup, visits: Visits, i: int, frames: Frames, here: Floats, before: Floats
) -> Way:
    """Find the way to visit i.

    Args:
        setup: The cell.
        visits: The program.
        i: Which visit.
        frames: The frames that hold there.
        here: Joints where the arm stands, (6,) [rad].
        before: Joints one visit earlier: where an arc began, if `here` is its VIA.

    Raises:
        PlanError: The target is not known or cannot be reached.
    """
    chain = setup.chain
    if visits.motion[i] == Motion.JOINT:
        goal = _goal_joints(setup, visits, i, frames, here)
        joints = np.vstack([here, goal])
        tcp = (chain.flange(joints) @ frames.tool)[:, :3, 3]
        return Way(joints, tcp)
    start = chain.flange(here[None])[0] @ frames.tool
    end = _goal_pose(setup, visits, i, frames, here)
    if visits.motion[i] == Motion.CIRCULAR:
        began = chain.flange(before[None])[0] @ frames.tool
        samples = _arc_piece(setup, visits, i, frames, (began, start, end))
    else:
        samples = straight(start, end)
    if visits.wrist_joint[i]:
        goal = _goal_joints(setup, visits, i, frames, here)
        joints = joints_with_wrist(chain, samples[:, :3, 3], frames.tool, here, goal)
    else:
        joints = joints_along(chain, samples @ undo(frames.tool), here)
    return Way(np.vstack([here, joints]), np.vstack([start[:3, 3], samples[:, :3, 3]]))


def _arc_piece(
    setup: Setup,
    visits: Visits,
    i: int,
    frames: Frames,
    poses: tuple[Floats, Floats, Floats],
) -> Floats:
    """Sample the part of an arc that ends at visit i.

    Args:
        setup: The cell.
        visits: The program.
        i: A VIA point, whose arc ends one visit later, or the end of an arc.
        frames: The frames that hold there.
        poses: TCP poses one visit earlier, now, and at visit i.
    """
    began, start, end = poses
    if not visits.via[i]:
        return arc(began, start, end)[1]
    if i + 1 >= len(visits):
        raise PlanError("the arc has no end")
    after = _goal_pose(setup, visits, i + 1, frames, np.full(6, np.nan))
    return arc(start, end, after)[0]


def _goal_joints(
    setup: Setup, visits: Visits, i: int, frames: Frames, here: Floats
) -> Floats:
    kind, values = Target(visits.target[i]), visits.values[i]
    if kind is Target.JOINTS:
        return _known(np.radians(values))
    if kind is Target.BY:
        return here + _known(np.radians(values))
    if kind in (Target.HOME, Target.CALIBRATION):
        return _place_of(setup, kind)
    config = None
    if kind in (Target.POSE, Target.NEAR) and visits.config_given[i]:
        config = visits.configs[visits.config[i]]
    goal = _goal_pose(setup, visits, i, frames, here)
    free = bool(visits.nearest_turn[i])
    return joints_of_pose(setup.chain, goal @ undo(frames.tool), here, config, free)


def _goal_pose(
    setup: Setup, visits: Visits, i: int, frames: Frames, here: Floats
) -> Floats:
    """Return the TCP pose in the arm base, (4, 4), that visit i asks for."""
    kind, values = Target(visits.target[i]), visits.values[i]
    tool = frames.tool
    if kind in (Target.JOINTS, Target.HOME, Target.CALIBRATION, Target.BY):
        joints = _goal_joints(setup, visits, i, frames, here)
        return np.asarray(setup.chain.flange(joints[None])[0] @ tool)
    present = setup.chain.flange(here[None])[0] @ tool
    if kind in (Target.POSE, Target.NEAR, Target.FOR):
        target = pose_of_record(_known(values))
        if kind is Target.NEAR:
            target = target @ _shift(0.0, 0.0, -visits.distance_mm[i])
        goal = flange_of(target, tool, frames.base, frames.uframe) @ tool
        distance = visits.distance_mm[i] * 1e-3
        return goal if kind is not Target.FOR else _towards(present, goal, distance)
    if kind is Target.AWAY:
        return np.asarray(present @ _shift(0.0, 0.0, -_known(values[:1])[0]))
    if kind is Target.RELATIVE_TOOL:
        return np.asarray(present @ _shift(*_known(values[:3])))
    if kind in (Target.RELATIVE_BASE, Target.RELATIVE_UFRAME):
        axes = _axes(kind, frames)
        return _moved(present, axes @ _known(values[:3]) * 1e-3, np.zeros(3))
    if kind is Target.ABOUT:
        axes = _axes(Target(int(_known(values[4:5])[0])), frames, present)
        axis = axes @ _known(values[:3])
        turn = axis / np.linalg.norm(axis) * np.radians(_known(values[3:4])[0])
        return _moved(present, np.zeros(3), turn)
    raise PlanError("the program does not tell where this move goes")


def _axes(kind: Target, frames: Frames, present: Floats | None = None) -> Floats:
    """Return the axes (3, 3) in the arm base of the frame that a step is given in."""
    if kind is Target.RELATIVE_UFRAME:
        return np.asarray((undo(frames.base) @ frames.uframe)[:3, :3])
    if kind is Target.RELATIVE_TOOL and present is not None:
        return np.asarray(present[:3, :3])
    return np.eye(3)


def _moved(present: Floats, shift: Floats, turn: Floats) -> Floats:
    return pose(exponential(turn) @ present[:3, :3], present[:3, 3] + shift)


def _shift(x: float, y: float, z: float) -> Floats:
    return pose(np.eye(3), np.array([x, y, z]) * 1e-3)


def _known(values: Floats) -> Floats:
    """Return the values.

    Raises:
        PlanError: One of them is not known.
    """
    if np.isnan(values).any():
        raise PlanError("the program does not tell the numbers of this target")
    return np.asarray(values)


def _place_of(setup: Setup, kind: Target) -> Floats:
    """Return the joints (6,) [rad] of a place that the controller holds."""
    home = kind is Target.HOME
    joints = setup.home if home else setup.calibration
    if joints is None:
        name, key = ("$HOME", "home") if home else ("$CAL_SYS", "calibration")
        raise PlanError(
            f"{name} is not known; give [{key}] joints_deg in the cell file"
        )
    return joints


def _towards(present: Floats, goal: Floats, distance: float) -> Floats:
    """Go a distance [m] from one pose towards another; the tool turns with the way."""
    way = goal[:3, 3] - present[:3, 3]
    length = float(np.linalg.norm(way))
    if distance > length:
        raise PlanError("the pose is nearer than the move is to go towards it")
    share = distance / length if length else 0.0
    turn = logarithm(present[:3, :3].T @ goal[:3, :3])
    turned = present[:3, :3] @ exponential(share * turn)
    return pose(turned, present[:3, 3] + share * way)
