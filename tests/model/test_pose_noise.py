"""The covariance of rows that share a stop or a pose, checked by its definition."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.calibration.design_matrix import DesignMatrix
from postproc.calibration.noise_estimate import estimate_noise
from postproc.model.effect_sum import Combination
from postproc.model.effects import propose
from postproc.model.kinematics import ArmStates
from postproc.model.noise import Noise, angle_step, poses_of
from postproc.model.whitening import RowBlocks, Whitener
from postproc.robot.state import States
from tests.calibration.simulator import NJ, PLATE, random_states

NOISE = Noise(1.5, 2e-5, None, 3e-5, 4e-5, 5e-5)


def visits(poses: int, rounds: int, nests: int, seed: int = 0) -> States:
    """Visit poses in rounds; every nest is read at every stop."""
    q = random_states(poses, np.random.default_rng(seed)).q
    pose = np.tile(np.repeat(np.arange(poses), nests), rounds)
    stop = np.repeat(np.arange(poses * rounds), nests)
    nest = np.tile(np.arange(nests), poses * rounds)
    side = np.where(np.arange(poses * rounds) < poses, 1.0, -1.0)[stop]
    alike = random_states(len(pose), np.random.default_rng(seed))
    return alike.with_(
        q=q[pose], tool=PLATE[nest], tool_id=nest, order=stop.astype(float),
        direction=np.repeat(side[:, None], 6, axis=1),
    )  # fmt: skip


def covariance(states: States, noise: Noise) -> np.ndarray:
    """Write the covariance of all rows out, (3 n, 3 n), from its definition."""
    J, n = ArmStates(NJ, states).jacobian, len(states)
    V = np.zeros((n, 3, n, 3))
    for i in range(n):
        V[i, :, i] += noise.tracker**2 * 1e-10 / states.readings[i] * np.eye(3)
        for k in range(n):
            if (states.q[i] == states.q[k]).all():
                V[i, :, k] += noise.pose_joint**2 * J[i] @ J[k].T
                V[i, :, k] += noise.pose**2 * np.eye(3)
            if states.order[i] == states.order[k]:
                V[i, :, k] += noise.joint**2 * J[i] @ J[k].T
                V[i, :, k] += noise.stop**2 * np.eye(3)
    return V.reshape(3 * n, 3 * n)


@pytest.mark.parametrize(("rounds", "nests"), [(1, 1), (1, 3), (2, 1), (2, 2)])
def test_whitened_rows_have_the_covariance_of_the_definition(
    rounds: int, nests: int
) -> None:
    states = visits(7, rounds, nests)
    batch = ArmStates(NJ, states)
    whitener = Whitener.build(batch, batch.walk.tcp, None)
    by = whitener.whitening(NOISE, np.ones(len(states)))
    rows = np.eye(3 * len(states)).reshape(len(states), 3, -1)
    W = by.apply(whitener.rotate(rows)).reshape(3 * len(states), -1)
    V = covariance(states, NOISE)
    np.testing.assert_allclose(W @ V @ W.T, np.eye(len(V)), atol=1e-9)
    assert by.log_det == pytest.approx(float(np.linalg.slogdet(V)[1]), abs=1e-8)


def test_a_row_that_is_dropped_is_as_if_it_were_not_there() -> None:
    states = visits(5, 2, 2)
    batch = ArmStates(NJ, states)
    weight = np.ones(len(states))
    weight[3] = 0.0
    whitener = Whitener.build(batch, batch.walk.tcp, None)
    by = whitener.whitening(NOISE, weight)
    rows = np.eye(3 * len(states)).reshape(len(states), 3, -1)
    W = by.apply(whitener.rotate(rows)).reshape(3 * len(states), -1)
    used = np.repeat(weight > 0, 3)
    precision = np.linalg.inv(covariance(states, NOISE)[np.ix_(used, used)])
    np.testing.assert_allclose(
        (W.T @ W)[np.ix_(used, used)], precision, rtol=1e-6, atol=2e3
    )
    assert not W[:, ~used].any() and not W[~used].any()


def test_scatter_of_reading_stop_and_pose_is_told_apart() -> None:
    """Means of 12 campaigns of 150 poses lie within 5 % of what was drawn."""
    states = visits(150, 2, 2, seed=3).with_(readings=np.full(600, 3.0))
    batch = ArmStates(NJ, states)
    V = covariance(states, NOISE)
    root = np.linalg.cholesky(V + 1e-18 * np.eye(len(V)))
    rng, found = np.random.default_rng(5), []
    for _ in range(12):
        error = (root @ rng.standard_normal(len(V))).reshape(-1, 3)
        scatter = NOISE.tracker**2 * 1e-10 * rng.chisquare(6.0, len(states))
        known = states.with_(scatter=scatter)
        whitener = Whitener.build(ArmStates(NJ, known), batch.walk.tcp, None)
        turned = whitener.rotate(error)
        products = [_products(turned, block.rows) for block in whitener.blocks]
        ones = np.ones(len(states))
        found.append(
            estimate_noise(whitener, turned**2, ones, Noise(1.0, 1e-6), products)
        )
    kinds = ("tracker", "joint", "stop", "pose_joint", "pose")
    mean = {k: np.mean([getattr(f, k) for f in found]) for k in kinds}
    assert mean == pytest.approx({k: getattr(NOISE, k) for k in kinds}, rel=0.05)


def _products(turned: np.ndarray, rows: np.ndarray) -> np.ndarray:
    flat = turned[rows].reshape(len(rows), -1)
    return flat[:, :, None] * flat[:, None]


def test_components_that_rows_cannot_tell_apart_are_not_estimated() -> None:
    def estimated(states: States) -> tuple[str, ...]:
        batch = ArmStates(NJ, states)
        return Whitener.build(batch, batch.walk.tcp, None).estimated

    assert estimated(visits(5, 1, 1)) == ("tracker", "joint")
    assert estimated(visits(5, 1, 2)) == ("tracker", "joint", "stop")
    assert estimated(visits(5, 2, 1)) == ("tracker", "joint", "pose_joint", "pose")
    assert len(estimated(visits(5, 2, 2))) == 5


def test_columns_of_rows_that_are_taken_at_once() -> None:
    """Every way to use the columns is that of the columns written out."""
    states = visits(40, 2, 2)
    batch = ArmStates(NJ, states)
    c = Combination(propose(("geometry", "backlash", "joint_spline"), NJ, states))
    whitener = Whitener.build(batch, batch.walk.tcp, None)
    by = whitener.whitening(NOISE, np.ones(len(states)))
    plain = DesignMatrix.of(c, batch).rotate(by.scale[:, :, None] * whitener.turn)
    design = replace(plain, blocks=by.blocks)
    p = len(c.parameters)
    X = design.dense().reshape(-1, p)
    own = by.apply(whitener.rotate(DesignMatrix.of(c, batch).dense()))
    np.testing.assert_allclose(X, own.reshape(-1, p), rtol=1e-9, atol=1e-6)
    rng = np.random.default_rng(1)
    values, rows = rng.standard_normal(p), rng.standard_normal((len(states), 3))
    root = rng.standard_normal((p, p))
    C = root @ root.T
    close = {"rtol": 1e-7, "atol": 1e-7 * float(np.abs(X).max()) ** 2}
    np.testing.assert_allclose(design.times(values).reshape(-1), X @ values, **close)
    np.testing.assert_allclose(design.moment(rows), X.T @ rows.reshape(-1), **close)
    np.testing.assert_allclose(design.gram(), X.T @ X, **close)
    np.testing.assert_allclose(design.combine(root), X @ root, **close)
    variance = np.einsum("rp,pq,rq->r", X, C, X)
    np.testing.assert_allclose(design.variance(C).reshape(-1), variance, **close)


def test_rows_of_a_pose_are_not_taken_apart() -> None:
    blocks = RowBlocks(((np.array([[0, 2]]), np.eye(6)[None]),))
    assert blocks.at_rows(np.array([1, 2, 0]), 4).parts[0][0].tolist() == [[2, 1]]
    assert not blocks.at_rows(np.array([1, 3]), 4)
    with pytest.raises(ValueError, match="separated"):
        blocks.at_rows(np.array([0, 1]), 4)


def test_a_bad_reading_is_seen_beside_the_others_of_its_pose() -> None:
    """An error of 0.2 mm hides in poses that scatter by more, but not at one stop."""
    states = visits(60, 1, 3)
    batch = ArmStates(NJ, states)
    noise = Noise(1.0, 0.0, None, 3e-4)
    rng = np.random.default_rng(2)
    stop = 3e-4 * rng.standard_normal((60, 3))
    error = np.repeat(stop, 3, axis=0) + 1e-5 * rng.standard_normal((180, 3))
    error[31] += 2e-4
    whitener = Whitener.build(batch, batch.walk.tcp, None)
    found = whitener.distances(whitener.rotate(error), noise, np.ones(180))
    assert int(np.argmax(found)) in (30, 31, 32) and found.max() > 10.0
    assert np.sort(found)[-2] < 6.0


def test_poses_are_numbered_by_their_angles_and_load() -> None:
    states = visits(4, 2, 1)
    assert poses_of(states)[:4].tolist() == poses_of(states)[4:].tolist()
    loaded = states.with_(payload=np.repeat([10.0, 20.0], 4))
    assert len(set(poses_of(loaded).tolist())) == 8
    moving = states.with_(heading=np.tile([1.0, 0.0, 0.0], (8, 1)))
    assert len(set(poses_of(moving).tolist())) == 8


@pytest.mark.parametrize("decimals", [0, 1, 2, 3])
def test_the_step_of_written_angles_is_found(decimals: int) -> None:
    q = np.random.default_rng(0).uniform(-2.0, 2.0, (50, 6))
    rounded = np.deg2rad(np.round(np.rad2deg(q), decimals))
    assert angle_step(rounded) == pytest.approx(np.deg2rad(10.0**-decimals))
    assert angle_step(np.round(q, 2)) == pytest.approx(0.01)
    assert angle_step(q) == 0.0
