"""Samples of ways are paired by how far along them they lie."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.compensation.paths.path_samples import PathSamples

ENDS = np.array(
    [[0.0] * 6, [0.3, -0.2, 0.1, 0.5, 0.0, 0.4], [0.6, 0.1, 0.1, 0.2, 0.3, 0.1]]
)


def made(*shares: Floats) -> tuple[PathSamples, Floats]:
    """Ways from end to end, straight in the joints' space, and TCP positions."""
    counts = [len(share) for share in shares]
    q = [
        a + share[:, None] * (b - a)
        for share, a, b in zip(shares, ENDS[:-1], ENDS[1:], strict=True)
    ]
    rows = np.arange(len(shares))
    samples = PathSamples(rows + 1, rows, np.concatenate(q), np.cumsum([0, *counts]))
    return samples, np.concatenate([share[:, None] * AHEAD for share in shares])


AHEAD = np.array([0.1, 0.0, 0.0])
EVEN, CORNER = np.linspace(0.0, 1.0, 9), np.array([0.0, 0.5, 0.9, 0.92, 0.95, 1.0])


def test_samples_are_taken_as_far_along() -> None:
    other, wanted = made(EVEN, EVEN)
    same_number = np.sort(np.r_[CORNER, 0.93, 0.97, 0.99])
    for shares in (
        (CORNER, EVEN),
        (EVEN, CORNER),
        (CORNER, CORNER),
        (same_number, EVEN),
    ):
        samples, place = made(*shares)
        found = samples.as_many(other, place, wanted)
        np.testing.assert_array_equal(found.first, other.first)
        np.testing.assert_allclose(found.q, other.q, atol=1e-12)


def test_ways_that_lie_alike_are_taken_as_they_are() -> None:
    other, wanted = made(EVEN, EVEN)
    samples, place = made(EVEN, EVEN)
    assert samples.as_many(other, place, wanted) is samples
    samples, place = made(EVEN, CORNER)
    found = samples.as_many(other, place, wanted)
    np.testing.assert_array_equal(found.q[:9], samples.q[:9])


def test_a_way_of_no_length_stays_where_it_is() -> None:
    other, wanted = made(EVEN, EVEN)
    still, place = made(np.zeros(2), CORNER)
    found = still.as_many(other, place, wanted)
    np.testing.assert_array_equal(found.q[:9], np.zeros((9, 6)))


def test_a_tool_that_turns_in_place_is_paired_by_its_joints() -> None:
    rng = np.random.default_rng(3)
    other, wanted = made(EVEN, EVEN)
    samples, place = made(CORNER, EVEN)
    noise = 1e-6 * rng.normal(size=(len(EVEN), 3)), 1e-6 * rng.normal(size=(6, 3))
    wanted[: len(EVEN)], place[: len(CORNER)] = noise
    found = samples.as_many(other, place, wanted)
    np.testing.assert_allclose(found.q, other.q, atol=1e-4)
