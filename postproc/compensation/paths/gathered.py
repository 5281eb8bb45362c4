"""A program with points, put together from the windows in which it was predicted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats, Ints
from postproc.compensation.output.rewrite import read_back
from postproc.compensation.paths.changed_windows import Part
from postproc.compensation.program import ParsedProgram
from postproc.compensation.window_result import WindowResult, join_windows
from postproc.language.text.number_edits import edits
from postproc.motion.cycle_time import ProgramCycle

ALIKE = 1e-6  # [rad] and of half the play: by which two arrivals of a joint may differ


@dataclass(frozen=True, eq=False)
class Gathered:
    """What tells of each of the m visits of a program with points.

    Attributes:
        parts: What was predicted of it.
        rows: The visit of these, counted one part after the other, (m,).
    """

    parts: Sequence[Part]
    rows: Ints

    @classmethod
    def of(cls, parts: Sequence[Part], part: Ints, own: Ints, count: int) -> Gathered:
        """Find the visits of parts that tell of a program.

        Args:
            parts: What was predicted of it.
            part: Which of these tells of each visit of the source, (n,).
            own: Which visits of the program those of the source are, (n,).
            count: How many visits the program has.
        """
        begin = np.cumsum([0, *(len(one.visits) for one in parts)])
        owner = np.searchsorted(own, np.arange(count))
        number = part[owner]
        ends = np.stack([one.own for one in parts])[number, owner]
        return cls(parts, begin[number] + ends + np.arange(count) - own[owner])

    def column(self, of: Callable[[Part], NDArray[Any]]) -> NDArray[Any]:
        """Return what parts tell of their visits, for those of the program, (m, ..)."""
        return np.concatenate([of(part) for part in self.parts])[self.rows]

    def correct(self, reading: ParsedProgram) -> WindowResult | None:
        """Correct a program as its windows are.

        Args:
            reading: The program with points.

        Returns:
            None where windows want other numbers of a literal that they share.
        """
        alone = [replace(part.kept, edits=()) for part in self.parts]
        kept = join_windows(alone).take(self.rows)
        visits, values = reading.visits, kept.decisions.corrected
        written = self.column(
            lambda part: np.isin(part.visits.target.literal, part.kept.edited)
        )
        rows = np.flatnonzero(written & (visits.target.shift < 0))
        edited, first = np.unique(visits.target.literal[rows], return_index=True)
        edited = edited.astype(np.int32)
        new = np.nan_to_num(values[rows[first]])
        found = edits(visits.literals, reading.sources, edited, new, visits.dialect)
        if not np.array_equal(read_back(visits, edited, found), values, equal_nan=True):
            return None
        return replace(kept, edited=edited, edits=found)

    def arrives_as(self, cycle: ProgramCycle, travels: bool) -> bool:
        """Return True if joints arrive at all visits of a program as in its parts.

        Args:
            cycle: The program in time.
            travels: How far joints have travelled matters too.
        """
        kinds: list[Callable[[ProgramCycle], Floats]] = [
            lambda ran: ran.path.q,
            lambda ran: ran.arrived.side,
        ]
        if travels:
            kinds.append(lambda ran: ran.arrived.travel)
        for of in kinds:
            there = np.concatenate([of(part.in_time.after) for part in self.parts])
            there = there[self.rows]
            if not np.allclose(of(cycle), there, rtol=0.0, atol=ALIKE, equal_nan=True):
                return False
        return True
