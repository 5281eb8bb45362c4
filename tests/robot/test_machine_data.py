"""Machine data become an arm file that says the same, or are refused in words."""

from __future__ import annotations

import re

import numpy as np
import pytest

from postproc.exceptions import ArmError
from postproc.robot.arm import load_arm
from postproc.robot.machine_data import (
    machine_arm_text,
    read_machine_data,
    shape_of_machine,
)
from tests.written import cli

KR210 = """&ACCESS RV
DEFDAT  $MACHINE PUBLIC
CHAR $TRAFONAME[32]
INT $NUM_AX=6 ; axes
INT $A4PAR=0
DECL MAIN_AXIS $MAIN_AXIS=#NR
DECL WRIST_AXIS $WRIST_AXIS=#ZEH
$TRAFONAME[]="#KR210R2700 EXTRA C4 FLR"
FRAME $TIRORO={X 0.0,Y 0.0,Z 675.000,A 0.0,B 0.0,C 0.0}
FRAME $TFLWP={X 0.0,Y 0.0,Z 215.000,A 0.0,B 0.0,C 0.0}
FRAME $TX3P3={X 1200.00,Y 0.0,Z -41.0000,A 0.0,B 90.0000,C 0.0}
REAL $LENGTH_A=350.000
REAL $LENGTH_B=1150.00
DECL DHART $DH_4={DHART_A 0.0,DHART_D 0.0,DHART_ALPHA 90.0000}
DECL DHART $DH_5={DHART_A 0.0,DHART_D 0.0,DHART_ALPHA -90.0000}
INT $AXIS_DIR[12]
DECL FRA $COUP_COMP[6,6]
$COUP_COMP[4,5]={N -91,D 5780}
$COUP_COMP[4,6]={N 97351,D 11765190}
$COUP_COMP[5,6]={N -134,D 14337}
"""
COLUMNS = {
    "AXIS_DIR": [-1, 1, 1, -1, -1, -1],
    "AXIS_SEQ": [1, 2, 3, 4, 5, 6],
    "SOFTN_END": [-185.0, -140.0, -120.0, -350.0, -125.0, -350.0],
    "SOFTP_END": [185.0, -5.0, 155.0, 350.0, 125.0, 350.0],
    "VEL_AXIS_MA": [4500.0] * 6,
    "RAT_MOT_AX": ["{N -35264,D 161}", "{N -4472,D 19}", "{N -241,D 1}",
                   "{N -17391,D 115}", "{N -42772,D 273}", "{N -329751,D 2680}"],
}  # fmt: skip


def written(folder, text=KR210, ending="\r\n", **columns):
    lines = [text.strip()]
    for name, values in (COLUMNS | columns).items():
        lines += [f"${name}[{k}]={v}" for k, v in enumerate(values, start=1)]
    place = folder / "$machine.dat"
    place.write_bytes(ending.join([*"\n".join(lines).split("\n"), "ENDDAT"]).encode())
    return place


def made(folder, place):
    out = folder / "arm.toml"
    out.write_text(machine_arm_text(read_machine_data(place), 0.06))
    return load_arm(out)


