"""Figures of a test after ISO 9283, from its readings.

Lengths are metres.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.calibration.iso9283.definitions import (
    cross_planes,
    distance_accuracy,
    distance_repeatability,
    overshoot,
    path_accuracy,
    path_repeatability,
    pose_accuracy,
    pose_drift,
    repeatability,
    rounding_error,
    variation,
)
from postproc.model.registration import rigid_fit
from postproc.robot.pose import lengths

POSE_CYCLES, PATH_CYCLES, CORNER_CYCLES = 30, 10, 3  # of the norm
DRIFT_BLOCK = 10  # readings of P1 that make one AP of a drift test
DRIFT_HOURS, SHORTEST_HOURS = 8.0, 1.0  # of the norm; less says nothing of drift
FIRST, SECOND = "P2", "P4"  # poses whose distance is judged
DRIFT_POSE = "P1"
CORNER = np.cos(np.deg2rad(30.0))  # a command path that turns by more has a corner
BEST_FIT = " after best fit"
NO_ISO = "not an ISO value"
CENTRED = 0.02  # mean error over its root mean square: a best fit left nothing of it
FEWEST_POSES = 3  # that a frame can be registered on


@dataclass(frozen=True, eq=False)
class PoseReadings:
    """Readings of n arrivals at poses.

    Attributes:
        pose: Name of every row's pose, n texts.
        direction: From where it was approached, n texts, "" where that is not stated.
        cycle: Number of the cycle, (n,).
        command: Commanded positions, (n, 3) [m].
        position: Attained positions, (n, 3) [m].
        time: (n,) [s], NaN where it is not known.
    """

    pose: tuple[str, ...]
    direction: tuple[str, ...]
    cycle: Ints
    command: Floats
    position: Floats
    time: Floats

    def rows(self, pose: str, direction: str) -> Ints:
        """Return the rows of a pose from one direction, by their cycles."""
        own = zip(self.pose, self.direction, strict=True)
        found = np.flatnonzero([pair == (pose, direction) for pair in own])
        return np.asarray(found[np.argsort(self.cycle[found], kind="stable")])

    @property
    def arrivals(self) -> tuple[tuple[str, str], ...]:
        """Return poses and directions, by their names."""
        return tuple(sorted(set(zip(self.pose, self.direction, strict=True))))


@dataclass(frozen=True, eq=False)
class PathReadings:
    """Readings of one command path that was followed several times.

    Attributes:
        path: Its name.
        s: Arc length of the m stations along the command path, ascending, (m,) [m].
        command: Their places on the command path, (m, 3) [m].
        cycles: The cycles: arc length (k,) and attained positions (k, 3) [m] of each.
    """

    path: str
    s: Floats
    command: Floats
    cycles: tuple[tuple[Floats, Floats], ...]


@dataclass(frozen=True)
class IsoValue:
    """One figure.

    Attributes:
        name: As the norm calls it, with what it is instead where it is not.
        place: Of which pose, distance, path or corner.
        size: [m].
        uncertainty: Half the 95 % interval by the scatter of the cycles [m]; NaN where
            these are too few.
        count: Cycles that it rests on.
        remark: Why it is no ISO value, "" where it is one.
    """

    name: str
    place: str
    size: float
    uncertainty: float
    count: int
    remark: str = ""


@dataclass(frozen=True)
class IsoFigures:
    """All figures of a test.

    Attributes:
        values: The figures, of poses first.
        largest: The largest value of every name.
        positions: Commanded position of every pose [m].
        best_fit: Why figures of accuracy are those after a best fit, "" if they are
            not.
    """

    values: tuple[IsoValue, ...]
    largest: tuple[IsoValue, ...]
    positions: dict[str, tuple[float, ...]]
    best_fit: str = ""


def iso_figures(
    poses: PoseReadings | None, paths: tuple[PathReadings, ...] = (), fit: bool = False
) -> IsoFigures:
    """Compute all figures that the readings of a test allow.

    Args:
        poses: Readings at poses, None for none.
        paths: Readings of paths.
        fit: Whether a frame is registered on the poses first.

    Returns:
        The figures. Those of accuracy are named "after best fit" where a frame was
        registered on the same poses: here, or before, which their mean error shows.
    """
    reason = ""
    if poses is not None:
        reason = "a frame was registered on these poses here" if fit else ""
        if fit:
            moved = rigid_fit(poses.position, poses.command)
            poses = replace(poses, position=_shift(poses.position, moved))
            paths = tuple(_shift_path(one, moved) for one in paths)
        elif is_centred(poses):
            reason = "the mean error of all poses is zero: a frame was registered on "
            reason += "them before"
    suffix = BEST_FIT if reason else ""
    values = [] if poses is None else _pose_values(poses, suffix)
    values += [value for path in paths for value in _path_values(path, suffix)]
    return IsoFigures(tuple(values), _largest(values), _positions(poses), reason)


def is_centred(poses: PoseReadings) -> bool:
    """Return True if the errors of all poses cancel, as a best fit makes them."""
    if len(set(poses.pose)) < FEWEST_POSES:
        return False
    error = poses.position - poses.command
    size = np.sqrt((error**2).sum(axis=1).mean())
    return bool(np.linalg.norm(error.mean(axis=0)) < CENTRED * size)


def _shift(points: Floats, by: Floats) -> Floats:
    return np.asarray(points @ by[:3, :3].T + by[:3, 3])


def _shift_path(path: PathReadings, by: Floats) -> PathReadings:
    return replace(path, cycles=tuple((s, _shift(p, by)) for s, p in path.cycles))


def _positions(poses: PoseReadings | None) -> dict[str, tuple[float, ...]]:
    if poses is None:
        return {}
    pairs = zip(poses.pose, poses.command.tolist(), strict=True)
    return {name: tuple(xyz) for name, xyz in sorted(dict(pairs).items())}


def _largest(values: list[IsoValue]) -> tuple[IsoValue, ...]:
    """Return the largest value of every name that has several, by its length."""
    names = dict.fromkeys(value.name for value in values)
    groups = ([v for v in values if v.name == name] for name in names)
    return tuple(max(g, key=lambda v: abs(v.size)) for g in groups if len(g) > 1)


def few(count: int, enough: int) -> str:
    """Say that so many cycles are fewer than the norm has, "" if they are not."""
    return f"{NO_ISO}: {count} of {enough} cycles" if count < enough else ""


def jackknife(count: int, value: Callable[[Ints], float]) -> float:
    """Return half the 95 % interval of a figure by leaving out one cycle at a time [m].

    Args:
        count: Cycles, n.
        value: The figure of some of them, by their numbers from 0.

    Returns:
        t(0.975, n - 1) sqrt((n - 1) / n sum (v_k - mean v)^2), NaN for n < 3 (Efron and
        Tibshirani 1993, chapter 11).
    """
    from scipy.stats import t  # slow to load

    if count < 3:
        return float("nan")
    every = np.arange(count)
    found = np.array([value(np.delete(every, k)) for k in every])
    spread = np.sqrt((count - 1) / count * ((found - found.mean()) ** 2).sum())
    return float(t.ppf(0.975, count - 1) * spread)


def _of_cycles(
    figure: Callable[[Floats], float], readings: Floats
) -> Callable[[Ints], float]:
    """Return the figure as a function of which cycles (n, ..) it rests on."""
    return lambda chosen: figure(readings[chosen])


def _mean(values: Floats) -> float:
    return float(values.mean())


def _value(
    name: str, place: str, count: int, enough: int, value: Callable[[Ints], float]
) -> IsoValue:
    """Compute a figure of n cycles, with what they say of its uncertainty."""
    spread = jackknife(count, value)
    size = value(np.arange(count))
    return IsoValue(name, place, size, spread, count, few(count, enough))


def _pose_values(poses: PoseReadings, suffix: str) -> list[IsoValue]:
    found: list[IsoValue] = []
    for pose, direction in poses.arrivals:
        rows = poses.rows(pose, direction)
        place = f"{pose} from {direction}" if direction else pose
        command, at = poses.command[rows[0]], poses.position[rows]
        found.append(
            _value(f"AP{suffix}", place, len(rows), POSE_CYCLES,
                   _of_cycles(partial(pose_accuracy, command), at))
        )  # fmt: skip
        if len(rows) > 1:
            found.append(
                _value("RP", place, len(rows), POSE_CYCLES,
                       _of_cycles(repeatability, at))
            )  # fmt: skip
    found += _variations(poses)
    found += _distances(poses)
    found += _drift(poses, suffix)
    return sorted(found, key=lambda value: value.name)


def _variations(poses: PoseReadings) -> list[IsoValue]:
    found = []
    for pose in sorted(set(poses.pose)):
        sides = [d for name, d in poses.arrivals if name == pose and d]
        if len(sides) < 2:
            continue
        groups = [poses.position[poses.rows(pose, side)] for side in sides]
        count = min(map(len, groups))

        def apart(k: Ints, groups: list[Floats] = groups) -> float:
            return variation(np.array([group[k].mean(axis=0) for group in groups]))

        value = _value("vAP", pose, count, POSE_CYCLES, apart)
        centres = np.array([group.mean(axis=0) for group in groups])
        value = replace(value, size=variation(centres))
        if len(sides) < 3:
            remark = f"{NO_ISO}: {len(sides)} of 3 directions"
            value = replace(value, remark=remark)
        found.append(value)
    return found


def _distances(poses: PoseReadings) -> list[IsoValue]:
    """Compute AD and RD between P2 and P4 over the cycles that have both."""
    ends = []
    for name in (FIRST, SECOND):
        sides = [d for pose, d in poses.arrivals if pose == name]
        if not sides:
            return []
        ends.append(poses.rows(name, sides[0]))
    first, second = (poses.cycle[rows] for rows in ends)
    _, a, b = np.intersect1d(first, second, return_indices=True)
    if not len(a):
        return []
    rows = ends[0][a], ends[1][b]
    one, other = (poses.position[r] for r in rows)
    gap = float(np.linalg.norm(np.subtract(*(poses.command[r[0]] for r in rows))))
    place = f"{FIRST} to {SECOND}"
    found = [
        _value("AD", place, len(a), POSE_CYCLES,
               lambda k: distance_accuracy(one[k], other[k], gap))
    ]  # fmt: skip
    if len(a) > 1:
        found.append(
            _value("RD", place, len(a), POSE_CYCLES,
                   lambda k: distance_repeatability(one[k], other[k]))
        )  # fmt: skip
    return found


def _drift(poses: PoseReadings, suffix: str) -> list[IsoValue]:
    """Compute dAP at P1 from blocks of readings in the order of their times."""
    sides = [d for pose, d in poses.arrivals if pose == DRIFT_POSE]
    if not sides:
        return []
    rows = poses.rows(DRIFT_POSE, sides[0])
    rows = rows[~np.isnan(poses.time[rows])]
    rows = rows[np.argsort(poses.time[rows], kind="stable")]
    count = len(rows) // DRIFT_BLOCK
    if count < 2:
        return []
    rows = rows[: count * DRIFT_BLOCK]
    blocks = poses.position[rows].reshape(count, DRIFT_BLOCK, 3)
    command = poses.command[rows[0]]
    hours = float(np.ptp(poses.time[rows]) / 3600.0)
    if hours < SHORTEST_HOURS:
        return []
    size = pose_drift(command, blocks)
    spread = jackknife(DRIFT_BLOCK, lambda k: pose_drift(command, blocks[:, k]))
    short = f"{NO_ISO}: over {hours:.1f} of {DRIFT_HOURS:g} h"
    remark = short if hours < DRIFT_HOURS else ""
    place = f"{DRIFT_POSE} over {hours:.1f} h"
    return [IsoValue(f"dAP{suffix}", place, size, spread, len(rows), remark)]


def tangents(path: PathReadings) -> tuple[Floats, Bools]:
    """Return unit tangents of a command path (m, 3), and which stations are corners."""
    legs = np.diff(path.command, axis=0)
    legs = legs / lengths(legs)[:, None]
    inner = path.command[2:] - path.command[:-2]
    size = np.maximum(lengths(inner), np.finfo(float).tiny)[:, None]
    whole = np.concatenate([legs[:1], inner / size, legs[-1:]])
    corner = np.zeros(len(path.s), dtype=bool)
    corner[1:-1] = (legs[:-1] * legs[1:]).sum(axis=1) < CORNER
    return whole, corner


def _path_values(path: PathReadings, suffix: str) -> list[IsoValue]:
    """Compute AT and RT in normal planes, and CR and CO at corners."""
    normals, corner = tangents(path)
    plain = np.flatnonzero(~corner)
    stations = path.command[plain]
    every = np.array(
        [cross_planes(stations, normals[plain], p) for _, p in path.cycles]
    )
    seen = ~np.isnan(every).any(axis=(0, 2))
    found, count = [], len(path.cycles)
    if seen.any():
        command, across = stations[seen], every[:, seen]
        found.append(
            _value(f"AT{suffix}", path.path, count, PATH_CYCLES,
                   _of_cycles(partial(path_accuracy, command), across))
        )  # fmt: skip
        if count > 1:
            found.append(
                _value("RT", path.path, count, PATH_CYCLES,
                       _of_cycles(path_repeatability, across))
            )  # fmt: skip
    for k in np.flatnonzero(corner):
        found += _corner_values(path, int(k), suffix)
    return sorted(found, key=lambda value: value.name)


def _corner_values(path: PathReadings, k: int, suffix: str) -> list[IsoValue]:
    """Compute CR and CO of a corner from halves of the legs beside it."""
    _, corner = tangents(path)
    ends = np.flatnonzero(corner | (np.arange(len(path.s)) % (len(path.s) - 1) == 0))
    at = int(np.searchsorted(ends, k))
    before, here, behind = path.s[ends[at - 1]], path.s[k], path.s[ends[at + 1]]
    low, high = (before + here) / 2, (here + behind) / 2
    place = path.command[k]
    into, onward = (path.command[[k, k + 1]] - path.command[[k - 1, k]])[:2]
    into, onward = into / np.linalg.norm(into), onward / np.linalg.norm(onward)
    tracks = [p[(s >= low) & (s <= high)] for s, p in path.cycles]
    tracks = [track for track in tracks if len(track) > 1]
    if not tracks:
        return []
    cr = np.array([rounding_error(place, track) for track in tracks])
    co = np.array([overshoot(place, into, onward, track) for track in tracks])
    name = f"{path.path} at {1e3 * here:.0f} mm"
    return [
        _value(f"{what}{suffix}", name, len(tracks), CORNER_CYCLES,
               _of_cycles(_mean, each))
        for what, each in (("CR", cr), ("CO", co))
    ]  # fmt: skip
