"""Arrivals at one literal: agreement, disagreement, and never a silent mean."""

import numpy as np

from postproc.reconcile import agree


def test_groups_by_literal():
    literal = np.array([3, -1, 3, 5])
    corrected = np.array([[1.0] * 6, [9.0] * 6, [3.0] * 6, [4.0] * 6])
    change = np.array([[0.0, 0, 0], [9, 9, 9], [0.3, 0.4, 0], [1, 1, 1]])
    found = agree(literal, np.array([True, True, True, False]), corrected, change)
    np.testing.assert_array_equal(found.literal, [3, 5])
    np.testing.assert_array_equal(found.group, [0, -1, 0, 1])
    np.testing.assert_array_equal(found.usable, [True, False])
    np.testing.assert_allclose(found.spread_mm, [0.5, 0.0])
    np.testing.assert_allclose(found.values[:, 0], [2.0, 4.0])
    np.testing.assert_array_equal(found.arrivals, [2, 1])


def test_nothing_visited():
    found = agree(np.array([-1]), np.array([True]), np.zeros((1, 6)), np.zeros((1, 3)))
    assert len(found.literal) == 0


def test_unusable_arrival_spoils_the_group():
    found = agree(
        np.array([0, 0]), np.array([True, False]), np.zeros((2, 6)), np.zeros((2, 3))
    )
    assert not found.usable[0]
