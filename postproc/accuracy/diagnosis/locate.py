"""Residuals seen from where they may live: a joint, a covariate, an order per turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.accuracy.diagnosis.candidate import Candidate
from postproc.accuracy.diagnosis.projection import Projection
from postproc.accuracy.fitted import Fit
from postproc.arrays import Floats
from postproc.model.covariate import covariate, unit
from postproc.model.effects.effect import Effect
from postproc.model.kinematics import Batch
from postproc.robot.pose import MM

LARGEST_ORDER = 60
OVERSAMPLED = 4  # orders tried per resolvable one


@dataclass(frozen=True, eq=False)
class Profile:
    """A residual along one direction against one covariate, before and after.

    Attributes:
        label, unit: The covariate; angles in degrees.
        values: (n,).
        direction: What the residual is read as, with its unit.
        before, after: Residual without and with the effect, (n,).
        lever: Millimetres of the TCP per unit of that residual, (n,).
    """

    label: str
    unit: str
    values: Floats
    direction: str
    before: Floats
    after: Floats
    lever: Floats


def profile(fit: Fit, place: int, candidate: Candidate) -> Profile:
    """Show an effect of a fit as its residual, with and without it.

    Args:
        fit: The fit with the effect.
        place: Place of the effect.
        candidate: The candidate that it was.
    """
    part = fit.combination.slices[place]
    moved = fit.columns[:, :, part] @ fit.values[part]
    joint = candidate.family.joint
    if joint is None:
        axis = moved / np.maximum(np.linalg.norm(moved, axis=1, keepdims=True), 1e-12)
        direction, scale = "along the effect [mm]", 1.0 / MM
        weight = np.ones(len(axis))
    else:
        axis = fit.batch.jacobian[:, :, joint - 1]
        direction, scale = f"joint {joint} [mrad]", 1e3
        weight = np.maximum((axis**2).sum(axis=1), 1e-9)
    effect = fit.combination.effects[place]
    if joint is not None and odd(effect, fit.batch):
        axis = axis * fit.batch.states.direction[:, joint - 1, None]
        direction = f"lambda x {direction}"
    seen = [
        scale * np.einsum("ni,ni->n", axis, r) / weight
        for r in (fit.residual + moved, fit.residual)
    ]
    name = candidate.source.split(" x ")[0]
    values, what = covariate(fit.batch, name), unit(name)
    if what == "rad":
        values, what = np.degrees(values), "deg"
    if what == "log rad":
        values, what = np.degrees(np.exp(values)), "deg"
    lever = np.sqrt(weight) / (scale * MM)
    return Profile(name, what, values, direction, seen[0], seen[1], lever)


def odd(effect: Effect, batch: Batch) -> bool:
    """Tell whether an effect turns round with the direction of arrival."""
    turned = batch.states.with_(direction=-batch.states.direction)
    there, back = effect.columns(batch), effect.columns(Batch(batch.arm, turned))
    return bool(np.allclose(there, -back) and np.any(there))


@dataclass(frozen=True, eq=False)
class Periodogram:
    """How much of a residual waves of one joint's angle would explain.

    Attributes:
        joint: Joint 1 to 6.
        orders: Waves per turn, (k,).
        power: Half of the fall of chi-square that a wave brings, (k,): about 1 where
            there is nothing.
    """

    joint: int
    orders: Floats
    power: Floats


def periodogram(projection: Projection, joint: int) -> Periodogram:
    """Compute the periodogram of a filtered residual in one joint's direction."""
    at = projection.at
    q = at.states.q[:, joint - 1]
    step = 2 * np.pi / max(float(np.ptp(q)), 0.1) / OVERSAMPLED
    orders = np.arange(1.0, LARGEST_ORDER, max(step, 0.05))
    axis = at.jacobian[:, :, joint - 1]
    waves = np.stack([np.sin(np.outer(q, orders)), np.cos(np.outer(q, orders))], axis=2)
    raw = axis[:, :, None] * waves.reshape(len(q), 1, -1)
    B = projection.filter(projection.fit.whiten(raw))
    B = B.reshape(len(B), len(orders), 2)
    gram = np.einsum("rok,rol->okl", B, B)
    along = np.einsum("rok,r->ok", B, projection.rest)
    size = np.trace(gram, axis1=1, axis2=2)[:, None, None]
    solved = np.linalg.solve(gram + 1e-6 * size * np.eye(2), along[:, :, None])[:, :, 0]
    return Periodogram(joint, orders, 0.5 * (along * solved).sum(axis=1))
