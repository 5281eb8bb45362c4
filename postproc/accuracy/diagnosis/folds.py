"""Whether a candidate predicts rows that did not fit it.

Rows are cut into short runs along what the question is about: along the visit order for
what passes with time, along the candidate's own covariate for what a joint does. Runs
are dealt to folds, so that a fold's rows have neighbours on both sides only at a
distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from postproc.accuracy.diagnosis.candidate import Candidate
from postproc.accuracy.fitted import Fit
from postproc.arrays import Floats

FOLDS = 10
RUN = 4  # rows of a run


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


@dataclass(frozen=True)
class Gain:
    """Fall of the squared held-out error that a candidate brings, per row.

    Attributes:
        mean: In units of the noise variance.
        std_error: Of the mean, over the rows.
    """

    mean: float
    std_error: float

    @property
    def sure(self) -> bool:
        """Whether it is larger than its standard error."""
        return self.mean > self.std_error


def held_out_gain(fit: Fit, number: int, candidate: Candidate) -> Gain:
    """Compare held-out errors with and without one effect of a fit.

    Args:
        fit: A fit with the effect in it; its noise and prior scales are kept.
        number: Place of the effect in the fit.
        candidate: The candidate that the effect was.
    """
    known = fit.whiten(fit.columns) * fit.prior_std
    target = fit.whiten(fit.residual + fit.columns @ fit.values)
    fold = deal(candidate.driver(fit.batch), FOLDS, seed=0)
    after = held_out_errors(known, target, fold)
    less = np.delete(known, fit.combination.slices[number], axis=1)
    before = held_out_errors(less, target, fold)
    used = fit.rows.weight > 0
    fall = (before**2 - after**2).reshape(-1, 3).sum(axis=1)[used]
    error = float(fall.std() / np.sqrt(max(len(fall), 1)))
    return Gain(float(fall.mean()), error)


def held_out_errors(X: Floats, y: Floats, fold: NDArray[np.int64]) -> Floats:
    """Predict every row from the other folds, prior N(0, I); return y - prediction.

    Args:
        X: Whitened columns times prior standard deviations, (3 n, p).
        y: Whitened target, (3 n,).
        fold: Fold of every row of three, (n,).
    """
    gram, moment = X.T @ X, X.T @ y
    errors = np.empty(len(y))
    for k in range(int(fold.max(initial=0)) + 1):
        out = np.repeat(fold == k, 3)
        if not out.any():
            continue
        rest = gram - X[out].T @ X[out] + np.eye(X.shape[1])
        p = cho_solve(cho_factor(rest), moment - X[out].T @ y[out])
        errors[out] = y[out] - X[out] @ p
    return errors
