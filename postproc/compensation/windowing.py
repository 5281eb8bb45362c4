"""Long programs in windows, and several programs side by side in one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from itertools import accumulate, chain, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Ints
from postproc.language.visits import Graph, Literals, Meaning, NumberPlaces, Visits

# The visits of several programs side by side, as if they were one program's.
#
# No move leads from one to another, and no number belongs to two of them.

# Which table a column of indices points into; what is below zero points nowhere.
TABLES = {
    "config": "configs",
    "name": "names",
    "shift": "shifts",
    "tool": "poses",
    "base": "poses",
    "uframe": "poses",
    "load": "loads",
}
NOTHING_FIRST = ("name", "load")  # their table's first row means that there is none


def concatenate(programs: Sequence[Visits]) -> Visits:
    """Put the visits of programs of one dialect one after the other."""
    parts = {name: _join_part(name, programs) for name in programs[0].parts}
    joined = replace(
        programs[0],
        files=tuple(chain.from_iterable(program.files for program in programs)),
        graph=_join_graphs(programs),
        reason=_join_reasons(programs),
        reasons=tuple(chain.from_iterable(program.reasons for program in programs)),
        literals=_literals(programs),
        **parts,
    )
    return joined.with_columns(**_join_references(programs))


def first_visits(programs: Sequence[Visits]) -> tuple[int, ...]:
    """Return the first visit of each program where they are side by side."""
    return tuple(offsets(map(len, programs))[:-1])


def offsets(sizes: Iterable[int]) -> list[int]:
    """Return where parts of these sizes begin, and at last where they end.

    >>> offsets([2, 0, 3])
    [0, 2, 2, 5]
    """
    return list(accumulate(sizes, initial=0))


def _join_part(name: str, programs: Sequence[Visits]) -> Any:
    """Join a part of the visits, with the tables that it points into."""
    own = [program.parts[name] for program in programs]
    columns: dict[str, Any] = {}
    for column in (f.name for f in fields(own[0])):
        found = [getattr(part, column) for part in own]
        if column == "aux":
            columns[column] = _join_axes(found)
            continue
        if column in TABLES:
            rows = [len(getattr(part, TABLES[column])) for part in own]
            found = _shift_indices(found, rows, column in NOTHING_FIRST)
        columns[column] = _join(found)
    return replace(own[0], **columns)


def _join(parts: Sequence[Any]) -> Any:
    """Join a column of all programs: an array, texts, or places of numbers."""
    if isinstance(parts[0], NumberPlaces):
        return NumberPlaces.join(parts)
    if isinstance(parts[0], Sequence):
        return tuple(chain.from_iterable(parts))
    return np.concatenate(parts)


def _shift_indices(
    parts: Sequence[NDArray[np.int64]], rows: Iterable[int], nothing_first: bool = False
) -> list[NDArray[np.int64]]:
    """Let indices point to where the rows of their tables have come to.

    Args:
        parts: Indices of each program.
        rows: How many rows the table of each has.
        nothing_first: The first row of a table means that there is none.
    """
    return [
        np.where(part >= nothing_first, part + offset, part)
        for part, offset in zip(parts, offsets(rows)[:-1], strict=True)
    ]


def _join_references(programs: Sequence[Visits]) -> dict[str, Ints]:
    """Join the columns that point to files, literals and visits."""
    tables = {
        "file": [len(program.files) for program in programs],
        "literal": [len(program.literals) for program in programs],
        "follows": [len(program.literals) for program in programs],
        "block": [len(program) for program in programs],
    }
    columns = [program.columns for program in programs]
    return {
        name: np.concatenate(_shift_indices([own[name] for own in columns], rows))
        for name, rows in tables.items()
    }


def _join_reasons(programs: Sequence[Visits]) -> Ints:
    rows = [len(program.reasons) for program in programs]
    own = [program.reason for program in programs]
    return np.concatenate(_shift_indices(own, rows, nothing_first=True))


def _join_graphs(programs: Sequence[Visits]) -> Graph:
    """Join from where arms come; the offsets are one more than there are visits."""
    graphs = [program.graph for program in programs]
    pred = _shift_indices([graph.pred for graph in graphs], map(len, programs))
    places = [len(graph.pred) for graph in graphs]
    start = _shift_indices([graph.pred_start[:-1] for graph in graphs], places)
    return Graph(np.append(np.concatenate(start), sum(places)), np.concatenate(pred))


def _join_axes(parts: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Join auxiliary axes: each program has as many as it uses."""
    axes = max(part.shape[1] for part in parts)
    wide = [(0, 0), (0, axes)]
    return np.concatenate(
        [np.pad(part, wide, constant_values=np.nan)[:, :axes] for part in parts]
    )


def _literals(programs: Sequence[Visits]) -> Literals:
    """Join the places in the texts."""
    own = [program.literals for program in programs]
    columns: dict[str, Any] = {}
    for name in (f.name for f in fields(Literals)):
        parts = [getattr(literals, name) for literals in own]
        if name == "file":
            parts = _shift_indices(parts, [len(program.files) for program in programs])
        columns[name] = _join(parts)
    return Literals(**columns)


# Long programs in windows, with halos: neighbours that are worked through with them.
#
# Behind a cut the program goes on from there alone, no jump leads across it, no number
# is used on both sides, and neither an arc nor a step begins there. What lies on both
# sides of it still acts on each other: over rounded points and steps of the correction
# both ways, over what the joints remember forwards. So a window is worked through with
# a halo on either side. How far things really reach is not guessed: windows must find
# the same at the targets beside a cut, round by round (see `parallel`).

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
