"""The chain against one that shares no code with it."""

from __future__ import annotations

import numpy as np

from postproc.model.effects.geometry import Geometry
from postproc.model.kinematics import NOMINAL, ArmStates
from tests.calibration.simulator import NJ, TOOL, Simulated, random_states


def test_deviations_move_the_tool_as_an_independent_chain_does() -> None:
    rng = np.random.default_rng(3)
    states = random_states(20, rng)
    batch = ArmStates(NJ, states)
    geometry = Geometry(beta=(1, 2, 3, 4, 5, 6))
    names = [p.name for p in geometry.parameters()]
    p = 2e-3 * rng.standard_normal(len(names))
    value = dict(zip(names, p, strict=True))
    link = np.zeros((6, 6))
    for j in range(6):
        link[j, 0] = value[f"a{j + 1}"]
        link[j, 3] = value[f"alpha{j + 1}"]
        link[j, 4] = value[f"beta{j + 1}"]
    real = Simulated(
        link=link,
        dh_d=np.array([value[f"d{j}"] for j in range(1, 7)]),
        dh_theta=np.array([value[f"theta{j}"] for j in range(1, 7)]),
        base=p[:6],
        tool=p[-3:],
    )
    still = np.zeros((20, 6))
    truth = real.tcp(states.q, still, states.tool)
    nominal = Simulated().tcp(states.q, still, states.tool)
    np.testing.assert_allclose(batch.walk.tcp, nominal, atol=1e-12)
    moved = batch.move(geometry.deviation(p), None)
    np.testing.assert_allclose(moved.tcp, truth, atol=1e-12)
    np.testing.assert_allclose(moved.walk.tcp, truth, atol=1e-12)
    np.testing.assert_allclose(
        geometry.displacement(batch, p), truth - nominal, atol=1e-12
    )


def test_kinematics_agree_with_the_arm() -> None:
    states = random_states(30, np.random.default_rng(4))
    batch = ArmStates(NJ, states)
    J = NJ.jacobian(states.q, TOOL)
    np.testing.assert_allclose(batch.jacobian, J[:, :3], atol=1e-12)
    np.testing.assert_allclose(batch.angular, J[:, 3:], atol=1e-12)
    np.testing.assert_allclose(
        batch.walk.flange, NJ.flange(states.q)[:, :3, :3], atol=1e-12
    )


def test_the_tcp_alone_is_that_of_the_walk() -> None:
    states = random_states(30, np.random.default_rng(5))
    shift = 1e-3 * np.random.default_rng(6).standard_normal((30, 6))
    batch = ArmStates(NJ, states).move(NOMINAL, shift)
    alone = batch.tcp
    assert "walk" not in vars(batch)
    np.testing.assert_allclose(alone, batch.walk.tcp, atol=1e-12)
    rows = np.array([4, 4, 17])
    np.testing.assert_array_equal(batch[rows].jacobian, batch.jacobian[rows])


def test_the_parameters_are_complete() -> None:
    # 27 directions show at one probe point; 30 with three, plus none that are spurious.
    from postproc.calibration.regression import observe
    from tests.calibration.simulator import PLATE

    rng = np.random.default_rng(0)
    for tools, rank in ((TOOL[None], 27), (PLATE, 30)):
        states = random_states(200, rng, tools)
        geometry = Geometry.propose(NJ, states)
        X = geometry.columns(ArmStates(NJ, states)) * 1e-3
        X = X.reshape(-1, X.shape[2])
        names = tuple(p.name for p in geometry.parameters())
        found = observe(X, names)
        assert found.rank == rank
        assert len(found.unseen) == len(names) - rank
        pairs = [{u.name, *u.partners} for u in found.unseen]
        assert {"base_z", "d1"} in pairs
        assert {"base_rz", "theta1"} in pairs
        assert {"d2", "d3"} in pairs
