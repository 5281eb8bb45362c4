"""Orientations of a 6D probe: what they add, and what they must not spoil."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.fit import into_base_frame
from postproc.calibration.measurements import Measurements, read_survey_file
from postproc.calibration.report import list_downweighted
from postproc.calibration.survey_checks import check_orientations
from postproc.exceptions import MeasurementError
from postproc.model.effects import BASE_EFFECTS
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from tests.calibration.simulator import (
    NJ,
    TOOL,
    Simulated,
    random_arm,
    random_states,
    survey_of,
)

NOISE = 5e-5  # [rad] of every measured orientation
MOUNT = Rotation.from_euler("XYZ", [20.0, -35.0, 110.0], degrees=True).as_matrix()


def oriented(seed: int, n: int = 200) -> tuple[Simulated, Measurements]:
    """Survey one point of an arm with a 6D probe of known mounting."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    states = random_states(n, rng)
    measured, _ = arm.measure(states, rng)
    R = arm.pose(states.q, states.direction, states.tool)[:, :3, :3] @ MOUNT
    shaken = Rotation.from_rotvec(NOISE * rng.standard_normal((n, 3))).as_matrix() @ R
    survey = survey_of(states, measured)
    return arm, replace(survey, rotation=shaken, mounting=MOUNT)


def fitted(survey: Measurements) -> Model:
    return model_of(fit_survey(survey, NJ, BASE_EFFECTS, None), survey)


def gap(arm: Simulated, model: Model, longer: float) -> tuple[np.ndarray, np.ndarray]:
    """True minus predicted error with a longer tool, and its standard error."""
    held = random_states(150, np.random.default_rng(9), TOOL[None] + [0, 0, longer])
    true = arm.tcp(held.q, held.direction, held.tool)
    p = model.predict(NJ, held)
    return true - ArmStates(NJ, held).walk.tcp - p.error, p.std_model


def rms(errors: list[np.ndarray]) -> float:
    return float(np.sqrt(np.mean([(e**2).sum(axis=1).mean() for e in errors])))


def test_a_6d_survey_of_one_point_holds_for_a_longer_tool() -> None:
    six, three, inside = [], [], []
    for seed in range(6):
        arm, survey = oriented(seed)
        model = fitted(survey)
        error, std = gap(arm, model, 0.1)
        six.append(error)
        inside.append(np.abs(error) < 1.96 * std)
        alone = fitted(replace(survey, rotation=None, mounting=None))
        three.append(gap(arm, alone, 0.1)[0])
        assert 0.85 < model.statistics["orientation_std_mrad"] / (NOISE * 1e3) < 1.15
        assert not model.predict(NJ, longer_states()).outside
        assert "probe_turn" not in {e.name for e in model.compensable()[0].effects}
    assert rms(six) < 0.25 * rms(three)
    assert np.mean(inside) > 0.93


def longer_states():  # type: ignore[no-untyped-def]
    return random_states(5, np.random.default_rng(3), TOOL[None] + [0, 0, 0.1])


def test_an_undeclared_mounting_leaves_the_flange_unseen_and_says_so() -> None:
    arm, survey = oriented(0)
    unknown = check_orientations(replace(survey, mounting=None), NJ)
    assert unknown.rotation is None
    assert "write euler_zyz_deg in [survey]" in unknown.warnings[-1]
    model = fitted(unknown)
    assert any("not surveyed" in w for w in model.predict(NJ, longer_states()).outside)
    assert rms([gap(arm, model, 0.0)[0]]) < 2e-5


def test_a_wrong_orientation_is_listed_and_its_position_kept() -> None:
    arm, survey = oriented(1)
    assert survey.rotation is not None
    spoilt = np.array(survey.rotation)
    spoilt[7] = Rotation.from_rotvec([0.02, 0.0, 0.0]).as_matrix() @ spoilt[7]
    survey = replace(survey, rotation=spoilt)
    fit = fit_survey(survey, NJ, BASE_EFFECTS, None)
    assert fit.turns is not None and fit.rows.weight[7] == 1
    assert np.flatnonzero(fit.turns.weight < 1).tolist() == [7]
    listed = list_downweighted(fit, survey)
    assert [row.id for row in listed] == ["8"]
    assert listed[0].why.startswith("orientation dropped: off by ")
    assert rms([gap(arm, model_of(fit, survey), 0.1)[0]]) < 4e-5


def test_orientations_turn_with_the_tracker() -> None:
    _, survey = oriented(2)
    assert survey.rotation is not None
    R = Rotation.from_rotvec([0.1, -0.2, 2.0]).as_matrix()
    seen = replace(
        survey,
        position=(survey.position - [3.0, -2.0, 1.0]) @ R,
        rotation=R.T @ survey.rotation,
    )
    placed, found = into_base_frame(seen, NJ)
    fit = fit_survey(placed, NJ, BASE_EFFECTS, found.tracker, ("registration",))
    assert fit.turns is not None
    assert fit.turns.std == pytest.approx(NOISE, rel=0.2)


def test_orientations_that_do_not_belong_to_the_arm() -> None:
    _, survey = oriented(3)
    assert survey.rotation is not None
    checked = check_orientations(survey, NJ)
    assert checked.rotation is survey.rotation
    turned = replace(survey, rotation=np.swapaxes(survey.rotation, 1, 2))
    checked = check_orientations(turned, NJ)
    assert checked.rotation is None and "they differ by" in checked.warnings[-1]
    with pytest.raises(MeasurementError, match=r"mounted .* deg off.*euler_zyz_deg"):
        check_orientations(replace(survey, mounting=np.eye(3)), NJ)


def test_orientations_are_read_as_turns_about_x_y_z(tmp_path) -> None:  # type: ignore[no-untyped-def]
    joints = ",".join(f"q{j}_deg" for j in range(1, 7))
    path = tmp_path / "s.csv"
    path.write_text(
        f"id,{joints},x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg\n"
        "1,1,2,3,4,5,6,7,8,9,90,0,90\n2,1,2,3,4,5,6,7,8,9,0,90,0\n"
    )
    R = read_survey_file(path, NJ, TOOL[None]).rotation
    assert R is not None
    np.testing.assert_allclose(R[0] @ [1, 0, 0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(R[1] @ [1, 0, 0], [0, 0, -1], atol=1e-12)
