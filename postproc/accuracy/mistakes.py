"""Which mistake in a measurement file would explain its positions."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from postproc.accuracy.measurement import Measurements
from postproc.arrays import Floats
from postproc.calibration.registration import register
from postproc.model.combination import Combination
from postproc.robot.arm import Arm
from postproc.robot.state import States

CLOSE = 0.01  # [m] a mended survey agrees at least so well
TRIED = 60  # rows that a guess is tried on
NOTHING = Combination(())


def likely_cure(survey: Measurements, arm: Arm) -> str:
    """Name the mistake that would explain the positions, if one does."""
    few = survey[np.unique(np.linspace(0, len(survey) - 1, TRIED).astype(np.int64))]
    for cure, states, position in _guesses(few.states, few.position):
        if register(arm, states, position, NOTHING, np.zeros(0)).typical < CLOSE:
            return cure
    return "Check units, joint order and signs, the tool and the frame (--frame)"


def _guesses(states: States, position: Floats) -> Iterator[tuple[str, States, Floats]]:
    """List mistakes that people make, most frequent first, each undone."""
    q = states.q

    def turned(angles: Floats) -> States:
        return states.with_(q=angles)

    yield (
        "The positions look like the tracker's frame: use --frame tracker",
        states,
        (position),
    )
    yield "The positions look like metres: write millimetres", states, position * 1e3
    yield (
        "The joint angles look like radians: write degrees",
        turned(np.rad2deg(q)),
        (position),
    )
    for j in range(6):
        sign = np.where(np.arange(6) == j, -1.0, 1.0)
        yield (
            f"Joint {j + 1} looks like it has the other sign",
            turned(q * sign),
            (position),
        )
    for i, j in combinations(range(6), 2):
        order = np.arange(6)
        order[[i, j]] = j, i
        cure = f"Joints {i + 1} and {j + 1} look swapped: correct the columns"
        yield cure, turned(q[:, order]), position
