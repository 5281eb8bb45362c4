"""Programs as the controller runs them."""

import numpy as np
import pytest

from postproc.language.visits import ELSEWHERE, START, Meaning
from postproc.robot.trajectory import Motion
from postproc.simulation import VirtualCell, run_program, virtual_arm
from postproc.simulation.kinematics import NJ220, pose_of_record, undo
from tests.simulation.builders import Program

ARM = virtual_arm(1)
HOME = np.radians([0.0, 0.0, -90.0, 0.0, 45.0, 0.0])
SETUP = VirtualCell(home=HOME)
DOWN = [1600.0, -300.0, 900.0, 0.0, 180.0, 0.0]


def shifted(dx: float, dy: float, dz: float) -> list[float]:
    return [DOWN[0] + dx, DOWN[1] + dy, DOWN[2] + dz, *DOWN[3:]]


def test_a_pose_is_reached_through_all_frames() -> None:
    program = Program(
        frames=[[0] * 6, [80, -40, 150, 10, 20, 30], [100, 200, 300, 40, 0, 0],
                [900, -100, 400, 5, 6, 7]]
    )  # fmt: skip
    target = [300.0, 200.0, 500.0, 90.0, 160.0, 30.0]
    program.add(target, tool=1, base=2, uframe=3, config="")
    visits = program.visits()
    run = run_program(ARM, SETUP, visits)
    assert run.why == ("",)
    tool, base, uframe = visits.frame.poses[1:]
    world = base @ NJ220.flange(run.arrivals.q)[0] @ tool
    wanted = uframe @ pose_of_record(np.array(target))
    np.testing.assert_allclose(world, wanted, atol=1e-11)
    np.testing.assert_allclose(
        ARM.nominal_tcp(run.arrivals)[0], (undo(base) @ wanted)[:3, 3], atol=1e-11
    )


def test_joint_targets_are_taken_as_they_are() -> None:
    q = [10.0, 5.0, -95.0, 200.0, 40.0, -400.0]
    run = run_program(ARM, SETUP, Program().joints(*q).visits())
    np.testing.assert_allclose(np.degrees(run.arrivals.q[0]), q)


def test_direction_of_joint_moves_comes_from_the_joints() -> None:
    program = Program().joints(0, 0, -90, 0, 45, 0)
    program.joints(10, 0, -95, 0, 45, 1).joints(5, 0, -90, 0, 50, 2)
    run = run_program(ARM, SETUP, program.visits())
    np.testing.assert_array_equal(run.arrivals.side[1, [0, 2, 5]], [1, -1, 1])
    np.testing.assert_array_equal(run.arrivals.side[2, [0, 2, 4, 5]], [-1, 1, 1, 1])
    np.testing.assert_array_equal(run.arrivals.side[:, 1], run.arrivals.side[0, 1])
    np.testing.assert_allclose(np.degrees(run.arrivals.travel[2, 0]), 5.0, atol=1e-9)


def test_a_joint_that_turns_back_inside_a_straight_move_arrives_backwards() -> None:
    # Past the base at constant x: axis 2 first retracts, then reaches out again.
    program = Program().add([1500.0, -800.0, 900.0, 0.0, 180.0, 0.0], config="")
    program.add([1500.0, 700.0, 900.0, 0.0, 180.0, 0.0], Motion.LINEAR)
    run = run_program(ARM, SETUP, program.visits())
    start, end = run.arrivals.q[:, 1]
    assert end < start  # the ends alone say backwards ..
    assert run.arrivals.side[1, 1] == 1.0  # .. but it arrives reaching out
    way = Program().add([1500.0, 600.0, 900.0, 0.0, 180.0, 0.0], config="").visits()
    just_before = run_program(ARM, SETUP, way).arrivals.q[0, 1]
    assert just_before < end


def test_an_arc_visits_its_via_point_and_its_end() -> None:
    program = Program().add(DOWN, config="")
    program.add(shifted(100, 100, 0), Motion.CIRCULAR, via=True)
    program.add(shifted(0, 200, 0), Motion.CIRCULAR)
    run = run_program(ARM, SETUP, program.visits())
    assert run.why == ("", "", "")
    tcp = NJ220.flange(run.arrivals.q)[:, :3, 3] * 1e3
    np.testing.assert_allclose(tcp[1], shifted(100, 100, 0)[:3], atol=1e-8)
    np.testing.assert_allclose(tcp[2], shifted(0, 200, 0)[:3], atol=1e-8)


