"""The virtual controller: where each move of a program goes, and its way there."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.exceptions import PlanError, PostprocError
from postproc.language.visits import START, Blend, Meaning, Visits, ZoneRule
from postproc.robot.trajectory import Motion
from postproc.simulation.kinematics import (
    ELBOW,
    GRAVITY,
    NJ220,
    SHOULDER,
    WRIST,
    Chain,
    branch_of,
    exponential,
    logarithm,
    nearest_turns,
    pose,
    pose_of_numbers,
    require_closed_form,
    solve_branch,
    undo,
)
from postproc.simulation.reference import USUAL_TRACKER

# How the controller turns Cartesian targets into joint angles, on its nominal arm.

FLAGS = {"W": WRIST, "S": SHOULDER, "E": ELBOW}
SINGULAR = np.radians(0.1)  # of axis 5: both wrist branches are tried from here
TURNING = (3, 5)  # joints 4 and 6 may turn more than once
SIGN_ROUNDING = 1e-6  # [rad] around 0 where an axis has any sign
TURN_NAMES = {"T1": 3, "T2": 5, "T3": 2}
IN_JOINTS = (
    Meaning.JOINTS, Meaning.HOME, Meaning.CALIBRATION, Meaning.BY,
    Meaning.PARTIAL_JOINTS,
)  # fmt: skip


def joints_of_pose(
    chain: Chain, flange: Floats, near: Floats, config: str | None, free_turns: bool
) -> Floats:
    """Return the joints that a JOINT move to a Cartesian target ends in.

    Args:
        chain: Nominal arm.
        flange: Wanted flange pose in the arm base, (4, 4) [m].
        near: Present joints, (6,) [rad].
        config: Configuration string, or None: the nearest solution.
        free_turns: The turns nearest to `near` instead of those of the string.

    Returns:
        (6,) [rad].

    Raises:
        PlanError: Out of reach or out of the joints' range in this configuration.
    """
    require_closed_form(chain)
    if config is None:
        branches, free_turns = list(range(8)), True
    else:
        words = config.upper().split()
        branches = [sum(weight for flag, weight in FLAGS.items() if flag in words)]
    found = np.vstack([solve_branch(chain, flange[None], b) for b in branches])
    found = _into_range(chain, found)
    if free_turns:
        turned = nearest_turns(found, near)
        found[:, TURNING] = turned[:, TURNING]
    else:
        found = _on_turns(found, config or "")
    usable = found[_is_allowed(chain, found)]
    if not len(usable):
        raise PlanError("no joint angles within range reach this pose")
    away = np.abs(usable - near).max(axis=1)
    return np.asarray(usable[np.argmin(away)])


def joints_along(chain: Chain, flanges: Floats, start: Floats) -> Floats:
    """Follow a Cartesian path without a jump.

    Args:
        chain: Nominal arm.
        flanges: Densely sampled flange poses, (m, 4, 4) [m].
        start: Joints before the first of them, (6,) [rad].

    Returns:
        (m, 6) [rad].

    Raises:
        PlanError: The path leaves the reach or the joints' range.
    """
    require_closed_form(chain)
    branch = int(branch_of(chain, start[None])[0])
    branches = [branch]
    if abs(np.sin(chain.dh_angles(start)[4])) < SINGULAR:
        branches.append(branch ^ WRIST)
    tracks = [_unwrap(solve_branch(chain, flanges, b), start) for b in branches]
    jumps = [np.abs(np.diff(track, axis=0)).max() for track in tracks]
    track = tracks[int(np.argmin(np.nan_to_num(jumps, nan=np.inf)))]
    if not np.all(_is_allowed(chain, track[1:])):
        raise PlanError("the path leaves the reach or the joint range of the arm")
    return np.asarray(track[1:])


def flange_of(target: Floats, tool: Floats, base: Floats, uframe: Floats) -> Floats:
    """Return the flange pose in the arm base: BASE^-1 UFRAME P TOOL^-1, (4, 4)."""
    return np.asarray(undo(base) @ uframe @ target @ undo(tool))


def _unwrap(track: Floats, start: Floats) -> Floats:
    return np.unwrap(np.vstack([start, track]), axis=0)


def _into_range(chain: Chain, q: Floats) -> Floats:
    """Give every joint that cannot turn around the turn that lies in its range."""
    out = q.copy()
    for j in (0, 1, 2, 4):
        middle = 0.5 * (chain.lower[j] + chain.upper[j])
        out[:, j] = middle + np.remainder(q[:, j] - middle + np.pi, 2 * np.pi) - np.pi
    for j in TURNING:
        out[:, j] = np.remainder(q[:, j] + np.pi, 2 * np.pi) - np.pi
    return out


def _is_allowed(chain: Chain, q: Floats) -> NDArray[np.bool_]:
    slack = 1e-9
    inside = (q >= chain.lower - slack) & (q <= chain.upper + slack)
    return np.asarray(inside.all(axis=1))


def _on_turns(q: Floats, config: str) -> Floats:
    """Put axes 4, 6 and 3 on the turns T1, T2, T3 = floor((q + 180 deg) / 360 deg).

    What is not written is 0 for axes 4 and 6; axis 3 stays in its range. ``T1:>0`` and
    ``T1:<0`` say the sign of axis 4 alone.
    """
    out = q.copy()
    for name, joint in TURN_NAMES.items():
        sign = re.search(rf"\b{name}\s*:\s*([<>])0", config, re.IGNORECASE)
        if sign:
            ahead = np.remainder(q[:, joint] + SIGN_ROUNDING, 2 * np.pi) - SIGN_ROUNDING
            near_zero = np.abs(ahead) <= SIGN_ROUNDING
            back = (sign[1] == "<") & ~near_zero
            out[:, joint] = ahead - 2 * np.pi * back
        match = re.search(rf"\b{name}\s*:\s*(-?\d+)", config, re.IGNORECASE)
        if match:
            rest = np.remainder(q[:, joint] + np.pi, 2 * np.pi) - np.pi
            out[:, joint] = rest + 2 * np.pi * int(match[1])
    return out


# Cartesian paths, densely sampled.

# A joint that turns between two samples is missed by about step^2 / (8 m): 1 urad.
STEP = 3e-3  # [m]
TURN_STEP = np.radians(1.0)
FEWEST = 4
APART = 1e-6  # [m] points nearer than this are one: they make no circle with a third


def straight(start: Floats, end: Floats) -> Floats:
    """Sample a straight line from one pose to another, without its first point.

    The orientation turns about one fixed axis.

    Args:
        start: Pose (4, 4) [m].
        end: Likewise.

    Returns:
        (m, 4, 4), the last one is `end`.
    """
    turn = logarithm(start[:3, :3].T @ end[:3, :3])
    way = end[:3, 3] - start[:3, 3]
    s = _progress(float(np.linalg.norm(way)), float(np.linalg.norm(turn)))
    samples = pose(
        start[:3, :3] @ exponential(s[:, None] * turn),
        start[:3, 3] + s[:, None] * way,
    )
    samples[-1] = end
    return samples


def arc(start: Floats, via: Floats, end: Floats) -> tuple[Floats, Floats]:
    """Sample the arc from `start` through `via` to `end`.

    The orientation turns steadily from each pose to the next.

    Args:
        start: Pose (4, 4) [m].
        via: Likewise.
        end: Likewise.

    Returns:
        The samples up to `via` and those up to `end`, as in `straight`.

    Raises:
        PlanError: The three points lie on a line.
    """
    centre, normal = _circle(start[:3, 3], via[:3, 3], end[:3, 3])
    first = _angle(start[:3, 3] - centre, via[:3, 3] - centre, normal)
    whole = _angle(start[:3, 3] - centre, end[:3, 3] - centre, normal)
    return (
        _sample_circle(start, via, centre, normal * first),
        _sample_circle(via, end, centre, normal * (whole - first)),
    )


def _sample_circle(start: Floats, end: Floats, centre: Floats, sweep: Floats) -> Floats:
    """Sample a piece of a circle that sweeps a rotation vector about its centre."""
    turn = logarithm(start[:3, :3].T @ end[:3, :3])
    radius = start[:3, 3] - centre
    length = float(np.linalg.norm(sweep) * np.linalg.norm(radius))
    s = _progress(length, float(np.linalg.norm(turn)))
    samples = pose(
        start[:3, :3] @ exponential(s[:, None] * turn),
        centre + exponential(s[:, None] * sweep) @ radius,
    )
    samples[-1] = end
    return samples


def _progress(length: float, angle: float) -> Floats:
    count = max(FEWEST, int(np.ceil(max(length / STEP, angle / TURN_STEP))))
    return np.arange(1, count + 1) / count


def _circle(p: Floats, q: Floats, r: Floats) -> tuple[Floats, Floats]:
    """Return the centre and the unit normal of the circle through three points."""
    u, v = q - p, r - p
    normal = np.cross(u, v)
    area = float(np.linalg.norm(normal))
    sides = [float(np.linalg.norm(side)) for side in (u, v, r - q)]
    if area < 1e-6 * sides[0] * sides[1] or min(sides) < APART:
        raise PlanError("the three points of the arc lie on a line")
    to_centre = np.cross(u @ u * v - v @ v * u, normal) / (2 * area**2)
    return p + to_centre, normal / area


def _angle(a: Floats, b: Floats, normal: Floats) -> float:
    """Return the angle in (0, 2 pi] from a to b about a normal."""
    angle = np.arctan2(np.cross(a, b) @ normal, a @ b)
    return float(angle if angle > 0 else angle + 2 * np.pi)


# Straight lines on which the wrist turns joint by joint ($ORNT_TYPE WRIST_JNT).

NEWTON_STEPS = 12
CLOSE = 1e-9  # [m]


def joints_with_wrist(
    chain: Chain, points: Floats, tool: Floats, start: Floats, end: Floats
) -> Floats:
    """Follow TCP points while joints 4 to 6 go straight from start to end.

    Newton's method on joints 1 to 3, for all points at once.

    Args:
        chain: Nominal arm.
        points: TCP positions at even steps, the last at the end, (m, 3) [m].
        tool: Flange to TCP, (4, 4).
        start: Joints before the first point, (6,) [rad].
        end: Joints at the last point, (6,) [rad].

    Returns:
        (m, 6) [rad].

    Raises:
        PlanError: The line leaves the reach of the arm.
    """
    progress = np.arange(1, len(points) + 1)[:, None] / len(points)
    q = start + progress * (end - start)
    for _ in range(NEWTON_STEPS):
        frames = chain.frames(q)
        tcp = frames[:, 6, :3, :3] @ tool[:3, 3] + frames[:, 6, :3, 3]
        miss = points - tcp
        if np.abs(miss).max() < CLOSE:
            break
        levers = tcp[:, None] - frames[:, :3, :3, 3]
        columns = chain.by_joints(np.cross(frames[:, :3, :3, 2], levers))
        jacobian = np.swapaxes(columns, 1, 2)
        if np.abs(np.linalg.det(jacobian)).min() < 1e-6:
            raise PlanError("the path passes a singularity of the arm")
        q[:, :3] += np.linalg.solve(jacobian, miss[..., None])[..., 0]
    inside = (q >= chain.lower) & (q <= chain.upper)
    if not np.abs(miss).max() < CLOSE or not inside.all():
        raise PlanError("the path leaves the reach or the joint range of the arm")
    return np.asarray(q)


# The place where the virtual arm works, as plain values.

SAME_POINT = 1e-6  # [m]


def _identity() -> Floats:
    return np.eye(4)


@dataclass(frozen=True)
class VirtualCell:
    """What the cell tells: SI units, poses in the frames of the controller.

    Attributes:
        chain: The nominal arm.
        coupling: Motor angles = coupling @ joint angles, (6, 6).
        tool: Flange to TCP, (4, 4) [m].
        base: World to arm base, (4, 4).
        uframe: World to user frame, (4, 4).
        tools: Tools that `tool_id` columns count, (k, 4, 4); empty: always `tool`.
        home: $HOME and where programs start, (6,) [rad], or None.
        calibration: $CAL_SYS, (6,) [rad], or None.
        payload: [kg].
        payload_com: In the flange frame, (3,) [m].
        temperature: At the start, [deg C].
        tracker: Where the tracker stands, (3,) [m] in the arm base frame.
        gravity: Acceleration of gravity in the arm base, (3,) [m/s^2].
    """

    chain: Chain = NJ220
    coupling: Floats = field(default_factory=lambda: np.eye(6))
    tool: Floats = field(default_factory=_identity)
    base: Floats = field(default_factory=_identity)
    uframe: Floats = field(default_factory=_identity)
    tools: Floats = field(default_factory=lambda: np.zeros((0, 4, 4)))
    home: Floats | None = None
    calibration: Floats | None = None
    payload: float = 0.0
    payload_com: Floats = field(default_factory=lambda: np.zeros(3))
    temperature: float = 22.0
    tracker: Floats = field(default_factory=lambda: USUAL_TRACKER.copy())
    gravity: Floats = field(default_factory=GRAVITY.copy)

    def tool_of(self, tool_id: NDArray[np.int64]) -> Floats:
        """Return the tool poses (n, 4, 4) of tool numbers (n,) from 0.

        Numbers that count from 1 to the number of tools are understood too.

        Raises:
            PostprocError: A number that belongs to no tool.
        """
        if not len(self.tools):
            return np.broadcast_to(self.tool, (len(tool_id), 4, 4))
        lowest, highest = (int(f(tool_id)) for f in (np.min, np.max))
        if lowest > 0 and highest == len(self.tools):
            tool_id, lowest, highest = tool_id - 1, lowest - 1, highest - 1
        if lowest < 0 or highest >= len(self.tools):
            raise PostprocError(
                f"the rows name tools {lowest} to {highest}, the cell has "
                f"{len(self.tools)} probe points. Add them to [survey] points_mm"
            )
        return np.asarray(self.tools[tool_id])

    def number_of(self, tool: Floats) -> int:
        """Return the number from 0 of the probe point at a tool's TCP, or -1."""
        away = np.linalg.norm(self.tools[:, :3, 3] - tool[:3, 3], axis=1)
        same = np.flatnonzero(away < SAME_POINT)
        return int(same[0]) if len(same) else -1


