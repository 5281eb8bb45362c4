"""Readings come to lie where they were read."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.paths.track_alignment import (
    FAR,
    align,
    find_stops,
    pair_places,
)
from tests.compensation.paths.measured_ways import COUNT, MOVES, made_ways, read

STOPS = np.zeros(2 * MOVES + 2, dtype=bool)


@pytest.mark.parametrize("scatter", [1e-6, 2e-5, 6e-5])
def test_stops_are_found_and_their_means_are_the_places(scatter):
    ways = made_ways()
    track = read(ways, scatter)
    assert track.scatter == pytest.approx(scatter, rel=0.1)
    stops = find_stops(track)
    ends = np.sort(np.concatenate([ways.first[:-1], ways.first[1:] - 1]))
    assert len(stops) == len(ends)
    off = np.linalg.norm(stops.place - ways.place[ends], axis=1)
    assert off.max() < max(4 * scatter / np.sqrt(20), 5e-5)


def test_readings_lie_on_the_samples_that_they_were_read_at():
    ways = made_ways()
    found = align(read(ways, 0.0), ways, STOPS)
    assert found.missed == 0 and len(found.ended) == MOVES
    on = found.on_the_way
    assert np.linalg.norm(on.off, axis=1).max() < 1e-6
    place = ways.place[on.sample]
    place = place + on.share[:, None] * (ways.place[on.sample + 1] - place)
    assert np.abs(place - on.position).max() < 1e-6
    assert len(np.unique(on.sample)) > 0.9 * MOVES * COUNT


def test_what_lies_across_is_told_and_what_lies_along_is_not():
    ways = made_ways()
    track = read(ways, 0.0)
    lifted = track.position + np.array([2e-3, 5e-4, 0.0])  # x is along the moves
    found = align(type(track)(track.time, lifted), ways, STOPS).on_the_way
    np.testing.assert_allclose(found.off[:, 1], 5e-4, atol=1e-6)
    inner = np.abs(found.position[:, 0] - 0.2) < 0.19
    assert np.abs(found.off[inner, 0]).max() < 1e-5
    np.testing.assert_allclose(np.abs(found.heading[:, 0]), 1.0, atol=0.05)


def test_stops_that_are_none_of_the_programs_are_left_out():
    ways = made_ways()
    track = read(ways, 1e-5)
    half = len(track.time) // 2
    begun = type(track)(track.time[half:], track.position[half:])
    found = align(begun, ways, STOPS)
    assert 0 < len(found.ended) < MOVES and found.missed > 0
    assert np.linalg.norm(found.on_the_way.off, axis=1).max() < 1e-4


def test_sequences_are_paired_in_order_at_least_cost():
    rng = np.random.default_rng(2)
    expected = rng.uniform(size=(30, 3))
    kept = np.sort(rng.choice(30, 22, replace=False))
    measured = expected[kept] + rng.normal(size=(22, 3)) * 1e-4
    more = np.insert(measured, [3, 9, 9], rng.uniform(2, 3, (3, 3)), axis=0)
    i, j = pair_places(more, expected)
    np.testing.assert_array_equal(j, kept)
    np.testing.assert_allclose(more[i], expected[j], atol=FAR)
    for rows in (pair_places(more, expected[:0]), pair_places(more[:0], expected)):
        assert len(rows[0]) == len(rows[1]) == 0


def test_places_that_are_visited_twice_keep_their_order():
    places = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 0], [1, 0, 0], [0, 0, 0]])
    i, j = pair_places(places[1:], places)
    assert list(zip(i, j, strict=True)) == [(0, 1), (1, 2), (2, 3), (3, 4)]
