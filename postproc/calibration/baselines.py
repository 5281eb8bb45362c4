"""The five published methods, on the same rows as ours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.calibration.diagnosis.held_out import whole_poses
from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.measurements import Measurements
from postproc.calibration.regression import fit_effects
from postproc.calibration.stops import pool_readings
from postproc.model.effect_sum import Combination
from postproc.model.effects import elm, maps
from postproc.model.effects.effect import Effect
from postproc.model.effects.elm import HiddenLayer
from postproc.model.effects.geometry import Geometry
from postproc.model.effects.maps import Interpolation
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model, weight_of
from postproc.model.model_file import Method
from postproc.model.noise import Noise, poses_of
from postproc.model.validity import Ranges
from postproc.robot.arm import Arm
from postproc.robot.pose import MM
from postproc.robot.state import States
from postproc.threads import in_one_thread

# The methods of the source, as models that predict like ours.
#
# They know nothing of noise, covariance or geometry; their standard error is what ten
# folds of cross-validation leave.

Trained = tuple[tuple[Effect, ...], Floats]
Trainer = Callable[[ArmStates, Floats, int], Trained]

NEURONS = 40
FOLDS = 10


def _elm(directions: bool) -> Trainer:
    """Make the trainer of an ELM with or without arrival directions."""

    def train(batch: ArmStates, error: Floats, seed: int) -> Trained:
        """Fit the output weights by the pseudo-inverse."""
        layer = HiddenLayer.draw(batch.states, NEURONS, seed, directions)
        return (elm.ElmMap(layer),), elm.train(layer, batch.states, error)

    return train


def _interpolation(batch: ArmStates, error: Floats, seed: int) -> Trained:
    """Keep the measured errors at their nominal places."""
    return (Interpolation.through(batch.walk.tcp),), error.reshape(-1)


def _kinematic_elm(batch: ArmStates, error: Floats, seed: int) -> Trained:
    """Fit the geometry, then an ELM of the joint angles to what is left."""
    geometry = Geometry.propose(batch.arm, batch.states)
    fitted = fit_effects(batch, batch.walk.tcp + error, (geometry,))
    effects, weights = _elm(directions=False)(batch, fitted.residual, seed)
    return (geometry, *effects), np.concatenate([fitted.values, weights])


def _kriging(batch: ArmStates, error: Floats, seed: int) -> Trained:
    """Fit a Gaussian process in the modified joint space."""
    effect, values = maps.train(batch.states, error, seed)
    return (effect,), values


TRAINERS: dict[Method, Trainer] = {
    "eja-elm": _elm(directions=True),
    "elm": _elm(directions=False),
    "interpolation": _interpolation,
    "kinematic-elm": _kinematic_elm,
    "kriging": _kriging,
}


def fit_method(method: Method, survey: Measurements, arm: Arm, seed: int) -> Model:
    """Fit a method of the source to a survey in the base frame, and cross-validate."""
    model = train_method(method, survey, arm, seed)
    batch = ArmStates(arm, survey.states)
    error = survey.position - batch.walk.tcp
    return replace(model, spread=_spread(method, batch, error, seed))


def train_method(method: Method, survey: Measurements, arm: Arm, seed: int) -> Model:
    """Fit a method of the source to a survey in the base frame, its spread unknown."""
    batch = ArmStates(arm, survey.states)
    error = survey.position - batch.walk.tcp
    effects, values = TRAINERS[method](batch, error, seed)
    combination = Combination(effects)
    left = np.linalg.norm(error - combination.error(batch, values), axis=1) / MM
    return Model(
        method=method,
        arm_name=arm.name,
        arm_id=arm.id,
        effects=combination,
        values=values,
        covariance=np.zeros((0, 0)),
        prior_std=np.zeros(len(values)),
        noise=Noise(0.0, 0.0),
        ranges=Ranges.of(survey.states),
        rows=len(survey),
        data_sha256=survey.sha256,
        statistics={
            "residual_mean_mm": float(left.mean()),
            "residual_max_mm": float(left.max()),
        },
        weight=weight_of(arm),
    )


def _spread(
    method: Method, batch: ArmStates, error: Floats, seed: int
) -> tuple[float, float, float]:
    """Root mean square per axis of what cross-validation leaves [m]."""
    n = len(batch)
    fold = np.random.default_rng(seed).permutation(np.arange(n) % min(FOLDS, n))
    fold = whole_poses(fold, poses_of(batch.states))
    left = np.zeros((n, 3))
    for k in np.unique(fold):
        inside = np.flatnonzero(fold != k)
        outside = np.flatnonzero(fold == k)
        if len(inside) == 0:
            return (np.inf, np.inf, np.inf)
        train = ArmStates(batch.arm, batch.states[inside])
        effects, values = TRAINERS[method](train, error[inside], seed)
        test = ArmStates(batch.arm, batch.states[outside])
        left[outside] = error[outside] - Combination(effects).error(test, values)
    x, y, z = np.sqrt((left**2).mean(axis=0))
    return float(x), float(y), float(z)


# How far the joints may reach for a method to follow.
#
# A random layer of 40 neurons follows the kinematics in a working volume, not over the
# whole range of the joints: there it leaves more than geometry alone does.

VOLUME_DEG = 40.0  # that the layer follows about as well as a model of the arm


def span_of(states: States) -> tuple[float, ...]:
    """Return how far every joint ranges over some states [deg]."""
    return tuple(float(v) for v in np.rad2deg(np.ptp(states.q, axis=0)))


def too_wide(model: Model, survey: Measurements, arm: Arm) -> tuple[str, ...]:
    """Tell of rows that span more than a published method can follow.

    Beyond a working volume it is what the method leaves of rows that it has not seen
    that counts, against what a fit of the geometry alone leaves.

    Args:
        model: Of a published method.
        survey: The rows that it was fitted to, base frame.
        arm: The arm.
    """
    span = span_of(survey.states)
    if max(span) <= VOLUME_DEG:
        return ()
    batch = ArmStates(arm, survey.states)
    geometry = fit_effects(
        batch, survey.position, (Geometry.propose(arm, batch.states),)
    )
    left = float(np.sqrt((geometry.residual**2).sum(axis=1).mean()))
    unseen = float(np.linalg.norm(model.spread))
    if unseen <= left:
        return ()
    widest = int(np.argmax(span))
    return (
        f"the rows span up to {span[widest]:.0f} deg (joint {widest + 1}), more than "
        f"{model.method} follows: ten folds of cross-validation leave "
        f"{unseen / MM:.3f} mm, geometry alone {left / MM:.3f} mm. Fit rows of one "
        f"working volume (about {VOLUME_DEG:.0f} deg), or use --method full",
    )


# The source's five rows and ours, on the same data and split.

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
    """All methods on one split.

    Attributes:
        rows: A row a method.
        split: Which rows are fitted and which are tested, in words.
        span_deg: How far the joints of the fitted rows range.
    """

    rows: tuple[MethodRow, ...]
    split: str
    span_deg: tuple[float, ...]


def random_split(
    pose: Rows, seed: int, share: float = TRAIN_SHARE
) -> tuple[Rows, Rows]:
    """Split rows at random into training and test rows, each in visit order.

    Args:
        pose: Number of the pose of every row, (n,): no pose is in both.
        seed: Of the random draw.
        share: Of the rows that are training rows, about.
    """
    order = np.random.default_rng(seed).permutation(len(pose))
    test = np.zeros(len(pose), dtype=np.int64)
    test[order[round(share * len(pose)) :]] = 1
    test = whole_poses(test, pose)
    return np.flatnonzero(test == 0), np.flatnonzero(test == 1)


@dataclass(frozen=True)
class Trial:
    """Rows to fit, and others to test on, in the base frame.

    Attributes:
        train, test: The rows.
        tracker: Tracker position in the base frame, (3,) [m], or None.
        truth: True positions of the test rows, (n, 3) [m]; None: as they were measured.
    """

    train: Measurements
    test: Measurements
    tracker: Floats | None = None
    truth: Floats | None = None


def blocks_of(n: int, blocks: int) -> list[tuple[Rows, Rows]]:
    """Cut n rows into blocks in their order: each is tested by a fit of the others."""
    parts = np.array_split(np.arange(n), blocks)
    return [(np.setdiff1d(np.arange(n), part), part) for part in parts]


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
    survey = pool_readings(survey)
    train, test = random_split(poses_of(survey.states), seed)
    trial = Trial(survey[train], survey[test], tracker)
    rows = compare_in([trial], arm, seed)
    return Comparison(rows, random_stated(train, test, seed), span_of(survey.states))


def random_stated(train: Rows, test: Rows, seed: int) -> str:
    """Say how rows were split at random."""
    return (
        f"{len(train)} rows to fit, {len(test)} to test, drawn at random (seed {seed})"
    )


@in_one_thread
def compare_in(trials: Sequence[Trial], arm: Arm, seed: int) -> tuple[MethodRow, ...]:
    """Fit every method in some trials; the errors on all test rows are put together.

    Args:
        trials: What is fitted, and tested.
        arm: The arm.
        seed: Of the random layers.
    """
    left = [errors_in(trial, arm, seed) for trial in trials]
    return tuple(
        _row(method, np.concatenate([errors[method] for errors in left]))
        for method in left[0]
    )


def errors_in(trial: Trial, arm: Arm, seed: int) -> dict[str, Floats]:
    """Return what every method leaves on the test rows, (n, 3) [m], by its name."""
    train, test = trial.train, trial.test
    position = test.position if trial.truth is None else trial.truth
    error = position - ArmStates(arm, test.states).walk.tcp
    left = {"no compensation": error}
    for method in ORDER:
        if method == "full":
            model = model_of(fit_survey(train, arm, None, trial.tracker), train)
        else:
            model = train_method(method, train, arm, seed)
        left[method] = error - model.predict_measured(arm, test.states)
    return left


def _row(method: str, error: Floats) -> MethodRow:
    """Summarise errors (n, 3) [m]."""
    e = np.linalg.norm(error, axis=1) / MM
    low, high = float(e.min()), float(e.max())
    return MethodRow(method, low, high, float(e.mean()), float(e.std()), len(e))
