"""What the windows of a program must agree on: all that was found at their cuts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Floats, Indices, Ints
from postproc.diagnostics import Reason
from postproc.robot.backlash_operator import PlayOperator
from postproc.robot.direction import NO_SIDES, FlankState

# What is looked at, round by round.


@dataclass(frozen=True)
class Snapshot:
    """What was proposed and looked at in one round, k visits (structure of arrays).

    Attributes:
        values: Numbers, (k, 6).
        status, why: What was decided, (k,); `why` is an index into `reasons`.
        reasons: See `Decisions`.
        correction: (k, 3) [m].
        aim: Sides that are corrected for, (k, 6).
        foretold, left: `SolverState.aside`, (k, 3) [m]; held, swung, settled, (k, 3).
        q, passed: Joint angles at the target and where it is passed, (k, 6) [rad].
        aside: From the one to the other, (k, 3) [m].
        slot: Branch, (k,).
        side, lo, hi: Where joints lie in their play, and what is known of its state
            [rad], (k, 6).
    """

    values: Floats
    status: Indices
    why: Ints
    reasons: tuple[Reason, ...]
    correction: Floats
    aim: Floats
    foretold: Floats
    left: Bools
    q: Floats
    passed: Floats
    aside: Floats
    slot: Ints
    side: Floats
    lo: Floats
    hi: Floats

    def __getitem__(self, rows: slice) -> Snapshot:
        """Return some of the visits."""
        arrays = {
            f.name: np.array(getattr(self, f.name)[rows])
            for f in fields(self)
            if f.name != "reasons"
        }
        return Snapshot(reasons=self.reasons, **arrays)

    @property
    def to_dict(self) -> list[Reason]:
        """Return the reason of every visit."""
        return [self.reasons[k] for k in self.why.tolist()]

    @property
    def sides(self) -> FlankState:
        """Return the sides alone."""
        return FlankState(self.side, PlayOperator(self.lo, self.hi))


@dataclass(frozen=True)
class Glimpses:
    """What was looked at, round by round, at some neighbouring visits.

    Attributes:
        rounds: The look of every round; none where nothing is known.
        written: The last look at the numbers as they are written.
    """

    rounds: tuple[Snapshot, ...] = ()
    written: Snapshot | None = None

    def at(self, turn: int | None) -> Snapshot | None:
        """Return the look of a round; None: that at written numbers.

        A window that has come to rest does not take the rounds of the others: what was
        the same by then stands for them.
        """
        if turn is None or not self.rounds:
            return self.written
        return self.rounds[min(turn, len(self.rounds) - 1)]

    def sides_at(self, turn: int | None) -> FlankState:
        """Return the sides that were found in a look, as far as they are known."""
        seen = self.at(turn)
        return NO_SIDES if seen is None else seen.sides

    def and_then(self, turn: int | None, seen: Snapshot) -> Glimpses:
        """Add a look; those at written numbers take the place of each other."""
        if turn is None:
            return replace(self, written=seen)
        return replace(self, rounds=(*self.rounds, seen))

    def __getitem__(self, rows: slice) -> Glimpses:
        """Return what was looked at at some of the visits."""
        written = None if self.written is None else self.written[rows]
        return Glimpses(tuple(seen[rows] for seen in self.rounds), written)


NOT_SEEN = Glimpses()


SEAM = 16  # first visits of a window, whose states come from the window before


@dataclass
class RoundLog:
    """What was looked at at both ends of a window, round by round.

    Attributes:
        left, right: Visits that are watched.
        begin, end: What was looked at there.
        settled: States of the visits at the seam when sides were settled, by rounds.
    """

    left: slice = field(default_factory=lambda: slice(0, 0))
    right: slice = field(default_factory=lambda: slice(0, 0))
    begin: Glimpses = NOT_SEEN
    end: Glimpses = NOT_SEEN
    settled: dict[int, Floats] = field(default_factory=dict)

    @property
    def seam(self) -> slice:
        """Return the first visits of the next window."""
        return slice(self.right.start, min(self.right.start + SEAM, self.right.stop))

    def see(self, turn: int | None, seen: Snapshot) -> None:
        """Keep what is watched of a look at all visits."""
        self.begin = self.begin.and_then(turn, seen[self.left])
        self.end = self.end.and_then(turn, seen[self.right])


# What both windows at a cut find at the visits beside it.

Array = NDArray[Any]

SAME = 1e-9  # of any unit: more than sums in blocks of other lengths differ by


def same_rows(a: Mapping[str, Array], b: Mapping[str, Array]) -> bool:
    """Tell whether the same arrays say the same."""
    return a.keys() == b.keys() and all(_same(a[name], b[name]) for name in a)


def _same(a: Array, b: Array) -> bool:
    if a.dtype.kind != "f":
        return bool(np.array_equal(a, b))
    return a.shape == b.shape and bool(
        np.allclose(a, b, rtol=0.0, atol=SAME, equal_nan=True)
    )


def _same_glimpse(a: Snapshot, b: Snapshot) -> bool:
    arrays = [
        {f.name: getattr(seen, f.name) for f in fields(Snapshot)
         if f.name not in ("why", "reasons")}
        for seen in (a, b)
    ]  # fmt: skip
    return a.to_dict == b.to_dict and same_rows(arrays[0], arrays[1])


def same_looks(a: Glimpses, b: Glimpses) -> bool:
    """Tell whether the same was looked at, in all rounds and as it is written."""
    turns = [None, *range(max(len(a.rounds), len(b.rounds)))]
    pairs = [(a.at(turn), b.at(turn)) for turn in turns]
    return all(x is None or y is None or _same_glimpse(x, y) for x, y in pairs)