@pytest.mark.parametrize(
    ("target", "values", "step"),
    [
        (Meaning.RELATIVE_TOOL, [10, 20, 30], [-10, 20, -30]),
        (Meaning.RELATIVE_BASE, [10, 20, 30], [10, 20, 30]),
        (Meaning.AWAY, [50], [0, 0, 50]),
        (Meaning.ABOUT, [0, 0, 1, 90, int(Meaning.RELATIVE_BASE)], [0, 0, 0]),
    ],
)
def test_moves_without_a_target_move_the_arm(target, values, step) -> None:
    # In DOWN the tool points down, its x axis backwards.
    program = Program().add(DOWN, config="").add(values, Motion.LINEAR, target)
    run = run_program(ARM, SETUP, program.visits())
    tcp = NJ220.flange(run.arrivals.q)[:, :3, 3] * 1e3
    np.testing.assert_allclose(tcp[1] - tcp[0], step, atol=1e-8)
    if target == Meaning.ABOUT:
        turned = run.arrivals.q[1] - run.arrivals.q[0]
        assert abs(turned).max() == pytest.approx(np.pi / 2, abs=1e-6)


def test_near_by_and_home() -> None:
    program = Program().add(DOWN, target=Meaning.NEAR, distance=100.0, config="")
    program.add([1, 2, 3, 4, 5, 6], target=Meaning.BY).add([], target=Meaning.HOME)
    run = run_program(ARM, SETUP, program.visits())
    tcp = NJ220.flange(run.arrivals.q)[0, :3, 3] * 1e3
    np.testing.assert_allclose(tcp, shifted(0, 0, 100)[:3], atol=1e-8)
    moved = np.degrees(run.arrivals.q[1] - run.arrivals.q[0])
    np.testing.assert_allclose(moved, [1, 2, 3, 4, 5, 6], atol=1e-9)
    np.testing.assert_allclose(run.arrivals.q[2], HOME)


def test_what_cannot_be_reached_is_left_out_and_the_arm_stays() -> None:
    program = Program().joints(0, 0, -90, 0, 45, 0).add([9000, 0, 0, 0, 0, 0])
    program.add([0] * 6, tool=-1).joints(np.nan, 0, 0, 0, 0, 0).joints(3, 0, -90, 0, 45)
    program.rows[-1]["values"][5] = 0.0
    run = run_program(ARM, SETUP, program.visits())
    np.testing.assert_array_equal(run.visit, [0, 4])
    assert "reach" in run.why[1] and "frame" in run.why[2] and "numbers" in run.why[3]
    assert run.arrivals.side[1, 0] == 1.0


def test_branches_are_run_from_their_first_predecessor() -> None:
    program = Program().joints(0, 0, -90, 0, 45, 0, pred=[START])
    program.joints(20, 0, -90, 0, 45, 0).joints(-20, 0, -90, 0, 45, 0, pred=[0])
    program.joints(0, 0, -90, 0, 45, 0, pred=[2, 1])
    program.joints(5, 0, -90, 0, 45, 0, pred=[ELSEWHERE])
    run = run_program(ARM, SETUP, program.visits())
    np.testing.assert_array_equal(run.arrivals.side[1:, 0], [1, -1, 1, 1])


def test_a_cell_without_home_starts_at_the_first_target() -> None:
    run = run_program(ARM, VirtualCell(), Program().add(DOWN, config="").visits())
    assert run.why == ("",)
    np.testing.assert_array_equal(np.abs(run.arrivals.side[0]), 1.0)


def test_time_speed_and_tools_are_kept() -> None:
    program = Program(frames=[[0] * 6, [0, 0, 100, 0, 0, 0], [9, 0, 0, 0, 0, 0]])
    program.add(DOWN, config="", tool=2).add(shifted(0, 200, 0), Motion.LINEAR, tool=2)
    program.add(shifted(0, 300, 0), Motion.LINEAR, tool=1, speed=0.05)
    run = run_program(ARM, SETUP, program.visits())
    np.testing.assert_array_equal(run.tool_id, [0, 0, 1])
    assert run.arrivals.speed[1] == pytest.approx(0.1)
    assert run.arrivals.speed[2] == pytest.approx(0.05)
    assert run.arrivals.time[1] - run.arrivals.time[0] == pytest.approx(2.3)
    np.testing.assert_allclose(run.arrivals.tool[2, :3, 3], [0, 0, 0.1])


def test_an_empty_program_runs() -> None:
    run = run_program(ARM, SETUP, Program().visits())
    assert len(run.visit) == 0 and len(run.arrivals) == 0
