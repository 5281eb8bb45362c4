"""The gap in the gears by its definition: a flank that is pushed along."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.simulation import make_arrivals, virtual_arm
from postproc.simulation.arm import (
    ELASTIC,
    GearKind,
    Gears,
    VirtualArm,
    at_start,
    follow,
    move,
    turning_points,
)
from postproc.simulation.kinematics import link_torque
from postproc.simulation.laws import Where, total

GAP = 1e-4
GEARS = Gears(np.full(6, GAP), np.eye(6))


def at_zero(side: float = 1.0):
    return at_start(GEARS, np.zeros(6), np.full(6, side))


def link_by_definition(path: np.ndarray, first_side: float) -> np.ndarray:
    """Push a link with two flanks: it stays inside motor +- GAP."""
    link = path[0] - first_side * GAP
    for motor in path[1:]:
        link = min(max(link, motor - GAP), motor + GAP)
    return (path[-1] - link) / GAP


@pytest.mark.parametrize("seed", range(10))
def test_side_is_that_of_a_pushed_link(seed: int) -> None:
    rng = np.random.default_rng(seed)
    steps = rng.normal(size=(60, 6)) * np.array([0.3, 0.6, 1.0, 2.0, 5.0, 20.0]) * GAP
    path = np.vstack([np.zeros(6), np.cumsum(steps, axis=0)])
    state = move(GEARS, at_zero(), path[1:])
    wanted = [link_by_definition(path[:, j], 1.0) for j in range(6)]
    np.testing.assert_allclose(state.side, wanted, atol=1e-9)


def test_a_joint_that_stands_keeps_its_side() -> None:
    state = move(GEARS, at_zero(-1.0), np.array([[0.5, 0, 0, 0, 0, 0]]))
    np.testing.assert_array_equal(state.side, [1, -1, -1, -1, -1, -1])


def test_a_short_way_back_leaves_the_flank_only_half_way() -> None:
    state = move(GEARS, at_zero(), np.full((1, 6), -0.5 * GAP))
    np.testing.assert_allclose(state.side, 0.5)
    assert (state.heading == 1).all()
    state = move(GEARS, state, np.full((1, 6), -3 * GAP))
    np.testing.assert_allclose(state.side, -1.0)
    assert (state.heading == -1).all()


def test_travel_and_loop_count_from_the_turns() -> None:
    stops = np.outer([0.0, 0.3, 0.1, 0.25], np.ones(6))
    state = at_start(GEARS, stops[0], np.ones(6))
    state = move(GEARS, state, stops[1:])
    np.testing.assert_allclose(state.travel, 0.15)
    np.testing.assert_allclose(state.loop, 0.2)


def test_a_path_in_pieces_is_the_path() -> None:
    path = np.cumsum(np.random.default_rng(3).normal(size=(40, 6)) * GAP, axis=0)
    whole, piece = move(GEARS, at_zero(), path), at_zero()
    for point in path:
        piece = move(GEARS, piece, point[None])
    np.testing.assert_allclose(whole.side, piece.side, atol=1e-9)
    np.testing.assert_allclose(whole.travel, piece.travel, atol=1e-12)


def test_only_turning_points_and_the_end_are_kept() -> None:
    path = np.zeros((5, 6))
    path[:, 0] = [0.0, 1.0, 2.0, 1.5, 1.0]
    path[:, 1] = [0.0, 1e-15, 0.0, 1e-15, 0.0]
    np.testing.assert_array_equal(turning_points(path)[:, 0], [2.0, 1.0])


def test_the_motor_of_a_coupled_wrist_turns_when_its_joint_does_not() -> None:
    coupling = np.eye(6)
    coupling[5, 4] = -1.0
    gears = Gears(np.full(6, GAP), coupling)
    state = at_start(gears, np.zeros(6), np.ones(6))
    state = move(gears, state, np.array([[0, 0, 0, 0, 0.2, 0.0]]))
    assert state.side[5] == -1.0


@pytest.mark.parametrize("seed", [4, 7])
def test_a_link_rests_while_its_motor_crosses_the_gap(seed: int) -> None:
    arm = virtual_arm(seed, "backlash")
    for q in (np.radians([20.0, 30.0, -100.0, 10.0, 40.0, 0.0]), np.full(6, -0.7)):
        gap = arm.gears.half_gaps(q[None])[0]
        assert (np.abs(gap / arm.gears.gap - 1) > 1e-3).all()
        way = q - np.linspace(0.0, 2.4, 25)[:, None] * gap
        before = at_start(arm.gears, q, np.ones(6))
        side = follow(arm.gears, before, way[1:]).side
        np.testing.assert_allclose(side, np.clip(1 - (q - way) / gap, -1, 1), atol=2e-3)
        joints = arm_joints(arm, way, side)
        np.testing.assert_allclose(joints[:21], np.tile(joints[0], (21, 1)), atol=1e-7)
        assert (joints[-1] < joints[20] - 0.3 * gap).all()


def arm_joints(arm: VirtualArm, q: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Return where the links stand."""
    return q + total(arm.laws, Where.JOINTS, make_arrivals(q, side))


