"""Lines whose wrist turns joint by joint."""

import numpy as np
import pytest

from postproc.exceptions import PlanError
from postproc.robot.trajectory import Motion
from postproc.simulation import NJ220, VirtualCell, run_program, virtual_arm
from postproc.simulation.controller import joints_with_wrist
from postproc.simulation.kinematics import pose
from tests.simulation.builders import Program

TOOL = pose(np.eye(3), np.array([0.08, -0.04, 0.15]))
START = np.radians([10.0, 10.0, -100.0, 20.0, 40.0, -30.0])
END = np.radians([-20.0, 20.0, -95.0, -30.0, -20.0, 60.0])


def ends() -> np.ndarray:
    return (NJ220.flange(np.stack([START, END])) @ TOOL)[:, :3, 3]


def test_the_tcp_is_on_the_line_and_the_wrist_goes_straight() -> None:
    start, end = ends()
    s = np.arange(1, 51)[:, None] / 50
    points = start + s * (end - start)
    q = joints_with_wrist(NJ220, points, TOOL, START, END)
    np.testing.assert_allclose((NJ220.flange(q) @ TOOL)[:, :3, 3], points, atol=1e-9)
    np.testing.assert_allclose(q[:, 3:], START[3:] + s * (END - START)[3:], atol=1e-14)
    np.testing.assert_allclose(q[-1], END, atol=1e-8)


def test_a_line_out_of_reach_is_refused() -> None:
    start, end = ends()
    points = start + np.linspace(0, 4, 30)[:, None] * (end - start)
    with pytest.raises(PlanError):
        joints_with_wrist(NJ220, points, TOOL, START, END)


def test_programs_may_ask_for_it() -> None:
    # Through the wrist singularity, which a steady turn of the tool does not survive.
    home = np.radians([0.0, 10.0, -100.0, 0.0, 30.0, 0.0])
    goal = np.degrees(home) * [1, 1, 1, 1, -1, 1]
    goal[0] += 3.0
    program = Program().joints(*np.degrees(home))
    program.joints(*goal, motion=Motion.LINEAR, wrist=True)
    run = run_program(virtual_arm(1), VirtualCell(home=home), program.visits())
    assert run.why == ("", "")
    np.testing.assert_allclose(np.degrees(run.arrivals.q[1]), goal, atol=1e-6)
    assert run.arrivals.side[1, 4] == -1.0
