"""From which side every drive arrives, read off the angles that it passes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from postproc.arrays import Bools, Floats

# Plays behind a reversal from which on a direction is compared. A blend takes half of a
# way at most: so what went back by two plays on the exact way goes back by one at least
# on any blend, and no play operator calls that the old direction.
SURE = 2.0


@dataclass(frozen=True)
class PlayMemory:
    """What the drives remember of their way.

    A drive has reversed where it is farther than its play from the extreme that it had
    reached; what goes back by less is jitter.

    Attributes:
        side: Last direction of each, (6,), 0 where none is known.
        high, low: Extremes since the last reversal, (6,) [rad].
        turned: Where that was, (6,) [rad].
        here: Where the drives are, (6,) [rad].
    """

    side: Floats
    high: Floats
    low: Floats
    turned: Floats
    here: Floats

    @classmethod
    def at(cls, drive: Floats) -> Self:
        """Know nothing of how the drives came to angles (6,)."""
        return cls(np.zeros(6), drive, drive, drive, drive)

    def pass_angles(self, drive: Floats, play: Floats) -> PlayMemory:
        """Pass angles, (k, 6) [rad], one after the other."""
        side, high, low, turned = self.side, self.high, self.low, self.turned
        for x in drive:
            high = np.where(side >= 0, np.maximum(high, x), high)
            low = np.where(side <= 0, np.minimum(low, x), low)
            back = (side >= 0) & (high - x > play)
            on = (side <= 0) & (x - low > play) & ~back
            turned = np.where(back, high, np.where(on, low, turned))
            side = np.where(back, -1.0, np.where(on, 1.0, side))
            high, low = np.where(on, x, high), np.where(back, x, low)
        return PlayMemory(side, high, low, turned, drive[-1])

    def sure(self, play: Floats) -> Bools:
        """Tell which drives have gone far enough since they reversed, (6,)."""
        far = np.abs(self.here - self.turned) > SURE * play
        return np.asarray((self.side != 0) & far)