def test_it_is_the_shipped_arm(tmp_path):
    """The shipped file comes from an independent source, a URDF's numbers."""
    arm, shipped = made(tmp_path, written(tmp_path)), load_arm("kr210-r2700-extra")
    assert arm.file.dh == shipped.file.dh and arm.file.opw == shipped.file.opw
    assert arm.name == "kr210r2700-extra-c4-flr"
    np.testing.assert_allclose(arm.lower, shipped.lower)
    np.testing.assert_allclose(arm.upper, shipped.upper)
    # Rated speeds of motors: those of the data sheet but for rounding.
    found = np.array(arm.file.joints.velocity_deg_s)
    np.testing.assert_allclose(found, shipped.file.joints.velocity_deg_s, rtol=0.005)
    assert arm.file.joints.gear_ratio[2] == -241.0
    np.testing.assert_allclose(arm.coupling, shipped.coupling, atol=1e-8)
    np.testing.assert_allclose(arm.gear_ratio, shipped.gear_ratio, atol=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_the_flange_is_where_the_machine_data_put_it(tmp_path, seed):
    rng = np.random.default_rng(seed)
    text = KR210
    for old in ("675.000", "215.000", "1200.00", "-41.0000", "350.000", "1150.00"):
        text = text.replace(old, f"{float(old) * rng.uniform(0.5, 1.5):.3f}")
    if seed % 2:
        text = text.replace("ALPHA 90.0", "ALPHA #").replace(
            "ALPHA -90.0", "ALPHA 90.0"
        )
        text = text.replace("ALPHA #", "ALPHA -90.0")
    place = written(tmp_path, text, AXIS_DIR=rng.choice([-1, 1], 6).tolist())
    arm, shape = made(tmp_path, place), shape_of_machine(read_machine_data(place))
    q = rng.uniform(-1.5, 1.5, (20, 6))
    wanted = np.array([shape.place(angles) for angles in q])
    np.testing.assert_allclose(arm.flange(q), wanted, atol=1e-12)


def test_a_drive_at_rest_lets_its_axis_turn_with_others(tmp_path):
    """``$COUP_COMP[m,n]`` is the reaction of axis n where m is turned by 1."""
    arm = made(tmp_path, written(tmp_path))
    turned = np.zeros(6)
    turned[3] = 1.0  # axis 4, the drives of 5 and 6 held
    turned[4] = -91 / 5780
    turned[5] = 97351 / 11765190 - 134 / 14337 * turned[4]
    drives = arm.coupling @ turned
    np.testing.assert_allclose(drives, [0, 0, 0, 1, 0, 0], atol=1e-8)


def test_couplings_are_written_with_what_they_say(tmp_path):
    text = machine_arm_text(read_machine_data(written(tmp_path)), 0.1, "mine")
    assert 'name = "mine"' in text and "axis 4 on 5 -91/5780" in text
    assert "5 on 6 -134/14337" in text and "on 4" not in text
    none = re.sub(r"(COUP_COMP.*)N -?\d+", r"\1N 0", KR210)
    text = machine_arm_text(read_machine_data(written(tmp_path, none)), 0.1)
    assert "couples no axes" in text and "drive_coupling" not in text


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("$NUM_AX=6", "$NUM_AX=4", "NUM_AX"),
        ("#NR", "#SS", "MAIN_AXIS"),
        ("#ZEH", "#SRH", "WRIST_AXIS"),
        ("$A4PAR=0", "$A4PAR=1", "A4PAR"),
        ("Z 675.000,A 0.0", "Z 675.000,A 9.0", "TIRORO"),
        ("B 90.0000", "B 80.0000", "TX3P3"),
        ("X 0.0,Y 0.0,Z 215", "X 1.0,Y 0.0,Z 215", "TFLWP"),
        ("DHART_D 0.0,DHART_ALPHA 90", "DHART_D 5.0,DHART_ALPHA 90", "DH_4"),
        ("ALPHA -90.0000", "ALPHA 90.0000", "DH_4 + $DH_5"),
        ("REAL $LENGTH_B=1150.00", "", "LENGTH_B"),
        ("$LENGTH_A=350.000", "$LENGTH_A=far", "far"),
        ("D 5780", "D 0", "COUP_COMP[4,5]"),
    ],
)
def test_what_is_no_such_arm_is_refused(tmp_path, old, new, said):
    assert old in KR210
    place = written(tmp_path, KR210.replace(old, new), ending="\n")
    with pytest.raises(ArmError, match=re.escape(said)):
        machine_arm_text(read_machine_data(place), 0.1)


def test_senses_and_ratios_must_be_there(tmp_path):
    for name, values in (("AXIS_DIR", [0] * 6), ("RAT_MOT_AX", ["{N 0,D 1}"] * 6)):
        place = written(tmp_path, **{name: values})
        with pytest.raises(ArmError, match=name):
            machine_arm_text(read_machine_data(place), 0.1)


def test_the_command(tmp_path):
    place, out = written(tmp_path), tmp_path / "arm.toml"
    found = cli("arm", "from-machine-dat", place, "-o", out)
    assert found.exit_code == 0 and f"written {out}" in found.stderr
    assert load_arm(out).file.opw is not None and load_arm(out).repeatability == 0.1e-3
    assert cli("arm", "from-machine-dat", tmp_path / "no.dat").exit_code == 2
    assert cli("arm", "from-machine-dat", place, "-o", place).exit_code == 2
