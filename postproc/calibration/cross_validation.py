"""What a fit is expected to leave at new poses, and whether a simpler one leaves less.

Poses are predicted by fits that have not seen any of their stops. Where a campaign is
short, effects are chosen again without each part, and the simplest model whose error is
within one standard error of the best is taken (Breiman et al., 1984, section 3.4.3).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.calibration.diagnosis.held_out import Folds, regions, whole_poses
from postproc.calibration.measurements import Measurements
from postproc.calibration.regression import Fit
from postproc.model.kinematics import Batch
from postproc.model.model import Model
from postproc.model.noise import poses_of
from postproc.model.statistics import ErrorStatistics
from postproc.robot.arm import Arm
from postproc.robot.pose import MM

PARTS = 5
WITHIN = 1.96  # standard deviations that hold 95 % of normal deviates
SURE = 1.645  # standard errors, one-sided 95 %

FitRows = Callable[[Measurements], tuple[Fit, Model]]


@dataclass(frozen=True, eq=False)
class HeldOutRows:
    """Errors of rows that no fit has seen.

    Attributes:
        error: What is left, (n, 3) [m].
        within: Whether a coordinate lies in its stated 95 % interval, (n, 3).
        used: Rows that are measurements of the arm, (n,).
        pose: Number of the pose of every row, (n,).
        tracker: Variance per axis of the tracker, (n,) [m^2].
    """

    error: Floats
    within: Bools
    used: Bools
    pose: Ints
    tracker: Floats

    def by_pose(self) -> Floats:
        """Average the length of what is left over every pose, (poses,) [m]."""
        size = np.linalg.norm(self.error, axis=1)[self.used]
        _, label = np.unique(self.pose[self.used], return_inverse=True)
        label = label.reshape(-1)
        return np.asarray(np.bincount(label, size) / np.bincount(label))


@dataclass(frozen=True)
class HeldOutError:
    """The expected error of new poses.

    Attributes:
        error: Statistics over held-out rows.
        arm_mm: Its mean without the tracker's own scatter.
        regions_mm: Mean error of regions of joint space that are left out.
        covered: Share of held-out coordinates in their stated 95 % intervals.
        chosen: Whether effects were chosen again without each part.
    """

    error: ErrorStatistics
    arm_mm: float
    regions_mm: float
    covered: float
    chosen: bool

    def describe(self) -> str:
        """Say it in a line."""
        how = "effects chosen again" if self.chosen else "effects as in this fit"
        return (
            f"expected on new poses {self.error.mean_mm:.4f} mm, without the tracker's "
            f"own scatter {self.arm_mm:.4f} mm, in regions that were left out "
            f"{self.regions_mm:.4f} mm; intervals hold {self.covered:.0%} "
            f"({self.error.n} held-out rows, {how})"
        )


def parts_of(pose: Ints, seed: int, parts: int = PARTS) -> Ints:
    """Deal poses to parts at random, rows (n,)."""
    _, label = np.unique(pose, return_inverse=True)
    label = label.reshape(-1)
    count = int(label.max(initial=-1)) + 1
    dealt = np.random.default_rng(seed).permutation(count) % parts
    return np.asarray(dealt[label])


def regions_of(survey: Measurements) -> Ints:
    """Cut rows into regions of joint space, whole poses, (n,)."""
    return whole_poses(regions(survey.states.q), poses_of(survey.states))


def held_out(
    survey: Measurements, arm: Arm, fit: FitRows, part: Ints, used: Bools
) -> HeldOutRows:
    """Predict every part of the rows by a fit of all others.

    Args:
        survey: The rows, base frame.
        arm: The arm.
        fit: Fits rows.
        part: Part of every row, (n,).
        used: Rows that count as measurements, (n,).
    """
    error = np.full((len(survey), 3), np.nan)
    within = np.zeros((len(survey), 3), dtype=bool)
    tracker = np.zeros(len(survey))
    for k in np.unique(part):
        out = np.flatnonzero(part == k)
        fitted, model = fit(survey[part != k])
        states = survey.states[out]
        batch = Batch(arm, states)
        read = model.reading(arm, states)
        error[out] = survey.position[out] - batch.walk.tcp - read.error
        within[out] = np.abs(error[out]) < WITHIN * read.std
        shape = fitted.noise.tracker_std(survey.position[out]) ** 2
        tracker[out] = shape / states.readings
    return HeldOutRows(error, within, used, poses_of(survey.states), tracker)


def held_out_linearly(fit: Fit, model: Model, part: Ints) -> HeldOutRows:
    """Predict every part by the others, effects and prior scales as in a fit.

    Args:
        fit: A fit of all rows, linearised where it ended.
        model: What it became.
        part: Part of every row, whole poses, (n,).
    """
    folds = Folds.of_fit(fit, part)
    jacobian, n = fit.design.jacobian, len(fit.batch)
    noise = fit.noise.arrival_variance(jacobian) + fit.noise.pose_variance(jacobian)
    tracker = fit.noise.tracker_std(fit.position) ** 2 / fit.batch.states.readings
    noise = noise + tracker[:, None] + fit.whitener.extra
    error, within = np.empty((n, 3)), np.empty((n, 3), dtype=bool)
    for rows, values, covariance in folds.solved():
        design = fit.design[rows]
        error[rows] = fit.residual[rows] + design.times(fit.values - values)
        known = design.variance(covariance)
        std = model.reading_spread * np.sqrt(known + noise[rows])
        within[rows] = np.abs(error[rows]) < WITHIN * std
    return HeldOutRows(error, within, fit.rows.weight > 0, fit.pose, tracker)


def summarise(rows: HeldOutRows, regions_mm: float, chosen: bool) -> HeldOutError:
    """Put held-out rows into figures."""
    used = rows.used
    square = (rows.error[used] ** 2).sum(axis=1)
    mean = float(np.sqrt(square).mean())
    share = 1.0 - 3.0 * float(rows.tracker[used].mean()) / float(square.mean())
    return HeldOutError(
        ErrorStatistics.of(rows.error[used]),
        mean * float(np.sqrt(max(0.0, share))) / MM,
        regions_mm,
        float(rows.within[used].mean()),
        chosen,
    )


def mean_error_mm(rows: HeldOutRows) -> float:
    """Average the lengths of what is left of the rows that count [mm]."""
    return float(np.linalg.norm(rows.error[rows.used], axis=1).mean()) / MM


@dataclass(frozen=True)
class Compared:
    """Held-out errors of two models at the same poses.

    Attributes:
        gain: Mean fall of the error by the second one [m].
        std_error: Of it, over poses [m].
    """

    gain: float
    std_error: float

    @classmethod
    def of(cls, first: HeldOutRows, second: HeldOutRows) -> Compared:
        """Pair the poses."""
        fall = first.by_pose() - second.by_pose()
        error = (
            float(fall.std(ddof=1) / np.sqrt(len(fall))) if len(fall) > 1 else np.inf
        )
        return cls(float(fall.mean()), error)

    @property
    def better(self) -> bool:
        """Whether the second one is better, one-sided 95 %."""
        return self.gain > SURE * self.std_error

    @property
    def worse(self) -> bool:
        """Whether the second one is worse, one-sided 95 %."""
        return self.gain < -SURE * self.std_error


def simplest(tried: Sequence[HeldOutRows]) -> int:
    """Return the number of the simplest model that is within an error of the best.

    Args:
        tried: Held-out errors of models, the simplest first.
    """
    means = [float(rows.by_pose().mean()) for rows in tried]
    best = int(np.argmin(means))
    for k in range(best):
        compared = Compared.of(tried[k], tried[best])
        if compared.gain <= compared.std_error:
            return k
    return best
