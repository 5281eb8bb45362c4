"""What comes from a target that the arm cannot reach comes from anywhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.compensation.eligibility.configuration_flags import (
    STOPPED,
    STRANDED,
    mark_stranded,
)
from postproc.compensation.program import PlannedProgram, plan_visits, read_program
from postproc.motion.targets import CODE, PATH_JUMP, PATH_LIMITS, PATH_REACH
from postproc.robot.cell import Cell, load_cell
from postproc.robot.pose import record_from_pose

START = "MOVE JOINT TO {0, 0, -90, 0, 45, 0}"
HERE, THERE = [0.0, 0.0, -90.0, 0.0, 45.0, 0.0], [5.0, 5.0, -95.0, 10.0, 40.0, 8.0]
NEAR, FAR = [8.0, 2.0, -92.0, 13.0, 44.0, 11.0], [3.0, 4.0, -99.0, 17.0, 50.0, 2.0]


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Cell:
    path: Path = tmp_path_factory.mktemp("cell") / "cell.toml"
    path.write_text('[robot]\narm = "nj220-2.7"\n')
    return load_cell(path)


@pytest.fixture(scope="module")
def pos(cell: Cell) -> Callable[..., str]:
    def written(joints: list[float], x: float | None = None) -> str:
        pose = cell.arm.flange(np.deg2rad([joints]))[0]
        if x is not None:
            pose[0, 3] = x
        numbers = ", ".join(f"{v:.6f}" for v in record_from_pose(pose))
        return f"POS({numbers}, '')"

    return written


def planned(cell: Cell, *lines: str) -> PlannedProgram:
    text = "\n".join(["PROGRAM job", "BEGIN", START, *lines, "END job"])
    return plan_visits(read_program({"job.pdl": text.encode()}, cell).visits, cell)


def stranded(found: PlannedProgram) -> list[bool]:
    return [found.reasons[i] == STRANDED for i in range(len(found.plan))]


def test_the_next_target_is_left_and_no_side_is_known_behind(cell, pos):
    away = f"MOVE LINEAR TO {pos(THERE, x=9.0)}"
    behind = f"MOVE JOINT TO {pos(NEAR)}", f"MOVE LINEAR TO {pos(FAR)}"
    found = planned(cell, away, *behind)
    assert found.reasons[1].text.startswith("out of reach")
    assert stranded(found) == [False, False, True, False]
    assert not found.plan.direction[2].any()  # but all of them are where it gets there
    assert planned(cell, *behind).plan.direction[1].all()
    assert found.plan.direction[3].all()  # every joint has moved farther than its play


def test_a_joint_that_then_hardly_moves_has_no_side_yet(cell, pos):
    beyond = f"MOVE LINEAR TO {pos(THERE, x=9.0)}"
    still = list(FAR)
    still[2] = NEAR[2]
    found = planned(
        cell, beyond, f"MOVE JOINT TO {pos(NEAR)}", f"MOVE JOINT TO {pos(still)}"
    )
    others = [0, 1, 3, 4, 5]
    assert found.plan.direction[3, 2] == 0 and found.plan.direction[3, others].all()
    assert planned(cell, f"MOVE JOINT TO {pos(NEAR)}", f"MOVE JOINT TO {pos(still)}"
                   ).plan.direction[2].all()  # fmt: skip


def test_behind_an_axis_that_leaves_its_range_on_the_way(cell, pos):
    upper = np.rad2deg(cell.arm.upper[0])
    far = f"MOVE JOINT TO {{{upper + 5:.1f}, 0, -90, 0, 45, 0}}"
    found = planned(cell, far, START)
    assert found.reasons[1].text.startswith("axis 1 would be beyond its limit")
    assert stranded(found) == [False, False, True]


@pytest.mark.parametrize(
    ("cause", "named"),
    [(PATH_LIMITS[1], "axis 2"), (PATH_REACH, "reach"), (PATH_JUMP, "singularity")],
)
def test_a_broken_path_is_named_and_not_its_target(cell, pos, cause, named):
    lines = [f"MOVE LINEAR TO {pos(at)}" for at in (HERE, THERE)]
    text = "\n".join(["PROGRAM job", "BEGIN", START, *lines, START, "END job"])
    visits = read_program({"job.pdl": text.encode()}, cell).visits
    found = plan_visits(visits, cell)
    assert found.reasons.none.all()
    plan = replace(found.plan, reason=np.array([0, CODE[cause], 0, 0]))
    why = mark_stranded(visits, found.targets, plan, found.reasons)
    assert named in found.reasons[2].text and "on the way" in found.reasons[2].text
    part = plan_visits(visits, cell, doubtful=int(why[1]))  # which begins behind it
    assert part.reasons[1] == found.reasons[2] and found.reasons.none[3] == (not why[2])


def test_a_step_goes_on_from_nowhere_until_a_place_is_named(cell, pos):
    away = f"MOVE LINEAR TO {pos(THERE, x=9.0)}"
    step = "MOVE RELATIVE VEC(0, 0, 10) IN BASE"
    found = planned(cell, away, step, step, f"MOVE JOINT TO {pos(NEAR)}", START)
    assert not any(found.reasons.none[1:4])
    assert stranded(found)[4:] == [True, False]


def test_an_arc_ends_nowhere_that_cannot_reach_its_point_on_the_way(cell, pos):
    arc = f"MOVE CIRCULAR TO {pos(NEAR)} VIA {pos(THERE, x=9.0)}"
    found = planned(cell, arc, f"MOVE LINEAR TO {pos(FAR)}", START)
    assert not found.reasons.none[1] and not found.reasons.none[2]
    assert stranded(found) == [False, False, False, True, False]


def test_only_ways_from_there_are_in_doubt(cell, pos):
    """Two ways lead to a target: that one of them strands is enough to leave it."""
    lines = ["IF $DIN[1] THEN", f"MOVE LINEAR TO {pos(THERE, x=9.0)}", "ENDIF",
             f"MOVE JOINT TO {pos(NEAR)}", f"MOVE JOINT TO {pos(FAR)}"]  # fmt: skip
    assert stranded(planned(cell, *lines)) == [False, False, True, False]


@pytest.mark.parametrize("care", ["TRUE", "$DIN[1]"])
def test_behind_a_stop_because_of_flags_no_side_is_known(cell, pos, care):
    named = f"MOVE LINEAR TO {pos(THERE)}".replace("''", "'W'")
    behind = f"MOVE JOINT TO {pos(NEAR)}", f"MOVE LINEAR TO {pos(FAR)}"
    found = planned(cell, f"$CNFG_CARE := {care}", named, *behind)
    assert found.reasons[1].text.startswith("$CNFG_CARE is")
    assert not found.reasons[2] and not found.reasons[3]
    assert not found.plan.direction[2].any()
    unchecked = planned(cell, "$CNFG_CARE := FALSE", named, *behind)
    assert unchecked.plan.direction[2].all()


def test_behind_such_a_stop_a_target_without_a_string_is_left(cell, pos):
    named = f"MOVE LINEAR TO {pos(THERE)}".replace("''", "'W'")
    bare = f"MOVE LINEAR TO {pos(NEAR)}".replace(", '')", ")")
    found = planned(cell, "$CNFG_CARE := TRUE", named, bare, bare, START, bare)
    assert [found.reasons[k] == STOPPED for k in range(6)] == [
        False, False, True, True, False, False
    ]  # fmt: skip
