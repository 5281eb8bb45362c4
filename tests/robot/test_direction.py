from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from postproc.robot.arm import Arm, load_arm
from postproc.robot.backlash_operator import (
    Edges,
    PlayOperator,
    _insert_turning_values,
)
from postproc.robot.direction import (
    WIDTH_IN_PLAYS,
    Arrivals,
    FlankState,
    arrivals,
    arrivals_of_rows,
    half_width,
    in_row_order,
    passages,
    sides,
    sides_along,
)


@pytest.fixture(scope="module")
def arm() -> Arm:
    return load_arm("nj220-2.7")


def sequential(q: np.ndarray, z: np.ndarray, half: float) -> np.ndarray:
    """Run the play operator by its definition, one angle after the other."""
    states = []
    for angle in q:
        z = np.minimum(np.maximum(z, angle - half), angle + half)
        states.append(z)
    return np.array(states)


def one_joint(arm: Arm, plays: list[float], joint: int = 0) -> Arrivals:
    """Visit angles of one joint, given in plays of that joint."""
    q = np.zeros((len(plays), 6))
    q[:, joint] = np.array(plays) * arm.play[joint]
    return arrivals_of_rows(arm, q)


angles = st.floats(-3.0, 3.0, allow_nan=False)


@given(arrays(float, (3, 2, 4), elements=angles), arrays(float, 4, elements=angles))
@settings(max_examples=60, deadline=None)
def test_clamps_are_a_monoid(bounds: np.ndarray, z: np.ndarray) -> None:
    a, b, c = (PlayOperator(*np.sort(pair, axis=0)) for pair in bounds)
    np.testing.assert_array_equal(a.then(b)(z), b(a(z)))
    left, right = a.then(b).then(c), a.then(b.then(c))
    np.testing.assert_array_equal(left.lo, right.lo)
    np.testing.assert_array_equal(left.hi, right.hi)


def test_before_the_first_move_nothing_is_known(arm: Arm) -> None:
    assert (one_joint(arm, [5.0]).direction == 0).all()


def test_side_of_a_joint_that_moves_and_rests(arm: Arm) -> None:
    side = one_joint(arm, [0, 10, 10, 3, 3, -20]).direction[:, 0]
    assert side.tolist() == [0, 1, 1, -1, -1, -1]


def test_a_joint_that_never_moved_is_unknown(arm: Arm) -> None:
    assert (one_joint(arm, [0, 10, 0]).direction[:, 1:] == 0).all()


@pytest.mark.parametrize(
    ("back", "side"), [(0.9, 1), (1.1, 0), (2.9, 0), (3.1, -1), (30.0, -1)]
)
def test_a_return_counts_after_one_and_three_plays(
    arm: Arm, back: float, side: int
) -> None:
    assert one_joint(arm, [0, 50, 50 - back]).direction[-1, 0] == side


def test_the_drive_decides_where_wrist_gears_are_coupled(arm: Arm) -> None:
    coupling = np.eye(6)
    coupling[5, 4] = -2.0
    coupled = replace(arm, coupling=coupling)
    q = np.zeros((3, 6))
    q[:, 4], q[:, 5] = [0.0, 0.1, 0.4], [0.0, -0.1, 0.1]
    assert arrivals_of_rows(arm, q).direction[2, 5] == 1
    assert arrivals_of_rows(coupled, q).direction[2, 5] == -1


def test_a_turn_between_the_last_two_samples_is_not_missed(arm: Arm) -> None:
    # The joint turns at u = 0.97, samples stand at 0.25 .. 1: each above the last.
    u = np.linspace(0, 1, 5)[1:]
    path = np.zeros((5, 6))
    path[1:, 0] = 2.0 * (u - u**2 / (2 * 0.97))
    path[0, 0] = 0.0
    q = path[[0, 4]]
    edges = Edges(np.array([0, 1, 2]), np.array([-1, 0]), path, np.array([0, 1, 5]))
    assert (np.diff(path[:, 0]) > 0).all()
    assert 0.97 - path[-1, 0] > 3 * arm.play[0]
    assert arrivals(arm, q, edges).direction[1, 0] == -1


def refined(y):
    """Put the turning values into one edge from the first row to the last."""
    edges = Edges(np.array([0, 1]), np.array([0]), y[1:], np.array([0, len(y) - 1]))
    return _insert_turning_values(y[:1], edges.source, edges.path, edges).values


def test_turning_values_are_exact_for_parabolas() -> None:
    rng = np.random.default_rng(0)
    vertex, height = rng.uniform(-0.99, 0.99, 6), rng.normal(size=6)
    t = np.array([-1.0, 0.0, 1.0])[:, None]
    y = height + 1.7 * (t - vertex) ** 2
    out = refined(y)
    assert len(out) == 2 + 2
    found = np.where(vertex < 0, out[0], out[2])
    np.testing.assert_allclose(found, height, atol=1e-12)
    np.testing.assert_array_equal(out[[1, 3]], y[1:])


