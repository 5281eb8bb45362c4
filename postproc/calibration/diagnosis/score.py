"""How strongly candidates are called for, and how strongly by chance alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

from postproc._native import of_blocks
from postproc.arrays import Floats, floats
from postproc.calibration.diagnosis.candidates import (
    Projection,
    ReducedCandidates,
    reduce_some,
)
from postproc.model.effects.effect import PART_MOTION, Candidate, Family

# How strongly a candidate's block of columns is called for.
#
# The evidence of a block is the ratio of marginal likelihoods with and without it, one
# prior scale for the block at its best value and the level of the noise integrated out:
#
#     log E(s) = -1/2 sum_i log(1 + s^2 g_i) - N/2 log(Q(s) / Q(0)),
#     Q(s) = |z|^2 - sum_i s^2 a_i^2 / (1 + s^2 g_i),
#
# g the eigenvalues of its Gram matrix, a its columns times the filtered residual z in
# that eigenbasis, N the number of rows. It charges for columns, so that a spline does
# not beat a sine that fits as well.

SIGNALS = np.exp(np.linspace(-1.0, 14.0, 16))  # s^2 g that are tried
SMALL = 1e-9  # Gram eigenvalues below this share of the largest are no direction
NOTHING_LEFT = 1e-2  # Gram of a block that the model takes up altogether


def log_evidence(blocks: ReducedCandidates, square: Floats, rows: int) -> Floats:
    """Compute the evidence of every block against every draw, (c, draws) [nats].

    Args:
        blocks: Reduced candidates.
        square: |z|^2 of every draw, (draws,), or of each for every block, (c, draws).
        rows: Number of scalar rows N.
    """
    gain, share = blocks.gain, blocks.along**2 / np.atleast_2d(square)[:, None]
    largest = gain.max(axis=1)
    if gain.shape[1] == 1:
        single = np.maximum(largest, 1e-300)[:, None]
        best = _of_one_column(share[:, 0] / single, rows)
    else:
        best = of_blocks(floats(gain), floats(share), SIGNALS, rows)
    best[largest < NOTHING_LEFT] = 0.0
    return best


def _of_one_column(share: Floats, rows: int) -> Floats:
    """Compute the evidence of single columns at its best prior scale [nats].

    With u = s^2 g / (1 + s^2 g) it is 1/2 log(1 - u) - N/2 log(1 - r u), largest at
    u = (N r - 1) / (r (N - 1)).

    Args:
        share: r = a^2 / (g |z|^2), what each explains of every draw.
        rows: Number of scalar rows N.
    """
    r = np.clip(share, 1e-300, 1.0 - 1e-12)
    u = np.clip((rows * r - 1.0) / (r * (rows - 1.0)), 0.0, 1.0 - 1e-12)
    evidence: Floats = 0.5 * np.log1p(-u) - 0.5 * rows * np.log1p(-r * u)
    return evidence


def explain_squares(blocks: ReducedCandidates) -> tuple[Floats, Floats]:
    """Return the squares that blocks explain by least squares, and their ranks.

    Returns:
        (c, draws) and (c,).
    """
    gain = blocks.gain
    kept = gain > SMALL * np.maximum(gain.max(axis=1, keepdims=True), NOTHING_LEFT)
    inverse = np.where(kept, 1.0 / np.where(kept, gain, 1.0), 0.0)
    return np.einsum("ck,ckd->cd", inverse, blocks.along**2), kept.sum(axis=1)


def score_p_value(blocks: ReducedCandidates, square: float, rows: int) -> Floats:
    """Compute the score (F) test of every block against the first draw, (c,)."""
    squares, rank = explain_squares(blocks)
    top = squares[:, 0] / np.maximum(rank, 1)
    under = np.maximum(square - squares[:, 0], 1e-12) / np.maximum(rows - rank, 1)
    return np.asarray(fisher.sf(top / under, np.maximum(rank, 1), rows - rank))


@dataclass(frozen=True)
class Score:
    """What speaks for a family.

    Attributes:
        family: The family.
        evidence: Log evidence averaged over the family's settings [nats].
        best: Its best candidate.
        best_evidence: Log evidence of that one alone.
        p_value: Of the score test of the best one alone.
        law: Of a free curve the best law of the same part and driver, as the table has
            it: a jump between two of its places may explain more.
    """

    family: Family
    evidence: float
    best: Candidate
    best_evidence: float
    p_value: float
    law: Candidate | None = None


def rank(
    reduced: tuple[ReducedCandidates, ...],
    square: float,
    rows: int,
    without: frozenset[str] = frozenset(),
) -> list[Score]:
    """Score families against the first draw, the best first.

    Args:
        reduced: Reduced candidates.
        square: |z|^2.
        rows: Number of scalar rows.
        without: Names of parameters whose candidates are left out.
    """
    found: dict[Family, list[tuple[float, float, Candidate]]] = {}
    for blocks in reduced:
        first = ReducedCandidates(
            blocks.candidates, blocks.gain, blocks.along[:, :, :1]
        )
        each = log_evidence(first, np.array([square]), rows)[:, 0]
        p = score_p_value(first, square, rows)
        for candidate, e, p_one in zip(blocks.candidates, each, p, strict=True):
            if without and not without.isdisjoint(candidate.names):
                continue
            found.setdefault(candidate.family, []).append((e, float(p_one), candidate))
    out = []
    for family, members in found.items():
        e = np.array([m[0] for m in members])
        log_prior = np.array([m[2].log_prior for m in members])
        top = members[int(np.argmax(e + log_prior))]
        weighed = e + log_prior
        total = float(weighed.max() + np.log(np.exp(weighed - weighed.max()).sum()))
        out.append(Score(family, total, top[2], float(top[0]), top[1]))
    return sorted(out, key=lambda s: -s.evidence)


def rank_some(
    projection: Projection,
    candidates: Sequence[Candidate],
    without: frozenset[str] = frozenset(),
) -> list[Score]:
    """Score a few candidates against what a fit leaves, the best family first.

    Args:
        projection: The fit.
        candidates: Of any widths.
        without: As in `rank`.
    """
    square = float(projection.rest @ projection.rest)
    reduced = reduce_some(projection, candidates)
    return rank(reduced, square, projection.rows, without)


def family_maxima(
    reduced: tuple[ReducedCandidates, ...], square: Floats, rows: int
) -> Floats:
    """Return the largest evidence of any family, for every draw, (draws,)."""
    total: dict[Family, Floats] = {}
    for blocks in reduced:
        each = log_evidence(blocks, square, rows)
        for candidate, e in zip(blocks.candidates, each, strict=True):
            value = e + candidate.log_prior
            before = total.get(candidate.family)
            total[candidate.family] = (
                value if before is None else np.logaddexp(before, value)
            )
    return np.asarray(np.max(np.stack(list(total.values())), axis=0))


# How large the largest evidence gets when there is nothing to find.

BOOTSTRAP_DRAWS = 300
LEAST = 1e-300  # p-values below this are all the same to anybody
TAIL = 0.2  # share of the draws that the tail is taken from


@dataclass(frozen=True, eq=False)
class Null:
    """Distribution of the largest of many statistics when there is nothing to find.

    Attributes:
        maxima: Sorted maxima of the draws, (draws,): evidence of a family of the whole
            library [nats], or what is asked of rows without a family in mind.
        cells: The same of the cells of the table of causes that have no name.
    """

    maxima: Floats
    cells: Null | None = None

    def p_of(self, score: Score) -> float:
        """Give the probability that noise alone makes such a score anywhere.

        Beside names, cells without one have a threshold of their own; either may be
        reached.
        """
        if self.cells is None:
            return self.p_value(score.evidence)
        own = self.cells if score.family.effect == PART_MOTION else self
        return min(2.0 * own.p_value(score.evidence), 1.0)

    @property
    def _tail(self) -> tuple[float, float]:
        """Where the tail begins, and its mean excess."""
        start = float(np.quantile(self.maxima, 1.0 - TAIL))
        excess = self.maxima[self.maxima > start] - start
        return start, max(float(excess.mean()) if len(excess) else 1.0, 1e-3)

    def p_value(self, evidence: float) -> float:
        """Give the probability that noise alone reaches as much anywhere.

        Beyond the start of the tail the draws are continued by an exponential.
        """
        start, scale = self._tail
        if evidence <= start:
            reached = (self.maxima >= evidence).sum()
            return float((reached + 1) / (len(self.maxima) + 1))
        return max(float(TAIL * np.exp(-(evidence - start) / scale)), LEAST)

    def threshold(self, level: float) -> float:
        """Give the evidence that noise reaches with a probability [nats]."""
        start, scale = self._tail
        if level >= TAIL:
            return float(np.quantile(self.maxima, 1.0 - level))
        return start + scale * float(np.log(TAIL / level))


def draws(projection: Projection, seed: int) -> Floats:
    """Draw from the current model, (3 n, draws).

    The filter turns draws from the model into plain noise, so no draw needs a fit.
    """
    rng = np.random.default_rng(seed)
    used = np.repeat(projection.fit.rows.weight > 0, 3)
    rows = rng.standard_normal((len(projection.rest), BOOTSTRAP_DRAWS))
    rows *= used[:, None]
    return rows


# Whether anything is left: tests that ask for no particular effect.
#
# Three questions, each against rows whose signs or places are drawn anew: do poses that
# are alike in two joint angles err alike (random smooth maps of pairs of joints, at two
# length scales); do rows that follow each other err alike (serial correlation); does
# the scatter of a joint change with the way since its last reversal, which no mean
# shows.

Dealt = NDArray[np.int32]

MAPS = 36
FEATURES = 10
LENGTHS = (0.5, 0.2)  # of the ranges of both joints
UNTAKEN = 0.5  # part of a direction that the model leaves of it: of others its priors,
#                not the rows, say how large they may be
LAGS = 3
OMNIBUS_DRAWS = 400
AT_ONCE = 50  # draws
WAYS = np.radians([2.0, 8.0])  # over which scatter may fade after a reversal
MAPPED_ROWS = 4000  # more rows than this are thinned for the maps


@dataclass(frozen=True)
class ResidualTest:
    """One statistic of what is left.

    Attributes:
        what: What it shows, in words.
        statistic: Standardised: 0 on average and of unit scale under noise.
        p_value: Against the same rows without order, all questions counted.
    """

    what: str
    statistic: float
    p_value: float


def leftovers(projection: Projection, seed: int) -> tuple[ResidualTest, ...]:
    """Ask all questions of a filtered residual, the most telling first."""
    rng = np.random.default_rng(seed)
    rest = projection.rest.reshape(-1, 3) * (projection.fit.rows.weight > 0)[:, None]
    flipped, dealt = _draws(rest, rng)
    found: list[tuple[str, Floats]] = [
        *_maps(projection, flipped, rng),
        *_serial(projection, flipped),
        *_scatter(projection, rest, dealt),
    ]
    every = np.array([values for _, values in found])
    draws = every[:, 1:]
    scale = np.maximum(draws.std(axis=1, keepdims=True), 1e-300)
    spread = (every - draws.mean(axis=1, keepdims=True)) / scale
    null = Null(np.sort(spread[:, 1:].max(axis=0)))
    out = [
        ResidualTest(what, float(values[0]), null.p_value(float(values[0])))
        for (what, _), values in zip(found, spread, strict=True)
    ]
    return tuple(sorted(out, key=lambda x: x.p_value))


def _draws(rest: Floats, rng: np.random.Generator) -> tuple[Floats, Dealt]:
    """Make draws of plain noise from the rows themselves, the rows as they are first.

    Rows (n, 3) with signs drawn anew keep how large and how round the scatter of every
    row is, which a model of the noise need not know; rows dealt anew to the poses keep
    it on the whole.

    Returns:
        Flipped rows, (3 n, 1 + DRAWS), and which row is dealt to each, (1 + DRAWS, n).
    """
    n = len(rest)
    flipped = np.empty((n, 3, 1 + OMNIBUS_DRAWS))
    flipped[:, :, 0] = rest
    signs = rng.choice([-1.0, 1.0], (n, OMNIBUS_DRAWS))
    np.multiply(rest[:, :, None], signs[:, None], out=flipped[:, :, 1:])
    dealt = np.empty((1 + OMNIBUS_DRAWS, n), dtype=np.int32)
    dealt[0] = np.arange(n)
    for order in dealt[1:]:
        order[:] = rng.permutation(n)
    return flipped.reshape(3 * n, -1), dealt


def _maps(
    projection: Projection, rows: Floats, rng: np.random.Generator
) -> list[tuple[str, Floats]]:
    """Explain joint errors by random smooth functions of two angles."""
    at = projection.at
    q = at.states.q
    place = (q - q.min(axis=0)) / np.maximum(np.ptp(q, axis=0), 1e-9)
    whitened = projection.fit.whiten(at.jacobian).reshape(len(q), 3, 6)
    keep, square = np.ones(len(q)), np.einsum("rd,rd->d", rows, rows)
    if len(q) > MAPPED_ROWS:
        keep[rng.permutation(len(q))[MAPPED_ROWS:]] = 0.0
    out = []
    for k in range(MAPS):
        a, b = rng.choice(6, 2, replace=False)
        j, length = k % 6, LENGTHS[(k // 6) % 2]
        waves = rng.standard_normal((2, FEATURES)) / length
        phase = rng.uniform(0, 2 * np.pi, FEATURES)
        feature = np.cos(place[:, [a, b]] @ waves + phase) * keep[:, None]
        columns = whitened[:, :, j, None] * feature[:, None, :]
        own, size, _ = np.linalg.svd(columns.reshape(-1, FEATURES), full_matrices=False)
        own = own[:, size > 1e-6 * max(float(size.max(initial=0.0)), 1e-9)]
        basis, left, _ = np.linalg.svd(projection.filter(own), full_matrices=False)
        kept = basis[:, left > UNTAKEN]
        share = ((kept.T @ rows) ** 2).sum(axis=0) / square
        what = f"joint {j + 1} errs alike where joints {min(a, b) + 1} and "
        out.append((what + f"{max(a, b) + 1} are alike", share))
    return out


def _serial(projection: Projection, rows: Floats) -> list[tuple[str, Floats]]:
    """Correlate rows with those that follow, in the base frame and in the tool's."""
    fit = projection.fit
    back = np.swapaxes(fit.whitener.turn, 1, 2)
    order = np.argsort(fit.batch.states.order, kind="stable")
    by_row = rows.reshape(len(order), 3, -1)
    found = np.empty(rows.shape[1])
    for first in range(0, len(found), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        turned = (back @ by_row[:, :, some])[order]
        along = sum(
            np.einsum("nid,nid->d", turned[lag:], turned[:-lag])
            for lag in range(1, LAGS + 1)
        )
        found[some] = along / np.einsum("nid,nid->d", turned, turned)
    return [("rows that follow each other err alike", found)]


def _scatter(
    projection: Projection, rest: Floats, dealt: Dealt
) -> list[tuple[str, Floats]]:
    """Compare the scatter of every joint soon and late after a reversal.

    Args:
        projection: The fit.
        rest: Rows, (n, 3).
        dealt: Which of them stands at each place, (draws, n).
    """
    fit = projection.fit
    travel = fit.batch.states.travel
    out = []
    for j in range(6):
        if np.isnan(travel[:, j]).any() or np.ptp(travel[:, j]) < 1e-9:
            continue
        axis = fit.whiten(projection.at.jacobian[:, :, j]).reshape(-1, 3)
        axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-12)
        square = np.stack([np.einsum("nk,nk->n", axis, rest[d]) ** 2 for d in dealt], 1)
        for way in WAYS:
            soon = np.exp(-travel[:, j] / way)
            soon = soon - soon.mean()
            what = f"joint {j + 1} scatters with the way since its last reversal"
            out.append((what, np.asarray(soon @ square / square.mean(axis=0))))
    return out
