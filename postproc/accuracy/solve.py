"""Which command lands on the wanted pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.orientation import turn
from postproc.arrays import Floats
from postproc.model.model import Model
from postproc.robot.arm import Arm
from postproc.robot.pose import (
    inverse,
    lengths,
    rotation_from_vector,
    rotation_vector,
    times,
)
from postproc.robot.state import States

CLOSE = 2e-7  # [m] where iterating stops
CLOSE_TURN = 2e-7  # [rad] likewise
MOST = 5  # iterations


@dataclass(frozen=True)
class Solution:
    """Corrected commands of n targets.

    Attributes:
        q: Joint angles of the command, (n, 6) [rad], NaN where it cannot be reached.
        command: TCP pose to command, base frame, (n, 4, 4).
        residual: Distance of the predicted landing from the wanted place, (n,) [m].
        iterations: How many were needed.
    """

    q: Floats
    command: Floats
    residual: Floats
    iterations: int


def solve(
    model: Model,
    arm: Arm,
    wanted: Floats,
    tool: Floats,
    states: States,
    orientation: bool = False,
) -> Solution:
    """Find the command whose predicted landing is the wanted place.

    The branch stays as it is, and so does the commanded orientation unless it is to be
    corrected too.

    Args:
        model: Predicts the error of a command.
        arm: The arm.
        wanted: TCP poses in the arm's base frame, (n, 4, 4).
        tool: Tool in the flange frame, (4, 4) or (n, 4, 4).
        states: The nominal states at the targets: angles, direction, loads.
        orientation: Correct the orientation as well as the position.
    """
    n = len(wanted)
    tool = np.broadcast_to(tool, (n, 4, 4))
    states = states.with_(tool=np.ascontiguousarray(tool[:, :3, 3]))
    from_tcp = inverse(np.ascontiguousarray(tool))
    command, q = np.array(wanted), np.array(states.q)
    place = wanted[:, :3, 3]
    branch = arm.branch(np.nan_to_num(q)) if arm.has_inverse else None
    landing = place + model.error(arm, states)
    turned, allowed = np.zeros((n, 3)), np.zeros((n, 3))  # [rad] found and allowed for
    if orientation:
        turned = turn(model, arm, states)
    iterations = 0
    while iterations < MOST:
        off = _distance(landing, place) > CLOSE  # NaN is not far
        if orientation:
            off |= _distance(turned, allowed) > CLOSE_TURN
        far = np.flatnonzero(off)
        if len(far) == 0:
            break
        command[far, :3, 3] += (place - landing)[far]
        if orientation:
            command[far, :3, :3] = _turned(wanted[far, :3, :3], -turned[far])
            allowed[far] = turned[far]
        own = None if branch is None else branch[far]
        q[far] = _nearest(arm, times(command[far], from_tcp[far]), q[far], own)
        moved = states[far].with_(q=np.array(q[far]))
        landing[far] = command[far, :3, 3] + model.error(arm, moved)
        if orientation:
            turned[far] = turn(model, arm, moved)
        iterations += 1
    return Solution(q, command, _distance(landing, place), iterations)


def _distance(a: Floats, b: Floats) -> Floats:
    """Distance between points (n, 3), (n,) [m]."""
    return lengths(a - b)


def _turned(rotation: Floats, by: Floats) -> Floats:
    """Turn rotations (n, 3, 3) by rotation vectors (n, 3) [rad] in the base frame."""
    return np.asarray(rotation_from_vector(by) @ rotation)


def _nearest(
    arm: Arm, flange: Floats, near: Floats, branch: NDArray[np.int64] | None
) -> Floats:
    """Solve for the joint angles next to given ones, in closed form or by Newton."""
    if branch is not None:
        return arm.nearest(flange, near, branch)
    q = np.array(near)
    for _ in range(4):
        at = arm.flange(q)
        turned = flange[:, :3, :3] @ np.swapaxes(at[:, :3, :3], 1, 2)
        gap = np.concatenate(
            [flange[:, :3, 3] - at[:, :3, 3], rotation_vector(turned)], axis=1
        )
        J = arm.jacobian(q, np.zeros(3))
        q = q + np.linalg.solve(J + 1e-12 * np.eye(6), gap[:, :, None])[:, :, 0]
    return q