def test_nothing_is_inserted_where_nothing_turns() -> None:
    y = np.arange(24.0).reshape(4, 6) ** 2
    np.testing.assert_array_equal(refined(y), y[1:])


def test_predecessors_that_agree_and_that_do_not(arm: Arm) -> None:
    # Visits 1 and 2 follow 0; visit 3 follows both.
    q = np.zeros((4, 6))
    q[:, 0] = [0.0, 0.1, 0.2, 0.5]
    q[:, 1] = [0.0, 0.1, -0.1, 0.0]
    first = np.array([0, 1, 2, 3, 5])
    source = np.array([-1, 0, 0, 1, 2])
    edges = Edges(first, source, q[[0, 1, 2, 3, 3]], np.arange(6))
    found = arrivals(arm, q, edges)
    assert found.direction[3, :2].tolist() == [1, 0]
    np.testing.assert_allclose(found.travel[3, :2], [0.5, 0.0])


def test_a_loop_is_known_where_every_round_agrees(arm: Arm) -> None:
    # 0 -> 1 -> 2 -> 1 ..: visit 1 is reached from both sides, visit 2 from one.
    q = np.zeros((3, 6))
    q[:, 0] = [0.0, 0.1, 0.2]
    first, source = np.array([0, 1, 3, 4]), np.array([-1, 0, 2, 1])
    edges = Edges(first, source, q[[0, 1, 1, 2]], np.arange(5))
    assert arrivals(arm, q, edges).direction[:, 0].tolist() == [0, 0, 1]


def test_a_loop_without_entry_is_unknown(arm: Arm) -> None:
    q = np.zeros((2, 6))
    q[:, 0] = [0.0, 0.1]
    edges = Edges(np.array([0, 1, 2]), np.array([1, 0]), q, np.arange(3))
    assert (arrivals(arm, q, edges).direction == 0).all()


def test_unknown_joint_angles_forget_the_past(arm: Arm) -> None:
    q = np.zeros((4, 6))
    q[:, 0] = [0.0, 0.1, np.nan, 0.3]
    found = arrivals_of_rows(arm, q)
    assert found.direction[:, 0].tolist() == [0, 1, 0, 0]
    assert np.isnan(found.travel[2, 0])


@given(st.lists(st.integers(-40, 40), min_size=1, max_size=60))
@settings(max_examples=60, deadline=None)
def test_rows_match_the_definition(plays: list[int]) -> None:
    arm = load_arm("nj220-2.7")
    q = np.array(plays, dtype=float) * 0.37 * arm.play[0]
    half = WIDTH_IN_PLAYS / 2 * arm.play[0]
    low = (q - sequential(q, q[0] + half, half)) / half
    high = (q - sequential(q, q[0] - half, half)) / half
    expected = (low >= 0.5 - 1e-9) * 1.0 - (high <= -0.5 + 1e-9) * 1.0
    found = one_joint(arm, (q / arm.play[0]).tolist()).direction[:, 0]
    near = (np.abs(np.abs(low) - 0.5) < 1e-6) | (np.abs(np.abs(high) - 0.5) < 1e-6)
    np.testing.assert_array_equal(found[~near], expected[~near])


def test_travel_counts_from_the_extreme_value_and_ignores_jitter(arm: Arm) -> None:
    plays = [0.0, 100, 99.5, 200, 150, 150.6, 120, 400]
    travel = one_joint(arm, plays).travel[:, 0] / arm.play[0]
    expected = [0, 100, 99.5, 200, 50, 49.4, 80, 280]
    np.testing.assert_allclose(travel, expected, atol=1e-9)


def test_long_chains_are_no_chains_of_python_calls(arm: Arm) -> None:
    q = np.cumsum(np.random.default_rng(1).normal(size=(20_000, 6)) * 0.01, axis=0)
    first, source = in_row_order(len(q))
    found = arrivals(arm, q, Edges(first, source, q, first)).direction
    half = WIDTH_IN_PLAYS / 2 * arm.play
    z = sequential(q, q[0] - half, half)
    np.testing.assert_array_equal(found[500:], np.sign(q - z)[500:] * (
        np.abs(q - z) >= half / 2)[500:])  # fmt: skip


