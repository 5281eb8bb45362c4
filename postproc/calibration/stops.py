"""Stops of a survey: readings that were taken while the arm stood still are one row."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from postproc.arrays import Floats, Ints
from postproc.calibration.measurements import DroppedRow, Measurements
from postproc.calibration.orientations import means
from postproc.model.noise import SAME_POSE, poses_of
from postproc.robot.pose import MM
from postproc.robot.state import States

AWAY = 2.0  # times the usual time between stops, in which an arm leaves and returns
AVERAGED = "readings of one probe point at a stop are averaged"
SAME_POINT = 1e-7  # [m] probe points that are one
FALSE_ALARMS = 0.01  # readings that are dropped per survey of good ones
FEWEST = 3  # readings of one stop of which one may disagree with the others
FINEST = 3e-6  # [m] least scatter of readings, which are written with few decimals
RESTLESS = np.deg2rad(0.05)  # most that angles of one stop differ, read back [rad]
CLEARLY = 100.0  # times as far as these differ the arm goes from pose to pose
JOINTS = 3  # that differ at least where angles are read back: a step turns one


def stops_of(states: States, visit: Ints | None = None) -> Ints:
    """Number the stops, (n,), rows in visit order.

    A stop is a run of rows with equal commanded angles, directions and payload, in
    which, if there is a clock, no gap is as long as the arm needs to leave and return.
    Readings of two tracker stations are of two stops. Angles that were read back from
    the controller may differ within a stop, see `restless`.

    Args:
        states: The rows.
        visit: Number of the visit of every row, (n,), -1 where it is not known.
    """
    if len(states) == 0:
        return np.zeros(0, dtype=np.int64)
    step = np.abs(np.diff(states.q, axis=0))
    moved = (step > max(SAME_POSE, restless(step))).any(axis=1)
    turned = (np.diff(states.direction, axis=0) != 0).any(axis=1)
    loaded = np.diff(np.nan_to_num(states.payload)) != 0
    seen = np.diff(states.station) != 0
    moving = ~np.isnan(states.heading[1:, 0])
    begins = np.asarray(moved | turned | loaded | seen | moving)
    gap = np.diff(states.time)
    usual = gap[begins & np.isfinite(gap)]
    if len(usual):  # the arm can have left a pose and returned in long gaps
        begins |= np.nan_to_num(gap) > AWAY * float(np.median(usual))
    run = np.concatenate([[0], np.cumsum(begins)]).astype(np.int64)
    if visit is None:
        return run
    known = visit >= 0
    pose = np.where(known, poses_of(states, RESTLESS), -1)
    parts = known, np.where(known, visit, run), pose, states.station
    key = np.column_stack([*parts, states.direction])
    _, label = np.unique(key, axis=0, return_inverse=True)
    return _in_order(label.reshape(-1))


def restless(step: Floats) -> float:
    """Return by how much angles differ from row to row while the arm stands [rad].

    Angles that are read back differ in their last digits. Such differences are told
    from moves by their size, where nothing lies between them and what is `CLEARLY`
    larger, and by several joints that differ at once.

    Args:
        step: Of every joint from row to row, (n - 1, 6) [rad].

    Returns:
        0 where no row differs from the one before by so little.
    """
    size = step.max(axis=1, initial=0.0)
    still, moves = size <= RESTLESS, size[size > RESTLESS]
    differ = still & (size > SAME_POSE)
    if not differ.any() or not len(moves):
        return 0.0
    most = float(size[differ].max())
    several = (step[differ] > size[differ, None] / CLEARLY).sum(axis=1) >= JOINTS
    if moves.min() < CLEARLY * most or several.mean() < 0.5:
        return 0.0
    return most


def pool_readings(survey: Measurements) -> Measurements:
    """Average the readings of every stop and nest into one row.

    A reading that disagrees with all others of its stop is dropped and listed. Two
    readings that disagree stay two rows: which one is wrong, the fit decides.

    Args:
        survey: Rows in visit order.

    Returns:
        Rows with the mean position and mean angles; `readings` and `scatter` of their
        states say how many readings there were and how they scatter. Rows of one stop
        have the same `order`.
    """
    stop = stops_of(survey.states, survey.visit)
    if len(np.unique(stop)) == len(survey):
        return survey
    survey, stop, label = _without_strays(survey, stop)
    first = np.unique(label, return_index=True)[1]
    count = np.bincount(label).astype(float)
    mean = means(survey.position, label)
    square = ((survey.position - mean[label]) ** 2).sum(axis=1)
    begins = np.unique(stop, return_index=True)[1]
    order = survey.states.order[begins[np.searchsorted(np.unique(stop), stop[first])]]
    pooled = survey[first]
    states = pooled.states.with_(
        q=_mean_angles(survey.states.q, stop)[first],
        readings=count, scatter=np.bincount(label, square), order=order,
        time=means(survey.states.time[:, None], label)[:, 0],
        temperature=means(survey.states.temperature[:, None], label)[:, 0],
    )  # fmt: skip
    rotation = survey.rotation
    if rotation is not None:
        rotation = _mean_rotations(rotation, label)
    note = f"{len(survey)} readings at {len(begins)} stops: {AVERAGED}"
    return replace(
        pooled, states=states, position=mean, rotation=rotation,
        warnings=(*survey.warnings, note),
    )  # fmt: skip


def _mean_angles(q: Floats, stop: Ints) -> Floats:
    """Average angles (n, 6) over each stop; those that are equal stay as they are."""
    _, begins, label = np.unique(stop, return_index=True, return_inverse=True)
    first = q[begins][label.reshape(-1)]
    apart = np.zeros((len(begins), q.shape[1]))
    np.maximum.at(apart, label.reshape(-1), np.abs(q - first))
    mean = means(q, label.reshape(-1))
    return np.where(apart > 0.0, mean, q[begins])[label.reshape(-1)]


def labels_of(states: States, visit: Ints | None = None) -> Ints:
    """Number the readings that belong together, (n,): of one stop and probe point."""
    if len(states) == 0:
        return np.zeros(0, dtype=np.int64)
    return _labels(states, stops_of(states, visit))


def _labels(states: States, stop: Ints) -> Ints:
    """Number pairs of stops and probe points, (n,)."""
    point = np.round(states.tool / SAME_POINT)
    keys = np.column_stack([stop, states.tool_id, point])
    _, label = np.unique(keys, axis=0, return_inverse=True)
    return label.reshape(-1)


def _in_order(label: Ints) -> Ints:
    """Number labels by where they first appear."""
    _, first, of_row = np.unique(label, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    return np.asarray(rank[of_row.reshape(-1)])


def _mean_rotations(rotation: Floats, label: Ints) -> Floats:
    """Average rotations (n, 3, 3) over each label: the nearest rotation to the mean."""
    mean = means(rotation.reshape(-1, 9), label).reshape(-1, 3, 3)
    u, _, vt = np.linalg.svd(mean)
    sign = np.linalg.det(u @ vt)
    u[:, :, 2] *= sign[:, None]
    return np.asarray(u @ vt)


def _without_strays(
    survey: Measurements, stop: Ints
) -> tuple[Measurements, Ints, Ints]:
    """Drop readings that disagree with the others of their stop, list them.

    The scatter is that of all stops with enough readings: most of these are good.

    Returns:
        The rows that stay, their stops, and which of them are averaged: a label.
    """
    label = _labels(survey.states, stop)
    several = np.bincount(label)[label]
    off = survey.position - _medians(survey.position, label)
    size = np.linalg.norm(off, axis=1)
    far = np.zeros(len(survey), dtype=bool)
    for some in (several >= FEWEST, several == 2):
        far |= some & (size > usual_limit(size[some], len(survey)))
    stray = far & (several >= FEWEST)
    gone = tuple(
        DroppedRow(
            survey.ids[i], int(survey.line[i]),
            f"off by {size[i] / MM:.3f} mm from the other readings of its stop",
        )
        for i in np.flatnonzero(stray)
    )  # fmt: skip
    apart = np.where(far, len(label) + np.arange(len(label)), label)
    kept = replace(survey[~stray], dropped=survey.dropped + gone)
    return kept, stop[~stray], _in_order(apart[~stray])


def usual_limit(size: Floats, count: int) -> float:
    """Return the deviation from a median that no good reading of a survey has [m].

    Args:
        size: Deviations of readings that scatter alike, (n,) [m].
        count: Number of all readings.
    """
    if not len(size):
        return np.inf
    usual = float(np.median(size) / np.sqrt(chi2.median(3)))
    return 2.0 * float(np.sqrt(chi2.isf(FALSE_ALARMS / count, 3))) * max(usual, FINEST)


def _medians(values: Floats, label: Ints) -> Floats:
    """Return the median of every row's label, (n, 3)."""
    out = np.empty_like(values)
    order = np.argsort(label, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(label[order])) + 1):
        out[rows] = np.median(values[rows], axis=0)
    return out
