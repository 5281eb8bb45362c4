"""What a model says about states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats


@dataclass(frozen=True)
class Prediction:
    """Predicted errors of n states: actual minus nominal TCP position, base frame.

    Attributes:
        error: (n, 3) [m].
        std_model: Standard error of `error` per axis, (n, 3) [m]: how well the error is
            known on average over arrivals.
        std_arrival: Standard deviation of one arrival, (n, 3) [m]: with repeatability.
        outside: Reasons why states lie outside what was surveyed, with the states,
            (n,) each. No reason: all inside.
    """

    error: Floats
    std_model: Floats
    std_arrival: Floats
    outside: dict[str, NDArray[np.bool_]]

    @property
    def any_outside(self) -> NDArray[np.bool_]:
        """Which states lie outside for any reason, (n,)."""
        out = np.zeros(len(self.error), dtype=bool)
        for rows in self.outside.values():
            out |= rows
        return out

    def why(self, row: int) -> tuple[str, ...]:
        """Give the reasons why one state lies outside."""
        return tuple(text for text, rows in self.outside.items() if rows[row])