# Gears of other kinds.

Q = np.radians([20.0, 30.0, -100.0, 10.0, 40.0, 0.0])


def arm_with(kind: str):
    return virtual_arm(7, gears=kind)


def shown(kind: str, path: np.ndarray, gears: Gears | None = None) -> np.ndarray:
    """Follow a path from rest on a forward flank; return what the links show."""
    gears = gears or replace(GEARS, kinds=(GearKind(kind),) * 6)
    states = follow(gears, at_start(gears, path[0], np.ones(6)), path[1:])
    return gears.show_sides(make_arrivals(path[1:], flank=states.flank[1:]))


def test_the_kind_of_the_gears_changes_nothing_else() -> None:
    sharp, other = arm_with("sharp"), arm_with("elastic")
    arrivals = make_arrivals(Q[None], 1.0)
    np.testing.assert_array_equal(sharp.tcp(arrivals), other.tcp(arrivals))
    assert set(sharp.gears.kinds) == {GearKind.SHARP}


def test_mixed_gears_behave_one_by_one_as_their_kinds_do() -> None:
    arms = [virtual_arm(seed, gears="mixed") for seed in range(8)]
    assert {kind for arm in arms for kind in arm.gears.kinds} == {*GearKind}
    path = Q + np.linspace(0.0, -6 * GAP, 50)[:, None]
    for arm in arms:
        whole = replace(arm.gears, gap=np.full(6, GAP), bends=np.ones(6))
        found = shown("", path, whole)
        for kind in GearKind:
            alone = shown("", path, replace(whole, kinds=(kind,) * 6))
            own = whole.are(kind)
            np.testing.assert_array_equal(found[:, own], alone[:, own])


def test_an_elastic_flank_goes_over_smoothly() -> None:
    back = -np.linspace(0.0, 2 * ELASTIC * GAP, 401)
    found = shown("elastic", np.tile(back[:, None], (1, 6)))[:, 0]
    wanted = np.cos(np.pi * np.arange(1, 401) / 400)
    np.testing.assert_allclose(found, wanted, atol=1e-9)
    closed = np.tile(np.append(back, back[::-1])[:, None], (1, 6))
    np.testing.assert_allclose(shown("elastic", closed)[-1], 1.0)


@pytest.mark.parametrize("seed", range(3))
def test_weight_chooses_the_flank_whichever_way_a_joint_moves(seed: int) -> None:
    arm = virtual_arm(seed, gears="gravity")
    gears = arm.gears
    there = np.linspace(Q - 0.02, Q + 0.02, 50)
    onwards, back = (shown("gravity", path, gears) for path in (there, there[::-1]))
    torque = link_torque(gears.body, there)
    heavy = (np.abs(torque) > 1.1 * gears.friction).all(axis=0)
    light = (np.abs(torque) < 0.9 * gears.friction).all(axis=0)
    assert heavy.any() and light.any()
    pushed = -np.sign(torque[0, heavy])
    np.testing.assert_array_equal(onwards[-1, heavy], pushed)
    np.testing.assert_array_equal(back[-1, heavy], pushed)
    np.testing.assert_array_equal(onwards[-1, light], 1.0)
    np.testing.assert_array_equal(back[-1, light], -1.0)


def test_fast_braking_changes_the_flank_and_slow_braking_does_not() -> None:
    gears = arm_with("inertia").gears
    path = np.linspace(Q - 0.1, Q + 0.1, 20)
    state = move(gears, at_start(gears, path[0], np.ones(6)), path[1:])
    slow, fast = 0.9 * gears.runs_on, 1.1 * gears.runs_on
    np.testing.assert_array_equal(gears.brake(state, slow).flank, 1.0)
    np.testing.assert_array_equal(gears.brake(state, fast).flank, -1.0)
    np.testing.assert_array_equal(gears.brake(state, -fast).flank, 1.0)
    behind = move(gears, gears.brake(state, fast), path[-1:] + 3 * gears.gap)
    np.testing.assert_allclose(behind.flank, 1.0)
    sharp = arm_with("sharp").gears
    np.testing.assert_array_equal(sharp.brake(state, fast).flank, 1.0)