# Where each move of a program goes: from six numbers to joints and the way there.


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
class MoveFrames:
    """The frames that hold at one visit, (4, 4) each."""

    tool: Floats
    base: Floats
    uframe: Floats


def frames_at(visits: Visits, i: int, poses: Floats) -> MoveFrames:
    """Return the frames of visit i.

    Args:
        visits: The program.
        i: Which visit.
        poses: `visits.frames` as poses, (k, 4, 4).

    Raises:
        PlanError: A frame is not known.
    """
    indices = [
        int(visits.frame.tool[i]),
        int(visits.frame.base[i]),
        int(visits.frame.uframe[i]),
    ]
    if min(indices) < 0:
        raise PlanError("a frame is not known at this move")
    return MoveFrames(*(poses[k] for k in indices))


def way_to(
    setup: VirtualCell,
    visits: Visits,
    i: int,
    frames: MoveFrames,
    here: Floats,
    before: Floats,
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
    if visits.motion.kind[i] == Motion.JOINT:
        goal = _goal_joints(setup, visits, i, frames, here)
        joints = np.vstack([here, goal])
        tcp = (chain.flange(joints) @ frames.tool)[:, :3, 3]
        return Way(joints, tcp)
    start = chain.flange(here[None])[0] @ frames.tool
    end = _goal_pose(setup, visits, i, frames, here)
    if visits.motion.kind[i] == Motion.CIRCULAR:
        began = chain.flange(before[None])[0] @ frames.tool
        samples = _arc_piece(setup, visits, i, frames, (began, start, end))
    else:
        samples = straight(start, end)
    if visits.motion.wrist_joint[i]:
        goal = _goal_joints(setup, visits, i, frames, here)
        joints = joints_with_wrist(chain, samples[:, :3, 3], frames.tool, here, goal)
    else:
        joints = joints_along(chain, samples @ undo(frames.tool), here)
    return Way(np.vstack([here, joints]), np.vstack([start[:3, 3], samples[:, :3, 3]]))


def _arc_piece(
    setup: VirtualCell,
    visits: Visits,
    i: int,
    frames: MoveFrames,
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
    if not visits.motion.via[i]:
        return arc(began, start, end)[1]
    if i + 1 >= len(visits):
        raise PlanError("the arc has no end")
    after = _goal_pose(setup, visits, i + 1, frames, np.full(6, np.nan))
    return arc(start, end, after)[0]


def _goal_joints(
    setup: VirtualCell, visits: Visits, i: int, frames: MoveFrames, here: Floats
) -> Floats:
    kind, values = Meaning(visits.target.meaning[i]), visits.target.values[i]
    if kind is Meaning.JOINTS:
        return _check_known(np.radians(values[:6]))
    if kind is Meaning.BY:
        return here + _check_known(np.radians(values[:6]))
    if kind is Meaning.PARTIAL_JOINTS:
        return _fill(np.radians(values[:6]), here)
    if kind in (Meaning.HOME, Meaning.CALIBRATION):
        return _place_of(setup, kind)
    config = None
    if kind in (Meaning.POSE, Meaning.NEAR) and visits.target.config_given[i]:
        config = visits.dialect.flag_words(
            visits.target.configs[visits.target.config[i]], values
        )
    goal = _goal_pose(setup, visits, i, frames, here)
    free = bool(visits.motion.nearest_turn[i])
    return joints_of_pose(setup.chain, goal @ undo(frames.tool), here, config, free)


def _goal_pose(
    setup: VirtualCell, visits: Visits, i: int, frames: MoveFrames, here: Floats
) -> Floats:
    """Return the TCP pose in the arm base, (4, 4), that visit i asks for."""
    kind, values = Meaning(visits.target.meaning[i]), visits.target.values[i]
    tool = frames.tool
    if kind in IN_JOINTS:
        joints = _goal_joints(setup, visits, i, frames, here)
        return np.asarray(setup.chain.flange(joints[None])[0] @ tool)
    present = setup.chain.flange(here[None])[0] @ tool
    if kind in (Meaning.POSE, Meaning.NEAR, Meaning.FOR):
        target = pose_of_numbers(_check_known(values))
        if kind is Meaning.NEAR:
            target = target @ _shift(0.0, 0.0, -visits.target.distance_mm[i])
        goal = flange_of(target, tool, frames.base, frames.uframe) @ tool
        distance = visits.target.distance_mm[i] * 1e-3
        return goal if kind is not Meaning.FOR else _towards(present, goal, distance)
    if kind is Meaning.AWAY:
        return np.asarray(present @ _shift(0.0, 0.0, -_check_known(values[:1])[0]))
    if kind is Meaning.RELATIVE_TOOL:
        return np.asarray(present @ _shift(*_check_known(values[:3])))
    if kind is Meaning.PARTIAL_POSE:
        user = undo(frames.base) @ frames.uframe
        goal = undo(user) @ present
        xyz = _fill(values[:3] * 1e-3, goal[:3, 3])
        return np.asarray(user @ pose(goal[:3, :3], xyz))
    if kind in (Meaning.RELATIVE_BASE, Meaning.RELATIVE_UFRAME):
        axes = _axes(kind, frames)
        return _move(present, axes @ _check_known(values[:3]) * 1e-3, np.zeros(3))
    if kind is Meaning.ABOUT:
        axes = _axes(Meaning(int(_check_known(values[4:5])[0])), frames, present)
        axis = axes @ _check_known(values[:3])
        turn = axis / np.linalg.norm(axis) * np.radians(_check_known(values[3:4])[0])
        return _move(present, np.zeros(3), turn)
    raise PlanError("the program does not tell where this move goes")


def _fill(values: Floats, before: Floats) -> Floats:
    """Return the values, and what was before where one is not written."""
    return np.asarray(np.where(np.isnan(values), before, values))


def _axes(kind: Meaning, frames: MoveFrames, present: Floats | None = None) -> Floats:
    """Return the axes (3, 3) in the arm base of the frame that a step is given in."""
    if kind is Meaning.RELATIVE_UFRAME:
        return np.asarray((undo(frames.base) @ frames.uframe)[:3, :3])
    if kind is Meaning.RELATIVE_TOOL and present is not None:
        return np.asarray(present[:3, :3])
    return np.eye(3)


def _move(present: Floats, shift: Floats, turn: Floats) -> Floats:
    return pose(exponential(turn) @ present[:3, :3], present[:3, 3] + shift)


def _shift(x: float, y: float, z: float) -> Floats:
    return pose(np.eye(3), np.array([x, y, z]) * 1e-3)


def _check_known(values: Floats) -> Floats:
    """Return the values.

    Raises:
        PlanError: One of them is not known.
    """
    if np.isnan(values).any():
        raise PlanError("the program does not tell the numbers of this target")
    return np.asarray(values)


def _place_of(setup: VirtualCell, kind: Meaning) -> Floats:
    """Return the joints (6,) [rad] of a place that the controller holds."""
    home = kind is Meaning.HOME
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


# How the virtual controller rounds a fly point.
#
# While the first of two moves is braked, the second one starts: between Cartesian moves
# with FLY_CART their motions are added up in space, else joint by joint. Both motions
# grow with the square of the time, so that the corner of two straight moves is a
# parabola. How long that lasts is in `shares`.

MOMENTS = np.linspace(0.0, 1.0, 33)  # of a corner, from its begin to its end
STRAIGHT = 1e-12  # [m^2] distances that differ less make no parabola


@dataclass(frozen=True)
class Corner:
    """The way round one point.

    Attributes:
        before: Part of the first move that is left out, 0 .. 1/2.
        behind: Part of the second move that is left out.
        to: Joints from the begin of the corner to the place nearest to the point,
            (k, 6) [rad].
        off: Joints from there to the end of the corner, (m, 6).
    """

    before: float
    behind: float
    to: Floats
    off: Floats


def round_corner(
    chain: Chain,
    tool: Floats,
    ways: tuple[Way, Way],
    shares: tuple[float, float],
    in_space: bool,
) -> Corner:
    """Round the point between two ways.

    Args:
        chain: Nominal arm.
        tool: Flange to TCP, (4, 4).
        ways: To the point, and on from it.
        shares: Parts of them that belong to the corner.
        in_space: Add up motions of the tool instead of motions of the joints.

    Raises:
        PlanError: The corner leaves the reach of the arm.
    """
    first = progress(ways[0], 1.0 - shares[0] * (1.0 - MOMENTS) ** 2)
    second = progress(ways[1], shares[1] * MOMENTS**2)
    point = ways[0].joints[-1]
    if in_space:
        first_pose, second_pose = (chain.flange(q) @ tool for q in (first, second))
        at = chain.flange(point[None]) @ tool
        back = np.swapaxes(at[:, :3, :3], 1, 2)
        turn = first_pose[:, :3, :3] @ back @ second_pose[:, :3, :3]
        place = first_pose[:, :3, 3] + second_pose[:, :3, 3] - at[:, :3, 3]
        added = pose(turn, place)
        joints = joints_along(chain, added @ undo(tool), first[0])
    else:
        joints = first + second - point
    tcp = (chain.flange(np.vstack([joints, point])) @ tool)[:, :3, 3]
    passing, k = _nearest(joints, np.sum((tcp[:-1] - tcp[-1]) ** 2, axis=1))
    return Corner(
        shares[0],
        shares[1],
        np.vstack([joints[: k + 1], passing]),
        np.vstack([passing, joints[k + 1 :]]),
    )


def progress(way: Way, part: Floats) -> Floats:
    """Return the joints (k, 6) at parts (k,) of a way that is sampled evenly."""
    marks = np.linspace(0.0, 1.0, len(way.joints))
    return np.stack([np.interp(part, marks, q) for q in way.joints.T], axis=1)


def _nearest(joints: Floats, distance: Floats) -> tuple[Floats, int]:
    """Return the joints where a squared distance is least, and the moment before.

    By parabolas through the three moments around the least one.
    """
    i = int(np.clip(np.argmin(distance), 1, len(distance) - 2))
    a, b, c = distance[i - 1 : i + 2]
    bend = a - 2 * b + c
    t = float(np.clip(0.5 * (a - c) / bend, -1, 1)) if bend > STRAIGHT else 0.0
    before, here, after = joints[i - 1 : i + 2]
    passing = (
        here + 0.5 * t * (after - before) + 0.5 * t**2 * (after - 2 * here + before)
    )
    return passing, i if t > 0 else i - 1


# How much of two moves the virtual controller gives to the corner between them.

USUAL_DISTANCE = 5.0  # [mm], where the program sets no $FLY_DIST
USUAL_PERCENT = 100.0  # where it sets no $FLY_PER
RAMP = 0.4  # [s] in which a joint reaches its full speed
NO_WAY = 1e-9  # [m], [rad]


def in_space(visits: Visits, i: int, j: int) -> bool:
    """Tell whether the corner between moves i and j is a Cartesian one."""
    cartesian = Motion.JOINT not in (visits.motion.kind[i], visits.motion.kind[j])
    return bool(cartesian and visits.zone.blend[i] == Blend.ZONE)


def shares(
    chain: Chain, visits: Visits, i: int, j: int, ways: tuple[Way, Way]
) -> tuple[float, float]:
    """Return the parts of moves i and j, 0 .. 1/2, that the corner at visit i takes.

    FLY_CART: $FLY_DIST before and behind the point (FLY_FROM), so much that the TCP
    passes at $FLY_DIST (FLY_TOL), or nothing (FLY_PASS); at most half of the shorter
    move. FLY_NORM: the last $FLY_PER % of the braking time.
    """
    kind, trajectory = visits.zone.blend[i], visits.zone.rule[i]
    passing = kind == Blend.ZONE and trajectory == ZoneRule.PASS
    if (
        not visits.motion.fly[i]
        or visits.motion.via[i]
        or passing
        or visits.zone.size_mm[i] < 0
    ):
        return 0.0, 0.0
    if not in_space(visits, i, j):
        return _overlapping(chain, visits, (i, j), ways)
    lengths = ways[0].length, ways[1].length
    if min(lengths) < NO_WAY:
        return 0.0, 0.0
    zone = 0.5 * min(lengths)
    distance = _value_or_usual(visits.zone.size_mm[i], USUAL_DISTANCE) * 1e-3
    if trajectory == ZoneRule.WITHIN:
        # The parabola's vertex is half as far from the point as the middle of its ends.
        turn = np.linalg.norm(_heading(ways[1], 0) - _heading(ways[0], -1))
        distance = distance * 4 / max(float(turn), NO_WAY)
    zone = min(zone, distance)
    return zone / lengths[0], zone / lengths[1]


def _overlapping(
    chain: Chain, visits: Visits, moves: tuple[int, int], ways: tuple[Way, Way]
) -> tuple[float, float]:
    """Brake the first move and start the second at the same time."""
    percent = np.clip(
        _value_or_usual(visits.zone.overlap_percent[moves[0]], USUAL_PERCENT),
        0.0,
        100.0,
    )
    pushes, times = [], []
    for move, way in zip(moves, ways, strict=True):
        most = np.abs(way.joints[-1] - way.joints[0]) / chain.speed
        lasts = max(float(most.max()), NO_WAY)  # [s] at full joint speed
        cruise = lasts
        if visits.motion.kind[move] != Motion.JOINT and visits.speed.linear[move] > 0:
            cruise = max(cruise, way.length / float(visits.speed.linear[move]))
        pushes.append(1.0 / (lasts * RAMP))
        times.append(min(lasts * RAMP / cruise, float(np.sqrt(lasts * RAMP))))
    overlap = percent / 100.0 * min(times)
    return 0.5 * pushes[0] * overlap**2, 0.5 * pushes[1] * overlap**2


def _heading(way: Way, end: int) -> Floats:
    """Return the direction of the TCP at the begin (0) or end (-1) of a way, (3,)."""
    step = way.tcp[1] - way.tcp[0] if end == 0 else way.tcp[-1] - way.tcp[-2]
    return np.asarray(step / max(float(np.linalg.norm(step)), NO_WAY))


def _value_or_usual(value: float, usual: float) -> float:
    return usual if np.isnan(value) else float(value)


# All ways of a program, with its fly points rounded, before any gear turns.

NOWHERE = Way(np.zeros((1, 6)), np.zeros((1, 3)))


@dataclass(frozen=True)
class Drive:
    """How the controller drives to one visit.

    Attributes:
        came_from: The visit before, or START.
        stands_there: The program starts at this visit, for want of a home.
        begin: Joints where the arm would stand before without rounding, (6,) [rad].
        way: The way without rounding; nowhere where the visit cannot be reached.
        path: Joints on the rounded way, (m, 6); the last are the arrival's.
        why: Why the visit cannot be reached, or "".
    """

    came_from: int
    stands_there: bool
    begin: Floats
    way: Way
    path: Floats
    why: str = ""

    @property
    def end(self) -> Floats:
        """Joints at the target, (6,) [rad]."""
        return np.asarray(self.begin if self.why else self.way.joints[-1])


def plan_drives(
    setup: VirtualCell, visits: Visits, poses: Floats, start: Floats
) -> list[Drive]:
    """Find the way to every visit.

    Args:
        setup: The cell.
        visits: The program.
        poses: `visits.frames` as poses, (k, 4, 4).
        start: Joints before the program, (6,) [rad].
    """
    drives: list[Drive] = []
    for i in range(len(visits)):
        known = [int(p) for p in visits.graph.predecessors(i) if 0 <= p < i]
        came_from = known[0] if known else START
        begin = start if came_from < 0 else drives[came_from].end
        before = start if came_from < 0 else drives[came_from].begin
        stands_there = came_from < 0 and setup.home is None
        if stands_there:
            begin = before = _first_joints(setup, visits, i, poses, start)
        drive = Drive(came_from, stands_there, begin, NOWHERE, NOWHERE.joints)
        try:
            frames = frames_at(visits, i, poses)
            way = way_to(setup, visits, i, frames, begin, before)
            drives.append(replace(drive, way=way, path=way.joints))
        except PlanError as error:
            drives.append(replace(drive, why=str(error)))
    return _round_fly_points(setup, visits, poses, drives)


def _first_joints(
    setup: VirtualCell, visits: Visits, i: int, poses: Floats, start: Floats
) -> Floats:
    """Return the joints at the first target, for a cell without a home."""
    try:
        frames = frames_at(visits, i, poses)
        one = visits.with_columns(kind=np.full_like(visits.motion.kind, Motion.JOINT))
        return np.asarray(way_to(setup, one, i, frames, start, start).joints[-1])
    except PlanError:
        return start


def _round_fly_points(
    setup: VirtualCell, visits: Visits, poses: Floats, drives: list[Drive]
) -> list[Drive]:
    """Round the fly points that have one way in and one way out."""
    ways_out = np.bincount(
        visits.graph.pred[visits.graph.pred >= 0], minlength=len(visits)
    )
    corners: dict[int, Corner] = {}
    for j, drive in enumerate(drives):
        i = drive.came_from
        if i < 0 or drive.why or drives[i].why or ways_out[i] != 1:
            continue
        if len(visits.graph.predecessors(i)) == 1 and drives[i].came_from >= 0:
            corner = _corner(setup, visits, poses, (i, j), (drives[i].way, drive.way))
            if corner is not None:
                corners[i] = corner
    return [
        replace(d, path=_join_pieces(d.way, corners.get(d.came_from), corners.get(i)))
        if d.came_from in corners or i in corners
        else d
        for i, d in enumerate(drives)
    ]


def _corner(
    setup: VirtualCell,
    visits: Visits,
    poses: Floats,
    moves: tuple[int, int],
    ways: tuple[Way, Way],
) -> Corner | None:
    """Round the point between two moves; None where the path goes through it."""
    i, j = moves
    parts = shares(setup.chain, visits, i, j, ways)
    if min(parts) <= 0.0:
        return None
    tool = frames_at(visits, i, poses).tool
    try:
        space = in_space(visits, i, j)
        return round_corner(setup.chain, tool, ways, parts, space)
    except PlanError:
        return None


def _join_pieces(way: Way, begin: Corner | None, end: Corner | None) -> Floats:
    """Put together what a corner leaves of a way, (m, 6)."""
    marks = np.linspace(0.0, 1.0, len(way.joints))
    inside = np.ones(len(marks), dtype=bool)
    pieces = [way.joints]
    if begin is not None:
        inside &= marks > begin.behind
        pieces.insert(0, begin.off)
    if end is not None:
        inside &= marks < 1.0 - end.before
        pieces.append(end.to)
    pieces = [way.joints[inside] if piece is way.joints else piece for piece in pieces]
    return np.vstack(pieces)
