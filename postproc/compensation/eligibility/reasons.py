"""Why something did not happen, for many visits at once."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Interned, Ints
from postproc.diagnostics import NO_REASON, Reason


class Reasons:
    """The first reason given for each of n visits.

    >>> from postproc.diagnostics import Code
    >>> reasons = Reasons(3)
    >>> far = Reason(Code.OUT_OF_REACH, "out of reach")
    >>> wrist = Reason(Code.SINGULAR_WRIST, "at the wrist singularity")
    >>> reasons.mark(np.array([True, False, False]), far)
    >>> reasons.mark(np.array([True, True, False]), wrist)
    >>> [str(reasons[k]) for k in range(3)]
    ['out of reach', 'at the wrist singularity', '']
    """

    def __init__(self, n: int) -> None:
        """Start with no reason for n visits."""
        self.index: Ints = np.zeros(n, dtype=np.int64)
        self._found = Interned([NO_REASON])

    def copy(self) -> Reasons:
        """Return the same, to go on from."""
        other = Reasons(0)
        other.index, other._found = np.array(self.index), Interned(self._found)
        return other

    @property
    def all(self) -> tuple[Reason, ...]:
        """Return the reasons; index 0 is `NO_REASON`."""
        return tuple(self._found)

    @property
    def none(self) -> Bools:
        """Tell which visits have no reason yet, (n,)."""
        return np.asarray(self.index == 0)

    def mark(self, rows: Bools, reason: Reason) -> None:
        """Give visits a reason, unless they have one already.

        Args:
            rows: Which visits, (n,).
            reason: The reason.
        """
        if rows.any() and (rows := rows & self.none).any():
            self.index[rows] = self._found[reason]

    def mark_visits(self, visits: Ints, reason: Reason) -> None:
        """Give a few visits a reason, by number, unless they have one already."""
        free = visits[self.index[visits] == 0]
        if len(free):
            self.index[free] = self._found[reason]

    def adopt(self, index: Ints, reasons: tuple[Reason, ...]) -> None:
        """Take over reasons found elsewhere, (n,) indices into them."""
        for number in np.flatnonzero(np.bincount(index)).tolist():
            if reasons[number]:
                self.mark(index == number, reasons[number])

    def __getitem__(self, visit: int) -> Reason:
        """Return the reason of one visit."""
        return self.all[int(self.index[visit])]


def mark_rows(n: int, rows: Ints) -> Bools:
    """Tell which of n rows are listed, (n,)."""
    found = np.zeros(n, dtype=bool)
    found[rows] = True
    return found