def naive(q: np.ndarray, edges: Edges, half: float) -> np.ndarray:
    """Propagate intervals edge by edge and sample by sample until nothing changes."""
    n = len(q)
    low, high = np.full(n, np.inf), np.full(n, -np.inf)
    for _ in range(4 * n):
        for v in range(n):
            for e in range(edges.first[v], edges.first[v + 1]):
                p = edges.source[e]
                a, b = (-np.inf, np.inf) if p < 0 else (low[p], high[p])
                if a > b:
                    continue
                for angle in edges.path[edges.start[e] : edges.start[e + 1], 0]:
                    a, b = (np.clip(z, angle - half, angle + half) for z in (a, b))
                low[v], high[v] = min(low[v], a), max(high[v], b)
    known = low <= high
    up = known & ((q[:, 0] - high) / half >= 0.5)
    down = known & ((q[:, 0] - low) / half <= -0.5)
    return up.astype(float) - down


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_graphs_match_a_naive_propagation(data: st.DataObject) -> None:
    arm = load_arm("nj220-2.7")
    n = data.draw(st.integers(1, 7))
    angle = st.integers(-12, 12).map(lambda k: 0.93 * k * arm.play[0])
    first, source, path, start = [0], [], [], [0]
    q = np.zeros((n, 6))
    q[:, 0] = [data.draw(angle) for _ in range(n)]
    for v in range(n):
        for p in data.draw(st.lists(st.integers(-1, n - 1), max_size=3, unique=True)):
            source.append(p)
            # Turning values between samples are tested elsewhere: only corners here.
            path += [q[v]]
            start.append(len(path))
        first.append(len(source))
    edges = Edges(np.array(first), np.array(source, dtype=int),
                  np.array(path).reshape(-1, 6), np.array(start))  # fmt: skip
    expected = naive(q, edges, WIDTH_IN_PLAYS / 2 * arm.play[0])
    np.testing.assert_array_equal(arrivals(arm, q, edges).direction[:, 0], expected)


@given(st.lists(st.integers(-30, 30), min_size=1, max_size=50))
@settings(max_examples=60, deadline=None)
def test_travel_matches_its_definition(steps: list[int]) -> None:
    arm = load_arm("nj220-2.7")
    play = arm.play[0]
    q = np.cumsum(steps) * 0.31 * play
    side, turn, extreme, expected = 0.0, q[0], q[0], []
    for angle in q:
        if side == 0 and abs(angle - extreme) > play / 2:
            side, extreme = np.sign(angle - extreme), angle
        elif side != 0 and side * (angle - extreme) > 0:
            extreme = angle
        elif side * (extreme - angle) > play:
            side, turn, extreme = -side, extreme, angle
        expected.append(abs(angle - turn))
    found = one_joint(arm, (q / play).tolist()).travel[:, 0]
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_a_walk_goes_on_where_it_was_cut(arm: Arm, seed: int) -> None:
    rng = np.random.default_rng(seed)
    q = np.cumsum(rng.normal(0, arm.play, (300, 6)), axis=0)
    first, source = in_row_order(len(q))
    whole = arrivals(arm, q, Edges(first, source, q, first))
    for begin, end in ((0, 1), (0, 40), (39, 41), (100, 170), (169, 300)):
        some = q[begin:]
        first, source = in_row_order(len(some))
        edges = Edges(first, source, some, first)
        found = arrivals(arm, some, edges, whole[begin:end])
        for name in ("direction", "side", "travel"):
            wanted = getattr(whole, name)[begin:]
            np.testing.assert_array_equal(getattr(found, name), wanted)
        again = sides(arm, some, passages(arm, some, edges), FlankState(
            whole.side[begin:end], whole.past.play[begin:end]))  # fmt: skip
        np.testing.assert_array_equal(again.side, whole.side[begin:])
        np.testing.assert_array_equal(again.play.lo, whole.past.play.lo[begin:])


def test_a_play_along_ways_is_as_wide_as_it_is_there(arm: Arm) -> None:
    rng = np.random.default_rng(11)
    half = half_width(arm)
    steps = rng.normal(size=(200, 6)) * half * rng.choice([0.1, 0.5, 3.0], (200, 1))
    q = np.linalg.solve(arm.coupling, np.cumsum(steps, axis=0).T).T
    begins = np.isin(np.arange(200), [0, 70, 71])
    side = rng.uniform(-1.0, 1.0, (3, 6))
    angles = q @ arm.coupling.T
    wide = half * (1.3 + np.cos(angles / half / 20.0))
    z = angles[begins] - side * half
    least, most = sides_along(arm, q, begins, PlayOperator(z, z), wide)
    np.testing.assert_allclose(least, most, rtol=0, atol=1e-9)
    wanted, way = np.empty((200, 6)), -1
    for k in range(200):
        if begins[k]:
            way += 1
            wanted[k] = side[way]
            continue
        over = (angles[k] - angles[k - 1]) * 2.0 / (wide[k] + wide[k - 1])
        wanted[k] = np.clip(wanted[k - 1] + over, -1.0, 1.0)
    np.testing.assert_allclose(least, wanted, rtol=0, atol=1e-9)


def test_a_play_that_is_not_known_stays_open_until_a_flank_is_reached(arm: Arm) -> None:
    half = half_width(arm)
    q = np.zeros((4, 6))
    q[:, 0] = np.array([0.0, 1.0, 2.5, 5.0]) * half[0]
    z = PlayOperator(q[:1] - half, q[:1] + half)
    wide = np.tile(2.0 * half, (4, 1))
    least, most = sides_along(arm, q, np.arange(4) == 0, z, wide)
    np.testing.assert_allclose(least[:, 0], [-1.0, -0.5, 0.25, 1.0], atol=1e-9)
    np.testing.assert_allclose(most[:, 0], 1.0, atol=1e-9)
