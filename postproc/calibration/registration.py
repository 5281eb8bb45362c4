"""Where the tracker stands, and where the probe sits on the flange.

P_base = T P_tracker. Found coarsely with the arm as far as it is known; then finely as
an effect of the set-up beside the arm's own (`Placement`).
"""

from __future__ import annotations

import warnings

import numpy as np

from postproc.arrays import Floats
from postproc.model.combination import Combination
from postproc.model.effects.placement import Placement
from postproc.model.kinematics import Batch
from postproc.model.model import Model, PredictedReading
from postproc.model.registration import Registration
from postproc.robot.arm import Arm
from postproc.robot.state import States

PASSES = 60
SETTLED = 1e-9  # [m]
ROBUST = 3.0  # residuals beyond this many typical ones count less


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
        arm_effects: Effects of the arm, or none; a tool's own error among them is not
            the probe's, which is found besides.
        values: Their parameters.
    """
    ids, which = np.unique(states.tool_id, return_inverse=True)
    probes = np.stack([states.tool[which == k].mean(axis=0) for k in range(len(ids))])
    batch = Batch(arm, states)
    at = arm_effects.at(batch, values)
    landed, R = batch.walk.tcp + arm_effects.error_at(at, batch, values), at.walk.flange
    flange = landed - np.einsum("nij,nj->ni", R, states.tool)
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
    return Registration(T, probes, ids)


def typical_gap(
    registered: Registration, arm: Arm, states: States, position: Floats
) -> float:
    """Return the median distance that a registration leaves of the nominal arm [m].

    Args:
        registered: As found.
        arm: The arm.
        states: States of the rows.
        position: Measured positions in the tracker frame, (n, 3) [m].
    """
    tcp = Batch(arm, registered.on_probes(states)).walk.tcp
    gap = registered.to_base(position) - tcp
    return float(np.median(np.linalg.norm(gap, axis=1)))


def _procrustes(a: Floats, b: Floats, weight: Floats) -> Floats:
    """Find the rigid transform (4, 4) that takes points a (n, 3) to b best."""
    from scipy.spatial.transform import Rotation  # slow to load, and for fits alone

    total = weight.sum()
    ca, cb = weight @ a / total, weight @ b / total
    with warnings.catch_warnings():  # of points on a line any turn about it will do
        warnings.simplefilter("ignore", UserWarning)
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


def predict_registered(
    model: Model, arm: Arm, states: States, position: Floats
) -> tuple[Registration, PredictedReading]:
    """Predict readings of another set-up, which is found from these rows themselves.

    Only what the set-up cannot imitate of the arm's error remains unsure: its columns
    are taken out of those of the model.

    Args:
        model: What is known of the arm; its own set-up is left out.
        arm: The arm.
        states: States of the rows; their `tool` is where the search starts.
        position: Measured positions, any frame that does not move, (n, 3) [m].

    Returns:
        The registration, and what is read at its probe points, base frame.
    """
    effects, values, covariance = model.compensable()
    placed = register(arm, states, position, effects, values)
    batch = Batch(arm, placed.on_probes(states))
    at = effects.at(batch, values)
    own = Placement(tuple(map(int, placed.tool_ids))).columns(at)
    A = own.reshape(3 * len(batch), -1)
    inverse = np.linalg.pinv(A)
    left = model.untold_variance(effects, at, values)
    if len(covariance):
        X = effects.columns(at).reshape(len(A), -1)
        X = X - A @ (inverse @ X)
        left = left + np.einsum("rp,rp->r", X @ covariance, X).reshape(-1, 3)
    scatter = float((model.reading_std(at, np.zeros((len(batch), 3))) ** 2).mean())
    told = scatter * np.einsum("rp,pr->r", A, inverse).reshape(-1, 3)
    known = left + told
    error = effects.error_at(at, batch, values)
    return placed, PredictedReading(error, model.reading_std(at, known))
