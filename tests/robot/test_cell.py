"""Cell files: defaults, and messages that name the place."""

import numpy as np
import pytest

from postproc.exceptions import ArmError, CellError
from postproc.robot.cell import load_cell

FULL = """
taught = ["P_Dock"]
[robot]
arm = "nj220-2.7"
[tool]
xyz_mm = [80.0, -40.0, 150.0]
[uframe]
xyz_mm = [1500.0, 0.0, 800.0]
euler_zyz_deg = [90.0, 0.0, 0.0]
source = "taught"
[home]
joints_deg = [0.0, 0.0, -90.0, 0.0, 90.0, 0.0]
[payload]
mass_kg = 40.0
com_mm = [0.0, 0.0, 100.0]
[environment]
temperature_c = 24.0
[tracker]
xyz_mm = [3000.0, 1000.0, 1200.0]
[aux]
1 = "gun"
[limits]
correction_mm = 4.0
[routines]
Dock = "moves"
motionless = ["Spot", "LRobot.*"]
[variables]
constant = ["VI_style", "Lib.*"]
[frames.routines.TF]
"1,2" = {tool = {xyz_mm = [1.0, 2.0, 3.0]}, uframe = [4.0, 5.0, 6.0, 0.0, 90.0, 0.0]}
"""


def write(tmp_path, text):
    path = tmp_path / "cell.toml"
    path.write_text(text)
    return path


def test_full_cell(tmp_path):
    cell = load_cell(write(tmp_path, FULL))
    np.testing.assert_allclose(cell.tool.pose[:3, 3], [0.08, -0.04, 0.15])
    np.testing.assert_allclose(cell.uframe.pose[:3, 0], [0, 1, 0], atol=1e-12)
    assert cell.uframe.source == "taught"
    assert cell.base.record == (0.0,) * 6
    assert cell.aux == {1: "gun"}
    assert cell.limits.correction_mm == 4.0 and cell.limits.conflict_mm == 0.02
    assert cell.routines == {"dock": "moves"}
    assert cell.constant == ("vi_style", "lib.*")
    assert cell.motionless == ("spot", "lrobot.*")
    assert cell.frame_tables["tf"]["1,2"].uframe.record() == (4, 5, 6, 0, 90, 0)
    assert cell.taught == {"p_dock"}
    np.testing.assert_allclose(cell.tracker, [3.0, 1.0, 1.2])


def test_a_routine_has_no_list_of_its_own(tmp_path):
    text = '[robot]\narm = "nj220-2.7"\n[routines]\nspot = ["a"]\n'
    with pytest.raises(CellError, match="only `motionless` lists routines"):
        load_cell(write(tmp_path, text))


def test_only_the_robot_is_required(tmp_path):
    cell = load_cell(write(tmp_path, '[robot]\narm = "nj220-2.7"\n'))
    np.testing.assert_array_equal(cell.tool.pose, np.eye(4))
    assert cell.home is None and cell.tracker is None
    assert np.isnan(cell.payload_mass) and np.isnan(cell.temperature)


ROBOT = '[robot]\narm = "nj220-2.7"\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", r"\$\.robot"),
        (ROBOT + "[tool]\nxyz_m = [0.1, 0, 0]\n", "xyz_m"),
        (ROBOT + "[tool]\nxyz_mm = [0.1, 0]\n", r"\$\.tool\.xyz_mm"),
        (ROBOT + "[tool]\nxyz_mm = [1e9, 0, 0]\n", r"is it in mm.*\$\.tool"),
        (ROBOT + "[tool]\nxyz_mm = [nan, 0, 0]\n", r"\$\.tool\.xyz_mm\[1\]"),
        (ROBOT + "[tol]\nxyz_mm = [0, 0, 0]\n", r"unknown key.*\$\.tol"),
        (ROBOT + "[payload]\nmass_kg = -1\n", r"\$\.payload\.mass_kg"),
        (ROBOT + "[environment]\ntemperature_c = 295.0\n", "temperature_c"),
        (ROBOT + '[aux]\n1 = "gnu"\n', r"\$\.aux\.1"),
        (ROBOT + '[aux]\nx = "gun"\n', r"\$\.aux\.x"),
        (ROBOT + "[home]\njoints_deg = [0, 99, 0, 0, 0, 0]\n", "axis 2"),
        ("[robot\n", "not valid TOML"),
    ],
)
def test_wrong_cell_names_file_and_place(tmp_path, text, said):
    with pytest.raises(CellError, match=said) as caught:
        load_cell(write(tmp_path, text))
    assert "cell.toml" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[limits]\nagree_mm = 0.1\n", r"is called conflict_mm @ \$\.limits\.agree_mm"),
        ("[limits]\nstep_mm = 0.1\n", "is called correction_step_mm"),
        ("[limits]\napproach_mm = 1.0\n", "is called reapproach_mm"),
        ("[tool]\nxyz_mm = [0, 0, 0]\ntaught_lambda = []\n", "called taught_direction"),
        ('[routines]\nspot = "still"\n', "still is called motionless"),
        ('[routines]\nstill = ["spot*"]\n', "still is called motionless"),
    ],
)
def test_an_old_word_has_the_new_one_named(tmp_path, text, said):
    with pytest.raises(CellError, match=said):
        load_cell(write(tmp_path, ROBOT + text))


def test_a_routine_may_be_called_like_an_old_word(tmp_path):
    cell = load_cell(write(tmp_path, ROBOT + '[routines]\nstill = "moves"\n'))
    assert cell.routines == {"still": "moves"}


def test_missing_cell(tmp_path):
    with pytest.raises(CellError, match="cannot be read"):
        load_cell(tmp_path / "none.toml")


def test_unknown_arm(tmp_path):
    with pytest.raises(ArmError, match="Shipped arms"):
        load_cell(write(tmp_path, '[robot]\narm = "xyz"\n'))


def test_mountings(tmp_path):
    robot = '[robot]\narm = "nj220-2.7"\n'
    turned = "[base]\nxyz_mm = [0, 0, 0]\neuler_zyz_deg = [0.0, 90.0, 0.0]\n"
    for text, weight in (
        ("", (0, 0, -1)),
        ('mounting = "ceiling"\n', (0, 0, 1)),
        ('mounting = "wall"\n', (1, 0, 0)),
        ("mounting = [0, -3, -4]\n", (0, -0.6, -0.8)),
        (turned, (1, 0, 0)),
        ('mounting = "floor"\n' + turned, (0, 0, -1)),  # stated: [base] is not asked
    ):
        cell = load_cell(write(tmp_path, robot + text))
        np.testing.assert_allclose(cell.arm.weight, weight, atol=1e-12)
    for wrong in ('"roof"', "[0, 0, 0]", "[1, 0]", "[1, 0, nan]", '["a", 0, 0]', "3"):
        with pytest.raises(CellError, match="direction in which weight pulls") as found:
            load_cell(write(tmp_path, robot + f"mounting = {wrong}\n"))
        assert "$.robot.mounting" in str(found.value)
