"""What $FLY_TYPE, $FLY_TRAJ, $FLY_DIST and $FLY_PER make of a fly point."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.solver.targets import rounding_of
from postproc.language.visits import Blend, ZoneRule
from postproc.motion.path import BlendCoupling
from postproc.motion.targets import Fly
from tests.bench.made import unbroken
from tests.made_visits import visits

NAN = float("nan")
NORM, CART = Blend.OVERLAP, Blend.ZONE


@pytest.mark.parametrize(
    ("type_", "trajectory", "distance", "percent", "expected"),
    [
        (CART, ZoneRule.FROM, 3.0, NAN, (Fly.FROM, 3e-3, 1.0)),
        (CART, ZoneRule.UNSET, NAN, NAN, (Fly.FROM, 5e-3, 1.0)),
        (CART, ZoneRule.WITHIN, 2.0, NAN, (Fly.WITHIN, 2e-3, 1.0)),
        (CART, ZoneRule.PASS, 2.0, NAN, (Fly.EXACT, 2e-3, 1.0)),
        (CART, ZoneRule.UNSET, -1.0, NAN, (Fly.EXACT, 0.0, 1.0)),
        (NORM, ZoneRule.UNSET, NAN, 70.0, (Fly.OVERLAP, 5e-3, 0.7)),
        (Blend.UNSET, ZoneRule.UNSET, NAN, NAN, (Fly.OVERLAP, 5e-3, 1.0)),
        (NORM, ZoneRule.UNSET, -1.0, 70.0, (Fly.EXACT, 0.0, 0.7)),
    ],
)
def test_settings(type_, trajectory, distance, percent, expected) -> None:
    one = visits(
        [0], [[0.0] * 6], fly=np.array([True]), size_mm=np.array([distance]),
        overlap_percent=np.array([percent]), blend=np.array([int(type_)]),
        rule=np.array([int(trajectory)]),
    )  # fmt: skip
    rounding, metres, overlap = rounding_of(one)
    assert (rounding[0], metres[0], overlap[0]) == pytest.approx(expected)


def test_targets_make_up_for_what_their_neighbours_pull() -> None:
    rng = np.random.default_rng(3)
    n = 40
    middle = np.arange(1, n - 1)
    v, w = rng.uniform(0, 0.125, (2, n - 2))
    along = np.eye(3)[rng.integers(0, 3, n - 2)]
    pull = BlendCoupling(middle, middle - 1, middle + 1, v, w, along)
    wanted = rng.normal(size=(n, 3))
    moved = pull.to_move(wanted)
    np.testing.assert_allclose(moved + pull.on(moved), wanted, atol=2e-3)
    np.testing.assert_array_equal(BlendCoupling().to_move(wanted), wanted)


def test_corners_are_bent_anew_as_sides_change(bench_cell, bench_model) -> None:
    made = unbroken(1500)
    found = compensate(made.source, bench_cell, bench_model, name="milled.pdl")
    assert found.after.p95_mm < 0.008
