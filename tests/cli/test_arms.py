"""postproc arm: the shipped arms in a table, an arm file from a URDF."""

import json
import re

import numpy as np
import pytest

from postproc.robot.arm import load_arm
from postproc.robot.arm_file import list_shipped_arms
from postproc.robot.pose import record_from_pose
from tests.robot.urdfs import NJ130_SERIAL, URDFS, urdf_text
from tests.written import cli


@pytest.mark.parametrize("name", sorted(set(list_shipped_arms()) - {"ur10"}))
def test_a_program_is_planned_with_every_arm(tmp_path, name):
    """Joint and linear moves to poses of known joint angles lead to these."""
    arm = load_arm(name)
    low, high = np.maximum(arm.lower, -2.8), np.minimum(arm.upper, 2.8)
    home = np.where(np.arange(6) == 4, 0.7, (low + high) / 2)
    q = home + np.random.default_rng(2).uniform(-0.15, 0.15, (4, 6))
    moves = (
        f"  MOVE {kind} TO POS({', '.join(f'{v:.4f}' for v in record)}, '')"
        for kind, record in zip(
            ("JOINT", "LINEAR") * 2, record_from_pose(arm.flange(q)), strict=True
        )
    )
    job, cell = tmp_path / "job.pdl", tmp_path / "cell.toml"
    job.write_text("\n".join(["PROGRAM job", "BEGIN", *moves, "END job", ""]))
    joints = [round(float(v), 4) for v in np.rad2deg(home)]
    cell.write_text(f'[robot]\narm = "{name}"\n[home]\njoints_deg = {joints}\n')
    found = cli("explain", job, "--cell", cell, "--report", "-")
    planned = [visit["q_deg"] for visit in json.loads(found.stdout)["visits"]]
    np.testing.assert_allclose(planned, np.rad2deg(q), atol=0.003)


@pytest.fixture
def urdf(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(urdf_text(URDFS["irb4600-60-2.05"], "irb"))
    return path


def test_all_shipped_arms_are_listed_with_their_reach():
    found = cli("arm", "list")
    rows = {line.split()[0]: line.split()[1:] for line in found.stdout.splitlines()}
    assert found.exit_code == 0 and set(rows) - {"arm"} == set(list_shipped_arms())
    assert rows["irb4600-60-2.05"] == ["2051", "0.06", "closed", "form"]
    assert rows["ur10"] == ["0.1", "numeric"]


def test_an_arm_file_is_written_and_can_be_loaded(urdf):
    place = urdf.with_name("arm.toml")
    found = cli("arm", "from-urdf", urdf, "-o", place)
    assert found.exit_code == 0 and f"written {place}" in found.stderr
    arm = load_arm(place)
    assert arm.name == "irb" and arm.file.opw is not None
    shipped = load_arm("irb4600-60-2.05").file.dh
    assert arm.file.dh.model_dump() == shipped.model_dump()


def test_it_goes_to_standard_output_and_says_what_was_rounded(urdf):
    urdf.write_text(urdf_text(NJ130_SERIAL).replace("-1.5707963267948966", "-1.57"))
    found = cli("arm", "from-urdf", urdf, "--base", "l0")
    assert found.exit_code == 0 and 'name = "robot"' in found.stdout
    assert found.stderr == (
        f"{urdf}: joint j3: -1.57 rad read as -90 deg\n"
        f"{urdf}: states no masses. [links] is not written\n"
    )


def test_an_offset_wrist_has_a_numeric_inverse_and_that_is_said(urdf):
    urdf.write_text(urdf.read_text().replace('xyz="0.135 0.0', 'xyz="0.135 0.05'))
    place = urdf.with_name("arm.toml")
    found = cli("arm", "from-urdf", urdf, "-o", place)
    assert found.exit_code == 0 and load_arm(place).file.opw is None
    said = r"robot\.urdf:41: joint j6 misses the wrist centre, off by 0\.05\. .*numeric"
    assert re.search(said, found.stderr)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("0.96", "0.96 0", ":36: <origin xyz> is not 3 numbers"),
        ("robot name", "robot nam", "is not XML"),
    ],
)
def test_what_cannot_be_written_ends_with_2(urdf, old, new, said):
    text = urdf.read_text()
    broken = text.replace(old, new, 1) if said[0] == ":" else text[:-20]
    urdf.write_text(broken)
    place = urdf.with_name("arm.toml")
    found = cli("arm", "from-urdf", urdf, "-o", place)
    assert found.exit_code == 2 and said in found.stderr and not place.exists()


