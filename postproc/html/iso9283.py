"""Accuracy, repeatability and multi-directional variation of poses (ISO 9283)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats, Ints

SAME = 1e-6  # [deg] commands that differ by less are the same pose


@dataclass(frozen=True)
class PoseFigures:
    """Figures of poses that were visited more than once [mm]; NaN where none were.

    Attributes:
        accuracy: AP, distance of the mean landing from the command, mean and max over
            poses reached twice or more from one side.
        repeatability: RP, mean distance from the mean landing plus three times its
            standard deviation, likewise.
        variation: vAP, largest distance between the mean landings from different
            sides, mean and max over poses reached from several sides.
        repeated: Poses reached more than once from one side.
        several: Poses reached from several sides.
        arrivals: Arrivals a side that the figures of `variation` rest on, at least.
    """

    accuracy: tuple[float, float]
    repeatability: tuple[float, float]
    variation: tuple[float, float]
    repeated: int
    several: int
    arrivals: int


def pose_figures(q_deg: Floats, direction: Ints, error_mm: Floats) -> PoseFigures:
    """Group measured rows by command and side, and work out the figures.

    Args:
        q_deg: Commanded joint angles, (n, 6).
        direction: Arrival directions, (n, 6).
        error_mm: Measured minus commanded position, (n, 3).
    """
    pose = _number(np.round(q_deg / SAME))
    side = _number(np.column_stack([pose, direction]))
    accuracy, repeatability, variation, arrivals = [], [], [], []
    for k in np.unique(side):
        e = error_mm[side == k]
        if len(e) > 1:
            centre = e.mean(axis=0)
            distance = np.linalg.norm(e - centre, axis=1)
            accuracy.append(float(np.linalg.norm(centre)))
            repeatability.append(float(distance.mean() + 3 * distance.std(ddof=1)))
    for k in np.unique(pose):
        sides, counts = np.unique(side[pose == k], return_counts=True)
        if len(sides) > 1:
            centres = np.array([error_mm[side == s].mean(axis=0) for s in sides])
            apart = np.linalg.norm(centres[:, None] - centres[None], axis=2)
            variation.append(float(apart.max()))
            arrivals.append(int(counts.min()))
    return PoseFigures(
        _mean_max(accuracy),
        _mean_max(repeatability),
        _mean_max(variation),
        len(accuracy),
        len(variation),
        min(arrivals, default=0),
    )


def _number(rows: Floats | Ints) -> Ints:
    """Number equal rows alike, (n,)."""
    return np.asarray(np.unique(rows, axis=0, return_inverse=True)[1]).ravel()


def _mean_max(values: list[float]) -> tuple[float, float]:
    """Return mean and maximum; NaN where there is none."""
    return (float(np.mean(values)), max(values)) if values else (np.nan, np.nan)
