"""Where the tracker stands, and where the probe sits on the flange.

P_base = T P_tracker. Found coarsely with the arm as far as it is known; then finely as
an effect of the set-up beside the arm's own (`Placement`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.model.combination import Combination
from postproc.model.kinematics import Batch
from postproc.robot.arm import Arm
from postproc.robot.state import States

PASSES = 60
SETTLED = 1e-9  # [m]
ROBUST = 3.0  # residuals beyond this many typical ones count less


@dataclass(frozen=True)
class Registration:
    """A tracker's place and the probe points, as fitted.

    Attributes:
        base_from_tracker: Transform of tracker coordinates into the base frame, (4, 4).
        probes: Probe points in the flange frame by `tool_id`, (k, 3) [m].
        typical: Median distance that is left [m].
    """

    base_from_tracker: Floats
    probes: Floats
    typical: float

    @property
    def tracker(self) -> Floats:
        """Position of the tracker in the base frame, (3,) [m]."""
        place: Floats = self.base_from_tracker[:3, 3]
        return place

    def to_base(self, position: Floats) -> Floats:
        """Convert positions (n, 3) [m] from the tracker's to the base frame."""
        T = self.base_from_tracker
        converted: Floats = position @ T[:3, :3].T + T[:3, 3]
        return converted


def register(
    arm: Arm,
    states: States,
    position: Floats,
    arm_effects: Combination,
    values: Floats,
) -> Registration:
    """Find the tracker and the probe points, the arm's own errors being known.

    Gauss-Newton on six numbers for the tracker and three per probe point, robust
    against rows that are no measurements.

    Args:
        arm: The arm.
        states: States of the rows; their `tool` is where the search starts.
        position: Measured positions in the tracker frame, (n, 3) [m].
        arm_effects: Effects of the arm, or none.
        values: Their parameters.
    """
    ids, which = np.unique(states.tool_id, return_inverse=True)
    probes = np.stack([states.tool[which == k].mean(axis=0) for k in range(len(ids))])
    batch = Batch(arm, states)
    at = arm_effects.at(batch, values)
    flange, R = at.walk.tcp, at.walk.flange
    flange = flange - np.einsum("nij,nj->ni", R, states.tool + at.deviation.tool)
    per_point = np.zeros((len(states), 3, len(ids), 3))
    per_point[np.arange(len(states)), :, which] = R
    columns = per_point.reshape(len(states), 3, -1)
    weight = np.ones(len(states))
    for _ in range(PASSES):
        tcp = flange + np.einsum("nij,nj->ni", R, probes[which])
        T = _procrustes(position, tcp, weight)
        measured = position @ T[:3, :3].T + T[:3, 3]
        gap = measured - tcp
        weight = _robust(gap)
        turned = np.swapaxes(np.cross(np.eye(3)[None], measured[:, None]), 1, 2)
        eye = np.tile(np.eye(3), (len(states), 1, 1))
        A = np.concatenate([columns, -eye, -turned], axis=2)
        A = (A * np.sqrt(weight)[:, None, None]).reshape(-1, A.shape[2])
        step = np.linalg.lstsq(A, (gap * np.sqrt(weight)[:, None]).reshape(-1))[0]
        move = step[: 3 * len(ids)].reshape(-1, 3)
        probes = probes + move
        if np.abs(move).max() < SETTLED:
            break
    typical = float(np.median(np.linalg.norm(gap, axis=1)))
    return Registration(T, probes, typical)


def _procrustes(a: Floats, b: Floats, weight: Floats) -> Floats:
    """Find the rigid transform (4, 4) that takes points a (n, 3) to b best."""
    from scipy.spatial.transform import Rotation  # slow to load, and for fits alone

    total = weight.sum()
    ca, cb = weight @ a / total, weight @ b / total
    turn, _ = Rotation.align_vectors(b - cb, a - ca, weights=weight)
    T = np.eye(4)
    T[:3, :3] = turn.as_matrix()
    T[:3, 3] = cb - T[:3, :3] @ ca
    return T


def _robust(gap: Floats) -> Floats:
    """Weigh rows by their distance over the typical one, (n,)."""
    size = np.linalg.norm(gap, axis=1)
    ratio = size / max(ROBUST * float(np.median(size)), 1e-12)
    return np.asarray(1.0 / np.maximum(ratio, 1.0) ** 2)
