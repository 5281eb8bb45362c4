"""How far off errors may be: parameters are not known exactly, nor are all sides.

A covariance of n errors is kept as (n, 6): xx, yy, zz, then xy, xz, yz.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats, any_in_rows
from postproc.model.effect_sum import Combination
from postproc.model.kinematics import ArmStates

ROWS, COLUMNS = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)  # of a covariance


def covariance_of(parts: Floats) -> Floats:
    """Sum the covariances of independent parts of unit variance, (n, 3, k) -> (n, 6).

    >>> covariance_of(np.array([[[1.0], [2.0], [0.0]]]))
    array([[1., 4., 0., 2., 0., 0.]])
    """
    out: Floats = np.einsum("nik,nik->ni", parts[:, ROWS], parts[:, COLUMNS])
    return out


def covariance_times(covariance: Floats, vectors: Floats) -> Floats:
    """Multiply covariances (n, 6) with vectors (n, 3): (n, 3).

    >>> covariance_times(np.array([[1.0, 2, 3, 4, 5, 6]]), np.array([[1.0, 0, 0]]))
    array([[1., 4., 5.]])
    """
    (a, b, c, d, e, f), (x, y, z) = covariance.T, vectors.T
    turned = a * x + d * y + e * z, d * x + b * y + f * z, e * x + f * y + c * z
    return np.stack(turned, axis=1)


def spread_covariance(columns: Floats, covariance: Floats) -> Floats:
    """Return the covariance of columns times uncertain factors, (n, 6).

    Args:
        columns: (n, 3, p).
        covariance: Of the factors, (p, p).
    """
    rows = columns.T.reshape(columns.shape[2], -1)  # one large product
    weighed = (covariance @ rows).reshape(columns.T.shape).T
    out: Floats = np.einsum("nip,nip->ni", weighed[:, ROWS], columns[:, COLUMNS])
    return out


def parameter_covariance(
    effects: Combination, at: ArmStates, covariance: Floats
) -> Floats:
    """Return the covariance that uncertain parameters give, (n, 6) [m^2].

    Args:
        effects: The effects.
        at: n states, with the kinematics taken at the parameters.
        covariance: Of the parameters, (p, p).
    """
    return spread_covariance(effects.columns(at), covariance)


def parameter_variance(
    effects: Combination, at: ArmStates, covariance: Floats
) -> Floats:
    """Return the variance that uncertain parameters give, (n, 3) [m^2]."""
    return parameter_covariance(effects, at, covariance)[:, :3]


def side_covariance(effects: Combination, at: ArmStates, values: Floats) -> Floats:
    """Return the covariance that unknown directions give, (n, 6) [m^2]."""
    unknown = 1.0 - np.clip(at.states.direction, -1.0, 1.0) ** 2
    out = np.zeros((len(at), 6))
    rows = np.flatnonzero(any_in_rows(unknown > 0.0))
    if len(rows):
        slopes = effects.direction_slopes(at[rows], values)
        out[rows] = covariance_of(slopes * np.sqrt(unknown[rows])[:, None])
    return out


def side_variance(effects: Combination, at: ArmStates, values: Floats) -> Floats:
    """Return the variance that unknown directions give, (n, 3) [m^2]."""
    return side_covariance(effects, at, values)[:, :3]


def beyond_variance(effects: Combination, at: ArmStates, prior_std: Floats) -> Floats:
    """Variance that free forms may have beyond the surveyed ranges, (n, 3) [m^2].

    Args:
        effects: The effects.
        at: n states, with the kinematics taken at the parameters.
        prior_std: Prior standard deviations of the parameters, (p,).
    """
    out = np.zeros((len(at), 3))
    for effect, part in zip(effects.effects, effects.slices, strict=True):
        turned = effect.beyond(at, prior_std[part])
        if turned is not None and turned.any():
            out += np.einsum("nij,nj->ni", at.jacobian**2, turned)
    return out


def moment_variance(effects: Combination, at: ArmStates, values: Floats) -> Floats:
    """Variance that an unknown moment of the survey gives, (n, 3) [m^2]."""
    out = np.zeros((len(at), 3))
    for effect, part in zip(effects.effects, effects.slices, strict=True):
        spread = effect.moment_variance(at, values[part])
        if spread is not None:
            out += spread
    return out


def unknown_variance(effects: Combination, at: ArmStates) -> Floats:
    """Variance that what no row of the survey shows gives, (n, 3) [m^2]."""
    out = np.zeros((len(at), 3))
    for effect in effects.effects:
        unknown = effect.unknown_variance(at)
        if unknown is not None:
            out += unknown
    return out
