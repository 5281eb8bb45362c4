"""How strongly a candidate's block of columns is called for.

The evidence of a block is the ratio of marginal likelihoods with and without it, one
prior scale for the block at its best value and the level of the noise integrated out:

    log E(s) = -1/2 sum_i log(1 + s^2 g_i) - N/2 log(Q(s) / Q(0)),
    Q(s) = |z|^2 - sum_i s^2 a_i^2 / (1 + s^2 g_i),

g the eigenvalues of its Gram matrix, a its columns times the filtered residual z in
that eigenbasis, N the number of rows. It charges for columns, so that a spline does
not beat a sine that fits as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as fisher

from postproc.accuracy.diagnosis.candidate import Candidate, Family
from postproc.accuracy.diagnosis.projection import Blocks
from postproc.arrays import Floats

SIGNALS = np.exp(np.linspace(-1.0, 14.0, 31))  # s^2 g that are tried
SMALL = 1e-9  # Gram eigenvalues below this share of the largest are no direction
NOTHING_LEFT = 1e-2  # Gram of a block that the model takes up altogether


def log_evidence(blocks: Blocks, square: Floats, rows: int) -> Floats:
    """Compute the evidence of every block against every draw, (c, draws) [nats].

    Args:
        blocks: Reduced candidates.
        square: |z|^2 of every draw, (draws,).
        rows: Number of scalar rows N.
    """
    gain, along2 = blocks.gain, blocks.along**2
    largest = np.maximum(gain.max(axis=1, keepdims=True), 1e-300)
    best = np.zeros(along2.shape[::2])
    for signal in SIGNALS:
        s2 = signal / largest
        shrunk = 1.0 + s2 * gain
        cost = 0.5 * np.log(shrunk).sum(axis=1)
        taken = np.einsum("ck,ckd->cd", s2 / shrunk, along2)
        left = np.maximum(1.0 - taken / square, 1e-12)
        np.maximum(best, -0.5 * rows * np.log(left) - cost[:, None], out=best)
    best[largest[:, 0] < NOTHING_LEFT] = 0.0
    return best


def explained(blocks: Blocks) -> tuple[Floats, Floats]:
    """Return the squares that blocks explain by least squares, and their ranks.

    Returns:
        (c, draws) and (c,).
    """
    gain = blocks.gain
    kept = gain > SMALL * np.maximum(gain.max(axis=1, keepdims=True), NOTHING_LEFT)
    inverse = np.where(kept, 1.0 / np.where(kept, gain, 1.0), 0.0)
    return np.einsum("ck,ckd->cd", inverse, blocks.along**2), kept.sum(axis=1)


def score_p_value(blocks: Blocks, square: float, rows: int) -> Floats:
    """Compute the score (F) test of every block against the first draw, (c,)."""
    squares, rank = explained(blocks)
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
    """

    family: Family
    evidence: float
    best: Candidate
    best_evidence: float
    p_value: float


def rank(
    reduced: tuple[Blocks, ...],
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
        first = Blocks(blocks.candidates, blocks.gain, blocks.along[:, :, :1])
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


def family_maxima(reduced: tuple[Blocks, ...], square: Floats, rows: int) -> Floats:
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
