"""The methods of the source, as models that predict like ours.

They know nothing of noise, covariance or geometry; their standard error is what ten
folds of cross-validation leave.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from postproc.accuracy.fit import fit_effects
from postproc.accuracy.measurement import Measurements
from postproc.arrays import Floats
from postproc.model.combination import Combination
from postproc.model.effects import elm, maps
from postproc.model.effects.effect import Effect
from postproc.model.effects.elm import HiddenLayer
from postproc.model.effects.geometry import Geometry
from postproc.model.effects.maps import Interpolation
from postproc.model.kinematics import Batch
from postproc.model.model import Method, Model, Ranges
from postproc.model.noise import Noise
from postproc.robot.arm import Arm
from postproc.robot.pose import MM

Trained = tuple[tuple[Effect, ...], Floats]
Trainer = Callable[[Batch, Floats, int], Trained]

NEURONS = 40
FOLDS = 10


def _elm(directions: bool) -> Trainer:
    """Make the trainer of an ELM with or without arrival directions."""

    def train(batch: Batch, error: Floats, seed: int) -> Trained:
        """Fit the output weights by the pseudo-inverse."""
        layer = HiddenLayer.draw(batch.states, NEURONS, seed, directions)
        return (elm.ElmMap(layer),), elm.train(layer, batch.states, error)

    return train


def _interpolation(batch: Batch, error: Floats, seed: int) -> Trained:
    """Keep the measured errors at their nominal places."""
    return (Interpolation.through(batch.walk.tcp),), error.reshape(-1)


def _kinematic_elm(batch: Batch, error: Floats, seed: int) -> Trained:
    """Fit the geometry, then an ELM of the joint angles to what is left."""
    geometry = Geometry.propose(batch.arm, batch.states)
    fitted = fit_effects(batch, batch.walk.tcp + error, (geometry,))
    effects, weights = _elm(directions=False)(batch, fitted.residual, seed)
    return (geometry, *effects), np.concatenate([fitted.values, weights])


def _kriging(batch: Batch, error: Floats, seed: int) -> Trained:
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
    """Fit a method of the source to a survey in the base frame."""
    batch = Batch(arm, survey.states)
    error = survey.position - batch.walk.tcp
    effects, values = TRAINERS[method](batch, error, seed)
    combination = Combination(effects)
    left = np.linalg.norm(error - combination.error(batch, values), axis=1) / MM
    model = Model(
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
    )
    return replace(model, spread=_spread(method, batch, error, seed))


def _spread(
    method: Method, batch: Batch, error: Floats, seed: int
) -> tuple[float, float, float]:
    """Root mean square per axis of what cross-validation leaves [m]."""
    n = len(batch)
    fold = np.random.default_rng(seed).permutation(np.arange(n) % min(FOLDS, n))
    left = np.zeros((n, 3))
    for k in range(min(FOLDS, n)):
        inside = np.flatnonzero(fold != k)
        outside = np.flatnonzero(fold == k)
        if len(inside) == 0:
            return (np.inf, np.inf, np.inf)
        train = Batch(batch.arm, batch.states[inside])
        effects, values = TRAINERS[method](train, error[inside], seed)
        test = Batch(batch.arm, batch.states[outside])
        left[outside] = error[outside] - Combination(effects).error(test, values)
    x, y, z = np.sqrt((left**2).mean(axis=0))
    return float(x), float(y), float(z)
