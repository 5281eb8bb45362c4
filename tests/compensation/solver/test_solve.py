from __future__ import annotations

import numpy as np

from postproc.compensation.solver.inverse_model import solve
from postproc.robot.state import make_states
from tests.calibration.simulator import NJ, TOOL, random_arm, random_states
from tests.model.test_model import model


def away_from_singularities(n: int, seed: int) -> np.ndarray:
    q = random_states(4 * n, np.random.default_rng(seed)).q
    q = q[np.abs(q[:, 4]) > 0.3]
    behind = np.hypot(*(NJ.link_frames(q)[:, 4, :2, 3].T)) > 0.5
    return q[behind][:n]


def test_the_solved_command_lands_on_the_wanted_pose() -> None:
    m = model()
    q = away_from_singularities(300, 0)
    side = np.random.default_rng(1).choice([-1.0, 1.0], q.shape)
    states = make_states(q, side, TOOL)
    tool = np.eye(4)
    tool[:3, 3] = TOOL
    wanted = NJ.flange(q) @ tool
    found = solve(m, NJ, wanted, tool, states)
    assert found.residual.max() <= 1e-6
    # By definition: where the command is plus its error is where the target is.
    commanded = NJ.flange(found.q) @ tool
    np.testing.assert_allclose(commanded, found.command, atol=1e-9)
    error = m.error(NJ, make_states(found.q, side, TOOL))
    np.testing.assert_allclose(commanded[:, :3, 3] + error, wanted[:, :3, 3], atol=1e-6)
    np.testing.assert_allclose(found.command[:, :3, :3], wanted[:, :3, :3])
    np.testing.assert_array_equal(NJ.branch(found.q), NJ.branch(q))
    assert np.abs(found.q - q).max() < 0.05


def test_a_true_arm_lands_better_when_commanded_so() -> None:
    arm = random_arm(np.random.default_rng(0))  # the arm that the model was fitted to
    q = away_from_singularities(100, 2)
    side = np.random.default_rng(3).choice([-1.0, 1.0], q.shape)
    tool = np.eye(4)
    tool[:3, 3] = TOOL
    wanted = NJ.flange(q) @ tool
    found = solve(model(), NJ, wanted, tool, make_states(q, side, TOOL))
    tools = np.tile(TOOL, (len(q), 1))
    before = np.linalg.norm(arm.tcp(q, side, tools) - wanted[:, :3, 3], axis=1)
    after = np.linalg.norm(arm.tcp(found.q, side, tools) - wanted[:, :3, 3], axis=1)
    assert after.mean() < 0.03e-3 < 1e-3 < before.mean()


def test_what_cannot_be_reached_is_nan() -> None:
    q = away_from_singularities(3, 4)
    wanted = NJ.flange(q)
    wanted[1, :3, 3] = 10.0, 0.0, 0.0
    found = solve(model(), NJ, wanted, np.eye(4), make_states(q))
    assert np.isnan(found.q[1]).all() and np.isnan(found.residual[1])
    assert found.residual[[0, 2]].max() <= 1e-6
