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
    for name in GIVEN:
        (tmp_path / name).write_bytes((HERE / "rapid" / name).read_bytes())
    return tmp_path


def run(backup, *more):
    job = backup / "RAPID" / "TASK1" / "PROGMOD" / "Job.mod"
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
