"""Ways that are known to the last digit, and a tracker's readings of them."""

from __future__ import annotations

import numpy as np

from postproc.compensation.paths.path_error import PredictedWays
from postproc.compensation.paths.track_alignment import Track

MOVES, COUNT, RATE = 6, 401, 100.0
STEP = np.array([0.0, 0.0, 3e-4])  # [m] that joint 1 makes as it changes its flank
CHANGE = slice(200, 205)  # samples of every move between which it does


def made_ways() -> PredictedWays:
    """Make moves of 400 mm to and fro along x, a little higher each time.

    Joint 1 goes from one flank to the other in the middle of each.
    """
    places, sides = [], []
    for k in range(MOVES):
        along = np.linspace(0.0, 0.4, COUNT)[:: 1 if k % 2 == 0 else -1]
        side = np.full(COUNT, -1.0)
        side[CHANGE] = np.linspace(-0.6, 0.6, 5)
        side[CHANGE.stop :] = 1.0
        side *= 1 if k % 2 == 0 else -1
        place = np.zeros((COUNT, 3))
        place[:, 0], place[:, 1] = along, 0.1 * k
        sides.append(side)
        places.append(place + side[:, None] * STEP / 2)
    side = np.zeros((MOVES * COUNT, 6))
    side[:, 0] = np.concatenate(sides)
    flank = np.zeros((len(side), 6, 3))
    flank[:, 0] = STEP
    first = np.arange(MOVES + 1) * COUNT
    visit = 2 * np.arange(MOVES) + 2
    return PredictedWays(
        visit, visit - 1, first, np.zeros((len(side), 6)), side,
        np.ones(len(side), dtype=bool), np.concatenate(places), flank,
    )  # fmt: skip


def read(
    ways: PredictedWays, scatter: float, share: float = 1.0, later: int = 0
) -> Track:
    """Read the ways: stops of 0.3 s at both ends, jumps from one move to the next.

    Args:
        ways: The ways.
        scatter: Of a coordinate [m].
        share: Of the predicted step that the joint really makes.
        later: Samples (of 1 mm) that it makes it later by.
    """
    parts = []
    for k in range(MOVES):
        own = slice(int(ways.first[k]), int(ways.first[k + 1]))
        side = ways.side[own, 0]
        moved = np.roll(side, later)
        moved[:later] = side[0]
        really = side[0] + share * (moved - side[0])
        place = ways.place[own] + (really - side)[:, None] * STEP / 2
        fine = np.repeat(place, 2, axis=0)
        fine[1:-1:2] = (place[:-1] + place[1:]) / 2  # 50 mm/s
        parts += [np.repeat(place[:1], 30, axis=0), fine]
        parts += [np.repeat(place[-1:], 30, axis=0)]
        if k + 1 < MOVES:
            gap = ways.place[own.stop] - place[-1]
            parts.append(place[-1] + np.linspace(0, 1, 40)[1:-1, None] * gap)
    position = np.concatenate(parts)
    noise = np.random.default_rng(5).normal(size=position.shape) * scatter
    return Track(7.0 + np.arange(len(position)) / RATE, position + noise)
