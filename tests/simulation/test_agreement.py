"""Two independent descriptions of one arm must agree where nothing is in error."""

from pathlib import Path

import numpy as np
import pytest

from postproc.compensation.solver.targets import targets_from_visits
from postproc.motion.planner import plan
from postproc.report.simulation import setup_of
from postproc.robot.arm import load_arm
from postproc.robot.cell import load_cell
from postproc.robot.state import make_states
from postproc.robot.trajectory import Motion
from postproc.simulation import (
    NJ220,
    VirtualCell,
    arrivals_of_states,
    run_program,
    virtual_arm,
)
from postproc.simulation.kinematics import (
    LinkMasses,
    foundation_moment,
    link_torque,
    payload_torque,
    solve_branch,
)
from postproc.simulation.reference import working_angles
from tests.simulation.builders import Program

ARM = load_arm("nj220-2.7")
Q = working_angles(np.random.default_rng(0), 50)


def test_flanges() -> None:
    np.testing.assert_allclose(NJ220.flange(Q), ARM.flange(Q), atol=1e-12)


def test_inverse_kinematics_branch_by_branch() -> None:
    flange = NJ220.flange(Q)
    theirs = ARM.inverse(flange).q
    for branch in range(8):
        ours = solve_branch(NJ220, flange, branch)
        gap = np.exp(1j * ours) - np.exp(1j * theirs[:, branch])
        both = ~np.isnan(gap).any(axis=1)
        assert both.sum() > 10
        np.testing.assert_allclose(np.abs(gap[both]), 0.0, atol=1e-8)


BASES = {
    "floor": 'mounting = "floor"',
    "ceiling": "[base]\nxyz_mm = [0, 0, 0]\neuler_zyz_deg = [0, 180, 30]",
    "wall": 'mounting = "wall"',
    "by the base": "[base]\nxyz_mm = [0, 0, 500]\neuler_zyz_deg = [20, 35, -70]",
    "by a vector": "mounting = [0.0, 3.0, -4.0]",
}


@pytest.mark.parametrize("base", BASES.values(), ids=BASES)
def test_weight(base: str, tmp_path: Path) -> None:
    """Both have their own way from the cell to torques and moments."""
    path = tmp_path / "cell.toml"
    path.write_text(f'[robot]\narm = "nj220-2.7"\n{base}\n')
    cell = load_cell(path)
    gravity = setup_of(cell).gravity
    np.testing.assert_allclose(gravity, 9.80665 * cell.arm.weight, atol=1e-6)
    mass, com = np.full(50, 60.0), np.tile([0.02, 0.1, 0.2], (50, 1))
    body = LinkMasses(NJ220, NJ220.mass, NJ220.centre, gravity)
    ours = link_torque(body, Q) + payload_torque(body, Q, mass, com)
    np.testing.assert_allclose(ours, cell.arm.gravity_torque(Q, mass, com), atol=0.5)
    moment = foundation_moment(body, Q, mass, com)
    theirs = cell.arm.tilting_moment(Q, mass, com)
    np.testing.assert_allclose(moment, theirs, atol=0.5)


def test_limits_and_speeds() -> None:
    np.testing.assert_allclose(NJ220.lower, ARM.lower)
    np.testing.assert_allclose(NJ220.upper, ARM.upper)
    np.testing.assert_allclose(NJ220.speed, ARM.velocity)


def test_a_perfect_arm_has_no_error_at_the_models_states() -> None:
    states = make_states(Q, np.ones((50, 6)), np.array([0.08, -0.04, 0.15]))
    perfect = virtual_arm(1, "")
    error = perfect.error(arrivals_of_states(states))
    np.testing.assert_allclose(error, 0.0, atol=1e-14)


def bent_panel() -> Program:
    """Approach, drill and retract under changing tilts, with arcs between rows."""
    rng = np.random.default_rng(0)
    program = Program(
        frames=[[0] * 6, [80, -40, 150, 0, 20, 0], [900, -100, 400, 5, 6, 7]]
    )
    frames = {"tool": 1, "uframe": 2, "config": ""}
    for k in range(60):
        x, y, tilt = 400 + 30 * (k // 20), 50 * (k % 20) - 500, 170 + 8 * np.sin(k / 9)
        turns = rng.uniform(-25, 25, (3, 2))
        heights = (650, 550, 650)
        for z, (a, r), how in zip(heights, turns, Motion, strict=True):
            linear = Motion.LINEAR if how else Motion.JOINT
            program.add([x, y, z, a, tilt, r], linear, **frames)
        if k % 20 == 19:
            via, end = [x + 20, y - 30, 650], [x, y - 70, 650]
            program.add([*via, 0, tilt, 0], Motion.CIRCULAR, via=True, **frames)
            program.add([*end, 0, tilt, 0], Motion.CIRCULAR, **frames)
    return program


def test_joints_and_directions_of_a_program(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    home = "[home]\njoints_deg = [0, 0, -90, 0, 45, 0]\n"
    path.write_text(f'[robot]\narm = "nj220-2.7"\n{home}')
    cell = load_cell(path)
    visits = bent_panel().visits()
    run = run_program(virtual_arm(1), VirtualCell(home=cell.home), visits)
    planned = plan(cell.arm, targets_from_visits(visits, cell)[0], np.radians(3.0))
    assert set(run.why) == {""}
    np.testing.assert_allclose(run.arrivals.q, planned.q, atol=1e-9)
    # The model calls a joint reversed after three plays, the real gap is a little less.
    sure = run.arrivals.travel > np.radians(0.03)
    known = planned.direction != 0
    assert (sure & known).mean() > 0.95
    np.testing.assert_array_equal(
        np.sign(run.arrivals.side)[sure & known], planned.direction[sure & known]
    )
