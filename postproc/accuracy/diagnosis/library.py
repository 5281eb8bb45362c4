"""All candidates with their columns, ready to be filtered by any fit of the rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.diagnosis.candidate import Candidate
from postproc.accuracy.diagnosis.curves import free_candidates
from postproc.accuracy.diagnosis.named import named_candidates
from postproc.accuracy.diagnosis.projection import Blocks, Projection, reduce_columns
from postproc.accuracy.fitted import Fit
from postproc.arrays import Floats
from postproc.model.kinematics import Batch
from postproc.model.noise import Whitener

KEPT = 60_000_000  # numbers of columns that are kept rather than made again
CHUNK = 5_000_000  # numbers of columns held at once while they are made


@dataclass(frozen=True, eq=False)
class Shelf:
    """Candidates of one width.

    Attributes:
        candidates: c candidates of k columns each.
        columns: Rotated as the rows are whitened, in units of the prior scales,
            (3 n, c, k), or None where they are made when needed.
    """

    candidates: tuple[Candidate, ...]
    columns: Floats | None

    def made(self, batch: Batch, whitener: Whitener) -> Floats:
        """Return the columns, (3 n, c, k)."""
        if self.columns is not None:
            return self.columns
        return make_columns(self.candidates, batch, whitener)


@dataclass(frozen=True, eq=False)
class Library:
    """Shelves by width.

    Columns are taken at the kinematics of the first fit: later fits differ by what
    moves a column by a thousandth.
    """

    shelves: tuple[Shelf, ...]

    @classmethod
    def of(cls, fit: Fit) -> Library:
        """List all candidates that a fit's rows can show."""
        at = fit.combination.at(fit.batch, fit.values)
        every = [*named_candidates(at), *free_candidates(at)]
        numbers = 3 * len(at) * sum(c.width for c in every)
        shelves = []
        for width, alike in by_width(every):
            step = max(1, CHUNK // (3 * len(at) * width))
            for first in range(0, len(alike), step):
                some = tuple(alike[first : first + step])
                keep = numbers <= KEPT
                columns = make_columns(some, at, fit.whitener) if keep else None
                shelves.append(Shelf(some, columns))
        return cls(tuple(shelves))

    def at_rows(self, rows: NDArray[np.int64]) -> Library:
        """Return the library for some of the rows."""
        scalar = (3 * rows[:, None] + np.arange(3)).reshape(-1)
        shelves = [
            s if s.columns is None else replace(s, columns=s.columns[scalar])
            for s in self.shelves
        ]
        return Library(tuple(shelves))

    def reduce(self, projection: Projection, rows: Floats) -> tuple[Blocks, ...]:
        """Filter all candidates and reduce them against rows (3 n, draws)."""
        whitener = projection.fit.whitener
        return tuple(
            reduce_columns(
                projection, s.candidates, s.made(projection.at, whitener), rows
            )
            for s in self.shelves
        )


def by_width(candidates: Sequence[Candidate]) -> list[tuple[int, list[Candidate]]]:
    """Group candidates by their number of columns."""
    widths: dict[int, list[Candidate]] = {}
    for candidate in candidates:
        widths.setdefault(candidate.width, []).append(candidate)
    return sorted(widths.items())


def reduce_some(
    projection: Projection, candidates: Sequence[Candidate], rows: Floats
) -> tuple[Blocks, ...]:
    """Filter a few candidates of any widths and reduce them against rows."""
    whitener = projection.fit.whitener
    return tuple(
        reduce_columns(
            projection, alike, make_columns(alike, projection.at, whitener), rows
        )
        for _, alike in by_width(candidates)
    )


def make_columns(
    candidates: Sequence[Candidate], batch: Batch, whitener: Whitener
) -> Floats:
    """Make the rotated, scaled columns of candidates of one width, (3 n, c, k)."""
    raw = np.concatenate([c.effect.columns(batch) for c in candidates], axis=2)
    raw *= np.array([p.scale for c in candidates for p in c.effect.parameters()])
    turned = whitener.rotate(raw)
    return turned.reshape(3 * len(batch), len(candidates), -1)
