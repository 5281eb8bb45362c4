"""A RobotWare backup: system modules are read, and MOC.cfg places the arm."""

from __future__ import annotations

import pytest

from postproc.files import FolderListing
from postproc.language.rapid.backup import read_arms, read_mounted_arms, system_modules
from tests.golden.case import HERE
from tests.golden.rapid_cases import DATA, go, module
from tests.written import cli

MOC = r"""MOC:CFG_1.0:6:0::
#
ROBOT:

      -name "ROB_1" -use_robot_type "ROB1_6640" \
      -base_frame_pos_x 1.5 -base_frame_pos_z 0.25 \
      -base_frame_orient_u0 0.707107 -base_frame_orient_u3 0.707107

      -name "ROB_2" -use_robot_type "ROB2_6640"
#
SINGLE:
      -name "STN1" -base_frame_pos_x 9
"""
SYS = r"""SYS:CFG_1.0:6:0::
#
CAB_TASKS:

      -Name "T_ROB2" -Type "NORMAL" -UseMechanicalUnitGroup "rob2" -MotionTask

      -Name "T_CTRL" -Type "STATIC" -Entry "Main"\
      -TrustLevel "None"

      -Name "T_ROB1" -Type "NORMAL" -MotionTask -UseMechanicalUnitGroup "rob1"
#
MECHANICAL_UNIT_GROUP:

      -Name "rob1" -Robot "ROB_1" -MechanicalUnit_1 "TRACK_1"\
      -UseMotionPlanner "motion_planner_1"

      -Name "rob2" -Robot "ROB_2" -UseMotionPlanner "motion_planner_2"
#
"""
INFO = """>>SYSPAR:
SYS.cfg
>>TASK1: (T_ROB1,,)
SYSMOD/user.sys @
>>TASK2: (T_ROB2,main,)
PROGMOD/Job.mod @
>>TASK3: (T_CTRL,,)
>>EOF:
"""
GIVEN = ("cell.toml", "model.json")


@pytest.fixture
def backup(tmp_path):
    """Write a backup whose tool and work object stand in a system module."""
    task = tmp_path / "RAPID" / "TASK1"
    for folder in (task / "PROGMOD", task / "SYSMOD", tmp_path / "SYSPAR"):
        folder.mkdir(parents=True)
    job = module(go("p1"), go("p2")).decode()
    shared = [line for line in DATA if "tooldata" in line or "wobjdata" in line]
    for line in shared:
        job = job.replace(line + "\n", "")
    (task / "PROGMOD" / "Job.mod").write_text(job)
    user = "\n".join(["MODULE USER(SYSMODULE)", *shared, "PROC away()", go("p3"),
                      "ENDPROC", "ENDMODULE", ""])  # fmt: skip
    (task / "SYSMOD" / "user.sys").write_text(user)
    (task / "SYSMOD" / "coded.sys").write_bytes(bytes(range(256)))
    (tmp_path / "SYSPAR" / "MOC.cfg").write_text(MOC)
    (tmp_path / "SYSPAR" / "SYS.cfg").write_text(SYS)
    (tmp_path / "BACKINFO").mkdir()
    (tmp_path / "BACKINFO" / "backinfo.txt").write_text(INFO)
    for name in GIVEN:
        (tmp_path / name).write_bytes((HERE / "rapid" / name).read_bytes())
    return tmp_path


def run(backup, *more, task="TASK1"):
    job = backup / "RAPID" / task / "PROGMOD" / "Job.mod"
    given = ("--cell", backup / "cell.toml", "--model", backup / "model.json")
    return cli("compensate", job, *given, "-o", backup / "out" / "Job.mod", *more)


def test_data_of_system_modules_are_known(backup):
    (backup / "out").mkdir()
    found = run(backup)
    assert found.exit_code == 0, found.stderr
    assert "3 visits (3 corrected)" in found.stderr and "user.sys" not in found.stderr
    assert {p.name for p in (backup / "out").iterdir()} == {
        "Job.mod", "Job.mod.postproc.json"}  # fmt: skip


