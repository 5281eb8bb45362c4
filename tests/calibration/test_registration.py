from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.fit import into_base_frame
from postproc.calibration.measurements import read_points, read_survey_file
from postproc.calibration.registration import register
from postproc.calibration.tables import TableFormat, read_column_map
from postproc.exceptions import MeasurementError
from postproc.model.effect_sum import Combination
from postproc.model.effects import BASE_EFFECTS
from postproc.model.kinematics import ArmStates
from postproc.robot.arm import load_arm
from tests.calibration.simulator import NJ, PLATE, random_arm, random_states, survey_of

SHARED = Path(os.environ.get("POSTPROC_SHARED", Path(__file__).parents[3] / "shared"))


def pose() -> tuple[np.ndarray, np.ndarray]:
    return Rotation.from_rotvec([0.1, -0.2, 2.0]).as_matrix(), np.array([3.0, -2, 1.0])


def test_tracker_and_probe_are_found_exactly_on_a_perfect_arm() -> None:
    states = random_states(60, np.random.default_rng(0), PLATE)
    R, t = pose()
    position = (ArmStates(NJ, states).walk.tcp - t) @ R  # tracker = R^T (base - t)
    blind = states.with_(tool=np.zeros((60, 3)))
    found = register(NJ, blind, position, Combination(()), np.zeros(0))
    np.testing.assert_allclose(found.transforms[0][:3, :3], R, atol=1e-7)
    np.testing.assert_allclose(found.tracker, t, atol=1e-7)
    np.testing.assert_allclose(found.probes, PLATE, atol=1e-7)


def test_an_arm_is_calibrated_in_the_tracker_s_frame() -> None:
    rng = np.random.default_rng(1)
    arm = random_arm(rng)
    states = random_states(300, rng)
    R, t = pose()
    measured = (arm.measure(states, rng)[0] - t) @ R
    measured[5] += 0.05
    survey, placed = into_base_frame(
        survey_of(states.with_(tool=np.zeros((300, 3))), measured), NJ
    )
    fit = fit_survey(survey, NJ, BASE_EFFECTS, placed.tracker, ("registration",))
    model = model_of(fit, survey)
    assert "registration" not in {e.name for e in model.compensable()[0].effects}
    assert fit.rows.weight[5] == 0
    # Distances do not depend on the frame: they must be the true ones.
    held = random_states(100, rng, placed.probes)
    true = arm.tcp(held.q, held.direction, np.tile(states.tool[0], (100, 1)))
    batch = ArmStates(NJ, held)
    ours = batch.walk.tcp + fit.combination.error(batch, fit.values)
    gap = np.linalg.norm(np.diff(true, axis=0), axis=1)
    gap -= np.linalg.norm(np.diff(ours, axis=0), axis=1)
    assert np.sqrt((gap**2).mean()) < 3e-5


@pytest.mark.parametrize(
    ("spoil", "match"),
    [
        (lambda q, p: (q, p * 1e-3), "look like metres"),
        (lambda q, p: (np.deg2rad(q), p), "look like radians"),
        (lambda q, p: (q * [1, 1, 1, -1, 1, 1], p), "Joint 4 looks like it has the"),
        (lambda q, p: (q[:, [1, 0, 2, 3, 4, 5]], p), "Joints 1 and 2 look swapped"),
    ],
)
def test_mistakes_are_named(spoil, match: str) -> None:  # type: ignore[no-untyped-def]
    states = random_states(80, np.random.default_rng(2))
    R, t = pose()
    q, position = spoil(states.q, (ArmStates(NJ, states).walk.tcp - t) @ R)
    survey = survey_of(states.with_(q=np.array(q)), position)
    with pytest.raises(MeasurementError, match=match):
        into_base_frame(survey, NJ)


def test_other_tools_files_are_read(tmp_path: Path) -> None:
    sa = tmp_path / "sa.txt"
    sa.write_text(
        "// SpatialAnalyzer\n// Group: A\np1, 100.0, 200.0, 300.0\np2, 4, 5, 600\n"
    )
    points = read_points(sa)
    assert points.text("id") == ["p1", "p2"] and points.line.tolist() == [3, 4]
    xyz = ("x_mm", "y_mm", "z_mm")
    assert points.block(xyz)[1].tolist() == [4.0, 5.0, 600.0]
    inches = read_points(sa, TableFormat(unit="inch"))
    assert inches.block(xyz)[0].tolist() == [2540.0, 5080.0, 7620.0]
    leica = tmp_path / "leica.txt"
    text = "Point Id;X [mm];Y [mm];Z [mm];Time\n'a1';1,5;2;3;'12:30'\n"
    leica.write_bytes(text.replace("Time", "Zeit für").encode("latin-1"))
    points = read_points(leica)
    assert points.text("id") == ["a1"]
    assert points.block(xyz)[0].tolist() == [1.5, 2.0, 3.0]
    (tmp_path / "bad.csv").write_text("a;b\n1;2\n")
    with pytest.raises(MeasurementError, match="no columns for a name"):
        read_points(tmp_path / "bad.csv")


def test_a_column_map_reads_the_rest(tmp_path: Path) -> None:
    form = tmp_path / "map.toml"
    joints = "\n".join(f'q{j}_deg = "A{j}"' for j in range(1, 7))
    form.write_text(
        f'[columns]\nid = "name"\n{joints}\n'
        + "\n".join(f'{a}_mm = {{ column = "{a}", factor = 1000.0 }}' for a in "xyz")
        + '\n[file]\ndelimiter = "|"\n'
    )
    data = tmp_path / "d.txt"
    data.write_text("name|A1|A2|A3|A4|A5|A6|x|y|z\np|1|2|3|4|5|6|0.1|0.2|0.3\n")
    found = read_survey_file(data, NJ, PLATE[:1], reading=TableFormat(form))
    np.testing.assert_allclose(found.position[0], [0.1, 0.2, 0.3])
    assert found.ids == ("p",)
    form.write_text("[columns]\nx_mm = 3\n")
    with pytest.raises(MeasurementError, match=r"\$\.columns\.x_mm"):
        read_column_map(form)
    form.write_text("[colums]\n")
    with pytest.raises(MeasurementError, match=r"unknown key @ \$\.colums"):
        read_column_map(form)


@pytest.mark.skipif(
    not (SHARED / "data" / "ipa-ur10").is_dir(), reason=f"no measured data in {SHARED}"
)
def test_a_real_arm_is_calibrated_from_tracker_data() -> None:
    arm = load_arm("ur10")
    path = SHARED / "data" / "ipa-ur10" / "measurements_joint_configurations.csv"
    series = read_survey_file(path, arm, np.zeros((1, 3)))
    assert len(series) == 1495
    rows = np.random.default_rng(0).permutation(1495)
    train, test = np.sort(rows[:500]), np.sort(rows[500:])
    survey, placed = into_base_frame(series[train], arm)
    left = {}
    for name, effects in {
        "geometry": ("geometry",),
        "full": ("geometry", "backlash", "compliance", "joint_spline"),
    }.items():
        fit = fit_survey(survey, arm, effects, placed.tracker, ("registration",))
        tool = np.tile(placed.probes[0], (len(test), 1))
        batch = ArmStates(arm, series.states[test].with_(tool=tool))
        gap = placed.to_base(series.position[test]) - batch.walk.tcp
        gap -= fit.combination.error(batch, fit.values)
        left[name] = np.linalg.norm(gap, axis=1).mean()
    assert left["full"] < 0.15e-3 < 0.35e-3 < left["geometry"] < 0.5e-3
