"""Generalised least squares with the true effects and the true covariance of the rows.

What a campaign can tell at best: geometry and angle-dependent backlash of the arm in
`tests.calibration.simulator`, by finite differences of its chain, with the standard
deviations that the arm was drawn with as the prior.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

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
    """True standard deviations, see `tests.campaign_rows.Habit`; tracker (n,)."""

    joint: float
    shift: float
    tracker: np.ndarray
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


@dataclass(frozen=True)
class Columns:
    """Further linear effects of rows.

    Attributes:
        of: Derivatives of the rows by their parameters, (n, 3, k).
        prior: Standard deviations of these beforehand, (k,).
    """

    of: np.ndarray
    prior: np.ndarray

    def beside(self, other: Columns) -> Columns:
        """Put others beside them."""
        of = np.concatenate([self.of, other.of], axis=2)
        return Columns(of, np.concatenate([self.prior, other.prior]))


def yielding(arm: Arm, states: States, torque: np.ndarray, soft: float) -> Columns:
    """Return the columns of joints that yield, one for each joint.

    Args:
        arm: The nominal arm.
        states: The rows.
        torque: Of the weight about every joint, (n, 6) [N m].
        soft: Standard deviation of a joint error at its largest torque [rad].
    """
    size = np.maximum(np.abs(torque).max(axis=0, initial=0.0), 1e-9)
    return Columns(jacobian(arm, states) * torque[:, None], soft / size)


def set_up(
    arm: Arm, states: States, stations: int, nests: int, far: float, reach: float
) -> Columns:
    """Return the columns of trackers whose place, and nests that, nobody knows.

    Args:
        arm: The nominal arm.
        states: The rows, with `station` and `tool_id`.
        stations: Number of stations.
        nests: Number of nests.
        far: Standard deviation of a place and a turn [m], [rad].
        reach: Standard deviation of a nest [m].
    """
    here = states.q, states.direction
    none, n = np.zeros(len(PRIOR)), len(states)
    tcp = place(arm, *here, states.tool, none)
    of = np.zeros((n, 3, 6 * stations + 3 * nests))
    for k in range(3):
        axis = np.eye(3)[k]
        turned = np.cross(axis, tcp)
        moved = place(arm, *here, states.tool + axis, none) - tcp
        for s in range(stations):
            own = states.station == s
            of[own, :, 6 * s + k], of[own, :, 6 * s + 3 + k] = axis, turned[own]
        for m in range(nests):
            own = states.tool_id == m
            of[own, :, 6 * stations + 3 * m + k] = moved[own]
    prior = np.r_[np.full(6 * stations, far), np.full(3 * nests, reach)]
    return Columns(of, prior)


def no_columns(states: States) -> Columns:
    """Return none."""
    return Columns(np.zeros((len(states), 3, 0)), np.zeros(0))


def solve(
    arm: Arm,
    states: States,
    position: np.ndarray,
    stop: np.ndarray,
    scatter: Scatter,
    more: Columns | None = None,
) -> np.ndarray:
    """Estimate the parameters, (57 + k,).

    Args:
        arm: The nominal arm.
        states: The rows.
        position: What was read, (n, 3) [m].
        stop: Number of the stop of every row, (n,).
        scatter: What the rows really scatter by.
        more: Further effects, k parameters.
    """
    none = np.zeros(len(PRIOR))
    nominal = place(arm, states.q, states.direction, states.tool, none)
    all_of = Columns(columns(arm, states), PRIOR).beside(more or no_columns(states))
    X, prior, error = all_of.of, all_of.prior, position - nominal
    J = jacobian(arm, states)
    _, pose = np.unique(states.q, axis=0, return_inverse=True)
    gram, moment = np.diag(1.0 / prior**2), np.zeros(len(prior))
    for k in np.unique(pose):
        rows = np.flatnonzero(pose.reshape(-1) == k)
        some = replace(scatter, tracker=scatter.tracker[rows])
        V = _covariance(J[rows], stop[rows], some)
        flat = X[rows].reshape(-1, len(prior))
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
    own = np.diag(np.repeat(scatter.tracker**2, 3))
    return V + scatter.rounding**2 * turned + own
