"""The arm of a backup that the task of a module moves."""

from __future__ import annotations

import pytest

from postproc.language.rapid.settings import UNKNOWN, arm_of_task
from tests.language.rapid.test_backup import INFO, MOC, SYS

ONE_ARM = MOC.replace('      -name "ROB_2"', '#\n      -name "ROB_2"')
AS_WRITTEN = MOC.replace("ROB_1", "ROB_3").replace("ROB_2", "ROB_1")
NAMED = MOC.replace("ROB_1", "LEFT").replace("ROB_2", "RIGHT")


def lay_out(folder, place, moc=MOC, sys=SYS, info=INFO):
    """Write the settings of a backup, and return a module in it."""
    files = {
        "SYSPAR/MOC.cfg": moc,
        "SYSPAR/SYS.cfg": sys,
        "BACKINFO/backinfo.txt": info,
    }
    for name, text in {**files, place: "MODULE m"}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        if text:
            (folder / name).write_text(text)
    return folder / place


@pytest.mark.parametrize(
    ("place", "number"),
    [("RAPID/TASK1/PROGMOD/a.mod", 1), ("RAPID/TASK2/PROGMOD/a.mod", 2),
     ("RAPID/task2/SYSMOD/a.sys", 2), ("RAPID/TASK3/PROGMOD/a.mod", 0),
     ("RAPID/TASK4/PROGMOD/a.mod", UNKNOWN), ("HOME/a.mod", UNKNOWN)],
)  # fmt: skip
def test_a_task_moves_the_arm_of_its_group(tmp_path, place, number):
    found = arm_of_task(lay_out(tmp_path, place))
    assert (found.number, found.arms) == (number, ("ROB_1", "ROB_2"))


@pytest.mark.parametrize(
    ("texts", "number"),
    [
        ({"moc": ONE_ARM}, 0),
        ({"moc": ""}, 0),
        ({"sys": ""}, UNKNOWN),
        ({"info": ""}, UNKNOWN),
        ({"info": INFO.replace("ROB2", "ROB9")}, UNKNOWN),
        ({"sys": SYS.replace('Group "rob2"', 'Group "ROB1"')}, 1),
        ({"sys": SYS.replace(' -UseMechanicalUnitGroup "rob2"', "")}, UNKNOWN),
        ({"sys": SYS.replace('"ROB_2"', '"ROB_7"')}, UNKNOWN),
        ({"moc": AS_WRITTEN, "sys": SYS.replace("ROB_2", "ROB_3")}, 2),
        ({"moc": NAMED, "sys": SYS.replace("ROB_2", "RIGHT")}, 2),
    ],
)
def test_only_what_the_files_say_counts(tmp_path, texts, number):
    module = lay_out(tmp_path, "RAPID/TASK2/PROGMOD/a.mod", **texts)
    assert arm_of_task(module).number == number
    if texts.get("moc") == AS_WRITTEN:
        assert arm_of_task(module).arms == ("ROB_1", "ROB_3")


def test_a_changed_file_is_read_again(tmp_path):
    module = lay_out(tmp_path, "RAPID/TASK2/PROGMOD/a.mod")
    assert arm_of_task(module).number == 2
    (tmp_path / "SYSPAR/SYS.cfg").write_text(
        SYS.replace('Group "rob2"', 'Group "rob1"')
    )
    assert arm_of_task(module).number == 1
