"""A URDF becomes an arm file that says the same, or is refused in words."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from postproc.exceptions import ArmError
from postproc.robot.arm import load_arm
from postproc.robot.arm_file import read_arm_file
from postproc.robot.inverse import wrap
from postproc.robot.ortho_parallel import arm_text, find_closed_form_obstacle
from postproc.robot.urdf import read_chain
from tests.reference import urdf
from tests.robot.urdfs import (
    DOWN,
    LEFT,
    NJ130_SERIAL,
    QUARTER,
    TOOL0,
    URDFS,
    Row,
    X,
    Y,
    Z,
    turning,
    upright,
    urdf_text,
)

IRB = URDFS["irb4600-60-2.05"]
# Lateral offsets, oblique zeros, a base frame that is turned and lifted.
OBLIQUE = (
    Row((0.1, -0.2, 0.3), (math.pi, 0.0, 0.7)),
    turning(1, (0.0, 0.0, -0.4), DOWN, (0.0, 0.0, 0.3)),
    turning(2, (0.2, 0.11, -0.1), Y, (0.0, 0.4, 0.0)),
    turning(3, (0.3, -0.05, -0.5), LEFT, (0.0, -0.9, 0.0)),
    turning(4, (0.05, 0.02, -0.04), X, (0.2, 0.0, 0.0)),
    turning(5, (0.7, 0.0, 0.0), Y, (0.0, 0.6, 0.0)),
    turning(6, (0.1, 0.0, 0.0), X, (-0.5, 0.0, 0.0)),
    TOOL0,
)
SERIAL = {name: rows for name, rows in URDFS.items() if name != "nj130-2.6"}
SERIAL |= {"nj130-2.6": NJ130_SERIAL, "oblique": OBLIQUE}


def write(folder, rows, text=None, **options):
    path = folder / "robot.urdf"
    path.write_text(urdf_text(rows, **options) if text is None else text)
    return path


@pytest.mark.parametrize("name", SERIAL)
def test_the_arm_file_places_the_flange_where_the_urdf_does(tmp_path, name):
    rows = SERIAL[name]
    base = "l1" if name == "oblique" else None
    text = arm_text(read_chain(write(tmp_path, rows), base), 0.08, "mine")
    (tmp_path / "arm.toml").write_text(text)
    arm = load_arm(tmp_path / "arm.toml")
    q = np.random.default_rng(3).uniform(-3.0, 3.0, (300, 6))
    wanted = urdf.flange(rows[1:] if base else rows, q)
    np.testing.assert_allclose(arm.flange(q), wanted, atol=1e-9)
    back = arm.on_branch(wanted, arm.branch(q))
    np.testing.assert_allclose(wrap(back - q), 0.0, atol=1e-6)
    assert arm.name == "mine" and arm.repeatability == pytest.approx(8e-5)
    np.testing.assert_allclose(arm.upper, 3.0)
    np.testing.assert_allclose(arm.velocity, 2.0)


@pytest.mark.parametrize("name", SERIAL)
def test_a_shipped_arm_is_what_its_urdf_gives(tmp_path, name):
    if name in ("nj130-2.6", "oblique"):
        pytest.skip("no shipped arm is this chain")
    text = arm_text(read_chain(write(tmp_path, SERIAL[name])), 0.1)
    (tmp_path / "arm.toml").write_text(text)
    found, shipped = read_arm_file(tmp_path / "arm.toml"), load_arm(name).file
    assert found.dh.model_dump() == shipped.dh.model_dump()
    assert found.opw == shipped.opw


def test_rounded_quarter_turns_are_whole_ones_and_that_is_said(tmp_path):
    rounded = (*NJ130_SERIAL[:2], replace(NJ130_SERIAL[2], rpy=(0.0, -1.57, 0.0)))
    chain = read_chain(write(tmp_path, (*rounded, *NJ130_SERIAL[3:])))
    assert chain.rounded == ("joint j3: -1.57 rad read as -90 deg",)
    q = np.random.default_rng(4).uniform(-3.0, 3.0, (20, 6))
    wanted = urdf.flange(NJ130_SERIAL, q)
    np.testing.assert_allclose(chain.flange(q), wanted, atol=1e-12)


@pytest.mark.parametrize("name", ['a "b"\n\t\\', "\x7f\x01", "\u00e4\U0001f916", "#"])
def test_any_name_can_be_written(tmp_path, name):
    chain = replace(read_chain(write(tmp_path, IRB)), name=name, base=name)
    (tmp_path / "arm.toml").write_text(arm_text(chain, 0.1), encoding="utf-8")
    assert load_arm(tmp_path / "arm.toml").name == name
    assert "mine?" in arm_text(chain, 0.1, "mine\udc80")


def test_the_base_may_hang_beside_the_chain(tmp_path):
    """As base does in ROS: the controller's frame, fixed on base_link."""
    extra = (
        '<link name="base"/><joint name="fixed" type="fixed">'
        '<parent link="l0"/><child link="base"/>'
        '<origin xyz="0 0 0.25" rpy="0 0 3.14159265358979"/></joint></robot>'
    )
    text = urdf_text(IRB).replace("</robot>", extra)
    chain = read_chain(write(tmp_path, IRB, text))
    assert chain.base == "base"
    q = np.random.default_rng(6).uniform(-3.0, 3.0, (20, 6))
    placed = urdf.origin((0.0, 0.0, 0.25), (0.0, 0.0, math.pi))
    wanted = np.linalg.inv(placed) @ urdf.flange(IRB, q)
    np.testing.assert_allclose(chain.flange(q), wanted, atol=1e-12)
    assert "a_mm = [175.0, 900.0, 175.0" in arm_text(chain, 0.1)


