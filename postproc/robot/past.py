"""What joints remember of the way that brought them to a place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.robot.play import Clamps
from postproc.robot.travel import Turned


@dataclass(frozen=True)
class Past:
    """What is known at one place, (1, 6) each; (0, 6) where nothing is.

    Attributes:
        play: Interval that the state of every play operator lies in [rad].
        turned: The last reversal of every joint.
    """

    play: Clamps
    turned: Turned


_NONE = np.empty((0, 6))
NOTHING = Past(Clamps(_NONE, _NONE), Turned(_NONE, _NONE, _NONE))
