"""Naming waves that a map of a joint holds: a gear's teeth instead of many knots.

A map that is fitted takes up every wave that its knots resolve, and a search that looks
at what is left finds none of them. So the map is taken out of the model and put beside
each wave again, its prior scale found anew: with map M of scale s and wave W of order k

    gain(k) = max_s [log E(M; s) + log E(W | M; s)] - max_s log E(M; s),

the evidence of `score`. A true wave makes the map smaller, or is finer than the map
resolves, and pays for itself; a map that must grow beside it tells of no wave. Waves
that are taken go out of the rows, and the next is looked for, until none is called for;
the map keeps the rest. A wave must run all along the joint, and predict held-out rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular

from postproc.arrays import Floats, Ints
from postproc.calibration.diagnosis.held_out import held_out_gain
from postproc.calibration.diagnosis.library import (
    Projection,
    ReducedCandidates,
    View,
)
from postproc.calibration.diagnosis.score import (
    SIGNALS,
    Null,
    Score,
    log_evidence,
    score_p_value,
)
from postproc.calibration.diagnosis.search import (
    HARDLY,
    LEVEL,
    OFFSETS,
    Addition,
    Search,
    settle,
    with_effects,
)
from postproc.calibration.regression import Fit
from postproc.model.covariate import JOINTS
from postproc.model.effects.effect import NAMED, Candidate, Effect, Family, JointEffect
from postproc.model.effects.transmission import FIRST_FREE, Orders, Transmission

FINER = 0.25  # step of the orders, in what the range of the joint resolves
NARROWED = tuple(0.5**k for k in range(6))  # steps round the best order that are tried
MOST = 8  # waves of a joint
FASTEST = 120.0  # turns of a motor a turn: twice that and more is asked for
STRETCHES = 6  # of a joint's range, with as many rows each
HELD = 0.5  # share of what a wave explains that it must explain from other stretches


def name_waves(found: Search) -> Search:
    """Take waves out of the maps that a search's fit holds, and name them.

    What was added before is looked at again: a map may have nothing left to explain.
    """
    whole = Projection.of(found.fit)
    scores = [s for j in JOINTS for s in waves_of(whole, j, found.null)]
    grown = _with(found, scores) if scores else found
    return settle(grown, 0) if grown is not found and found.additions else grown


def _with(found: Search, scores: Sequence[Score]) -> Search:
    """Fit waves together with all else; keep those that predict held-out rows."""
    effects = found.fit.combination.effects
    fit = with_effects(found.fit, [*effects, *(s.best.effect for s in scores)])
    gains = [held_out_gain(fit, len(effects) + k, s.best) for k, s in enumerate(scores)]
    kept = [
        Addition(s, found.null.p_value(s.evidence), gain)
        for s, gain in zip(scores, gains, strict=True)
        if gain.sure
    ]
    if not kept:
        return found
    if len(kept) < len(scores):
        named = [a.candidate.effect for a in kept]
        fit = with_effects(found.fit, [*effects, *named])
    additions = (*found.additions, *kept)
    return replace(found, fit=fit, additions=additions, waves=len(kept))


def waves_of(whole: Projection, joint: int, null: Null) -> list[Score]:
    """Find the waves in the map of a joint, from 1, the clearest first.

    Args:
        whole: A fit; without a map of the joint there are none.
        joint: The joint.
        null: Distribution of the largest evidence when there is nothing.
    """
    fit = whole.fit
    known = fine_parameters(fit, joint)
    if len(known) == 0:
        return []
    pursuit = Pursuit.of(whole, joint, known)
    orders, out = pursuit.orders, list[Score]()
    for _ in range(MOST if len(orders) > 1 else 0):
        best = pursuit.best(orders)
        if best is None or null.p_value(best.evidence) > LEVEL:
            break
        if pursuit.everywhere(best.best.effect):
            out.append(best)
        pursuit = pursuit.without(best.best.effect)
    return out


def fine_parameters(fit: Fit, joint: int) -> Ints:
    """Number the parameters of a fit that map a joint finely, (k,)."""
    parts = zip(fit.combination.effects, fit.combination.slices, strict=True)
    found = [part.start + effect.fine(joint) for effect, part in parts]
    return np.concatenate(found).astype(np.int64)


@dataclass(frozen=True, eq=False)
class Pursuit:
    """Rows of a joint without its map, and the map's columns.

    Attributes:
        whole: The fit with the map.
        projection: The fit without the map.
        joint: The joint, from 1.
        view: Rows along the joint, what the model and waves before take with them.
        square: |z|^2 of the filtered rows that are left.
        columns: Of the map, times their prior scales and whitened, (n, k).
        taken: Orders of waves that were taken before.
    """

    whole: Projection
    projection: Projection
    joint: int
    view: View
    square: float
    columns: Floats
    taken: tuple[float, ...] = ()

    @classmethod
    def of(cls, whole: Projection, joint: int, known: Ints) -> Pursuit:
        """Take a map out of a fit.

        Args:
            whole: The fit.
            joint: The joint, from 1.
            known: Parameters of its map, (k,).
        """
        fit = whole.fit
        projection = Projection.leaving(fit, known)
        view = projection.view(joint - 1, projection.twice)
        angles = np.concatenate(
            [
                effect.basis(projection.at)[:, effect.fine(joint)]
                for effect in fit.combination.effects
                if isinstance(effect, JointEffect) and len(effect.fine(joint))
            ],
            axis=1,
        )
        columns = angles * fit.prior_std[known] * view.size[:, None]
        square = float(projection.rest @ projection.rest)
        held = {
            k
            for effect in fit.combination.effects
            if isinstance(effect, Transmission)
            for j, k in effect.waves
            if j == joint
        }
        return cls(whole, projection, joint, view, square, columns, tuple(held))

    @property
    def orders(self) -> Floats:
        """List the orders that are tried, finer than what the range resolves."""
        told = Orders.of(self.whole.at.states.q[:, self.joint - 1], FASTEST)
        step = FINER * 2.0 * np.pi / told.covered
        return np.arange(FIRST_FREE, told.told, step)

    def everywhere(self, effect: Effect) -> bool:
        """Tell whether a wave runs all along the joint, in one phase.

        Its size found in all parts of the joint's range but one must explain what it
        explains in that one: a step or a spot that no map resolves is a sum of waves
        too, but in its own place only.
        """
        own, rest = self._beside(effect)
        angle = self.whole.at.states.q[:, self.joint - 1]
        place = np.argsort(np.argsort(angle)) * STRETCHES // len(angle)
        which = np.repeat(place, 3) == np.arange(STRETCHES)[:, None]
        gram = np.stack([own[w].T @ own[w] for w in which])
        along = np.stack([own[w].T @ rest[w] for w in which])
        grams, alongs = gram.sum(axis=0) - gram, along.sum(axis=0) - along
        size = np.linalg.solve(grams, alongs[:, :, None])[:, :, 0]
        gain = 2 * (along * size).sum() - np.einsum("pi,pij,pj->", size, gram, size)
        whole = along.sum(axis=0)
        every = whole @ np.linalg.solve(gram.sum(axis=0), whole)
        return bool(gain > HELD * every)

    def _beside(self, effect: Effect) -> tuple[Floats, Floats]:
        """Filter a wave's columns and the rows by the fit and by waves before it.

        Returns:
            (3 n, 2) and (3 n,).
        """
        assert isinstance(effect, Transmission)
        before = tuple((self.joint, k) for k in self.taken)
        waves = Transmission((*before, *effect.waves)).columns(self.whole.at)
        seen = self.whole.filter(self.whole.fit.whiten(waves))
        basis, _ = np.linalg.qr(seen[:, :-2])
        own, rest = seen[:, -2:], self.whole.rest
        return own - basis @ (basis.T @ own), rest - basis @ (basis.T @ rest)

    def best(self, orders: Floats) -> Score | None:
        """Find the best wave of some orders, refined, and the evidence of a wave.

        None where the evidence has no peak: it grows towards orders that nobody tried.
        """
        free = orders[self._far(orders)]
        gain = self.gains(free)
        inner = _inner(gain)
        free, gain = free[inner], gain[inner]
        if len(free) == 0:
            return None
        share = -float(np.log(len(orders)))
        top = float(gain.max())
        evidence = top + share + float(np.log(np.exp(gain - top).sum()))
        order, top = self._refined(float(free[np.argmax(gain)]), orders[1] - orders[0])
        family = Family(Transmission.name, self.joint, None, NAMED)
        effect = Transmission(((self.joint, order),))
        candidate = Candidate(family, effect, f"joint {self.joint}", share)
        return Score(family, evidence, candidate, top, self._p_value(order))

    def _refined(self, order: float, step: float) -> tuple[float, float]:
        """Move an order to its peak, or to a whole one that does hardly worse.

        Returns:
            The order, and what it gains [nats].
        """
        for width in NARROWED:
            near = order + width * step * OFFSETS
            gains = self.gains(near)
            order, top = float(near[np.argmax(gains)]), float(gains.max())
        whole = float(round(order))
        plain = float(self.gains(np.array([whole]))[0])
        return (whole, plain) if plain > top - HARDLY else (order, top)

    def _far(self, orders: Floats) -> Floats:
        """Mark orders that are told from those taken before."""
        apart = np.abs(orders[:, None] - np.array(self.taken)[None, :])
        step = float(orders[1] - orders[0]) / FINER
        return np.asarray((apart > 0.5 * step).all(axis=1))

    def gains(self, orders: Floats) -> Floats:
        """Return what each order gains over the map alone [nats], (m,)."""
        waves = self._waves(orders)
        size, turn, along = self._map
        shared = (turn.T @ self._gram(self.columns, waves)).reshape(len(turn), -1, 2)
        blocks = self._blocks(waves)
        rest = (waves.T @ self.view.rows)[:, 0].reshape(-1, 2)
        best, alone = np.full(len(orders), -np.inf), -np.inf
        for signal in (0.0, *SIGNALS):
            s2 = signal / max(float(size.max(initial=0.0)), 1e-300)
            shrunk = s2 / (1.0 + s2 * size)
            left = self.square - float(shrunk @ along**2)
            cost = 0.5 * float(np.log1p(s2 * size).sum())
            here = -0.5 * self.projection.rows * np.log(left / self.square) - cost
            if here < alone:  # a larger map beside a wave is a finer map, no wave
                break
            alone, weighed = here, shared * shrunk[:, None, None]
            gram = blocks - np.einsum("kmi,kmj->mij", shared, weighed)
            moment = rest - np.einsum("kmi,k->mi", weighed, along)
            np.maximum(best, here + self._evidence(gram, moment, left), out=best)
        return np.asarray(best - alone)

    @cached_property
    def _map(self) -> tuple[Floats, Floats, Floats]:
        """Turn the map's columns so that their sums are apart: sizes, turn, moments."""
        size, turn = np.linalg.eigh(self._gram(self.columns, self.columns))
        along = turn.T @ (self.columns.T @ self.view.rows)[:, 0]
        return np.maximum(size, 0.0), turn, along

    def _evidence(self, gram: Floats, moment: Floats, square: float) -> Floats:
        """Compute the evidence of waves from their sums, (m, 2, 2) and (m, 2)."""
        reduced = _reduced(gram, moment)
        rows = self.projection.rows
        return log_evidence(reduced, np.array([square]), rows)[:, 0]

    def _p_value(self, order: float) -> float:
        """Test a wave alone against the rows without the map."""
        waves = self._waves(np.array([order]))
        rest = (waves.T @ self.view.rows)[:, 0].reshape(-1, 2)
        reduced = _reduced(self._blocks(waves), rest)
        return float(score_p_value(reduced, self.square, self.projection.rows)[0])

    def without(self, effect: Effect) -> Pursuit:
        """Take a wave out of the rows and of all columns, whatever its size.

        With u the wave's columns made orthonormal under the filter and v = F F u, what
        is left of the product of columns x and y is x . F F y - (v . x) (v . y).
        """
        assert isinstance(effect, Transmission)
        orders = np.array([k for _, k in effect.waves])
        waves = self._waves(orders)
        root = np.linalg.cholesky(self._gram(waves, waves))
        u = solve_triangular(root, waves.T, lower=True).T
        v = u - self.view.taken @ (self.view.taken.T @ u)
        along = u.T @ self.view.rows
        view = replace(
            self.view,
            taken=np.concatenate([self.view.taken, v], axis=1),
            rows=self.view.rows - v @ along,
        )
        square = self.square - float((along**2).sum())
        taken = (*self.taken, *map(float, orders))
        return replace(self, view=view, square=square, taken=taken)

    def _waves(self, orders: Floats) -> Floats:
        """Make whitened columns of sines and cosines, (n, 2 m)."""
        angle = np.outer(self.projection.at.states.q[:, self.joint - 1], orders)
        both = np.stack([np.sin(angle), np.cos(angle)], axis=2)
        columns: Floats = both.reshape(len(angle), -1) * self.view.size[:, None]
        return columns

    def _gram(self, one: Floats, other: Floats) -> Floats:
        """Sum products of filtered columns, (k, k')."""
        taken = self.view.taken
        return np.asarray(one.T @ other - (one.T @ taken) @ (taken.T @ other))

    def _blocks(self, waves: Floats) -> Floats:
        """Sum products of the two columns of every wave, (m, 2, 2)."""
        pairs = waves.reshape(len(waves), -1, 2)
        taken = (self.view.taken.T @ waves).reshape(-1, pairs.shape[1], 2)
        own = np.einsum("nmi,nmj->mij", pairs, pairs)
        return np.asarray(own - np.einsum("nmi,nmj->mij", taken, taken))


def _inner(gain: Floats) -> slice:
    """Leave out what rises towards either end: a peak there is none.

    >>> _inner(np.array([3.0, 1.0, 2.0, 1.0, 4.0]))
    slice(1, 4, None)
    """
    rises, falls = (np.flatnonzero(sign * np.diff(gain) > 0) for sign in (1, -1))
    if len(rises) == 0 or len(falls) == 0:
        return slice(0)
    return slice(int(rises[0]), int(falls[-1]) + 2)


def _reduced(gram: Floats, moment: Floats) -> ReducedCandidates:
    """Reduce waves to what their evidence needs."""
    size, turn = np.linalg.eigh(gram)
    along = np.einsum("mij,mi->mj", turn, moment)
    return ReducedCandidates((), np.maximum(size, 0.0), along[:, :, None])
