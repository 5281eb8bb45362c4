"""How much less sure a fit is of poses unlike those that it has seen.

The covariance of a fit is right where its effects are the causes. Real arms have more
causes than a fit has effects: what it takes for certain is then the best description of
the poses that were measured, and another campaign visits others. Regions of joint space
that are left out, and predicted from all others, tell how wrong that is.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.diagnosis.held_out import Folds, regions
from postproc.calibration.regression import Fit

LEAST_ROWS = 100
CLEARLY = 10.0  # nats that a wider variance must be worth
STRAY = 5.0  # sigma beyond which a reading tells no more
LOG_WIDEST = float(np.log(100.0))
TRIED = 47


def widening(fit: Fit) -> float:
    """Estimate the factor on the covariance of a fit that holds for other regions.

    With r what a region is left by a fit of all others, in units of the noise, and V
    the variance that this fit states, r is taken as N(0, 1 + s V), s most likely. It is
    1 where s is not clearly larger: rows without other causes ask for none.

    Args:
        fit: The fit.
    """
    used = fit.rows.weight > 0
    if used.sum() < LEAST_ROWS:
        return 1.0
    folds = Folds.of_fit(fit, regions(fit.batch.states.q))
    left, stated = folds.errors()[0][used], folds.variance()[used]
    scale = np.exp(np.linspace(0.0, LOG_WIDEST, TRIED))
    found = np.array([_log_likelihood(left, 1.0 + s * stated) for s in scale])
    best = int(found.argmax())
    return float(scale[best]) if found[best] > found[0] + CLEARLY else 1.0


def _log_likelihood(left: Floats, variance: Floats) -> float:
    """Give the log density of what is left, up to a constant; strays count as far."""
    square = np.minimum(left**2 / variance, STRAY**2)
    return -0.5 * float((np.log(variance) + square).sum())
