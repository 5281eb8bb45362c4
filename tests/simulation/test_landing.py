"""Where a program lands."""

import numpy as np
import pytest

from postproc.exceptions import PostprocError
from postproc.language.visits import ELSEWHERE, Blend, ZoneRule
from postproc.robot.trajectory import Motion
from postproc.simulation import VirtualCell, land, run_program, virtual_arm
from postproc.simulation.path import score_paths
from tests.simulation.builders import Program

ARM = virtual_arm(2)
SETUP = VirtualCell(home=np.radians([0.0, 0.0, -90.0, 0.0, 45.0, 0.0]))


def grid(moved: np.ndarray | None = None) -> Program:
    program = Program(frames=[[0.0] * 6, [80, -40, 150, 0, 0, 0]])
    for k, y in enumerate(np.linspace(-400, 400, 9)):
        shift = np.zeros(3) if moved is None else moved[k]
        at = np.array([1500.0, y, 900.0]) + shift
        how = Motion.LINEAR if k else Motion.JOINT
        program.add([*at, 0.0, 180.0, 0.0], how, tool=1, config="")
    return program


def test_uncompensated_the_error_is_that_of_the_arm() -> None:
    visits = grid().visits()
    found = land(ARM, SETUP, visits)
    np.testing.assert_array_equal(found.visit, np.arange(9))
    wanted = visits.target.values[:, :3] * 1e-3
    np.testing.assert_allclose(found.wanted, wanted, atol=1e-12)
    run = run_program(ARM, SETUP, visits)
    np.testing.assert_allclose(found.error, ARM.error(run.arrivals), atol=1e-12)


def test_moving_the_commands_against_the_error_removes_it() -> None:
    original = grid().visits()
    error, moved = land(ARM, SETUP, original).error, np.zeros((9, 3))
    assert np.linalg.norm(error, axis=1).mean() > 0.5e-3
    for _ in range(3):
        moved -= error * 1e3
        error = land(ARM, SETUP, original, grid(moved).visits()).error
    assert np.linalg.norm(error, axis=1).max() < 1e-8


def test_programs_that_do_not_pair_are_refused() -> None:
    short = Program().add([1500, 0, 900, 0, 180, 0]).visits()
    with pytest.raises(PostprocError, match="1 visits"):
        land(ARM, SETUP, grid().visits(), short)


def test_a_visit_that_one_version_cannot_reach_is_left_out() -> None:
    moved = np.zeros((9, 3))
    moved[4] = [9000.0, 0, 0]
    found = land(ARM, SETUP, grid().visits(), grid(moved).visits())
    assert 4 not in found.visit and len(found.visit) == 8


def branching(fly: int, zone: float = 20.0, **behind) -> Program:
    """Draw two ways to a last point: the run takes the first of them."""
    program = Program(frames=[[0.0] * 6, [80, -40, 150, 0, 0, 0]])
    places = [(-400, 900), (-200, 900), (-200, 1000), (0, 900), (200, 900)]
    begins: list[list[int] | None] = [None, None, [0], [1, 2], None]
    for k, ((y, z), begin) in enumerate(zip(places, begins, strict=True)):
        how = Motion.LINEAR if k else Motion.JOINT
        told = {"fly": k == fly, "fly_dist": zone if k == fly else np.nan}
        told |= {"blend": Blend.ZONE, "zone_rule": ZoneRule.FROM} if k == fly else {}
        at = [1500.0, y, z, 0.0, 180.0, 0.0]
        program.add(at, how, tool=1, config="", pred=begin, **told)
    return program


@pytest.mark.parametrize(("fly", "left"), [(1, 0), (2, 1), (3, 0), (4, 0)])
def test_a_fly_point_that_the_run_does_not_go_on_from_is_left_out(fly, left) -> None:
    visits = branching(fly).visits()
    found = land(ARM, SETUP, visits)
    assert found.left_out == left and len(found.visit) == 5 - left
    assert (fly in found.visit) == (not left)
    assert len(found.error) == 5 - left
    again = land(ARM, SETUP, visits, branching(fly).visits(), np.arange(5))
    np.testing.assert_array_equal(again.visit, found.visit)
    assert again.left_out == left


def test_a_fly_point_before_what_is_not_followed_is_left_out() -> None:
    program = branching(2)
    program.rows[3]["pred"] = [ELSEWHERE]
    assert 2 not in land(ARM, SETUP, program.visits()).visit
    program.rows[0]["pred"] = [ELSEWHERE]  # the last visit does not stand before it
    program.rows[2]["fly"], program.rows[4]["fly"] = False, True
    assert land(ARM, SETUP, program.visits()).left_out == 0


def test_no_move_is_skipped_where_a_program_is_compared_with_itself():
    run = run_program(ARM, SETUP, grid().visits())
    every, one = (
        score_paths(ARM, SETUP, run, run, skipped=skipped)
        for skipped in (None, np.array([2]))
    )
    np.testing.assert_array_equal(every.visit, one.visit)
    assert len(every.visit)
