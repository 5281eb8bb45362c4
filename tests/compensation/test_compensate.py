"""The main job: what is corrected, what is refused, what is left alone and why."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.outcome import Status
from postproc.compensation.output.sidecar import FileRecord, restore
from postproc.compensation.program import read_program
from postproc.exceptions import CellError, ModelError, ProgramError
from postproc.report.json import report_text
from postproc.report.simulation import setup_of
from postproc.robot.cell import load_cell
from postproc.simulation import land, virtual_arm
from tests.conftest import CELL, SEED

HEAD = (
    "PROGRAM job\r\nVAR\r\n  p, r : POSITION\r\n  j : JOINTPOS FOR ARM[1]\r\nBEGIN\r\n"
)
TAIL = "END job\r\n"
FIRST = "  MOVE JOINT TO {5.0, 10.0, -95.0, 20.0, 50.0, 30.0}\r\n"


def program(*lines: str) -> bytes:
    return (HEAD + "".join(f"  {line}\r\n" for line in lines) + TAIL).encode("latin-1")


@pytest.fixture
def run(job_cell, job_model):
    def compensated(*lines: str, cell=job_cell):
        return compensate(program(*lines), cell, job_model, name="job.pdl")

    return compensated


def statuses(outcome):
    return [Status(s).name for s in outcome.decisions.status]


def whys(outcome):
    d = outcome.decisions
    return [d.reasons[k].text for k in d.why]


JOINTS = "MOVE JOINT TO {5.0, 10.0, -95.0, 20.0, 50.0, 30.0}"
NEXT = "MOVE JOINT TO {15.0, 20.0, -85.0, 30.0, 60.0, 45.0}"
POSE = "MOVE LINEAR TO POS(100.0, 200.0, 150.0, 0.0, 175.0, 0.0, '')"
BACK = "MOVE LINEAR TO POS(100.0, 200.0, 50.00, 0.0, 175.0, 0.0, '')"


HIGH = "MOVE JOINT TO {12.0, 20.0, -85.0, 30.0, 60.0, 45.0}"
LOW = "MOVE JOINT TO {-12.0, -8.0, -140.0, -40.0, 20.0, -60.0}"


def test_corrects_joint_and_pose_targets(run):
    outcome = run(JOINTS, POSE, BACK)
    assert statuses(outcome) == ["CORRECTED"] * 3
    assert outcome.exit_code == 0
    assert outcome.before.mean_mm > 0.5
    assert outcome.after.max_mm < 0.004  # digits of the joint target
    text = outcome.outputs["job.pdl"]
    assert text.startswith(b"-- postproc ") and text.count(b"\r\n") == text.count(b"\n")


def test_only_numbers_of_targets_and_the_stamp_change(run):
    source = program(JOINTS + "   -- keep {1.0, 2.0}", "  x  := 5.000 ", POSE)
    outcome = run(JOINTS + "   -- keep {1.0, 2.0}", "  x  := 5.000 ", POSE)
    lines = outcome.outputs["job.pdl"].split(b"\r\n")[1:]
    original = source.split(b"\r\n")
    number = re.compile(rb"-?\d+\.\d+")
    assert len(lines) == len(original)
    for old, new in zip(original, lines, strict=True):
        if b"MOVE" not in old:
            assert new == old
        assert number.sub(b"#", new.split(b"--")[0]) == number.sub(
            b"#", old.split(b"--")[0]
        )
    assert b"-- keep {1.0, 2.0}" in lines[5]
    orientation = lines[7].split(b",")[3:6]
    assert orientation == original[7].split(b",")[3:6]


def test_lands_where_the_program_says(run, job_cell):
    targets = [JOINTS, POSE, BACK, NEXT, POSE]
    outcome = run(*targets)
    arm, setup = virtual_arm(SEED), setup_of(job_cell)
    original = read_program({"job.pdl": program(*targets)}, job_cell).visits
    done = read_program(outcome.outputs, job_cell).visits
    before = np.linalg.norm(land(arm, setup, original).error, axis=1)
    after = np.linalg.norm(land(arm, setup, original, done).error, axis=1)
    assert before.mean() > 0.7e-3
    sure = slice(1, None)  # from which side the first target is reached is not known
    assert after[sure].mean() < 0.03e-3 and after[sure].max() < 0.1e-3
    assert after[0] < before[0] / 2


def test_restore_gives_the_source_back(run):
    outcome = run(JOINTS, POSE)
    record = json.loads(outcome.sidecar)["files"]["job.pdl"]
    record["edits"] = [tuple(e) for e in record["edits"]]
    again = restore(outcome.outputs["job.pdl"], FileRecord.read(record), "job.pdl")
    assert again == program(JOINTS, POSE)


def test_same_input_same_bytes(run):
    assert run(JOINTS, POSE).outputs == run(JOINTS, POSE).outputs


def test_refuses_a_second_pass(run, job_cell, job_model):
    done = run(JOINTS, POSE).outputs["job.pdl"]
    with pytest.raises(ProgramError, match=r"job\.pdl:1: is compensated already"):
        compensate(done, job_cell, job_model, name="job.pdl")


def test_refuses_a_controller_that_compensates(tmp_path, job_model):
    text = CELL.replace("[tool]", "absolute_accuracy = true\n[tool]")
    (tmp_path / "cell.toml").write_text(text)
    cell = load_cell(tmp_path / "cell.toml")
    with pytest.raises(CellError, match="do it twice"):
        compensate(program(JOINTS), cell, job_model)


def test_refuses_a_model_of_another_arm(job_cell, job_model):
    with pytest.raises(ModelError, match="not for"):
        compensate(program(JOINTS), job_cell, replace(job_model, arm_id="0" * 16))


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("MOVE LINEAR TO POS(9000.0, 0.0, 0.0, 0.0, 175.0, 0.0, '')", "reach"),
        ("MOVE JOINT TO {5.0, 94.99999, -95.0, 20.0, 50.0, 30.0}", "surveyed|limit"),
        ("MOVE JOINT TO {5.0, 10.0, -95.0, 20.0, 1.0, 30.0}", "wrist"),
        ("MOVE JOINT TO {5.0, 10.0, -95.0, 20.0, 500.0, 30.0}", "limit"),
    ],
)
def test_guarded_targets_keep_their_value(run, line, said):
    outcome = run(JOINTS, line)
    assert statuses(outcome)[1] == "REJECTED"
    assert re.search(said, whys(outcome)[1])
    assert outcome.exit_code == 1
    assert line.encode() in outcome.outputs["job.pdl"]


def test_a_program_without_a_target_of_its_own_stays_as_it_is(run):
    line = "MOVE LINEAR RELATIVE VEC(1, 2, 3) IN TOOL"
    found = run(line)
    assert found.decisions.status.tolist() == [Status.UNCHANGED]
    assert line.encode() in found.outputs["job.pdl"]


def test_unknown_frame_is_not_compensated(run):
    outcome = run(JOINTS, "$UFRAME := frame_from_vision()", POSE, NEXT)
    assert statuses(outcome) == ["CORRECTED", "RUNTIME", "RUNTIME"]
    assert "$UFRAME" in whys(outcome)[1]


UNREAD = ("FROBNICATE p WITH 3", "SPLINE TO POS(1, 2, 3, 0, 0, 0, '') 3",
          "WAIT FOR tracker(1) ?? 3", "$ARM_DATA[1].TOOL := POS(1 1)")  # fmt: skip


@pytest.mark.parametrize("line", UNREAD)
def test_targets_after_what_is_not_understood_are_left(run, line):
    outcome = run(JOINTS, line, POSE, NEXT)
    assert statuses(outcome) == ["CORRECTED", "RUNTIME", "RUNTIME"]
    assert "not understood" in whys(outcome)[1]
    assert outcome.exit_code == 1
    alone = run(JOINTS, POSE, NEXT, line)  # it may hold a target itself
    assert statuses(alone) == ["CORRECTED"] * 3 and alone.exit_code == 1


@pytest.mark.parametrize("line", ["WAIT FOR $DIN[1] ?? 3", "PULSE ?? 3", "n := 3 3"])
def test_what_cannot_move_the_arm_leaves_targets_alone(run, line):
    outcome = run(JOINTS, line, POSE, NEXT)
    assert statuses(outcome) == ["CORRECTED"] * 3 and outcome.exit_code == 0


DISTURBED = {
    "SENSOR_TRK(TRUE)": "SENSOR_TRK(FALSE)",
    "SENSOR_TRK(mode)": "SENSOR_TRK(OFF)",
    "$SENSOR_ENBL := TRUE": "$SENSOR_ENBL := FALSE",
    "$ARM_DATA[1].SENSOR_ENBL := ON": "$SENSOR_ENBL := OFF",
    "$CONV_ENBL := TRUE": "$CONV_ENBL := FALSE",
    "$CAL_SYS[2] := 3.0": "",
    "$ARM_DATA[1].CAL_SYS[2] := 3.0": "",
    "$CAL_SYS := {0, 0, -90, 0, 60, 0}": "",
    "$TOOL_MASS := mass": "",
}


@pytest.mark.parametrize("line", DISTURBED)
def test_targets_are_left_where_the_arm_does_not_go_as_written(run, line):
    outcome = run(JOINTS, line, POSE, *filter(None, [DISTURBED[line]]), NEXT)
    assert statuses(outcome)[:2] == ["CORRECTED", "RUNTIME"]
    assert (statuses(outcome)[2] == "CORRECTED") is bool(DISTURBED[line])
    assert outcome.exit_code == 1


@pytest.mark.parametrize(("mass", "status"), [(0.2, "CORRECTED"), (200.0, "REJECTED")])
def test_a_stated_load_counts_and_is_guarded_by_what_it_leaves_unsure(
    run, mass, status
):
    outcome = run(JOINTS, f"$TOOL_MASS := {mass}", POSE)
    assert statuses(outcome) == ["CORRECTED", status]
    assert any("payload_mm" in why for why in whys(outcome)) is (status == "REJECTED")


def test_settings_that_disturb_nothing(run):
    lines = ("$SENSOR_ENBL := FALSE", "$SENSOR_ENBL[2] := FALSE", "$CONV_ENBL := OFF",
             "SENSOR_TRK(FALSE)", "$ARM_DATA[2].SENSOR_ENBL := TRUE",
             "$ARM_DATA[2].CAL_SYS[1] := 3.0")  # fmt: skip
    assert statuses(run(JOINTS, *lines, POSE)) == ["CORRECTED"] * 2


def test_a_tool_far_from_the_survey_is_guarded(run):
    outcome = run("$TOOL := POS(0.0, 0.0, 1900.0, 0.0, 0.0, 0.0, '')", JOINTS)
    assert statuses(outcome) == ["REJECTED"]
    assert "tool" in whys(outcome)[0]


def test_a_variable_reached_from_two_sides_has_one_correction_for_both(run):
    lines = (
        "p := POS(100.0, 200.0, 150.0, 0.0, 175.0, 0.0, '')",
        HIGH, "MOVE JOINT TO p", LOW, "MOVE JOINT TO p",
    )  # fmt: skip
    outcome = run(*lines)
    assert statuses(outcome) == ["CORRECTED"] * 4
    assert "mm off each" in whys(outcome)[1]
    assert lines[0].encode() not in outcome.outputs["job.pdl"]


def test_a_variable_reached_alike_is_corrected_once(run):
    lines = (
        "p := POS(100.0, 200.0, 150.0, 0.0, 175.0, 0.0, '')",
        JOINTS, "MOVE JOINT TO p", JOINTS, "MOVE JOINT TO p",
    )  # fmt: skip
    outcome = run(*lines)
    # the very first move arrives from an unknown side only at the first literal
    assert statuses(outcome)[1] == statuses(outcome)[3] == "CORRECTED"
    assert lines[0].encode() not in outcome.outputs["job.pdl"]


def test_moves_without_a_target_do_not_count(run):
    outcome = run(JOINTS, "MOVE TO $HOME", "MOVE RELATIVE VEC(0, 0, 20) IN TOOL")
    assert statuses(outcome) == ["CORRECTED", "UNCHANGED", "UNCHANGED"]
    assert outcome.exit_code == 0


def test_direction_is_that_of_the_approach(run):
    outcome = run(JOINTS, NEXT, JOINTS)
    d = outcome.decisions
    np.testing.assert_array_equal(d.direction[1], np.ones(6))
    np.testing.assert_array_equal(d.direction[2], -np.ones(6))
    gap = np.linalg.norm(d.correction[0] - d.correction[2])
    assert gap > 0.01e-3


def test_report_has_the_agreed_keys(run):
    report = json.loads(report_text(run(JOINTS, POSE, "MOVE TO $HOME")))
    assert set(report) >= {"program", "model", "targets", "predicted", "diagnostics"}
    row = report["targets"][1]
    assert set(row) >= {
        "line", "literal", "name", "move", "q_deg", "lambda", "side", "status", "code",
        "reason", "original", "corrected", "correction_mm", "std_error_mm",
    }  # fmt: skip
    assert row["move"] == "LINEAR" and row["literal"] == {"file": "job.pdl", "line": 7}
    assert row["original"][:3] == [100.0, 200.0, 150.0]
    assert report["targets"][2]["literal"] is None
    assert set(report["predicted"]["before"]) >= {"mean_mm", "std_mm", "max_mm"}
