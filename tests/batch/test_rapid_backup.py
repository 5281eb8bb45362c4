"""`batch` over a RobotWare backup: its system modules are read, and copied."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from postproc.batch.archive import missing_in_cell
from postproc.batch.plan import make_plan
from postproc.batch.tree import scan
from postproc.compensation.options import Options
from postproc.language.rapid.backup import read_axes, read_backup
from postproc.robot.cell import load_cell
from tests.golden.rapid_cases import DATA
from tests.language.rapid.test_backup import GIVEN, MOC, backup  # noqa: F401
from tests.written import cli

SECOND = '      -name "ROB_2"'
ONE_ARM = MOC.replace(SECOND, f"#\n{SECOND}")


@pytest.fixture
def tree(backup, tmp_path_factory):  # noqa: F811
    """Move a backup into a folder of its own, beside cell and model."""
    root = tmp_path_factory.mktemp("plant")
    (backup / "RAPID" / "TASK1" / "SYSMOD" / "coded.sys").unlink()
    for name in GIVEN:
        (backup / name).rename(root / name)
    backup.rename(root / "backup")
    return root


def run(tree):
    given = ("--cell", tree / "cell.toml", "--model", tree / "model.json")
    return cli("batch", tree / "backup", tree / "out", *given, "-j", "1")


def test_a_batch_reads_system_modules_and_copies_them(tree):
    found = run(tree)
    assert found.exit_code == 0, found.output
    task = tree / "out" / "RAPID" / "TASK1"
    before = tree / "backup" / "RAPID" / "TASK1"
    name = "SYSMOD/user.sys"
    assert (task / name).read_bytes() == (before / name).read_bytes()
    job = "PROGMOD/Job.mod"
    assert (task / job).read_bytes() != (before / job).read_bytes()


def test_a_batch_tells_where_the_backup_places_the_arm(tree):
    (tree / "backup" / "SYSPAR" / "MOC.cfg").write_text(ONE_ARM)
    told = run(tree).output
    assert "SYSPAR/MOC.cfg gives arms 1" in told
    assert "xyz_mm = [1500.0, 0.0, 250.0]" in told


def test_a_cell_that_agrees_with_the_backup_lacks_no_base(tree):
    (tree / "backup" / "SYSPAR" / "MOC.cfg").write_text(ONE_ARM)
    found = read_backup(tree)
    assert found.place == "backup/SYSPAR/MOC.cfg"
    cell = tree / "cell.toml"
    base = "[base]\nxyz_mm = [{}, 0.0, 250.0]\neuler_zyz_deg = [90.0, 0.0, 0.0]\n"
    text = cell.read_text()
    cell.write_text(text + "\n" + base.format(1500.0))
    assert not any("xyz_mm" in line for line in missing_in_cell(found, load_cell(cell)))
    cell.write_text(text + "\n" + base.format(1400.0))
    assert any("xyz_mm" in line for line in missing_in_cell(found, load_cell(cell)))


def test_a_backup_of_two_arms_places_none(tree):
    found = read_backup(tree / "backup")
    assert found.root == () and found.entries == {"arms": (1, 2)}


def second_task(tree):
    """Add a second task with the same job, and a system module."""
    first, second = (tree / "backup" / "RAPID" / f"TASK{k}" for k in (1, 2))
    shutil.copytree(first, second)
    return "RAPID/TASK2/PROGMOD/Job.mod"


def test_a_program_of_another_arm_is_absent_and_its_system_modules_are_copied(tree):
    job = second_task(tree)
    found = run(tree)
    assert found.exit_code == 2
    assert f"absent: {job}" in found.output and "moves ROB_2, arm 2" in found.output
    assert not (tree / "out" / job).exists()
    assert (tree / "out" / "RAPID/TASK2/SYSMOD/user.sys").exists()
    assert (tree / "out" / "RAPID/TASK1/PROGMOD/Job.mod").exists()


def test_a_plan_gives_every_arm_of_a_backup_its_cell(tree):
    job = second_task(tree)
    text = (tree / "cell.toml").read_text()
    other = text.replace("[robot]", "[robot]\narm_number = 2")
    (tree / "second.toml").write_text(other)
    rule = '[[rule]]\npattern = "**"\narm = {}\ncell = "{}"\nmodel = "model.json"\n'
    rules = rule.format(2, "second.toml") + rule.format(1, "cell.toml")
    (tree / "plan.toml").write_text(rules)
    plan = make_plan(tree / "plan.toml", None, None, Options())
    found = scan(tree / "backup", plan)
    numbers = {u.program: plan.setups[u.setup].cell.arm_number for u in found.units}
    assert numbers == {"RAPID/TASK1/PROGMOD/Job.mod": 1, job: 2} and not found.refused


def test_a_folder_without_settings_is_no_backup(tmp_path):
    assert read_backup(tmp_path) is None and read_backup(tmp_path / "none") is None


AXES = ONE_ARM.replace(
    '-name "STN1" -base_frame_pos_x 9',
    r"""-name "STN1" -use_single_type "STN" -use_joint "stn_1" \
      -base_frame_coordinated ""

      -name "TRACK_1" -use_single_type "TRACK" -use_joint "trk_1"
