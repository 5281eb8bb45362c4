"""Where the tracker stands, and where the probe sits on the flange.

P_base = T P_tracker. Found coarsely with the arm as far as it is known; then finely as
an effect of the set-up beside the arm's own (`Placement`).
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.model.effect_sum import Combination
from postproc.model.effects.placement import POINT, Placement, unseen_axes
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model, PredictedReading
from postproc.model.registration import Registration, rigid_fit
from postproc.model.variance import spread_covariance
from postproc.robot.arm import Arm
from postproc.robot.state import States

PASSES = 200
SETTLED = 1e-9  # [m]
ROBUST = 3.0  # residuals beyond this many typical ones count less
NEAR_POINT, NEAR_FLANGE = (
    POINT,
    1.0,
)  # [m] prior of a probe: round its point, the flange
LEAST_GAP = 1e-7  # [m] what a perfect arm leaves
STOPS = 6  # poses from which a tracker and a probe are found
SPREAD = 0.05  # [m] that poses spread across the line that fits them best


def register(
    arm: Arm,
    states: States,
    position: Floats,
    arm_effects: Combination,
    values: Floats,
    stations: tuple[str, ...] = ("",),
) -> Registration:
    """Find the tracker's stations and the probe points, the arm's errors being known.

    Gauss-Newton on six numbers for every station and three per probe point, robust
    against rows that are no measurements. A probe has a normal prior: 0.3 m round the
    point that the states have, 1 m round the flange where they have none.

    Args:
        arm: The arm.
        states: States of the rows; their `tool` is where the search starts.
        position: Measured positions in the frame of their station, (n, 3) [m].
        arm_effects: Effects of the arm, or none; a tool's own error among them is not
            the probe's, which is found besides.
        values: Their parameters.
        stations: Names of the tracker's stations, by `states.station`.
    """
    ids, which = np.unique(states.tool_id, return_inverse=True)
    stated = np.stack([states.tool[which == k].mean(axis=0) for k in range(len(ids))])
    near = NEAR_POINT if np.abs(stated).max() > 0 else NEAR_FLANGE
    batch = ArmStates(arm, states)
    at = arm_effects.at(batch, values)
    landed, R = batch.walk.tcp + arm_effects.error_at(at, batch, values), at.walk.flange
    flange = landed - np.einsum("nij,nj->ni", R, states.tool)
    per_point = np.zeros((len(states), 3, len(ids), 3))
    per_point[np.arange(len(states)), :, which] = R
    columns = per_point.reshape(len(states), 3, -1)
    own = [states.station == s for s in range(len(stations))]
    T = np.tile(np.eye(4), (len(stations), 1, 1))
    found, weight = stated, np.ones(len(states))
    for _ in range(PASSES):
        tcp = flange + np.einsum("nij,nj->ni", R, found[which])
        for s, rows in enumerate(own):
            if rows.any():
                T[s] = rigid_fit(position[rows], tcp[rows], weight[rows])
        placed = Registration(T, found, ids, stations)
        measured = placed.to_base(position, states.station)
        gap = measured - tcp
        weight = robust_weights(gap)
        step = _step(columns, measured, gap, weight, own, (stated - found) / near, near)
        found = found + step
        if np.abs(step).max() < SETTLED:
            break
    return Registration(T, found, ids, stations)


def _step(
    columns: Floats,
    measured: Floats,
    gap: Floats,
    weight: Floats,
    own: list[Bools],
    off: Floats,
    near: float,
) -> Floats:
    """Move the probe points (k, 3) [m], the stations being free to follow.

    Args:
        columns: Of the points, (n, 3, 3 k).
        measured: Positions in the base frame, (n, 3) [m].
        gap: What they are off by, (n, 3) [m].
        weight: Of the rows, (n,).
        own: Rows of every station.
        off: From the points to the middle of their priors, in standard deviations.
        near: Standard deviation of the prior [m].
    """
    turned = np.swapaxes(np.cross(np.eye(3)[None], measured[:, None]), 1, 2)
    rigid = np.concatenate([np.tile(-np.eye(3), (len(gap), 1, 1)), -turned], axis=2)
    placed = [rigid * rows[:, None, None] for rows in own]
    root = np.sqrt(weight)[:, None]
    A = np.concatenate([columns, *placed], axis=2) * root[:, :, None]
    scatter = max(float(np.median(np.linalg.norm(gap, axis=1))), LEAST_GAP)
    prior = np.zeros((columns.shape[2], A.shape[2]))
    np.fill_diagonal(prior, scatter / near)
    rows = np.concatenate([A.reshape(-1, A.shape[2]), prior])
    target = np.concatenate([(gap * root).reshape(-1), scatter * off.reshape(-1)])
    step = np.linalg.lstsq(rows, target)[0]
    return np.asarray(step[: columns.shape[2]].reshape(-1, 3))


def find_undetermined_axes(placed: Registration, arm: Arm, states: States) -> Floats:
    """Find directions along which no row shows where a probe sits, (m, 3).

    A tool that never turned shows none; one that turned about one axis shows all but
    that axis. The tracker's place then follows the probe's.

    Args:
        placed: The registration.
        arm: The arm.
        states: States of the rows.

    Returns:
        Unit vectors in the flange frame.
    """
    walk = ArmStates(arm, placed.on_probes(states)).walk
    hidden = unseen_axes(walk.flange, walk.tcp, states.station)
    return np.array([unseen.axis for unseen in hidden]).reshape(-1, 3)


def covers_a_plane(arm: Arm, states: States) -> bool:
    """Return True if the stops of rows do not lie about one line."""
    tcp = ArmStates(arm, states).walk.tcp
    size = np.linalg.svd(tcp - tcp.mean(axis=0), compute_uv=False)
    return bool(size[1] > SPREAD * np.sqrt(len(tcp)))


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
    if len(states) == 0:
        return 0.0
    tcp = ArmStates(arm, registered.on_probes(states)).walk.tcp
    gap = registered.to_base(position, states.station) - tcp
    return float(np.median(np.linalg.norm(gap, axis=1)))


def station_of(
    placed: Registration,
    arm: Arm,
    states: States,
    position: Floats,
    names: tuple[str, ...],
) -> Registration:
    """Give rows the stations of a survey: by name, else that which leaves least.

    Args:
        placed: The survey's registration.
        arm: The arm.
        states: States of the rows, with stations of their own.
        position: Measured positions in the frame of their station, (n, 3) [m].
        names: Names of the rows' stations.
    """
    chosen = []
    for number, name in enumerate(names):
        own = states.station == number
        here = states[own].with_(station=np.zeros(int(own.sum()), dtype=np.int64))
        if name in placed.stations:
            chosen.append(placed.stations.index(name))
            continue
        sizes = [
            typical_gap(placed.at_station(k), arm, here, position[own])
            for k in range(len(placed.stations) if own.any() else 1)
        ]
        chosen.append(int(np.argmin(sizes)))
    return Registration(
        placed.transforms[chosen], placed.probes, placed.tool_ids, names
    )


def robust_weights(gap: Floats) -> Floats:
    """Weigh rows by their distance over the typical one, (n,)."""
    size = np.linalg.norm(gap, axis=1)
    ratio = size / max(ROBUST * float(np.median(size)), 1e-12)
    return np.asarray(1.0 / np.maximum(ratio, 1.0) ** 2)


def predict_registered(
    model: Model,
    arm: Arm,
    states: States,
    position: Floats,
    stations: tuple[str, ...] = ("",),
) -> tuple[Registration, PredictedReading]:
    """Predict readings of another set-up, which is found from these rows themselves.

    Only what the set-up cannot imitate of the arm's error remains unsure: its columns
    are taken out of those of the model.

    Args:
        model: What is known of the arm; its own set-up is left out.
        arm: The arm.
        states: States of the rows; their `tool` is where the search starts.
        position: Measured positions, any frame that does not move, (n, 3) [m].
        stations: Names of the tracker's stations, by `states.station`.

    Returns:
        The registration, and what is read at its probe points, base frame.
    """
    effects, values, covariance = model.compensable()
    placed = register(arm, states, position, effects, values, stations)
    batch = ArmStates(arm, placed.on_probes(states))
    at = effects.at(batch, values)
    own = Placement.propose(arm, states).columns(at)
    A = own.reshape(3 * len(batch), -1)
    inverse = np.linalg.pinv(A)
    known = model.unmodelled_covariance(effects, at, values)
    if len(covariance):
        X = effects.columns(at).reshape(len(A), -1)
        X = X - A @ (inverse @ X)
        known += spread_covariance(X.reshape(len(batch), 3, -1), covariance)
    scatter = model.reading_covariance(at, np.zeros((len(batch), 6)))[:, :3].mean()
    known[:, :3] += scatter * np.einsum("rp,pr->r", A, inverse).reshape(-1, 3)
    error = effects.error_at(at, batch, values)
    return placed, PredictedReading(error, model.reading_covariance(at, known))
