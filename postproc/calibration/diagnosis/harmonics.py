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

import numpy as np
from scipy.linalg import solve_triangular
from scipy.sparse import csr_array

from postproc.arrays import Bools, Floats, Ints
from postproc.calibration.diagnosis.candidates import (
    ROUNDED,
    Projection,
    ReducedCandidates,
)
from postproc.calibration.diagnosis.held_out import compare_held_out
from postproc.calibration.diagnosis.score import (
    SIGNALS,
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
from postproc.model.effects.effect import NAMED, Candidate, Family
from postproc.model.effects.transmission import FIRST_FREE, Orders, Transmission

FINER = 0.25  # step of the orders, in what the range of the joint resolves
NARROWED = (1.0, 0.25, 0.0625)  # steps round the best order that are tried
GATHERED = 0.5  # of a wave's phase, between angles that many rows are gathered at
MOST = 8  # waves of a joint
FASTEST = 120.0  # turns of a motor a turn: twice that and more is asked for
STRETCHES = 6  # of a joint's range, with as many rows each
HELD = 0.5  # share of what a wave explains that it must explain from other stretches


def name_waves(found: Search) -> Search:
    """Take waves out of the maps that a search's fit holds, and name them.

    What was added before is looked at again: a map may have nothing left to explain.
    """
    whole = Projection.of(found.fit)
    least = found.null.threshold(LEVEL)
    scores = [s for j in JOINTS for s in waves_of(whole, j, least)]
    grown = _with(found, scores) if scores else found
    return settle(grown, 0) if grown is not found and found.additions else grown


def _with(found: Search, scores: Sequence[Score]) -> Search:
    """Fit waves together with all else; keep those that predict held-out rows."""
    effects = found.fit.combination.effects
    fit = with_effects(found.fit, [*effects, *(s.best.effect for s in scores)])
    gains = [
        compare_held_out(fit, len(effects) + k, s.best) for k, s in enumerate(scores)
    ]
    kept = [
        Addition(s, found.null.p_of(s), gain)
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


def waves_of(whole: Projection, joint: int, least: float) -> list[Score]:
    """Find the waves in the map of a joint, from 1, the clearest first.

    Args:
        whole: A fit; without a map of the joint there are none.
        joint: The joint.
        least: Evidence that each must have [nats].
    """
    known = fine_parameters(whole.fit, joint)
    angle = whole.at.states.q[:, joint - 1]
    told = Orders.of(angle, FASTEST)
    step = FINER * 2.0 * np.pi / told.covered
    orders = np.arange(FIRST_FREE, told.told, step)
    if len(known) == 0 or len(orders) < 2:
        return []
    pursuit, out = MatchingPursuit.of(whole, joint, known, orders), list[Score]()
    for _ in range(MOST):
        best = pursuit.best()
        if best is None or best.evidence <= least:
            break
        order = best.best.effect.nonlinear()["order"][0]
        seen = pursuit.filter_wave(order)
        if pursuit.everywhere(seen):
            out.append(best)
        pursuit = pursuit.without(order, seen)
    return out


def fine_parameters(fit: Fit, joint: int) -> Ints:
    """Number the parameters of a fit that map a joint finely, (k,)."""
    parts = zip(fit.combination.effects, fit.combination.slices, strict=True)
    found = [part.start + effect.fine(joint) for effect, part in parts]
    return np.concatenate(found).astype(np.int64)


@dataclass(frozen=True, eq=False)
class Along:
    """Filtered rows along the axis of a joint, as numbers at its angles.

    The columns of a wave are f(theta) times the whitened axis: their product with
    anything is a sum of f times numbers, one at the angle of every row.

    Attributes:
        angle: Of the joint, (m,) [rad].
        square: Of the whitened axis: for products of two waves, (m,).
        model: U of `Projection` without the map, and of waves that are taken, (m, k).
        curves: Columns of the map, filtered twice, (m, c).
        rows: The rows, filtered twice, (m,).
    """

    angle: Floats
    square: Floats
    model: Floats
    curves: Floats
    rows: Floats

    def gather_rows(self, step: float) -> Along:
        """Gather rows at angles of an even grid, where these are far fewer.

        f(theta) is interpolated between four angles, and each takes its share of the
        numbers of a row (error: 0.02 (order step)^4).
        """
        low = float(self.angle.min())
        count = int(np.ptp(self.angle) / step) + 4
        if 2 * count > len(self.angle):
            return self
        place, t = np.divmod((self.angle - low) / step, 1.0)
        share = [
            -t * (t - 1) * (t - 2) / 6, (t * t - 1) * (t - 2) / 2,
            -t * (t + 1) * (t - 2) / 2, t * (t * t - 1) / 6,
        ]  # fmt: skip
        at = place.astype(np.int64)[:, None] + np.arange(4)
        starts = 4 * np.arange(len(t) + 1)
        shares = np.stack(share, axis=1).reshape(-1)
        rows = csr_array((shares, at.reshape(-1), starts), (len(t), count)).T
        return Along(
            low + step * np.arange(-1.0, count - 1.0),
            *(rows @ x for x in (self.square, self.model, self.curves, self.rows)),
        )

    def waves(self, orders: Floats) -> Floats:
        """Evaluate sines and cosines, (m, 2 k)."""
        angle = np.outer(self.angle, orders)
        out = np.empty((*angle.shape, 2))
        np.sin(angle, out=out[:, :, 0])
        np.cos(angle, out=out[:, :, 1])
        return out.reshape(len(angle), -1)

    def sums(self, orders: Floats) -> WaveSums:
        """Multiply waves of some orders with the map, each other and the rows."""
        waves = self.waves(orders)
        known = (self.model.T @ waves).reshape(-1, len(orders), 2)
        pairs = waves.reshape(-1, len(orders), 2)
        own = [self.square @ (pairs[:, :, a] * pairs[:, :, b]) for a, b in PAIRS]
        own = [x - (known[:, :, a] * known[:, :, b]).sum(axis=0)
               for x, (a, b) in zip(own, PAIRS, strict=True)]  # fmt: skip
        curves = (self.curves.T @ waves).reshape(-1, len(orders), 2)
        return WaveSums(
            orders, curves, np.stack(own), (self.rows @ waves).reshape(-1, 2)
        )

    def filter_columns(self, waves: Floats) -> Floats:
        """Filter columns of waves (m, k) twice."""
        return self.square[:, None] * waves - self.model @ (self.model.T @ waves)


PAIRS = ((0, 0), (0, 1), (1, 1))  # of sine and cosine


@dataclass(frozen=True, eq=False)
class WaveSums:
    """Products of filtered waves.

    Attributes:
        orders: Of k waves, (k,).
        curves: With the map, (c, k, 2).
        own: Of sine and cosine with themselves, `PAIRS`, (3, k).
        rest: With the rows, (k, 2).
    """

    orders: Floats
    curves: Floats
    own: Floats
    rest: Floats

    def __getitem__(self, some: Bools | slice) -> WaveSums:
        """Return some of the waves."""
        return WaveSums(
            self.orders[some], self.curves[:, some], self.own[:, some], self.rest[some]
        )

    def without(self, curves: Floats, waves: Floats, rest: Floats) -> WaveSums:
        """Take filtered columns of unit length out.

        Args:
            curves: Their products with the map, (c, 2).
            waves: With the waves, (2, k, 2).
            rest: With the rows, (2,).
        """
        own = np.stack(
            [(waves[:, :, a] * waves[:, :, b]).sum(axis=0) for a, b in PAIRS]
        )
        return WaveSums(
            self.orders, self.curves - np.einsum("cu,uki->cki", curves, waves),
            self.own - own, self.rest - np.einsum("u,uki->ki", rest, waves),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class MatchingPursuit:
    """Rows along a joint without its map, and the map's columns.

    Attributes:
        whole: The fit with the map.
        joint: The joint, from 1.
        axis: Whitened, (n, 3) [1/rad].
        along: Rows along it, filtered by the fit without the map and by waves before.
        square: |z|^2 of the filtered rows that are left.
        gram: Products of the map's filtered columns, (c, c).
        moment: Of these and the rows, (c,).
        tried: Waves of all orders that are tried.
        basis: Waves before, filtered by the whole fit and made orthonormal, (3 n, k).
        taken: Orders of waves that were taken before.
    """

    whole: Projection
    joint: int
    axis: Floats
    along: Along
    square: float
    gram: Floats
    moment: Floats
    tried: WaveSums
    basis: Floats
    taken: tuple[float, ...] = ()

    @classmethod
    def of(
        cls, whole: Projection, joint: int, known: Ints, orders: Floats
    ) -> MatchingPursuit:
        """Take a map out of a fit.

        With U r V^T the columns X of all parameters (see `Projection`), the filter
        without the map is I - U M (U M)^T, and the map is U B.

        Args:
            whole: The fit.
            joint: The joint, from 1.
            known: Parameters of its map, (c,).
            orders: Of the waves that are tried, two at least.
        """
        fit, target = whole.fit, whole.fit.target
        M, B = _apart(whole, known)
        size = 1.0 - 1.0 / whole.root**2  # U^T U
        seen, told = M.T @ (size[:, None] * B), whole.taken.T @ target
        left, moment = B - M @ seen, M.T @ told
        axis = fit.whiten(whole.at.jacobian[:, :, joint - 1]).reshape(-1, 3)
        finest = GATHERED / float(orders[-1])
        along = _along(whole, axis, joint, target).gather_rows(finest)
        rows, model = along.rows - along.model @ (M @ moment), along.model @ M
        along = replace(along, model=model, curves=along.model @ left, rows=rows)
        square = float(target @ target - moment @ moment)
        gram, none = B.T @ (size[:, None] * left), np.zeros((len(target), 0))
        rest = B.T @ told - seen.T @ moment
        tried = along.sums(orders)
        waves = [
            wave
            for effect in fit.combination.effects
            if isinstance(effect, Transmission)
            for wave in effect.waves
        ]
        held = tuple({order for j, order in waves if j == joint})
        return cls(
            whole, joint, axis, along, square, gram, rest, tried, none, held
        )  # fmt: skip

    def filter_wave(self, order: float) -> Floats:
        """Filter a wave's columns by the whole fit and by waves before it, (3 n, 2)."""
        angle = order * self.whole.at.states.q[:, self.joint - 1]
        both = np.stack([np.sin(angle), np.cos(angle)], axis=1)
        columns = self.axis[:, :, None] * both[:, None]
        own = self.whole.filter(columns.reshape(-1, 2))
        return own - self.basis @ (self.basis.T @ own)

    def everywhere(self, own: Floats) -> bool:
        """Tell whether a wave runs all along the joint, in one phase.

        Its size found in all parts of the joint's range but one must explain what it
        explains in that one: a step or a spot that no map resolves is a sum of waves
        too, but in its own place only.

        Args:
            own: Its columns, see `seen`.
        """
        rest = self.whole.rest - self.basis @ (self.basis.T @ self.whole.rest)
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

    def best(self) -> Score | None:
        """Find the best wave of the orders tried, refined, and the evidence of a wave.

        None where the evidence has no peak: it grows towards orders that nobody tried.
        """
        orders = self.tried.orders
        far = self._far(orders)
        gain = self._gains(self.tried[far])
        inner = _inner(gain)
        free, gain = orders[far][inner], gain[inner]
        if len(free) == 0:
            return None
        share = -float(np.log(len(orders)))
        top = float(gain.max())
        evidence = top + share + float(np.log(np.exp(gain - top).sum()))
        order, top = self._refine_order(
            float(free[np.argmax(gain)]), orders[1] - orders[0]
        )
        family = Family(Transmission.name, self.joint, None, NAMED)
        effect = Transmission(((self.joint, order),))
        candidate = Candidate(family, effect, f"joint {self.joint}", share)
        # A wave alone is tested against the rows without the map.
        wave = self.along.sums(np.array([order]))
        blocks = _reduce_waves(wave.own, wave.rest)
        p_value = float(score_p_value(blocks, self.square, self.whole.rows)[0])
        return Score(family, evidence, candidate, top, p_value)

    def _refine_order(self, order: float, step: float) -> tuple[float, float]:
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

    def _far(self, orders: Floats) -> Bools:
        """Mark orders that are told from those taken before."""
        apart = np.abs(orders[:, None] - np.array(self.taken)[None, :])
        step = float(orders[1] - orders[0]) / FINER
        return np.asarray((apart > 0.5 * step).all(axis=1))

    def gains(self, orders: Floats) -> Floats:
        """Return what each order gains over the map alone [nats], (k,)."""
        return self._gains(self.along.sums(orders))

    def _gains(self, waves: WaveSums) -> Floats:
        """Return the same, their products known: all scales of the map at once."""
        size, turn = np.linalg.eigh(self.gram)
        size, moment = np.maximum(size, 0.0), turn.T @ self.moment
        s2 = np.array([0.0, *SIGNALS]) / max(float(size.max(initial=0.0)), 1e-300)
        shrunk = s2[:, None] / (1.0 + np.outer(s2, size))
        left = self.square - shrunk @ moment**2
        cost = 0.5 * np.log1p(np.outer(s2, size)).sum(axis=1)
        alone = -0.5 * self.whole.rows * np.log(left / self.square) - cost
        # A larger map beside a wave is a finer map, no wave.
        falls = np.flatnonzero(np.diff(alone) < 0)
        some = slice(int(falls[0]) + 1 if len(falls) else len(s2))
        shrunk, left, alone = shrunk[some], left[some], alone[some]
        curves = np.tensordot(turn.T, waves.curves, 1)
        squares = [curves[:, :, a] * curves[:, :, b] for a, b in PAIRS]
        both = zip(waves.own, squares, strict=True)
        own: Floats = np.stack([x - shrunk @ y for x, y in both])
        rest = waves.rest - np.tensordot(shrunk * moment, curves, 1)
        blocks = _reduce_waves(own.reshape(3, -1), rest.reshape(-1, 2))
        square = np.repeat(left, len(waves.orders))[:, None]
        beside = log_evidence(blocks, square, self.whole.rows)
        gain = alone[:, None] + beside.reshape(len(alone), -1) - alone[-1]
        return np.asarray(gain.max(axis=0))

    def without(self, order: float, own: Floats) -> MatchingPursuit:
        """Take a wave out of the rows and of all columns, whatever its size.

        With u the wave's columns made orthonormal under the filter and v = F F u, what
        is left of the product of columns x and y is x . F F y - (v . x) (v . y).

        Args:
            order: Its order.
            own: Its columns, see `seen`.
        """
        waves = self.along.waves(np.array([order]))
        once = self.along.filter_columns(waves)
        root = np.linalg.cholesky(waves.T @ once)
        u, v = (solve_triangular(root, x.T, lower=True).T for x in (waves, once))
        curves, rest = self.along.curves.T @ u, self.along.rows @ u
        along = replace(
            self.along,
            model=np.concatenate([self.along.model, v], axis=1),
            curves=self.along.curves - v @ curves.T,
            rows=self.along.rows - v @ rest,
        )
        others = (v.T @ along.waves(self.tried.orders)).reshape(2, -1, 2)
        basis = np.concatenate([self.basis, np.linalg.qr(own)[0]], axis=1)
        return replace(
            self, along=along, square=self.square - float(rest @ rest),
            gram=self.gram - curves @ curves.T, moment=self.moment - curves @ rest,
            tried=self.tried.without(curves, others, rest), basis=basis,
            taken=(*self.taken, order),
        )  # fmt: skip


def _apart(whole: Projection, known: Ints) -> tuple[Floats, Floats]:
    """Write the model without some parameters, and these, as mixtures of its U.

    Returns:
        M (k, l), so that U M is the U of the model without them, and B (k, c).
    """
    mixed = whole.root[:, None] * whole.axes.T
    out = np.zeros(mixed.shape[1], dtype=bool)
    out[known] = True
    others = whole.axes[~out]
    size, turn = np.linalg.eigh((others * (whole.root**2 - 1.0)) @ others.T)
    told = size > ROUNDED * len(size) * float(size.max(initial=0.0))
    M: Floats = mixed[:, ~out] @ (turn[:, told] / np.sqrt(1.0 + size[told]))
    return M, mixed[:, out]


def _along(whole: Projection, axis: Floats, joint: int, target: Floats) -> Along:
    """See the rows and U of a whole fit along an axis, neither filtered."""
    by_row = whole.taken.reshape(len(axis), 3, -1)
    model = (axis[:, None] @ by_row)[:, 0]
    rows = np.einsum("nk,nk->n", axis, target.reshape(-1, 3))
    angle = whole.at.states.q[:, joint - 1]
    square = np.einsum("nk,nk->n", axis, axis)
    return Along(angle, square, model, model[:, :0], rows)


def _inner(gain: Floats) -> slice:
    """Leave out what rises towards either end: a peak there is none.

    >>> _inner(np.array([3.0, 1.0, 2.0, 1.0, 4.0]))
    slice(1, 4, None)
    """
    rises, falls = (np.flatnonzero(sign * np.diff(gain) > 0) for sign in (1, -1))
    if len(rises) == 0 or len(falls) == 0:
        return slice(0)
    return slice(int(rises[0]), int(falls[-1]) + 2)


def _reduce_waves(own: Floats, rest: Floats) -> ReducedCandidates:
    """Reduce waves, own (3, k) and rest (k, 2), to what their evidence needs."""
    middle, half = (own[0] + own[2]) / 2.0, (own[0] - own[2]) / 2.0
    apart, turn = np.hypot(half, own[1]), np.arctan2(own[1], half) / 2.0
    size = np.stack([middle + apart, middle - apart], axis=1)
    cos, sin = np.cos(turn), np.sin(turn)
    along = np.stack(
        [cos * rest[:, 0] + sin * rest[:, 1], cos * rest[:, 1] - sin * rest[:, 0]], 1
    )
    return ReducedCandidates((), np.maximum(size, 0.0), along[:, :, None])
