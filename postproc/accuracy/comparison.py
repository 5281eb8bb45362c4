"""The source's five rows and ours, on the same data and split."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.full import fit_survey, model_of
from postproc.accuracy.measurement import Measurements
from postproc.accuracy.methods import fit_method
from postproc.arrays import Floats
from postproc.model.kinematics import Batch
from postproc.model.model import Method
from postproc.robot.arm import Arm
from postproc.robot.pose import MM

Rows = NDArray[np.int64]

TRAIN_SHARE = 2 / 3  # 300 of 450, as the source
ORDER: tuple[Method, ...] = (
    "eja-elm",
    "elm",
    "interpolation",
    "kinematic-elm",
    "kriging",
    "full",
)


@dataclass(frozen=True)
class MethodRow:
    """Errors that one method leaves on rows it has not seen [mm]."""

    method: str
    min_mm: float
    max_mm: float
    mean_mm: float
    std_mm: float
    n: int


@dataclass(frozen=True)
class Comparison:
    """All methods on one split."""

    rows: tuple[MethodRow, ...]
    split: str


def random_split(n: int, seed: int, share: float = TRAIN_SHARE) -> tuple[Rows, Rows]:
    """Split n rows at random into training and test rows, each in visit order."""
    order = np.random.default_rng(seed).permutation(n)
    cut = round(share * n)
    return np.sort(order[:cut]), np.sort(order[cut:])


def compare(
    survey: Measurements, arm: Arm, tracker: Floats | None = None, seed: int = 0
) -> Comparison:
    """Fit every method to a random part of a survey and test it on the rest.

    Args:
        survey: Measurements in the base frame.
        arm: The arm.
        tracker: Tracker position in the base frame, (3,) [m], or None.
        seed: Of the split and of the random layers.
    """
    train, test = random_split(len(survey), seed)
    split = (
        f"{len(train)} rows to fit, {len(test)} to test, drawn at random (seed {seed})"
    )
    rows = compare_on(survey[train], survey[test], arm, tracker, seed)
    return Comparison(rows, split)


def compare_on(
    train: Measurements,
    test: Measurements,
    arm: Arm,
    tracker: Floats | None,
    seed: int,
    truth: Floats | None = None,
) -> tuple[MethodRow, ...]:
    """Fit every method to one survey and test it on another.

    Args:
        train: Rows to fit.
        test: Rows to test on.
        arm: The arm.
        tracker: Tracker position in the base frame, or None.
        seed: Of the random layers.
        truth: True positions of the test rows where they are known, (n, 3) [m].
    """
    position = test.position if truth is None else truth
    error = position - Batch(arm, test.states).walk.tcp
    rows = [_row("no compensation", error)]
    for method in ORDER:
        if method == "full":
            model = model_of(fit_survey(train, arm, None, tracker), train)
        else:
            model = fit_method(method, train, arm, seed)
        rows.append(_row(method, error - model.measured_error(arm, test.states)))
    return tuple(rows)


def _row(method: str, error: Floats) -> MethodRow:
    """Summarise errors (n, 3) [m]."""
    e = np.linalg.norm(error, axis=1) / MM
    low, high = float(e.min()), float(e.max())
    return MethodRow(method, low, high, float(e.mean()), float(e.std()), len(e))
