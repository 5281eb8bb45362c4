"""Where a long program may be cut, and its windows with their halos."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from postproc.arrays import Bools, Ints
from postproc.language.visits import Graph, Meaning, Visits

# Long programs in windows, with halos: neighbours that are worked through with them.
#
# Behind a cut the program goes on from there alone, no jump leads across it, no number
# is used on both sides, and neither an arc nor a step begins there. What lies on both
# sides of it still acts on each other: over rounded points and steps of the correction
# both ways, over what the joints remember forwards. So a window is worked through with
# a halo on either side. How far things really reach is not guessed: windows must find
# the same at the targets beside a cut, round by round (see `workers`).

LEAST = 20_000  # visits of a window; shorter programs are one
HALO = 400  # visits on either side; a round reaches some 20, and LONG ones are long
BAND = 32  # visits on either side of a cut that both must agree on
RUN_UP = 2_000  # visits that tell how the arm comes to a window
STEPS = (
    Meaning.RELATIVE_TOOL, Meaning.RELATIVE_BASE, Meaning.RELATIVE_UFRAME, Meaning.AWAY,
    Meaning.ABOUT, Meaning.BY, Meaning.FOR, Meaning.PARTIAL_POSE,
    Meaning.PARTIAL_JOINTS,
)  # fmt: skip


@dataclass(frozen=True)
class Window:
    """Visits first .. end - 1 of a program, and those worked through with them.

    Attributes:
        first, end: The visits.
        begin, stop: .. with both halos.
    """

    first: int
    end: int
    begin: int
    stop: int

    @property
    def seeds(self) -> int:
        """Return how many of its visits are only where it begins: one, or none."""
        return min(self.begin, 1)

    @property
    def own(self) -> slice:
        """Return which of its visits are its own."""
        return self.rows(self.first, self.end)

    def rows(self, first: int, end: int) -> slice:
        """Return which of its visits are first .. end - 1 of the program."""
        return slice(first - self.begin, end - self.begin)

    def of(self, visits: Visits, known: bool = True) -> Visits:
        """Cut a window out; where it begins is a move without a target.

        Args:
            visits: The program.
            known: It is known where the arm stands there; else it comes from anywhere.
        """
        if self.begin == 0 and self.stop == len(visits):
            return visits
        rows = slice(self.begin, self.stop)
        start = visits.graph.pred_start[self.begin + self.seeds : self.stop + 1]
        pred = visits.graph.pred[start[0] : start[-1]]
        pred = np.where(pred >= 0, pred - rows.start, pred)
        start = np.concatenate([np.zeros(self.seeds, dtype=np.int64), start - start[0]])
        if self.seeds and not known:
            start[1:] += 1
            pred = np.append(-1, pred)
        return self._from_a_seed(visits.take(rows, Graph(start, pred)))

    def _from_a_seed(self, taken: Visits) -> Visits:
        """Let the move where a window begins have no target."""
        block = taken.motion.block
        columns = {"block": np.where(block >= 0, block - self.begin, block)}
        for name in ("literal", "follows", "shift"):
            columns[name] = np.array(taken.columns[name])
            columns[name][: self.seeds] = -1
        return taken.with_columns(**columns)


def windows(quiet: Bools, least: int) -> list[Window]:
    """Cut a program into windows, none shorter than `least` visits if there are two.

    Args:
        quiet: Behind which visits it may be cut, (n,).
        least: Visits of a window.
    """
    n, places, least = len(quiet), np.flatnonzero(quiet) + 1, max(least, HALO)
    ends = [0]
    while ends[-1] + 2 * least <= n:
        later = places[np.searchsorted(places, ends[-1] + least) :]
        if len(later) == 0 or later[0] > n - least:
            break
        ends.append(int(later[0]))
    return [window(quiet, a, b) for a, b in pairwise([*ends, n])]


def share(n: int, processes: int) -> int:
    """Return the visits of a window of n: every process gets as many windows.

    >>> [share(n, 2) for n in (40_000, 100_000, 1_000_000)]
    [20000, 25000, 20000]
    """
    count = n // LEAST
    return n // max(count - count % processes, 1)


def window(quiet: Bools, first: int, end: int, before: int = -1) -> Window:
    """Give visits their halos, from one place that may be cut to another.

    Args:
        quiet: Behind which visits the program may be cut, (n,).
        first: The first visit.
        end: One past the last.
        before: How many visits there must be before them; default: `HALO`.
    """
    lead = max(first - 1 - (HALO if before < 0 else before), 0)
    earlier = np.flatnonzero(quiet[: lead + 1][::-1])
    begin = lead - int(earlier[0]) if len(earlier) and first else 0
    later = np.flatnonzero(quiet[end + HALO - 1 :])
    stop = end + HALO + int(later[0]) if len(later) else len(quiet)
    return Window(first, end, begin, min(stop, len(quiet)))


def cut_points(visits: Visits) -> Bools:
    """Tell behind which visits a program may be cut where the arm stops, (n,)."""
    return np.asarray(seams(visits) & ~visits.motion.fly)


def seams(visits: Visits) -> Bools:
    """Tell behind which visits a program may be cut, (n,)."""
    n = len(visits)
    to = np.repeat(np.arange(n), np.diff(visits.graph.pred_start))
    known = visits.graph.pred >= 0
    single = (np.diff(visits.graph.pred_start) == 1)[to]
    goes_on = known & single & (visits.graph.pred == to - 1)
    jumps = known & ~goes_on
    crossed = _find_covered(visits.graph.pred[jumps], to[jumps], n) | _same_numbers(
        visits
    )
    quiet = np.zeros(n, dtype=bool)
    quiet[visits.graph.pred[goes_on]] = True
    begins = visits.motion.via | np.isin(
        visits.target.meaning, STEPS
    )  # an arc, or a step
    quiet &= ~visits.motion.via & ~np.append(begins[1:], False) & ~crossed
    on = np.flatnonzero(visits.motion.block >= 0)  # a curve, from where it begins
    quiet &= ~_find_covered(np.maximum(visits.motion.block[on] - 1, 0), on, n)
    return np.asarray(quiet)


def _same_numbers(visits: Visits) -> Bools:
    """Tell behind which visits numbers are used again, (n,)."""
    n, m = len(visits), len(visits.literals)
    first, last = np.full(m, n), np.full(m, -1)
    for column in (visits.target.literal, visits.target.follows):
        rows = np.flatnonzero(column >= 0)
        np.minimum.at(first, column[rows], rows)
        np.maximum.at(last, column[rows], rows)
    used = np.flatnonzero(first < last)
    return _find_covered(first[used], last[used], n)


def _find_covered(a: Ints, b: Ints, n: int) -> Bools:
    """Tell behind which of n visits one passes on the ways from a to b, (n,)."""
    begin = np.bincount(np.minimum(a, b), minlength=n)
    end = np.bincount(np.maximum(a, b), minlength=n)
    return np.asarray(np.cumsum(begin - end) > 0)