def test_what_the_cell_must_add_is_listed_once(backup):
    (backup / "out").mkdir()
    told = run(backup).stderr
    assert told.count("archive-base") == 1
    assert "[base] xyz_mm = [1500.000, 0.000, 250.000]" in told
    text = (backup / "cell.toml").read_text()
    base = "[base]\nxyz_mm = [1500.0, 0.0, 250.0]\neuler_zyz_deg = [90.0, 0.0, 0.0]\n"
    (backup / "cell.toml").write_text(f"{text}\n{base}")
    assert "archive-base" not in run(backup).stderr


def test_only_modules_that_can_be_read_belong_to_the_task(backup):
    job = backup / "RAPID" / "TASK1" / "PROGMOD" / "Job.mod"
    assert [p.name for p in system_modules(job, FolderListing())] == ["user.sys"]
    assert system_modules(backup / "Job.mod", FolderListing()) == ()


def test_points_of_system_modules_keep_their_numbers(backup):
    (backup / "out").mkdir()
    user = backup / "RAPID" / "TASK1" / "SYSMOD" / "user.sys"
    job = backup / "RAPID" / "TASK1" / "PROGMOD" / "Job.mod"
    line = next(one for one in DATA if "robtarget p1:" in one)
    job.write_text(job.read_text().replace(line, ""))
    user.write_text(user.read_text().replace("PROC away", f"{line}\nPROC away"))
    before = user.read_bytes()
    found = run(backup)
    assert found.exit_code == 1 and "not rewritten" in found.stderr
    assert user.read_bytes() == before and not (backup / "out" / "user.sys").exists()


def test_arms_of_a_backup():
    one, two = read_arms(MOC)
    assert (one.name, one.kind) == ("ROB_1", "ROB1_6640")
    assert one.position == (1500.0, 0.0, 250.0)
    assert one.quaternion == (0.707107, 0.0, 0.0, 0.707107)
    assert two.quaternion == (1.0, 0.0, 0.0, 0.0) and two.position == (0.0,) * 3
    assert read_arms("EIO:CFG_1.0\n") == () == read_arms("")


def test_the_settings_are_found_above_the_program(backup, tmp_path):
    job = backup / "RAPID" / "TASK1" / "PROGMOD" / "Job.mod"
    assert [arm.name for arm in read_mounted_arms(job)] == ["ROB_1", "ROB_2"]


def test_a_module_of_another_arm_than_the_cell_s_is_refused(backup):
    (backup / "out").mkdir()
    (backup / "RAPID" / "TASK1").rename(backup / "RAPID" / "TASK2")
    found = run(backup, task="TASK2")
    assert found.exit_code == 2 and not [*(backup / "out").iterdir()]
    assert "task T_ROB2 moves ROB_2, arm 2 of its backup" in found.stderr
    assert "arm_number = 2 under [robot]" in found.stderr
    cell = backup / "cell.toml"
    text = cell.read_text()
    cell.write_text(text.replace("[robot]", "[robot]\narm_number = 2"))
    assert run(backup, task="TASK2").exit_code == 0
    (backup / "RAPID" / "TASK2").rename(backup / "RAPID" / "TASK1")
    found = run(backup)
    assert found.exit_code == 2 and "T_ROB1 moves ROB_1, arm 1" in found.stderr


@pytest.mark.parametrize("gone", ["SYSPAR/SYS.cfg", "BACKINFO/backinfo.txt"])
def test_of_several_arms_the_backup_must_tell_which(backup, gone):
    (backup / "out").mkdir()
    (backup / gone).unlink()
    found = run(backup)
    assert found.exit_code == 2
    assert "has the arms ROB_1, ROB_2: which it moves is not known" in found.stderr
    one_arm = MOC.replace('      -name "ROB_2"', '#\n      -name "ROB_2"')
    (backup / "SYSPAR" / "MOC.cfg").write_text(one_arm)
    assert run(backup).exit_code == 0
