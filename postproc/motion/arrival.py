"""Where one move leads to from one place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats


@dataclass(frozen=True)
class Arrival:
    """Where one edge leads to.

    Attributes:
        q: (6,) [rad], NaN where not known.
        flange: (4, 4) [m].
        slot: Branch, -1 where unknown.
        path: Joint angles along the edge, the target included, (k, 6); empty where the
            path is not known.
        reason: Index into `REASONS`.
    """

    q: Floats
    flange: Floats
    slot: int
    path: Floats
    reason: int


NO_PATH = np.empty((0, 6))
