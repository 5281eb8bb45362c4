"""Arm files against Pinocchio's own reading of the URDFs that they were made from."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from postproc.robot.arm import Arm, arm_of_text
from postproc.robot.ortho_parallel import arm_text
from postproc.robot.urdf import UrdfChain, read_chain
from postproc.verify.opinion import Opinion
from postproc.verify.urdf import ArmClaim, UrdfChainNames, judge_urdf, with_whole_turns
from tests.robot.test_urdf import OBLIQUE, SERIAL, write
from tests.robot.urdfs import NJ130_SERIAL, URDFS
from tests.verify import urdfs

INERTIAL = (
    '<inertial><origin xyz="0.1 -0.05 {z}" rpy="0.3 0 1.2"/><mass value="{mass}"/>'
    "</inertial>"
)


def chain(folder: Path, name: str = "irb4600-60-2.05") -> UrdfChain:
    """Write a URDF and read it."""
    return read_chain(write(folder, SERIAL[name]), "l1" if name == "oblique" else None)


def judged(made: UrdfChain, arm: Arm, text: str = "") -> Opinion:
    """Compare an arm with a URDF, or with another text of it."""
    joints = tuple(joint.name for joint in made.moving)
    text = text or made.path.read_text()
    names = UrdfChainNames(text, made.base, made.tip, joints)
    claim = ArmClaim(arm.file, arm.flange, arm.gravity_torque)
    return judge_urdf(arm.name, names, claim, 100)


def made_of(made: UrdfChain) -> Arm:
    """Make the arm of a URDF."""
    return arm_of_text(made.path, arm_text(made, 0.1))


@pytest.mark.parametrize("name", SERIAL)
def test_an_arm_file_is_what_pinocchio_reads(tmp_path: Path, name: str) -> None:
    made = chain(tmp_path, name)
    opinion = judged(made, made_of(made))
    assert opinion.agrees, opinion.to_dict()
    assert {row.what for row in opinion.rows} >= {"flange: place", "joint limits"}
    assert [row.compared for row in opinion.rows][:3] == [100, 100, 18]


@pytest.mark.parametrize(
    ("old", "new", "row"),
    [
        ("0.175", "0.1752", "flange: place"),
        ('<axis xyz="0.0 1.0 0.0"', '<axis xyz="0.0 -1.0 0.0"', "flange: place"),
        ('rpy="0.0 0.0 0.0"', 'rpy="0.0 0.0 0.002"', "flange: orientation"),
        ('lower="-3.0"', 'lower="-3.0001"', "joint limits"),
        ('velocity="2.0"', 'velocity="2.001"', "joint limits"),
    ],
)
def test_another_urdf_disagrees(tmp_path: Path, old: str, new: str, row: str) -> None:
    made = chain(tmp_path)
    text = made.path.read_text()
    assert old in text
    opinion = judged(made, made_of(made), text.replace(old, new, 1))
    assert row in [r.what for r in opinion.rows if r.beyond]


@pytest.mark.parametrize("wrong", ["mass", "centre"])
def test_links_are_compared(tmp_path: Path, wrong: str) -> None:
    path = write(tmp_path, URDFS["irb4600-60-2.05"])
    text = path.read_text()
    for k in range(1, 8):
        body = INERTIAL.format(z=0.05 * k, mass=10.0 * k)
        text = text.replace(f'<link name="l{k}"/>', f'<link name="l{k}">{body}</link>')
    path.write_text(text)
    made = read_chain(path)
    arm = made_of(made)
    assert arm.file.links is not None
    right = judged(made, arm)
    assert right.agrees, right.to_dict()
    assert [r.compared for r in right.rows if r.what == "link masses"] == [6]
    old, new = ("30.0", "30.001") if wrong == "mass" else ("0.15", "0.1505")
    off = [r.what for r in judged(made, arm, text.replace(old, new)).rows if r.beyond]
    assert off == (["link masses"] if wrong == "mass" else []) + ["gravity torque"]


def test_rounded_quarter_turns_widen_the_bound_and_no_more(tmp_path: Path) -> None:
    made = chain(tmp_path, "nj130-2.6")
    text = made.path.read_text().replace("-1.5707963267948966", "-1.57")
    arm = made_of(made)
    opinion = judged(made, arm, text)
    assert opinion.agrees, opinion.to_dict()
    rows = {row.what: row for row in opinion.rows}
    assert rows["flange: place"].largest < 1e-9  # [mm]
    stated = rows["flange, angles of the URDF as rounded: place"]
    assert 0.1 < stated.largest < stated.bound < 5.0


def test_whole_turns_are_taken_in_angles_alone() -> None:
    text = "<origin xyz='1.57 0 0' rpy='1.57 0.5 -3.1416'/><axis xyz='1.57 0 0'/>"
    whole = with_whole_turns(text)
    assert whole.count("1.57 0 0") == 2
    assert re.search(r"rpy='1.5707963\d+ 0.5 -3.14159265\d+'", whole)


def test_a_parallelogram_is_compared_in_series(tmp_path: Path) -> None:
    """The URDF states joints in series, the controller keeps axis 2 out of axis 3."""
    made = read_chain(write(tmp_path, NJ130_SERIAL))
    text = arm_text(made, 0.1)
    # The number that the comment names is right for this arm.
    stated = re.search(r"axis2_in_axis3 = 0.0 .*: (-?1\.0) where the forearm", text)
    assert stated is not None
    coupled = text.replace("axis2_in_axis3 = 0.0", f"axis2_in_axis3 = {stated[1]}")
    assert judged(made, arm_of_text(made.path, coupled)).agrees


def test_the_base_may_stand_askew(tmp_path: Path) -> None:
    """Weight pulls along -z of the base link, wherever the file's root is."""
    path = write(tmp_path, OBLIQUE)
    text = path.read_text()
    for k in range(1, 9):
        body = INERTIAL.format(z=0.05 * k, mass=10.0 * k)
        text = text.replace(f'<link name="l{k}"/>', f'<link name="l{k}">{body}</link>')
    path.write_text(text)
    made = read_chain(path, "l1")
    arm = made_of(made)
    assert arm.file.links is not None
    assert judged(made, arm).agrees


@pytest.mark.parametrize("given", urdfs.ARMS, ids=lambda given: given.name)
def test_arms_of_a_public_package(tmp_path: Path, given: urdfs.Given) -> None:
    robots = urdfs.folder()
    if robots is None:
        pytest.skip(f"{urdfs.PACKAGE} is not installed")
    opinion = urdfs.judged(given, robots, tmp_path)
    assert opinion.agrees, opinion.to_dict()