def test_inputs_are_never_overwritten(urdf):
    before = urdf.read_bytes()
    found = cli("arm", "from-urdf", urdf, "-o", urdf)
    assert found.exit_code == 2 and "is an input" in found.stderr
    assert urdf.read_bytes() == before
    assert cli("arm", "from-urdf", urdf.with_name("no.urdf")).exit_code == 2
    found = cli("arm", "from-urdf", urdf, "--repeatability", "1")
    assert found.exit_code == 2 and "change it in the arm file" in found.stderr


def test_an_arm_file_is_verified_before_it_is_written(urdf):
    place = urdf.with_name("arm.toml")
    found = cli("arm", "from-urdf", urdf, "-o", place, "--verify", "new")
    assert found.exit_code == 0 and place.exists()
    assert "flange: place" in found.stderr and "second opinion: agrees" in found.stderr


def test_another_arm_disagrees_and_nothing_is_written(urdf):
    place = urdf.with_name("arm.toml")
    given = "arm", "from-urdf", urdf, "-o", place, "--verify"
    assert cli(*given, "irb6640-185-2.8").exit_code == 1
    same = cli(*given, "irb4600-60-2.05")
    assert same.exit_code == 1 and "joint limits" in same.stderr
    assert re.search(r"flange: place +1000 +< 1e-06 mm", same.stderr)
    assert not place.exists()


def test_what_differs_is_not_written(urdf, monkeypatch):
    from postproc.robot import ortho_parallel as made

    place, right = urdf.with_name("arm.toml"), made.arm_text
    monkeypatch.setattr(
        made,
        "arm_text",
        lambda *a: right(*a).replace("lower_deg = [-", "lower_deg = [-1"),
    )
    found = cli("arm", "from-urdf", urdf, "-o", place, "--verify", "new")
    assert found.exit_code == 1 and not place.exists()


def test_without_pinocchio_it_says_what_installs_it(urdf, monkeypatch):
    from postproc.verify import extra

    monkeypatch.setattr(extra, "find_spec", lambda name: None)
    found = cli("arm", "from-urdf", urdf, "--verify", "new")
    assert found.exit_code == 2 and "pip install pin toppra" in found.stderr
    assert cli("arm", "from-urdf", urdf).exit_code == 0


def test_an_endless_joint_takes_the_range_that_is_stated(urdf):
    urdf.write_text(urdf.read_text().replace('"revolute"', '"continuous"', 1))
    found = cli(
        "arm", "from-urdf", urdf, "--verify", "new", "-o", urdf.with_name("arm.toml")
    )
    assert (
        found.exit_code == 0
        and "is continuous: the given range is used" in found.stderr
    )
    assert "continuous joints: the URDF states no range" in found.stderr


@pytest.mark.parametrize(
    ("old", "new"), [('<robot name="irb">', "<robot>"), ('<link name="l3"/>', "")]
)
def test_what_pinocchio_cannot_read_is_no_traceback(urdf, old, new):
    text = urdf.read_text()
    assert old in text
    urdf.write_text(text.replace(old, new))
    place = urdf.with_name("arm.toml")
    found = cli("arm", "from-urdf", urdf, "-o", place, "--verify", "new")
    assert found.exit_code == 2 and "leave --verify out" in found.stderr
    assert not place.exists()
    assert cli("arm", "from-urdf", urdf, "-o", place).exit_code == 0
