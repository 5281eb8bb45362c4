"""How the bends of ways are cut tells how much the servos lag."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.paths.path_error import PredictedWays
from postproc.compensation.paths.servo_lag import CORNER, REACH, ServoLag, servo_lag
from postproc.compensation.paths.track_alignment import OnTheWay
from tests.slow import slow

MOVES, COUNT, RATE, SPEED, RADIUS = 8, 301, 500.0, 0.2, 0.1
SHARP = np.zeros(2 * MOVES + 2, dtype=bool)


def ways_of(place: np.ndarray) -> PredictedWays:
    """Make ways of the same samples (s, 3), nothing but places on them."""
    n = MOVES * COUNT
    visit = 2 * np.arange(MOVES) + 2
    return PredictedWays(
        visit, visit - 1, np.arange(MOVES + 1) * COUNT, np.zeros((n, 6)),
        np.zeros((n, 6)), np.ones(n, dtype=bool), np.tile(place, (MOVES, 1)),
        np.zeros((n, 6, 3)),
    )  # fmt: skip


def arcs() -> PredictedWays:
    """Make arcs of a half turn."""
    turn = np.linspace(0.0, np.pi, COUNT)
    flat = RADIUS * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return ways_of(np.column_stack([flat, np.zeros(COUNT)]))


def read(ways: PredictedWays, lag: float, scatter: float = 5e-6) -> OnTheWay:
    """Read ways of servos that follow with a lag, by its differential equation."""
    rng, parts = np.random.default_rng(3), []
    for first in ways.first[:-1].tolist():
        place = ways.place[first : first + COUNT]
        way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1)))
        time = np.arange(0.0, way[-1] / SPEED, 1e-4)
        meant = np.stack([np.interp(SPEED * time, way, c) for c in place.T], axis=1)
        lagging = meant.copy()
        for k in range(1, len(time) if lag else 0):  # lag * dx/dt = meant - x
            lagging[k] = lagging[k - 1] + (meant[k] - lagging[k - 1]) * 1e-4 / lag
        rows = np.arange(0, len(time), round(1e4 / RATE))
        position = lagging[rows] + rng.normal(size=(len(rows), 3)) * scatter
        parts.append(laid(position, time[rows], place, first))
    return OnTheWay.join(parts)


def laid(
    position: np.ndarray, time: np.ndarray, place: np.ndarray, first: int
) -> OnTheWay:
    """Lay readings on the nearest places of a way, which looks across it."""
    fine = np.linspace(0, COUNT - 1, 20 * (COUNT - 1) + 1)
    dense = np.stack([np.interp(fine, np.arange(COUNT), c) for c in place.T], axis=1)
    gaps = np.linalg.norm(position[:, None] - dense[None], axis=2)
    nearest = gaps.argmin(axis=1)
    sample = np.minimum(fine[nearest].astype(int), COUNT - 2)
    return OnTheWay(
        sample + first, fine[nearest] - sample, time, position,
        position - dense[nearest], np.zeros_like(position),
    )  # fmt: skip


@pytest.mark.parametrize("lag", [5e-3, *slow([15e-3])])
def test_a_lag_is_told_by_how_arcs_are_cut(lag: float) -> None:
    ways = arcs()
    found = servo_lag(ways, ways.place, read(ways, lag), SHARP)
    assert found.is_certain and found.moves == MOVES
    assert found.seconds == pytest.approx(lag, rel=0.03)
    assert found.most > found.seconds


def test_servos_that_do_not_lag_have_none_told() -> None:
    ways = arcs()
    found = servo_lag(ways, ways.place, read(ways, 0.0), SHARP)
    assert not found.is_certain and np.isnan(found.seconds)
    assert found.most < 3e-3


def test_of_straight_ways_nothing_is_told() -> None:
    ways = ways_of(np.linspace([0.0, 0.0, 0.0], [0.3, 0.0, 0.0], COUNT))
    found = servo_lag(ways, ways.place, read(ways, 15e-3), SHARP)
    assert not found.is_certain
    assert found.most > 15e-3  # whatever it is, it may be


def test_rounded_corners_are_left_out() -> None:
    ways = arcs()
    sound = read(ways, 5e-3)
    begun = np.linalg.norm(sound.position - ways.place[0], axis=1) < 0.8 * CORNER
    off = sound.off + np.where(begun[:, None], [1e-3, 0.0, 0.0], 0.0)
    rounded = SHARP.copy()
    rounded[ways.source] = True
    found = servo_lag(ways, ways.place, replace(sound, off=off), rounded)
    assert found.seconds == pytest.approx(5e-3, rel=0.03)
    assert servo_lag(
        ways, ways.place, replace(sound, off=off), SHARP
    ).square != pytest.approx(found.square, rel=0.1)
    assert REACH < CORNER


def test_few_bends_tell_nothing() -> None:
    ways = arcs()
    some = read(ways, 15e-3)
    found = servo_lag(ways, ways.place, some[some.sample < 3 * COUNT], SHARP)
    assert found == ServoLag(0.0, float("inf"), 3)