def changed(k, **parts):
    """Return the IRB with another joint k."""
    return (*IRB[:k], replace(IRB[k], **parts), *IRB[k + 1 :])


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (changed(0, axis=X), "joint j1 does not turn about z of l0.*--base"),
        (changed(0, xyz=(0.1, 0.0, 0.4)), "joint j1 is beside the base's z.*--base"),
        (changed(3, axis=Y), "j4 is not square to axis 3.*no joint angles move"),
        (changed(4, axis=X), "j5 is not square to axis 4.*no joint angles move"),
        (changed(6, xyz=(0.0, 0.01, 0.0)), "joint j6 misses the flange.*--tip"),
        (changed(6, rpy=(0.0, 0.0, 0.0)), "not along the z of the flange.*--tip"),
        (changed(6, rpy=(0.0, -QUARTER, 0.0)), "behind its flange.*--tip"),
        (changed(5, axis=Y), "joint j6 is not along the z of the flange.*--tip"),
        (changed(2, xyz=(0.0, 0.0, 0.0)), "j3 ends an upper arm of no.*no joint angl"),
        (IRB[1:], "has 5 revolute joints between l0 and tool0, not 6"),
    ],
)
def test_what_is_not_such_an_arm_is_refused_with_its_joint(tmp_path, rows, said):
    path = write(tmp_path, rows)
    with pytest.raises(ArmError, match=said) as refused:
        arm_text(read_chain(path), 0.1)
    if "joints" not in said:
        line = refused.value.line
        assert path.read_text().splitlines()[line - 1].strip().startswith("<joint")


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (changed(1, axis=Z), "joint j2 is not square to axis 1"),
        (changed(2, axis=X), "joint j3 is not parallel to axis 2"),
        (changed(4, xyz=(0.96, 0.0, 0.03)), "joint j5 does not cross axis 4.*0.03"),
        (changed(5, xyz=(0.13, 0.0, 0.02)), "joint j6 misses the wrist.*0.02"),
        (upright(0.5, 0.2, 0.9, 0.2, 0.0, 0.1), "joint j4 ends a forearm of no length"),
    ],
)
def test_an_arm_of_another_structure_has_no_closed_form(tmp_path, rows, said):
    chain = read_chain(write(tmp_path, rows))
    assert re.search(rf":\d+: {said}.*numeric", find_closed_form_obstacle(chain))
    (tmp_path / "arm.toml").write_text(arm_text(chain, 0.1))
    arm = load_arm(tmp_path / "arm.toml")
    q = np.random.default_rng(5).uniform(-3.0, 3.0, (50, 6))
    np.testing.assert_allclose(arm.flange(q), urdf.flange(rows, q), atol=1e-9)
    assert arm.file.opw is None
    assert find_closed_form_obstacle(read_chain(write(tmp_path, IRB))) == ""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<robot", "<xacro:robot", ":2: <xacro:robot> is not expanded.*xacro FILE"),
        ('xyz="0.175', 'xyz="${a1}', r":.*<origin xyz> is not 3 numbers.*xacro FILE"),
        (
            'lower="-3.0"',
            'lower="nan"',
            "<limit lower> is not a number below 1e.09: nan",
        ),
        ('lower="-3.0"', 'lower="low"', "<limit lower> is not a number: low"),
        ('axis xyz="0.0', 'axis xyz="1e300', "is not 3 numbers below 1e.09: 1e300"),
        ('lower="-3.0" upper="3.0"', "", "joint j1 has no range.*<limit"),
        ('type="revolute"', 'type="prismatic"', "joint j1 is prismatic"),
        ('velocity="2.0"', 'velocity="0"', "joint j1 has no velocity"),
        ('axis xyz="0.0 0.0 1.0"', 'axis xyz="0 0 0"', "has an axis of no direction"),
        ("<limit", '<mimic joint="j2"/><limit', "joint j1 follows j2"),
        ("</robot>", "", "is not XML"),
        ("<robot", "<!DOCTYPE r><robot", "declares a document type"),
        ('child link="l2"', 'child link="l1"', "two joints carry link l1"),
        ('parent link="l0"', 'parent link="l3"', "closes a ring"),
        ("robot", "model", "is no URDF: it begins with <model>"),
    ],
)
def test_a_wrong_file_is_refused_with_its_place(tmp_path, old, new, said):
    text = urdf_text(IRB)
    assert old in text
    count = -1 if old == "robot" else 1
    with pytest.raises(ArmError, match=r"robot\.urdf.*" + said):
        read_chain(write(tmp_path, IRB, text.replace(old, new, count)))


def test_ends_that_are_not_there_or_not_clear_are_asked_for(tmp_path):
    path = write(tmp_path, IRB)
    with pytest.raises(ArmError, match=r"has no link flange\. Links: l0, l1"):
        read_chain(path, tip="flange")
    text = urdf_text(IRB).replace("tool0", "end")
    two = text.replace("</robot>", '<link name="other"/></robot>')
    with pytest.raises(ArmError, match=r"which link .*\(l0, other\)\. .*--base"):
        read_chain(write(tmp_path, IRB, two))
    with pytest.raises(ArmError, match=r"which link .*\(end, other\)\. .*--tip"):
        read_chain(write(tmp_path, IRB, two), base="l0")
    assert read_chain(write(tmp_path, IRB, text)).tip == "end"
    with pytest.raises(ArmError, match=r"joint j1 moves l3 against the chain"):
        read_chain(write(tmp_path, IRB), base="l3", tip="l0")
