"""The virtual arm's corners: by their geometry, and against the planner's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from postproc.compensation.solver.targets import targets_from_visits
from postproc.language.visits import Blend, Visits, ZoneRule
from postproc.motion.planner import plan
from postproc.robot.cell import load_cell
from postproc.robot.trajectory import Motion
from postproc.simulation import NJ220, VirtualCell, run_program, virtual_arm
from tests.simulation.builders import Program

HOME = np.radians([0.0, 0.0, -90.0, 0.0, 45.0, 0.0])
CORNER = np.array([1500.0, 0.0, 1200.0])


def square(**fly: object) -> Visits:
    """Two sides of 100 mm at a right angle, the corner flown."""
    program = Program()
    for xyz, motion in (
        (CORNER - [0, 100, 0], Motion.JOINT),
        (CORNER, Motion.LINEAR),
        (CORNER + np.array([0, 0, 100]), Motion.LINEAR),
    ):
        given = fly if (xyz == CORNER).all() else {}
        program.add([*xyz, 0.0, 150.0, 0.0], motion, **given)
    return program.visits()


def miss(visits: Visits) -> float:
    """Distance at which the commanded path passes the corner [mm]."""
    run = run_program(virtual_arm(1, ""), VirtualCell(home=HOME), visits)
    at = NJ220.flange(run.arrivals.q[1:2])[0, :3, 3] * 1e3
    return float(np.linalg.norm(at - CORNER))


CART = {"fly": True, "blend": int(Blend.ZONE)}


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, 0.0),
        (CART | {"fly_dist": 10.0}, 10 * np.sqrt(2) / 4),
        (CART | {"fly_dist": 500.0}, 50 * np.sqrt(2) / 4),
        (CART, 5 * np.sqrt(2) / 4),
        (CART | {"fly_dist": 2.0, "zone_rule": int(ZoneRule.WITHIN)}, 2.0),
        (CART | {"fly_dist": 9.0, "zone_rule": int(ZoneRule.PASS)}, 0.0),
        (CART | {"fly_dist": -1.0}, 0.0),
    ],
)
def test_the_path_passes_the_corner(given: dict, expected: float) -> None:
    assert miss(square(**given)) == pytest.approx(expected, abs=1e-3)


def test_less_overlap_passes_closer_by_its_square() -> None:
    whole, half = (
        miss(square(fly=True, blend=int(Blend.OVERLAP), overlap_percent=percent))
        for percent in (100.0, 50.0)
    )
    assert half == pytest.approx(whole / 4, rel=0.01) and whole > 0.1


@pytest.mark.parametrize("kind", list(Blend))
def test_planner_and_controller_agree(tmp_path: Path, kind: Blend) -> None:
    """Two codes of one law: in space here, joint by joint there."""
    path = tmp_path / "cell.toml"
    home = "[home]\njoints_deg = [0, 0, -90, 0, 45, 0]\n"
    path.write_text(f'[robot]\narm = "nj220-2.7"\n{home}')
    cell = load_cell(path)
    rng = np.random.default_rng(int(kind))
    program = Program().joints(0.0, 0.0, -90.0, 0.0, 45.0, 0.0)
    for k in range(60):
        xyz = CORNER + rng.uniform(-150, 150, 3)
        turn = [rng.uniform(-10, 10), rng.uniform(140, 160), rng.uniform(-10, 10)]
        motion = Motion.LINEAR if k % 3 else Motion.JOINT
        fly = {"fly": k % 7 > 0, "blend": int(kind), "fly_dist": 8.0}
        program.add([*xyz, *turn], motion, overlap_percent=80.0, **fly)
    visits = program.visits()
    run = run_program(virtual_arm(1), VirtualCell(home=cell.home), visits)
    planned = plan(cell.arm, targets_from_visits(visits, cell)[0], 0.01)
    assert len(run.visit) == 61
    aside = np.linalg.norm(planned.aside, axis=1)
    assert (aside > 1e-5).sum() > 40
    np.testing.assert_allclose(run.arrivals.q, planned.q, atol=1e-3)
    direction, side = planned.direction, run.arrivals.side
    sure = (direction != 0) & (np.abs(side) == 1)
    assert sure[1:].mean() > 0.7 and (direction[sure] == side[sure]).mean() > 0.995
