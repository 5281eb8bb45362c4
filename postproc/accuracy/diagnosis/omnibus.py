"""Whether anything is left: tests that ask for no particular effect.

Three questions, each against rows whose signs or places are drawn anew: do poses that
are alike in two joint angles err alike (random smooth maps of pairs of joints, at two
length scales); do rows that follow each other err alike (serial correlation); does the
scatter of a joint change with the way since its last reversal, which no mean shows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.accuracy.diagnosis.projection import Projection
from postproc.arrays import Floats

MAPS = 36
FEATURES = 10
LENGTHS = (0.5, 0.2)  # of the ranges of both joints
LAGS = 3
DRAWS = 400
WAYS = np.radians([2.0, 8.0])  # over which scatter may fade after a reversal
MAPPED_ROWS = 4000  # more rows than this are thinned for the maps


@dataclass(frozen=True)
class Leftover:
    """One statistic of what is left.

    Attributes:
        what: What it shows, in words.
        statistic: Standardised: 0 on average and of unit scale under noise.
        p_value: Against the same rows without order, all questions counted.
    """

    what: str
    statistic: float
    p_value: float


def leftovers(projection: Projection, seed: int) -> tuple[Leftover, ...]:
    """Ask all questions of a filtered residual, the most telling first."""
    rng = np.random.default_rng(seed)
    rest = projection.rest.reshape(-1, 3) * (projection.fit.rows.weight > 0)[:, None]
    flipped, shuffled = _draws(rest, rng)
    found: list[tuple[str, Floats]] = [
        *_maps(projection, flipped, rng),
        *_serial(projection, flipped),
        *_scatter(projection, shuffled),
    ]
    spread = np.array([_standardised(values) for _, values in found])
    worst = spread[:, 1:].max(axis=0)
    out = []
    for (what, _), values in zip(found, spread, strict=True):
        reached = float((worst >= values[0]).sum() + 1) / (DRAWS + 1)
        out.append(
            Leftover(what, float(values[0]), min(reached, _tail(worst, values[0])))
        )
    return tuple(sorted(out, key=lambda x: x.p_value))


def _draws(rest: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Make draws of plain noise from the rows themselves, the rows as they are first.

    Rows (n, 3) with signs drawn anew keep how large and how round the scatter of every
    row is, which a model of the noise need not know; rows dealt anew to the poses keep
    it on the whole.

    Returns:
        Flipped and shuffled rows, (3 n, 1 + DRAWS) each.
    """
    n = len(rest)
    signs = rng.choice([-1.0, 1.0], (n, DRAWS))
    flipped = (rest[:, :, None] * signs[:, None, :]).reshape(3 * n, DRAWS)
    dealt = np.stack([rest[rng.permutation(n)].reshape(-1) for _ in range(DRAWS)])
    first = rest.reshape(-1)
    return np.column_stack([first, flipped]), np.column_stack([first, dealt.T])


def _standardised(values: Floats) -> Floats:
    """Give values the scale of their draws (all but the first)."""
    draws = values[1:]
    return np.asarray((values - draws.mean()) / max(float(draws.std()), 1e-300))


def _tail(worst: Floats, value: float) -> float:
    """Continue the draws by an exponential beyond their top fifth."""
    start = float(np.quantile(worst, 0.8))
    scale = float((worst[worst > start] - start).mean())
    return float(0.2 * np.exp(-(value - start) / scale)) if value > start else 1.0


def _maps(
    projection: Projection, rows: Floats, rng: np.random.Generator
) -> list[tuple[str, Floats]]:
    """Explain joint errors by random smooth functions of two angles."""
    at = projection.at
    q = at.states.q
    place = (q - q.min(axis=0)) / np.maximum(np.ptp(q, axis=0), 1e-9)
    whitened = projection.fit.whiten(at.jacobian).reshape(len(q), 3, 6)
    keep = _thinned(len(q), rng)
    out = []
    for k in range(MAPS):
        a, b = rng.choice(6, 2, replace=False)
        j, length = k % 6, LENGTHS[(k // 6) % 2]
        waves = rng.standard_normal((2, FEATURES)) / length
        phase = rng.uniform(0, 2 * np.pi, FEATURES)
        feature = np.cos(place[:, [a, b]] @ waves + phase) * keep[:, None]
        columns = whitened[:, :, j, None] * feature[:, None, :]
        columns = projection.filter(columns.reshape(-1, FEATURES))
        basis, size, _ = np.linalg.svd(columns, full_matrices=False)
        kept = basis[:, size > 1e-6 * max(float(size.max(initial=0.0)), 1e-9)]
        share = ((kept.T @ rows) ** 2).sum(axis=0) / (rows**2).sum(axis=0)
        what = f"joint {j + 1} errs alike where joints {min(a, b) + 1} and "
        out.append((what + f"{max(a, b) + 1} are alike", share))
    return out


def _thinned(n: int, rng: np.random.Generator) -> Floats:
    """Mark the rows that the maps use, (n,)."""
    keep = np.ones(n)
    if n > MAPPED_ROWS:
        keep[rng.permutation(n)[MAPPED_ROWS:]] = 0.0
    return keep


def _serial(projection: Projection, rows: Floats) -> list[tuple[str, Floats]]:
    """Correlate rows with those that follow, in the base frame and in the tool's."""
    fit = projection.fit
    n, draws = len(fit.batch), rows.shape[1]
    turned = np.swapaxes(fit.whitener.turn, 1, 2) @ rows.reshape(n, 3, draws)
    turned = turned[np.argsort(fit.batch.states.order, kind="stable")]
    total = (turned**2).sum(axis=(0, 1))
    along = sum(
        (turned[lag:] * turned[:-lag]).sum(axis=(0, 1)) for lag in range(1, LAGS + 1)
    )
    return [("rows that follow each other err alike", np.asarray(along / total))]


def _scatter(projection: Projection, rows: Floats) -> list[tuple[str, Floats]]:
    """Compare the scatter of every joint soon and late after a reversal."""
    fit = projection.fit
    travel = fit.batch.states.travel
    out = []
    for j in range(6):
        if np.isnan(travel[:, j]).any() or np.ptp(travel[:, j]) < 1e-9:
            continue
        axis = fit.whiten(projection.at.jacobian[:, :, j]).reshape(-1, 3)
        axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-12)
        square = np.einsum("nk,nkd->nd", axis, rows.reshape(len(axis), 3, -1)) ** 2
        for way in WAYS:
            soon = np.exp(-travel[:, j] / way)
            soon = soon - soon.mean()
            what = f"joint {j + 1} scatters with the way since its last reversal"
            out.append((what, np.asarray(soon @ square / square.mean(axis=0))))
    return out
