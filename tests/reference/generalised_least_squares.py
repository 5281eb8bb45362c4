"""Generalised least squares with the true effects and the true covariance of the rows.

What a campaign can tell at best: geometry and angle-dependent backlash of the arm in
`tests.calibration.simulator`, by finite differences of its chain, with the standard
deviations that the arm was drawn with as the prior.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.robot.arm import Arm
from postproc.robot.state import States

LINKS, TOOL, LOST = 36, 3, 18  # parameters: link placements, tool, backlash
PRIOR = np.concatenate(
    [np.full(LINKS, 5e-4), np.full(TOOL, 5e-4), np.tile([2e-4, 5e-5, 5e-5], 6)]
)
STEP = 1e-6


def place(
    arm: Arm, q: np.ndarray, side: np.ndarray, tool: np.ndarray, p: np.ndarray
) -> np.ndarray:
    """Place the TCP by a chain of 4 x 4 matrices, (n, 3) [m].

    Args:
        arm: The nominal arm, of which the D-H numbers are read.
        q: Joint angles, (n, 6) [rad].
        side: Arrival directions, (n, 6).
        tool: TCP in the flange frame, (n, 3) [m].
        p: Parameters, (57,).
    """
    dh, link = arm.dh, p[:LINKS].reshape(6, 6)
    b0, s, c = p[LINKS + TOOL :].reshape(6, 3).T
    actual = q + side * (b0 + s * np.sin(q) + c * np.cos(q))
    theta = dh.offset + dh.sense * (actual @ dh.mix.T)
    T = np.tile(np.eye(4), (len(q), 1, 1))
    for j in range(6):
        T = T @ _turned(2, theta[:, j]) @ _shifted(dh.a[j], 0.0, dh.d[j])
        T = T @ _turned(0, np.full(len(q), dh.alpha[j]))
        T = T @ _shifted(*link[j, :3])
        for axis in range(3):
            T = T @ _turned(axis, np.full(len(q), link[j, 3 + axis]))
    at = tool + p[LINKS : LINKS + TOOL]
    return np.einsum("nij,nj->ni", T[:, :3, :3], at) + T[:, :3, 3]


def _turned(axis: int, angle: np.ndarray) -> np.ndarray:
    i, k = (axis + 1) % 3, (axis + 2) % 3
    T = np.tile(np.eye(4), (len(angle), 1, 1))
    T[:, i, i] = T[:, k, k] = np.cos(angle)
    T[:, k, i] = np.sin(angle)
    T[:, i, k] = -T[:, k, i]
    return T


def _shifted(x: float, y: float, z: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


@dataclass(frozen=True)
class Scatter:
    """True standard deviations, see `tests.campaigns.Habit`."""

    joint: float
    shift: float
    tracker: float
    rounding: float


def columns(arm: Arm, states: States) -> np.ndarray:
    """Differentiate the TCP by the parameters, (n, 3, 57)."""
    here = states.q, states.direction, states.tool
    out = np.empty((len(states), 3, len(PRIOR)))
    for k in range(len(PRIOR)):
        step = np.zeros(len(PRIOR))
        step[k] = STEP
        ahead, behind = place(arm, *here, step), place(arm, *here, -step)
        out[:, :, k] = (ahead - behind) / (2.0 * STEP)
    return out


def jacobian(arm: Arm, states: States) -> np.ndarray:
    """Differentiate the TCP by the joint angles, (n, 3, 6)."""
    none, out = np.zeros(len(PRIOR)), np.empty((len(states), 3, 6))
    for j in range(6):
        step = np.zeros(6)
        step[j] = STEP
        ahead = place(arm, states.q + step, states.direction, states.tool, none)
        behind = place(arm, states.q - step, states.direction, states.tool, none)
        out[:, :, j] = (ahead - behind) / (2.0 * STEP)
    return out


def solve(
    arm: Arm,
    states: States,
    position: np.ndarray,
    stop: np.ndarray,
    scatter: Scatter,
) -> np.ndarray:
    """Estimate the parameters, (57,).

    Args:
        arm: The nominal arm.
        states: The rows.
        position: What was read, (n, 3) [m].
        stop: Number of the stop of every row, (n,).
        scatter: What the rows really scatter by.
    """
    none = np.zeros(len(PRIOR))
    nominal = place(arm, states.q, states.direction, states.tool, none)
    X, error = columns(arm, states), position - nominal
    J = jacobian(arm, states)
    _, pose = np.unique(states.q, axis=0, return_inverse=True)
    gram, moment = np.diag(1.0 / PRIOR**2), np.zeros(len(PRIOR))
    for k in np.unique(pose):
        rows = np.flatnonzero(pose.reshape(-1) == k)
        V = _covariance(J[rows], stop[rows], scatter)
        flat = X[rows].reshape(-1, len(PRIOR))
        whitened = np.linalg.solve(V, flat)
        gram += flat.T @ whitened
        moment += whitened.T @ error[rows].reshape(-1)
    return np.linalg.solve(gram, moment)


def _covariance(J: np.ndarray, stop: np.ndarray, scatter: Scatter) -> np.ndarray:
    """Covariance of the rows of one pose, (3 m, 3 m)."""
    m = len(J)
    same = np.repeat(np.repeat(stop[:, None] == stop, 3, 0), 3, 1).astype(float)
    stacked, shared = J.reshape(-1, 6), np.tile(np.eye(3), (m, m))
    turned = stacked @ stacked.T
    V = same * (scatter.joint**2 * turned + scatter.shift**2 * shared)
    return V + scatter.rounding**2 * turned + scatter.tracker**2 * np.eye(3 * m)
