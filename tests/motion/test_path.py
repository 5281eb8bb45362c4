from __future__ import annotations

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from postproc.motion.path import STEP, TURN, arcs, join_segments, lines

points = arrays(float, (3, 3), elements=st.floats(-2.0, 2.0, allow_nan=False))


def poses(xyz: np.ndarray, seed: int = 0) -> np.ndarray:
    T = np.tile(np.eye(4), (len(xyz), 1, 1))
    T[:, :3, :3] = Rotation.random(
        len(xyz), rng=np.random.default_rng(seed)
    ).as_matrix()
    T[:, :3, 3] = xyz
    return T


def test_lines_are_straight_and_turn_about_one_axis() -> None:
    begin, end = poses(np.zeros((1, 3)), 1), poses(np.array([[0.3, 0.4, 0.0]]), 2)
    u = np.linspace(0, 1, 11)
    T = lines(begin, end).poses(np.zeros(11, dtype=int), u)
    np.testing.assert_allclose(T[[0, -1]], np.concatenate([begin, end]), atol=1e-12)
    np.testing.assert_allclose(T[:, :3, 3], u[:, None] * end[0, :3, 3], atol=1e-12)
    steps = Rotation.from_matrix(T[:-1, :3, :3].transpose(0, 2, 1) @ T[1:, :3, :3])
    first = np.tile(steps.as_rotvec()[:1], (10, 1))
    np.testing.assert_allclose(steps.as_rotvec(), first, atol=1e-12)


def test_samples_are_as_dense_as_promised() -> None:
    begin, end = (
        poses(np.zeros((2, 3)), 3),
        poses(np.array([[1.0, 0, 0], [0, 0, 0]]), 3),
    )
    end[1, :3, :3] = begin[1, :3, :3] @ Rotation.from_rotvec([0.5, 0, 0]).as_matrix()
    count = lines(begin, end).intervals(np.array([1, 1]))
    assert count.tolist() == [int(1 / STEP), int(np.ceil(0.5 / TURN))]


@given(points)
@settings(max_examples=80, deadline=None)
def test_arcs_lie_on_the_circle_and_pass_all_three_points(xyz: np.ndarray) -> None:
    u, v = xyz[1] - xyz[0], xyz[2] - xyz[0]
    sides = [np.linalg.norm(d) for d in (u, v, v - u)]
    assume(min(sides) > 0.05)
    assume(np.linalg.norm(np.cross(u, v)) > 0.1 * sides[0] * sides[1])
    T = poses(xyz)
    to_via, to_end = arcs(T[:1], T[1:2], T[2:])
    assert to_via.valid[0] and to_end.valid[0]
    both = join_segments([to_via, to_end])
    k = np.repeat([0, 1], 9)
    sampled = both.poses(k, np.tile(np.linspace(0, 1, 9), 2))
    centre = to_via.centre[0]
    distance = np.linalg.norm(sampled[:, :3, 3] - centre, axis=1)
    np.testing.assert_allclose(distance, distance[0], rtol=1e-9)
    np.testing.assert_allclose(sampled[[0, 8, 9, 17]], T[[0, 1, 1, 2]], atol=1e-8)
    flat = (sampled[:, :3, 3] - centre) @ np.cross(u, v)
    np.testing.assert_allclose(flat, 0.0, atol=1e-9)
    assert to_via.angle[0] + to_end.angle[0] < 2 * np.pi


def test_points_on_a_line_make_no_arc() -> None:
    T = poses(np.array([[0, 0, 0], [0.1, 0.1, 0], [0.3, 0.3, 0], [0, 0, 0]], float))
    assert not arcs(T[:1], T[1:2], T[2:3])[0].valid[0]
    assert not arcs(T[:1], T[1:2], T[3:])[0].valid[0]
