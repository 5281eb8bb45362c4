"""Which configuration strings count: $CNFG_CARE, $TURN_CARE, $JNT_MTURN."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from postproc.compensation.eligibility.configuration_flags import (
    AFTER,
    FROM_ANYWHERE,
    find_overruled,
)
from postproc.compensation.findings.findings import list_overruled_strings
from postproc.compensation.program import (
    ParsedProgram,
    PlannedProgram,
    plan_visits,
    read_program,
)
from postproc.robot.cell import Cell, load_cell
from postproc.robot.pose import record_from_pose

HERE, THERE = [0.0, 0.0, -90.0, 0.0, 45.0, 0.0], [5.0, 5.0, -95.0, 10.0, 40.0, 8.0]
START = "MOVE JOINT TO {0, 0, -90, 0, 45, 0}"


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Cell:
    path: Path = tmp_path_factory.mktemp("cell") / "cell.toml"
    path.write_text('[robot]\narm = "nj220-2.7"\n')
    return load_cell(path)


def pos(cell: Cell, joints: list[float], config: str) -> str:
    pose = cell.arm.flange(np.deg2rad([joints]))[0]
    numbers = ", ".join(f"{x:.6f}" for x in record_from_pose(pose))
    return f"POS({numbers}, '{config}')"


def planned(cell: Cell, *lines: str) -> tuple[ParsedProgram, PlannedProgram]:
    text = "\n".join(["PROGRAM job", "VAR x : BOOLEAN", "BEGIN", *lines, "END job"])
    reading = read_program({"job.pdl": text.encode()}, cell)
    return reading, plan_visits(reading.visits, cell)


def whys(found: PlannedProgram, n: int) -> list[str]:
    return [found.reasons[i].text for i in range(n)]


@pytest.mark.parametrize(
    ("said", "why", "noted"),
    [
        ("-- nothing", "", 1),
        ("$CNFG_CARE := TRUE", "$CNFG_CARE is TRUE", 0),
        ("$CNFG_CARE := FALSE", "", 0),
        ("READ (x)\n$CNFG_CARE := x", "$CNFG_CARE is not known here", 0),
        ("IF $DIN[1] THEN\n$CNFG_CARE := TRUE\nENDIF", "$CNFG_CARE is not known", 0),
    ],
)
def test_a_line_to_another_branch(cell: Cell, said: str, why: str, noted: int) -> None:
    line = f"MOVE LINEAR TO {pos(cell, THERE, 'W')}"
    reading, found = planned(cell, START, said, line)
    assert found.reasons[1].text.startswith(why) and bool(why) == bool(
        found.reasons[1].text
    )
    rows = find_overruled(found.targets, found.plan).find_unchecked(reading.visits)
    notes = list_overruled_strings(reading.visits, rows)
    assert len(notes) == noted


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ("-- nothing", ""),
        ("$TURN_CARE := TRUE", "$TURN_CARE is TRUE"),
        ("$TURN_CARE := FALSE", ""),
        ("$TURN_CARE := $DIN[2]", "$TURN_CARE is not known here"),
    ],
)
def test_a_line_to_another_turn(cell: Cell, said: str, why: str) -> None:
    line = f"MOVE LINEAR TO {pos(cell, THERE, 'T1:0 T2:1')}"
    _, found = planned(cell, START, said, line)
    assert found.reasons[1].text.startswith(why) and bool(why) == bool(
        found.reasons[1].text
    )
    right = f"MOVE LINEAR TO {pos(cell, THERE, 'T1:0 T2:0')}"
    assert not planned(cell, START, said, right)[1].reasons[1]


def test_with_items_hold_for_one_move(cell: Cell) -> None:
    line = f"MOVE LINEAR TO {pos(cell, THERE, 'W')}"
    back = f"MOVE LINEAR TO {pos(cell, HERE, 'W')}"
    with_ = f"{line} WITH $CNFG_CARE = FALSE"
    _, found = planned(cell, START, "$CNFG_CARE := TRUE", with_, back)
    assert whys(found, 2) == ["", ""]
    assert found.reasons[2].text.startswith("$CNFG_CARE is TRUE")
    _, other = planned(cell, START, "$ARM_DATA[2].CNFG_CARE := TRUE", line)
    assert other.reasons[1].text == ""


@pytest.mark.parametrize(
    ("said", "doubted"),
    [("TRUE", False), ("FALSE", True), ("$DIN[1]", True), (None, False)],
)
def test_a_joint_move_to_another_branch(
    cell: Cell, said: str | None, doubted: bool
) -> None:
    care = f"$CNFG_CARE := {said}" if said else "-- nothing"
    flipped = [*THERE[:3], THERE[3] - 180, -THERE[4], THERE[5] - 180]
    other = f"MOVE JOINT TO {pos(cell, flipped, 'W T1:0 T2:0')}"
    after = f"MOVE LINEAR TO {pos(cell, HERE, 'W T1:0 T2:0')}"
    _, found = planned(cell, START, care, other, after, START, after)
    assert ("another branch than the arm is on" in found.reasons[1].text) == doubted
    comes = "the move before it ends with an uncertain branch or turn"
    assert (found.reasons[2].text == comes) == doubted
    assert (found.reasons[3].text == comes) == doubted
    assert "the move before" not in found.reasons[4].text
    np.testing.assert_allclose(np.rad2deg(found.plan.q[1]), flipped, atol=1e-3)
    same = f"MOVE JOINT TO {pos(cell, THERE, '')}"
    _, found = planned(cell, START, care, same, same)
    assert whys(found, 3) == ["", "", ""]


@pytest.mark.parametrize(
    ("turn", "multi", "planned_turn", "doubted"),
    [
        (None, None, 1, False),
        ("TRUE", "TRUE", 1, False),
        ("FALSE", None, 1, True),
        ("FALSE", "FALSE", 0, False),
        (None, "FALSE", 0, False),
        ("TRUE", "FALSE", 0, True),
        ("TRUE", "$DIN[1]", 1, True),
        ("$DIN[1]", "FALSE", 0, True),
    ],
)
def test_a_joint_move_to_another_turn(
    cell: Cell, turn: str | None, multi: str | None, planned_turn: int, doubted: bool
) -> None:
    said = [f"$TURN_CARE := {turn}"] * bool(turn) + [f"$JNT_MTURN := {multi}"] * bool(
        multi
    )
    move = f"MOVE JOINT TO {pos(cell, THERE, 'T1:0 T2:1')}"
    _, found = planned(cell, START, *said, move)
    assert ("another turn than the nearest" in found.reasons[1].text) == doubted
    wanted = THERE[5] + 360 * planned_turn
    assert np.rad2deg(found.plan.q[1, 5]) == pytest.approx(wanted, abs=1e-3)
    near = f"MOVE JOINT TO {pos(cell, THERE, 'T1:0 T2:0')}"
    assert not planned(cell, START, *said, near)[1].reasons[1]


@pytest.mark.parametrize("config", ["W T1:0 T2:0", "T1:0 T2:1", "T1:0 T2:0"])
@pytest.mark.parametrize("care", ["TRUE", "FALSE"])
def test_wrist_axes_on_a_line_keep_branch_and_turn(
    cell: Cell, config: str, care: str
) -> None:
    switch = [f"$CNFG_CARE := {care}", f"$TURN_CARE := {care}"]
    line = f"MOVE LINEAR TO {pos(cell, THERE, config)} WITH $ORNT_TYPE = WRIST_JNT"
    _, found = planned(cell, START, *switch, line)
    assert ("WRIST_JNT" in found.reasons[1].text) == (config != "T1:0 T2:0")


def test_an_unknown_start_goes_by_the_string_where_that_counts(cell: Cell) -> None:
    move = f"MOVE JOINT TO {pos(cell, THERE, 'T1:0 T2:1')}"
    _, found = planned(cell, move)
    assert found.reasons[0].text == ""
    np.testing.assert_allclose(
        np.rad2deg(found.plan.q[0]), [*THERE[:5], THERE[5] + 360], atol=1e-3
    )


@pytest.mark.parametrize("kind", ["JOINT", "LINEAR"])
@pytest.mark.parametrize("switch", ["FALSE", "$DIN[1]"])
def test_the_string_does_not_tell_where_an_unknown_start_leads_if_it_need_not_count(
    cell: Cell, kind: str, switch: str
) -> None:
    """The arm keeps the branch that it is on, which nobody knows."""
    care = f"$CNFG_CARE := {switch}"
    move = f"MOVE {kind} TO {pos(cell, THERE, 'T1:0 T2:0')}"
    _, found = planned(cell, care, move, move, START, move)
    assert found.reasons[0] == FROM_ANYWHERE
    assert found.reasons[1] == AFTER
    assert not found.reasons[3]
    _, found = planned(cell, START, care, move)
    assert not found.reasons[1]