""",
)
JOINTS = """#
JOINT:
      -name "rob1_1" -logical_axis 1
      -name "trk_1" -logical_axis 7
      -name "stn_1" -logical_axis 9
"""


def test_a_batch_asks_once_for_external_axes(tree):
    (tree / "backup" / "SYSPAR" / "MOC.cfg").write_text(AXES + JOINTS)
    told = run(tree).output
    assert told.count("[aux]") == 1
    pasted = [line.strip() for line in told.splitlines() if ' = "track"' in line]
    assert pasted == ['1 = "track"   # TRACK_1', '3 = "track"   # STN1']
    cell = tree / "cell.toml"
    cell.write_text(cell.read_text() + "\n[aux]\n" + "\n".join(pasted) + "\n")
    assert load_cell(cell).aux == {1: "track", 3: "track"}
    assert "[aux]" not in run(tree).output


def test_axes_that_the_cell_declares_are_not_asked_for(tree):
    (tree / "backup" / "SYSPAR" / "MOC.cfg").write_text(AXES + JOINTS)
    cell = tree / "cell.toml"
    cell.write_text(cell.read_text() + '\n[aux]\n1 = "gun"\n')
    told = run(tree).output
    assert "# under [aux]: 1 external axes" in told
    assert '3 = "track"   # STN1' in told and "TRACK_1" not in told


@pytest.mark.parametrize(
    ("text", "axes"),
    [
        (AXES, {1: "STN1", 2: "TRACK_1"}),
        (AXES + JOINTS, {1: "TRACK_1", 3: "STN1"}),
        (AXES + JOINTS.replace(" 9", " 7"), {1: "STN1", 2: "TRACK_1"}),
        (AXES + JOINTS.replace(" 9", " x"), {1: "STN1", 2: "TRACK_1"}),
        (ONE_ARM.partition("SINGLE")[0], {}),
        ("EIO:CFG_1.0\n", {}),
    ],
)
def test_axes_are_numbered_by_their_joints(text, axes):
    assert read_axes(text) == axes


SHARED = next(line for line in DATA if "wobjdata w:" in line).replace("TASK ", "")
OTHER = "MODULE Job\n{}\nPROC main()\n{}\nENDPROC\nENDMODULE\n"


@pytest.mark.parametrize(
    ("declared", "body", "code"),
    [
        ("", "Set do1;", 0),
        (SHARED, "Set do1;", 0),
        (SHARED, "w.oframe.trans.x:=n;", 1),
        ("", "w:=wobj0;", 1),
        (SHARED.replace("900", "901"), "Set do1;", 1),
    ],
)
def test_a_batch_knows_what_other_tasks_may_change(
    tree, monkeypatch, declared, body, code
):
    task = tree / "backup" / "RAPID" / "TASK1"
    for path in (task / "PROGMOD" / "Job.mod", task / "SYSMOD" / "user.sys"):
        path.write_text(path.read_text().replace("TASK PERS wobjdata", "PERS wobjdata"))
    other = tree / "backup" / "RAPID" / "TASK3" / "PROGMOD" / "Job.mod"
    other.parent.mkdir(parents=True)
    other.write_text(OTHER.format(declared, body))
    found = run(tree)
    assert found.exit_code == code, found.output
    out = tree / "out" / "RAPID"
    before, after = (d / "PROGMOD" / "Job.mod" for d in (task, out / "TASK1"))
    point = next(line for line in before.read_text().splitlines() if "p1:=" in line)
    assert (point in after.read_text()) == bool(code)
    same = out / "TASK3" / "PROGMOD" / "Job.mod"
    assert same.read_bytes() == other.read_bytes()  # nothing corrected, and no stamp
    assert (after.with_name("Job.mod.postproc.json")).is_file()
    plan = make_plan(None, tree / "cell.toml", tree / "model.json", Options())
    monkeypatch.chdir(tree)
    assert scan(Path("backup"), plan).units == scan(tree / "backup", plan).units
