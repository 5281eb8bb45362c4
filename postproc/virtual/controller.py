"""How the controller turns Cartesian targets into joint angles, on its nominal arm."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.exceptions import PlanError
from postproc.virtual.inverse import (
    ELBOW,
    SHOULDER,
    WRIST,
    branch_of,
    nearest_turns,
    require_closed_form,
    solve_branch,
)
from postproc.virtual.kinematics import Chain
from postproc.virtual.rotation import undo

FLAGS = {"W": WRIST, "S": SHOULDER, "E": ELBOW}
SINGULAR = np.radians(0.1)  # of axis 5: both wrist branches are tried from here
TURNING = (3, 5)  # joints 4 and 6 may turn more than once
TURN_NAMES = {"T1": 3, "T2": 5, "T3": 2}


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
        branches = [_branch_of_flags(config)]
    found = np.vstack([solve_branch(chain, flange[None], b) for b in branches])
    found = _into_range(chain, found)
    if free_turns:
        turned = nearest_turns(found, near)
        found[:, TURNING] = turned[:, TURNING]
    else:
        found = _on_turns(found, config or "")
    usable = found[_allowed(chain, found)]
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
    tracks = [_unwrapped(solve_branch(chain, flanges, b), start) for b in branches]
    jumps = [np.abs(np.diff(track, axis=0)).max() for track in tracks]
    track = tracks[int(np.argmin(np.nan_to_num(jumps, nan=np.inf)))]
    if not np.all(_allowed(chain, track[1:])):
        raise PlanError("the path leaves the reach or the joint range of the arm")
    return np.asarray(track[1:])


def flange_of(target: Floats, tool: Floats, base: Floats, uframe: Floats) -> Floats:
    """Return the flange pose in the arm base: BASE^-1 UFRAME P TOOL^-1, (4, 4)."""
    return np.asarray(undo(base) @ uframe @ target @ undo(tool))


def _unwrapped(track: Floats, start: Floats) -> Floats:
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


def _allowed(chain: Chain, q: Floats) -> NDArray[np.bool_]:
    slack = 1e-9
    inside = (q >= chain.lower - slack) & (q <= chain.upper + slack)
    return np.asarray(inside.all(axis=1))


def _branch_of_flags(config: str) -> int:
    words = config.upper().split()
    return sum(weight for flag, weight in FLAGS.items() if flag in words)


def _on_turns(q: Floats, config: str) -> Floats:
    """Put axes 4, 6 and 3 on the turns T1, T2, T3 = floor((q + 180 deg) / 360 deg).

    What is not written is 0 for axes 4 and 6; axis 3 stays in its range.
    """
    out = q.copy()
    for name, joint in TURN_NAMES.items():
        match = re.search(rf"\b{name}\s*:\s*(-?\d+)", config, re.IGNORECASE)
        if match:
            rest = np.remainder(q[:, joint] + np.pi, 2 * np.pi) - np.pi
            out[:, joint] = rest + 2 * np.pi * int(match[1])
    return out
