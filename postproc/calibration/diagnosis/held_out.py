"""Whether a candidate predicts rows that did not fit it, and how well one could."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.calibration.design_matrix import DesignMatrix
from postproc.calibration.evidence import invert_information
from postproc.calibration.iso9283.definitions import variation
from postproc.calibration.regression import Fit
from postproc.model.effects.effect import Candidate
from postproc.model.kinematics import ArmStates
from postproc.model.noise import Noise, poses_of

# Whether a candidate predicts rows that did not fit it.
#
# Rows are cut into short runs along what the question is about: along the visit order
# for what passes with time, along the candidate's own covariate for what a joint does.
# Runs are dealt to folds, so that a fold's rows have neighbours on both sides only at a
# distance.

FOLDS = 10
RUN = 4  # rows of a run
FARTHEST = 100.0  # squared error of a row that counts, in noise variances
REGIONS = 6  # of joint space
LEAST_SPREAD = 1e-3  # [rad] of a joint that has moved


def deal(values: Floats, folds: int, seed: int, run: int = RUN) -> NDArray[np.int64]:
    """Cut rows into runs along a covariate and deal these to folds.

    Args:
        values: The covariate, (n,).
        folds: Number of folds.
        seed: Of the dealing.
        run: Rows of a run.

    Returns:
        Fold of every row, (n,).
    """
    place = np.argsort(np.argsort(values, kind="stable"), kind="stable")
    runs = place // run
    count = int(runs.max(initial=0)) + 1
    rng = np.random.default_rng(seed)
    hands = np.concatenate(
        [rng.permutation(folds) for _ in range(-(-count // folds))]
    )  # every fold once a round
    return np.asarray(hands[runs], dtype=np.int64)


def whole_poses(fold: NDArray[np.int64], pose: NDArray[np.int64]) -> NDArray[np.int64]:
    """Put all rows of a pose into the fold of its first one, (n,)."""
    _, first, of_row = np.unique(pose, return_index=True, return_inverse=True)
    return np.asarray(fold[first][of_row.reshape(-1)])


def regions(q: Floats) -> NDArray[np.int64]:
    """Cut rows into regions of joint space: a fold then has no neighbours elsewhere.

    Args:
        q: Joint angles, (n, 6) [rad].

    Returns:
        Region of every row, (n,).
    """
    from scipy.cluster.vq import kmeans2  # slow to load, and for fits alone

    spread = np.maximum(q.std(axis=0), LEAST_SPREAD)
    with warnings.catch_warnings():  # poses that repeat may leave a region empty
        warnings.simplefilter("ignore", UserWarning)
        _, region = kmeans2(q / spread, REGIONS, seed=1, minit="++")
    return np.asarray(region, dtype=np.int64)


@dataclass(frozen=True)
class Gain:
    """Fall of the squared held-out error that a candidate brings, per row.

    Attributes:
        mean: In units of the noise variance.
        std_error: Of the mean, over the poses.
    """

    mean: float
    std_error: float

    @classmethod
    def between(cls, before: Floats, after: Floats, fit: Fit) -> Self:
        """Compare two sets of held-out errors (n, 3) of a fit's rows that count.

        A row that is beyond the others along what drives a curve, at its very end, is
        predicted anyhow: no row counts for more than `FARTHEST`.
        """
        used = fit.rows.weight > 0
        square = (np.minimum((e**2).sum(axis=1), FARTHEST) for e in (before, after))
        fall = np.subtract(*square)[used]
        _, pose = np.unique(fit.pose[used], return_inverse=True)
        by_pose = np.bincount(pose.reshape(-1), fall)
        mean = float(fall.mean())
        each = by_pose - mean * np.bincount(pose.reshape(-1))
        error = float(np.sqrt((each**2).sum()) / max(len(fall), 1))
        return cls(mean, error)

    @property
    def sure(self) -> bool:
        """Whether it is larger than its standard error."""
        return self.mean > self.std_error


def compare_held_out(fit: Fit, number: int, candidate: Candidate) -> Gain:
    """Compare held-out errors with and without one effect of a fit.

    Args:
        fit: A fit with the effect in it; its noise and prior scales are kept.
        number: Place of the effect in the fit.
        candidate: The candidate that the effect was.
    """
    fold = deal(candidate.driver(fit.batch), FOLDS, seed=0)
    return gain_in(fit, number, Folds.of_fit(fit, fold))


def gain_in(fit: Fit, number: int, folds: Folds) -> Gain:
    """Compare what folds leave with and without one effect of their fit.

    Args:
        fit: The fit.
        number: Place of the effect in it.
        folds: Its rows in folds.
    """
    after, before = folds.errors(fit.combination.slices[number])
    return Gain.between(before, after, fit)


@dataclass(frozen=True, eq=False)
class Folds:
    """Rows in folds, with the sums over each that predict it from the others.

    Attributes:
        rows: Rows of every fold.
        design: Whitened columns.
        prior: Standard deviations of the parameters beforehand, (p,).
        target: Whitened target, (n, 3).
        grams, moments: Sums of products of prior-scaled columns, (folds, p, p) and
            (folds, p).
    """

    rows: tuple[NDArray[np.int64], ...]
    design: DesignMatrix
    prior: Floats
    target: Floats
    grams: Floats
    moments: Floats

    @classmethod
    def of(
        cls, design: DesignMatrix, prior: Floats, y: Floats, fold: NDArray[np.int64]
    ) -> Folds:
        """Cut rows into folds.

        Args:
            design: Whitened columns of n rows.
            prior: Standard deviations of the parameters beforehand, (p,).
            y: Whitened target, (3 n,).
            fold: Fold of every row, (n,).
        """
        rows = tuple(np.flatnonzero(fold == k) for k in np.unique(fold))
        target, square = y.reshape(-1, 3), np.outer(prior, prior)
        grams = np.stack([design[r].gram() * square for r in rows])
        moments = np.stack([design[r].moment(target[r]) * prior for r in rows])
        return cls(rows, design, prior, target, grams, moments)

    @classmethod
    def of_fit(cls, fit: Fit, fold: NDArray[np.int64]) -> Folds:
        """Cut the rows of a fit into folds; its noise and prior scales are kept.

        All rows of a pose are in one fold.
        """
        fold = whole_poses(fold, fit.pose)
        return cls.of(fit.whitened, fit.prior_std, fit.target, fold)

    def errors(self, without: slice = slice(0)) -> tuple[Floats, Floats]:
        """Predict every fold from the others; return what is left, (n, 3).

        Args:
            without: Columns that are in question.

        Returns:
            With all columns, and without these.
        """
        gram = self.grams.sum(axis=0) + np.eye(len(self.prior))
        moment = self.moments.sum(axis=0)
        left = np.empty_like(self.target), np.empty_like(self.target)
        for k, rows in enumerate(self.rows):
            both = _with_and_without(
                gram - self.grams[k], moment - self.moments[k], without
            )
            for out, p in zip(left, both, strict=True):
                out[rows] = self.target[rows] - self.design[rows].times(self.prior * p)
        return left

    def solve(self) -> Iterator[tuple[NDArray[np.int64], Floats, Floats]]:
        """Fit all others than each fold: its rows, values and covariance, (p, p)."""
        gram = self.grams.sum(axis=0) + np.eye(len(self.prior))
        moment = self.moments.sum(axis=0)
        for k, rows in enumerate(self.rows):
            _, inverse, part = invert_information(gram - self.grams[k])
            values = (inverse if part is None else part) @ (moment - self.moments[k])
            covariance = inverse * np.outer(self.prior, self.prior)
            yield rows, self.prior * values, covariance

    def variance(self) -> Floats:
        """Say how unsure every fold is of what the others tell of it, (n, 3)."""
        out = np.empty_like(self.target)
        for rows, _, covariance in self.solve():
            out[rows] = self.design[rows].variance(covariance)
        return out


def _with_and_without(
    gram: Floats, moment: Floats, part: slice
) -> tuple[Floats, Floats]:
    """Solve normal equations for all parameters, and with some of them at 0.

    With C the inverse, the others are p - C_k (C_kk)^-1 p_k where those k are 0.
    """
    _, inverse, told = invert_information(gram)
    if told is None:
        p = inverse @ moment
        own = inverse[:, part]
        return p, p - own @ np.linalg.solve(own[part], p[part])
    others = np.delete(np.arange(len(moment)), part)
    _, inverse, some = invert_information(gram[np.ix_(others, others)])
    less = np.zeros_like(moment)
    less[others] = (inverse if some is None else some) @ moment[others]
    return told @ moment, less


# The noise floor: how large the error of one measured row is at best.

ENOUGH = 5  # repeats beyond the first that give an estimate
LENGTH = float(np.sqrt(8 / (3 * np.pi)))  # mean length over its root mean square
ISO_RP = 3.615  # RP of ISO 9283 over the standard deviation per axis, round scatter


@dataclass(frozen=True)
class NoiseFloor:
    """Mean length of the error that measuring and arriving make by themselves [m]."""

    size: float
    source: str
    measured: bool = True  # by other than these rows' own fit


def noise_floor(fit: Fit, tracker_known: bool) -> NoiseFloor:
    """Take the noise floor from repeats, else from data sheets, else from the fit.

    Args:
        fit: A fit of the rows.
        tracker_known: Whether the cell says where the tracker stands.
    """
    same = repeats(fit.batch)
    count = sum(len(rows) - 1 for rows in same)
    if count >= ENOUGH:
        square = sum(
            float(((fit.error[r] - fit.error[r].mean(axis=0)) ** 2).sum()) for r in same
        )
        size = LENGTH * float(np.sqrt(square / count))
        return NoiseFloor(size, f"repeated poses ({count} repeats)")
    if tracker_known:
        sheet = Noise(1.0, 0.0, fit.noise.origin)
        tracker = sheet.tracker_std(fit.position)
        arrival = fit.batch.arm.repeatability / ISO_RP
        size = LENGTH * float(np.sqrt(3 * (arrival**2 + (tracker**2).mean())))
        return NoiseFloor(size, "tracker and repeatability of the data sheets")
    of_stops = replace(fit.noise, pose_joint=0.0, pose=0.0)
    variance = 3.0 * fit.whitener.read_variance(of_stops)
    return NoiseFloor(
        LENGTH * float(np.sqrt(variance)), "estimated from the rows", False
    )


def repeats(batch: ArmStates) -> list[NDArray[np.int64]]:
    """Group the rows that went to one pose in the same way."""
    s = batch.states
    key = np.column_stack([poses_of(s), s.direction, s.tool_id])
    _, label = np.unique(key, axis=0, return_inverse=True)
    return _several(label)


def sides(batch: ArmStates) -> list[list[NDArray[np.int64]]]:
    """Group the rows of one pose by the side that they came from, if several."""
    s = batch.states
    pose = np.column_stack([poses_of(s), s.tool_id])
    _, label = np.unique(pose, axis=0, return_inverse=True)
    out = []
    for rows in _several(label):
        _, side = np.unique(s.direction[rows], axis=0, return_inverse=True)
        side = side.reshape(-1)
        if side.max() > 0:
            out.append([rows[side == k] for k in range(int(side.max()) + 1)])
    return out


def _several(label: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """List the rows of every label that has more than one."""
    label = label.reshape(-1)
    order = np.argsort(label, kind="stable")
    cuts = np.flatnonzero(np.diff(label[order])) + 1
    return [rows for rows in np.split(order, cuts) if len(rows) > 1]


def multi_directional(batch: ArmStates, error: Floats) -> float | None:
    """Compute vAP, the multi-directional pose accuracy variation of ISO 9283 [m].

    At every pose that is visited from several sides: the largest distance between the
    mean positions of two sides. Returns the mean over the poses, or None.
    """
    poses = sides(batch)
    if not poses:
        return None
    apart = []
    for pose in poses:
        centres = np.array([error[rows].mean(axis=0) for rows in pose])
        apart.append(variation(centres))
    return float(np.mean(apart))
