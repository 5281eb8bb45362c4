"""Why something did not happen, for many visits at once."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Ints


class Reasons:
    """The first reason given for each of n visits.

    >>> reasons = Reasons(3)
    >>> reasons.mark(np.array([True, False, False]), "out of reach")
    >>> reasons.mark(np.array([True, True, False]), "joint limit")
    >>> [reasons.texts[k] for k in reasons.index]
    ['out of reach', 'joint limit', '']
    """

    def __init__(self, n: int) -> None:
        """Start with no reason for n visits."""
        self.index: Ints = np.zeros(n, dtype=np.int64)
        self._codes: dict[str, int] = {"": 0}

    @property
    def texts(self) -> tuple[str, ...]:
        """Return the texts; index 0 is "" (no reason)."""
        return tuple(self._codes)

    @property
    def none(self) -> Bools:
        """Tell which visits have no reason yet, (n,)."""
        return np.asarray(self.index == 0)

    def mark(self, rows: Bools, text: str) -> None:
        """Give visits a reason, unless they have one already.

        Args:
            rows: Which visits, (n,).
            text: The reason.
        """
        rows = rows & self.none
        if rows.any():
            self.index[rows] = self._codes.setdefault(text, len(self._codes))

    def adopt(self, index: Ints, texts: tuple[str, ...]) -> None:
        """Take over reasons found elsewhere, (n,) indices into texts."""
        for code in np.flatnonzero(np.bincount(index)).tolist():
            if texts[code]:
                self.mark(index == code, texts[code])

    def __getitem__(self, visit: int) -> str:
        """Return the reason of one visit."""
        return self.texts[int(self.index[visit])]
