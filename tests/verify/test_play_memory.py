"""What a drive remembers, against the play operator that it has no part in."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.robot.arm import load_arm
from postproc.robot.direction import arrivals_of_rows
from postproc.verify.play_memory import PlayMemory

PLAY = np.full(6, 0.01)


def passed(*angles: float) -> PlayMemory:
    drive = np.repeat(np.array(angles)[:, None], 6, axis=1)
    return PlayMemory.at(drive[0]).pass_angles(drive, PLAY)


@pytest.mark.parametrize(
    ("angles", "side", "sure"),
    [
        ((0.0, 1.0), 1, True),
        ((0.0, 1.0, -1.0), -1, True),
        ((0.0, 1.0, 0.995), 1, True),  # jitter
        ((0.0, 1.0, 0.985), -1, False),  # between one and two plays
        ((0.0, 0.005), 0, False),  # never more than its play
        ((0.0, 1.0, 1.0, 1.0), 1, True),  # at rest
        ((0.0, 1.0, 0.9, 0.915), 1, False),
    ],
)
def test_the_last_motion_beyond_its_play_counts(angles, side, sure) -> None:
    memory = passed(*angles)
    assert (memory.side == side).all()
    assert (memory.sure(PLAY) == sure).all()


def test_where_both_are_sure_they_agree() -> None:
    """Over random walks of every size, from a tenth of a play to many."""
    arm, rng = load_arm("nj220-2.7"), np.random.default_rng(8)
    compared = 0
    for _ in range(200):
        size = arm.play * 10 ** rng.uniform(-1, 2)
        q = np.cumsum(rng.normal(size=(40, 6)) * size, axis=0)
        told = arrivals_of_rows(arm, q).direction
        memory = PlayMemory.at(q[0])
        for row in range(1, 40):
            memory = memory.pass_angles(q[row : row + 1], arm.play)
            both = memory.sure(arm.play) & (told[row] != 0)
            assert (memory.side == told[row])[both].all()
            compared += int(both.sum())
    assert compared > 20_000
