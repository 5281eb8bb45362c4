"""One arrival: from known joint angles over one edge to a target."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.motion.along import along_late_arc, along_line
from postproc.motion.arrival import NO_PATH, Arrival
from postproc.motion.branches import nearest_slot, nearest_turns, on_written_turns
from postproc.motion.path import lines
from postproc.motion.reasons import (
    CODE,
    NO_BRANCH,
    NO_CIRCLE,
    NO_START,
    NO_TARGET,
    OUT_OF_REACH,
    PATH_REACH,
)
from postproc.motion.targets import Kind, Move
from postproc.motion.workspace import Workspace
from postproc.motion.wrist import wrist_interpolated
from postproc.robot.arm import Arm


def arrive(work: Workspace, v: int, edge: int) -> Arrival:
    """Go over an edge whose source has known joint angles."""
    targets, source = work.targets, int(work.source[edge])
    kind, near = targets.kind[v], work.q[source]
    if kind == Kind.JOINT_STEP:
        q = near + targets.joints[v]
        return Arrival(q, work.arm.flange(q[None])[0], -1, q[None], 0)
    flange = work.flange[v]
    if kind == Kind.TOWARDS:
        flange = part_way(work, v, work.flange[source])
        if np.isnan(flange).any():
            return Arrival(np.full(6, np.nan), flange, -1, NO_PATH, CODE[NO_TARGET])
    elif np.isnan(flange).any():
        flange = work.after_step(v, work.flange[source])
    if kind == Kind.JOINTS:
        end = Arrival(work.q[v], flange, -1, work.q[v][None], 0)
    else:
        end = choose(work, v, flange, near)
    if targets.move[v] == Move.JOINT or np.isnan(flange).any():
        return end
    if work.samples.broken[edge]:
        return Arrival(end.q, flange, end.slot, NO_PATH, CODE[NO_CIRCLE])
    if np.isnan(targets.tool[v]).any():
        return Arrival(end.q, flange, end.slot, NO_PATH, end.reason)
    if targets.move[v] == Move.CIRCULAR and not work.samples.ready[edge]:
        return along_late_arc(work, v, edge, flange, end)
    if targets.wrist_joint[v]:
        path = wrist_interpolated(
            work.arm, near, end.q, targets.tool[v], work.samples.count(edge)
        )
        reason = end.reason if len(path) else end.reason or CODE[PATH_REACH]
        return Arrival(end.q, flange, end.slot, path, reason)
    return along_line(work, v, edge, flange, end)


def part_way(work: Workspace, v: int, flange: Floats) -> Floats:
    """Place the flange after going a distance towards a pose, (4, 4) [m].

    The tool turns in proportion; NaN where the pose is nearer than the distance, for
    what the arm does then is not known.
    """
    targets = work.targets
    line = lines((flange @ targets.tool[v])[None], targets.tcp[v][None])
    distance, length = float(targets.distance[v]), float(line.length[0])
    if not distance <= length:
        return np.full((4, 4), np.nan)
    share = np.array([distance / length if length > 0.0 else 0.0])
    tcp = line.poses(np.zeros(1, dtype=np.int64), share)[0]
    reached: Floats = tcp @ work.tool_inverse[v]
    return reached


def choose(work: Workspace, v: int, flange: Floats, near: Floats | None) -> Arrival:
    """Choose a solution by configuration string, else the nearest one.

    Args:
        work: The workspace.
        v: The target.
        flange: Its flange pose, (4, 4) [m].
        near: Joint angles before, (6,) [rad], or None where they are not known.
    """
    arm, targets = work.arm, work.targets
    unknown = np.full(6, np.nan)
    if np.isnan(flange).any():
        return Arrival(unknown, flange, -1, NO_PATH, CODE[OUT_OF_REACH])
    branches = work.solutions(v, flange)
    if np.isnan(branches).any(axis=1).all():
        return Arrival(unknown, flange, -1, NO_PATH, CODE[OUT_OF_REACH])
    slot = int(targets.slot[v])
    if slot < 0 and near is None:
        return Arrival(unknown, flange, -1, NO_PATH, CODE[NO_START])
    if slot < 0 and near is not None:
        slot = nearest_slot(branches, near)
    q = branches[slot]
    if np.isnan(q).any():
        return Arrival(unknown, flange, slot, NO_PATH, CODE[NO_BRANCH])
    if near is None or (targets.slot[v] >= 0 and not targets.nearest_turn[v]):
        q = on_written_turns(q[None], targets.turns[v][None])[0]
    else:
        q = _nearest_allowed(arm, q, near)
    return Arrival(q, flange, slot, q[None], 0)


def _nearest_allowed(arm: Arm, q: Floats, near: Floats) -> Floats:
    """Take the nearest turn of every axis that has it in its range."""
    turned = nearest_turns(q, near)
    return np.where((turned >= arm.lower) & (turned <= arm.upper), turned, q)
