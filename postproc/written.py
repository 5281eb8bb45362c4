"""Commands in the numbers of the file, and how far those change."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.language.visits import Target, Visits
from postproc.motion.planner import Plan
from postproc.resolve import few_frames
from postproc.robot.pose import (
    MM,
    angles_near,
    inverse,
    products,
    rotation_from_vector,
    rotation_from_zyz,
)
from postproc.solved import Solved


def new_numbers(visits: Visits, plan: Plan, solved: Solved, aside: Floats) -> Floats:
    """Express commands in the numbers of the file, (n, 6).

    P = inverse(UFRAME) . BASE . command. A fly point is moved so that the path passes
    it where it should. An orientation that does not change keeps its written angles.
    """
    numbers = np.array(visits.values)
    joints = visits.target == Target.JOINTS
    numbers[joints] += np.rad2deg(solved.q[joints] - plan.q[joints])
    poses = np.flatnonzero(visits.target == Target.POSE)
    placed = base_in_uframe(visits, poses)
    command = np.array(solved.command[poses, :, 3])
    command[:, :3] -= aside[poses]
    point = np.einsum("nij,nj->ni", placed, command)
    numbers[poses, :3] = point[:, :3] / MM
    rows = solved.turned[visits.target[solved.turned] == Target.POSE]
    if len(rows) == 0:
        return numbers
    by = rotation_from_vector(turns_in_file(visits, solved)[rows])
    written = numbers[rows, 3:]
    numbers[rows, 3:] = angles_near(written, by @ rotation_from_zyz(written))
    return numbers


def base_in_uframe(visits: Visits, rows: Ints) -> Floats:
    """Return the pose of the arm's base in the user frame, (k, 4, 4) [m]."""
    if len(rows) == 0:
        return np.empty((0, 4, 4))
    frames = few_frames(visits)
    return products(inverse(frames), frames, visits.uframe[rows], visits.base[rows])


def turns_in_file(visits: Visits, solved: Solved) -> Floats:
    """Give the commands' rotations in the frame of the numbers, (n, 3) [rad]."""
    out = np.array(solved.turn)
    poses = solved.turned[visits.target[solved.turned] == Target.POSE]
    axes = base_in_uframe(visits, poses)[:, :3, :3]
    out[poses] = np.einsum("nij,nj->ni", axes, out[poses])
    return out


def change_mm(visits: Visits, numbers: Floats, correction: Floats) -> Floats:
    """Give the change that arrivals at one literal must agree on, (n, 3) [mm].

    For a pose it is that of its numbers (the same literal may be reached in two user
    frames), for joint angles that of the TCP.
    """
    poses = (visits.target == Target.POSE)[:, None]
    moved = numbers[:, :3] - visits.values[:, :3]
    near = np.flatnonzero(visits.target == Target.NEAR)
    axes = base_in_uframe(visits, near)[:, :3, :3]
    change = np.where(poses, moved, correction / MM)
    change[near] = np.einsum("nij,nj->ni", axes, correction[near]) / MM
    return change
