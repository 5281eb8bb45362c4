"""Arrivals at one literal: agreement, disagreement, and one correction for all."""

import numpy as np
import pytest

from postproc.compensation.solver.agreement import agree, average, weigh_middle


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


def test_literals_with_one_arrival_each_are_groups_of_one():
    rng = np.random.default_rng(2)
    literal = np.array([7, -1, 2, 9, 4])
    corrected, change = rng.normal(size=(5, 6)), rng.normal(size=(5, 3))
    usable = np.array([True, True, False, True, True])
    alone = agree(literal, usable, corrected, change)
    # The same with one more arrival, at another literal twice: the general case.
    again = [0, 1, 2, 3, 4, 4, 4]
    literal, usable = np.append(literal, [11, 11]), usable[again]
    general = agree(literal, usable, corrected[again], change[again])
    for name in ("literal", "usable", "spread_mm", "values", "change_mm", "arrivals"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(general, name)[:4])
    np.testing.assert_array_equal(alone.group, general.group[:5])


def test_literals_in_the_order_of_the_visits_agree_as_in_any_other():
    rng = np.random.default_rng(3)
    literal = np.array([2, -1, 4, 7])
    usable = np.array([True, True, False, True])
    corrected, change = rng.normal(size=(4, 6)), rng.normal(size=(4, 3))
    found = agree(literal, usable, corrected, change)
    back = agree(literal[::-1], usable[::-1], corrected[::-1], change[::-1])
    for name in ("literal", "usable", "spread_mm", "values", "change_mm", "arrivals"):
        np.testing.assert_array_equal(getattr(found, name), getattr(back, name))
    np.testing.assert_array_equal(found.group, back.group[::-1])


# Arrivals that need different corrections, and one that helps each of them.


def in_one_group(change, std=0.0):
    """Average the arrivals at one literal, whose numbers are their corrections."""
    n = len(change)
    alone = agree(np.zeros(n, dtype=int), np.ones(n, dtype=bool), change, change)
    known = np.ones(1, dtype=bool)
    return average(alone, change, change, known, np.full(n, std))


@pytest.mark.parametrize("seed", range(20))
def test_the_middle_is_where_the_farthest_point_is_nearest(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(rng.integers(2, 8), rng.integers(1, 5)))
    share = weigh_middle(points)
    assert share.min() >= 0.0 and abs(share.sum() - 1.0) < 1e-9
    middle = share @ points
    radius = np.linalg.norm(points - middle, axis=1).max()
    for other in middle + 0.3 * rng.normal(size=(500, points.shape[1])):
        assert np.linalg.norm(points - other, axis=1).max() > radius * (1.0 - 5e-3)


def test_many_arrivals_do_not_outvote_one():
    change = np.vstack([np.tile([1.0, 0.0, 0.0], (999, 1)), [[1.4, 0.0, 0.0]]])
    found = in_one_group(change)
    np.testing.assert_allclose(found.change_mm, [[1.2, 0.0, 0.0]])
    np.testing.assert_allclose(found.values, [[1.2, 0.0, 0.0]])
    np.testing.assert_allclose(found.radius_mm, [0.2])
    np.testing.assert_allclose(found.share_out(change), np.tile([1.2, 0, 0], (1000, 1)))
    assert not found.find_apart(0.02).any()


@pytest.mark.parametrize(
    ("change", "std"),
    [
        ([[1.0, 0, 0], [0.05, 0, 0]], 0.0),  # the second is 0.475 off instead of 0.05
        ([[1.0, 0, 0], [-1.0, 0, 0]], 0.0),  # both need the opposite
        ([[1.0, 0, 0], [0.5, 0, 0]], 0.2),  # 0.25 + 1.96 x 0.2 is more than 0.5
    ],
)
def test_what_does_not_help_every_arrival_is_no_correction(change, std):
    found = in_one_group(np.array(change), std)
    assert found.radius_mm.tolist() == [0.0] and found.find_apart(0.02).all()
    assert np.isnan(found.weights).all()
