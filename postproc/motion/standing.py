"""Where the arm stands at a stop, and what its joints remember: enough to go on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.motion.workspace import Known
from postproc.robot.play import NOTHING, Past


@dataclass(frozen=True)
class Standing:
    """One stop, or none: arrays of k = 1 or 0 rows.

    Attributes:
        q: Joint angles, (k, 6) [rad].
        flange: (k, 4, 4) [m].
        slot: Branch, (k,).
        past: What the joints remember.
    """

    q: Floats
    flange: Floats
    slot: Ints
    past: Past

    def __len__(self) -> int:
        """Return 1 at a stop, 0 where nothing is known."""
        return len(self.q)

    @classmethod
    def at_end(cls, q: Floats, flange: Floats, slot: Ints, past: Past) -> Standing:
        """Keep the last of n targets, none of the others."""
        return cls(np.array(q[-1:]), np.array(flange[-1:]), np.array(slot[-1:]), past)

    @property
    def known(self) -> Known:
        """Return it as the first targets of a program, whatever leads to them."""
        return Known(np.arange(len(self)), self.q, self.flange, self.slot)


NOWHERE = Standing(
    np.empty((0, 6)), np.empty((0, 4, 4)), np.empty(0, dtype=np.int64), NOTHING
)
