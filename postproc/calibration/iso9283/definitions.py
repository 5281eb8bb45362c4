"""Performance figures of a robot after ISO 9283, by their formulas.

They are those of ISO 9283:1998, chapters 7 and 8, as the literature and data sheets
give them: the text of the norm could not be read for this. Lengths are metres.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.robot.pose import lengths

IN_PLANE = 1e-9  # [m] a reading that is so near lies in the normal plane


def pose_accuracy(command: Floats, position: Floats) -> float:
    """Compute AP = | mean of the attained positions - command | [m].

    Args:
        command: (3,) [m].
        position: (n, 3) [m].
    """
    return float(np.linalg.norm(position.mean(axis=0) - command))


def repeatability(position: Floats) -> float:
    """Compute RP = mean l + 3 s_l [m], l: the distances from the mean position.

    s_l is the standard deviation of l with n - 1; positions are (n, 3) [m].
    """
    apart = lengths(position - position.mean(axis=0))
    return float(apart.mean() + 3.0 * apart.std(ddof=1))


def variation(centres: Floats) -> float:
    """Compute vAP: the largest distance between mean positions (k, 3) [m]."""
    return float(np.linalg.norm(centres[:, None] - centres[None], axis=2).max())


def distance_accuracy(first: Floats, second: Floats, commanded: float) -> float:
    """Compute AD = mean attained distance - commanded distance [m], with its sign.

    Args:
        first: Attained positions of one pose, (n, 3) [m].
        second: Those of the other in the same cycles.
        commanded: The commanded distance [m].
    """
    return float(lengths(first - second).mean() - commanded)


def distance_repeatability(first: Floats, second: Floats) -> float:
    """Compute RD = 3 s_D [m] of the attained distances of cycles, with n - 1."""
    return float(3.0 * lengths(first - second).std(ddof=1))


def pose_drift(command: Floats, blocks: Floats) -> float:
    """Compute dAP: the largest change of AP since the first block [m].

    Args:
        command: (3,) [m].
        blocks: Attained positions of b blocks of readings, (b, n, 3) [m].
    """
    each = np.array([pose_accuracy(command, block) for block in blocks])
    return float(np.abs(each - each[0]).max())


def path_accuracy(command: Floats, crossings: Floats) -> float:
    """Compute AT: the largest distance from the command path to the mean path [m].

    Args:
        command: Stations of the command path, (m, 3) [m].
        crossings: Where the n cycles pass the normal planes there, (n, m, 3) [m].
    """
    return float(lengths(crossings.mean(axis=0) - command).max())


def path_repeatability(crossings: Floats) -> float:
    """Compute RT = max over the stations of mean l + 3 s_l [m]; see `path_accuracy`."""
    return max(repeatability(crossings[:, k]) for k in range(crossings.shape[1]))


def cross_planes(command: Floats, normals: Floats, track: Floats) -> Floats:
    """Find where an attained path passes the normal planes of stations.

    Args:
        command: The stations, (m, 3) [m].
        normals: Unit tangents of the command path there, (m, 3).
        track: Attained positions in their order, (k, 3) [m].

    Returns:
        The passage next to every station, (m, 3) [m]; NaN where there is none.
    """
    out = np.full(command.shape, np.nan)
    for i, (place, normal) in enumerate(zip(command, normals, strict=True)):
        off = (track - place) @ normal
        before, after = off[:-1], off[1:]
        cut = np.flatnonzero(before * after < 0.0)
        share = before[cut] / (before[cut] - after[cut])
        between = track[cut] + share[:, None] * (track[cut + 1] - track[cut])
        found = np.concatenate([track[np.abs(off) <= IN_PLANE], between])
        if len(found):
            out[i] = found[np.argmin(lengths(found - place))]
    return out


def rounding_error(corner: Floats, track: Floats) -> float:
    """Compute CR of one cycle: the smallest distance of a path from a corner [m].

    Args:
        corner: (3,) [m].
        track: Attained positions in their order, (k, 3) [m].
    """
    start, way = track[:-1], np.diff(track, axis=0)
    square = np.maximum((way**2).sum(axis=1), np.finfo(float).tiny)
    share = np.clip(((corner - start) * way).sum(axis=1) / square, 0.0, 1.0)
    return float(lengths(start + share[:, None] * way - corner).min())


def overshoot(corner: Floats, into: Floats, onward: Floats, track: Floats) -> float:
    """Compute CO of one cycle: the largest deviation from the path beyond a corner [m].

    Only what lies beyond the corner in the direction of the first leg counts.

    Args:
        corner: (3,) [m].
        into: Unit vector of the leg that leads to the corner, (3,).
        onward: Unit vector of the leg behind it, (3,).
        track: Attained positions of both legs, (k, 3) [m].
    """
    off = track - corner
    aside = off - (off @ onward)[:, None] * onward
    beyond = off @ into > 0.0
    return float(lengths(aside[beyond]).max()) if beyond.any() else 0.0
