"""What a fit is expected to leave at new poses, and whether a simpler one leaves less.

Poses are predicted by fits that have not seen any of their stops. Where a campaign is
short, effects are chosen again without each part, and more than `geometry,backlash` is
taken only where that leaves new poses less, beyond what chance does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from postproc.arrays import Bools, Floats, Ints
from postproc.calibration.diagnosis.held_out import Folds, regions, whole_poses
from postproc.calibration.joint_scatter import split_by_joint
from postproc.calibration.measurements import Measurements
from postproc.calibration.regression import Fit
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.model.noise import poses_of
from postproc.model.statistics import ErrorStatistics
from postproc.robot.arm import Arm
from postproc.robot.pose import MM
from postproc.robot.state import States

PARTS = 5
STRAY = 5.0  # standard deviations beyond which an error counts no more
WITHIN = 1.96  # standard deviations that hold 95 % of normal deviates
SURE = 1.645  # standard errors, one-sided 95 %
LEVEL = 0.025  # of a false choice between two models

FitRows = Callable[[Measurements], tuple[Fit, Model]]


@dataclass(frozen=True, eq=False)
class HeldOutRows:
    """Errors of rows that no fit has seen.

    Attributes:
        error: Reading minus prediction, (n, 3) [m].
        std: Stated standard deviation of a reading, (n, 3) [m].
        part: Part of every row, (n,): what predicted it has seen no other row of it.
        used: Rows that are measurements of the arm, (n,).
        pose: Number of the pose of every row, (n,).
        tracker: Variance per axis of the tracker, (n,) [m^2].
    """

    error: Floats
    std: Floats
    part: Ints
    used: Bools
    pose: Ints
    tracker: Floats

    @property
    def widening(self) -> float:
        """Factor on the stated standard deviations by what held-out rows show."""
        return self._birge_ratio(self.used)

    @property
    def covered(self) -> float:
        """Share of coordinates in their 95 % intervals.

        Intervals of a part are widened by what all other parts show.
        """
        ratio, hits = self.error / self.std, []
        for k in np.unique(self.part):
            others = self.used & (self.part != k)
            wide = self._birge_ratio(others)
            own = np.abs(ratio[self.used & (self.part == k)])
            hits.append(own < WITHIN * wide)
        return float(np.concatenate(hits).mean())

    def _birge_ratio(self, rows: Bools) -> float:
        """Return the factor by which errors of rows exceed their standard deviations.

        The root of the mean squared ratio, at least 1 (R. T. Birge, Phys. Rev. 40,
        1932), strays counting as far; 1 where as much is reached by chance, with three
        independent coordinates a pose.
        """
        ratio = np.minimum(np.abs(self.error / self.std)[rows], STRAY)
        poses = len(np.unique(self.pose[rows]))
        if poses == 0:
            return 1.0
        square = float((ratio**2).mean())
        chance = 1.0 + SURE * float(np.sqrt(2.0 / (3.0 * poses)))
        return float(np.sqrt(square)) if square > chance else 1.0

    def by_pose(self) -> Floats:
        """Average the length of the error over every pose, (poses,) [m]."""
        return _lengths_by_pose(self.error[self.used], self.pose[self.used])


def _lengths_by_pose(error: Floats, pose: Ints) -> Floats:
    """Average the lengths of errors (n, 3) over every pose, (poses,) [m]."""
    _, label = np.unique(pose, return_inverse=True)
    label = label.reshape(-1)
    size = np.bincount(label, np.linalg.norm(error, axis=1))
    return np.asarray(size / np.bincount(label))


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
            f"error expected on new poses {self.error.mean_mm:.4f} mm (without scatter "
            f"of the tracker {self.arm_mm:.4f} mm), in regions without rows "
            f"{self.regions_mm:.4f} mm; 95 % intervals cover {self.covered:.0%} "
            f"({self.error.n} held-out rows, {how})"
        )


def parts_of(pose: Ints, seed: int, parts: int = PARTS) -> Ints:
    """Deal poses to parts at random, rows (n,)."""
    _, label = np.unique(pose, return_inverse=True)
    label = label.reshape(-1)
    count = int(label.max(initial=-1)) + 1
    dealt = np.random.default_rng(seed).permutation(count) % parts
    return np.asarray(dealt[label])


def regions_of(states: States) -> Ints:
    """Cut rows into regions of joint space, whole poses, (n,)."""
    return whole_poses(regions(states.q), poses_of(states))


def predict_held_out(
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
    std = np.ones((len(survey), 3))
    tracker = np.zeros(len(survey))
    for k in np.unique(part):
        out = np.flatnonzero(part == k)
        fitted, model = fit(survey[part != k])
        states = survey.states[out]
        batch = ArmStates(arm, states)
        read = model.reading(arm, states)
        error[out] = survey.position[out] - batch.walk.tcp - read.error
        std[out] = read.std
        shape = fitted.noise.tracker_std(survey.position[out]) ** 2
        tracker[out] = shape / states.readings
    return HeldOutRows(error, std, part, used, poses_of(survey.states), tracker)


def predict_held_out_linearly(fit: Fit, part: Ints) -> HeldOutRows:
    """Predict every part by the others, effects and prior scales as in a fit.

    Args:
        fit: A fit of all rows, linearised where it ended.
        part: Part of every row, whole poses, (n,).
    """
    folds, fit = Folds.of_fit(fit, part), split_by_joint(fit)
    jacobian, n = fit.design.jacobian, len(fit.batch)
    noise = fit.noise.arrival_variance(jacobian) + fit.noise.pose_variance(jacobian)
    tracker = fit.noise.tracker_std(fit.position) ** 2 / fit.batch.states.readings
    noise = noise + tracker[:, None] + fit.whitener.extra
    error, std = np.empty((n, 3)), np.empty((n, 3))
    for rows, values, covariance in folds.solve():
        design = fit.design[rows]
        error[rows] = fit.residual[rows] + design.times(fit.values - values)
        known = design.variance(covariance)
        std[rows] = fit.reading_spread * np.sqrt(known + noise[rows])
    return HeldOutRows(error, std, part, fit.rows.weight > 0, fit.pose, tracker)


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
        rows.covered,
        chosen,
    )


def mean_error_mm(rows: HeldOutRows) -> float:
    """Average the lengths of the errors of the rows that count [mm]."""
    return float(np.linalg.norm(rows.error[rows.used], axis=1).mean()) / MM


@dataclass(frozen=True)
class PairedErrors:
    """Held-out errors of two models at the same poses.

    Attributes:
        gain: Mean fall of the error by the second one [m].
        std_error: Of it, over poses [m].
        poses: Number of poses.
    """

    gain: float
    std_error: float
    poses: int

    @classmethod
    def of(cls, first: HeldOutRows, second: HeldOutRows) -> PairedErrors:
        """Pair the poses."""
        return cls._of_falls(first.by_pose() - second.by_pose())

    @classmethod
    def between(cls, first: Floats, second: Floats, pose: Ints) -> PairedErrors:
        """Pair the poses of errors of the same rows, (n, 3) [m] each."""
        by_pose = (_lengths_by_pose(error, pose) for error in (first, second))
        return cls._of_falls(np.subtract(*by_pose))

    @classmethod
    def _of_falls(cls, fall: Floats) -> PairedErrors:
        """Take by how much the second one is better at every pose, (poses,) [m]."""
        spread = float(fall.std(ddof=1)) if len(fall) > 1 else np.inf
        return cls(float(fall.mean()), spread / len(fall) ** 0.5, len(fall))

    @property
    def better(self) -> bool:
        """Whether the second one is better beyond doubt."""
        return self.gain > self.limit

    @property
    def limit(self) -> float:
        """Gain that chance alone reaches at `LEVEL` [m]."""
        return float(student.isf(LEVEL, max(self.poses - 1, 1))) * self.std_error


def choose(tried: Sequence[HeldOutRows]) -> int:
    """Choose the simplest model that no other beats beyond what chance does.

    Args:
        tried: Held-out errors of models, the simplest first.
    """
    best = 0
    for k in range(1, len(tried)):
        if PairedErrors.of(tried[best], tried[k]).better:
            best = k
    return best
