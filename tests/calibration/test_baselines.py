"""The source's methods, by their definitions."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.arrays import Floats
from postproc.calibration.baselines import (
    ORDER,
    TRAINERS,
    Trained,
    compare,
    fit_method,
    random_split,
    span_of,
    too_wide,
)
from postproc.calibration.fit import fit_measurements
from postproc.calibration.measurements import Measurements
from postproc.model.effects.elm import HiddenLayer
from postproc.model.kinematics import ArmStates
from postproc.model.model import load_model
from postproc.robot.cell import load_cell
from postproc.robot.state import make_states
from tests.calibration.simulator import NJ, random_arm, random_states, survey_of

ROOT = Path(__file__).parents[2]


def survey(n: int = 120, seed: int = 0) -> tuple:  # type: ignore[type-arg]
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    states = random_states(n, rng)
    measured, _ = arm.measure(states, rng)
    return arm, states, survey_of(states, measured)


def test_output_weights_are_the_pseudo_inverse() -> None:
    _, states, rows = survey()
    model = fit_method("eja-elm", rows, NJ, seed=3)
    layer = model.effects.effects[0].layer  # type: ignore[attr-defined]
    assert len(layer) == 40 and len(layer.weights[0]) == 12
    x = np.hstack(
        [2 * (states.q - layer.lower) / np.subtract(layer.upper, layer.lower) - 1,
         states.direction]
    )  # fmt: skip
    H = 1 / (1 + np.exp(-(x @ np.array(layer.weights).T + layer.bias)))
    T = NJ.flange(states.q)
    tcp = T[:, :3, 3] + np.einsum("nij,nj->ni", T[:, :3, :3], states.tool)
    beta = np.linalg.pinv(H) @ (rows.position - tcp)
    np.testing.assert_allclose(model.error(NJ, states), H @ beta, atol=1e-9)


def test_without_directions_both_sides_are_alike() -> None:
    _, states, rows = survey()
    other = states.with_(direction=-states.direction)
    for method, alike in (("elm", True), ("eja-elm", False), ("kriging", False)):
        model = fit_method(method, rows, NJ, seed=0)  # type: ignore[arg-type]
        same = np.allclose(model.error(NJ, states), model.error(NJ, other), atol=1e-12)
        assert same is alike, method


def test_interpolation_and_kriging_go_through_the_points() -> None:
    _, states, rows = survey()
    T = NJ.flange(states.q)
    tcp = T[:, :3, 3] + np.einsum("nij,nj->ni", T[:, :3, :3], states.tool)
    error = rows.position - tcp
    found = fit_method("interpolation", rows, NJ, 0).error(NJ, states)
    np.testing.assert_allclose(found, error, atol=1e-6)
    found = fit_method("kriging", rows, NJ, 0).error(NJ, states)
    assert np.linalg.norm(found - error, axis=1).mean() < 0.2e-3


@pytest.mark.parametrize("method", TRAINERS)
def test_every_method_makes_a_model_file(method: str, tmp_path: Path) -> None:
    arm, _, rows = survey()
    model = fit_method(method, rows, NJ, 0)  # type: ignore[arg-type]
    model.save(tmp_path / "m.json")
    again = load_model(tmp_path / "m.json")
    held = random_states(40, np.random.default_rng(9))
    p = again.predict(NJ, held)
    np.testing.assert_array_equal(p.error, model.predict(NJ, held).error)
    assert again.method == method
    # Cross-validation says how wrong it is, within a factor of two.
    truth, _ = arm.measure(held, np.random.default_rng(1))
    T = NJ.flange(held.q)
    tcp = T[:, :3, 3] + np.einsum("nij,nj->ni", T[:, :3, :3], held.tool)
    real = np.sqrt(((truth - tcp - p.error) ** 2).mean())
    assert 0.5 < p.std_model.mean() / real < 2.0


def test_the_comparison_has_the_five_rows_and_ours() -> None:
    _, _, rows = survey(150)
    found = compare(rows, NJ, seed=1)
    assert [r.method for r in found.rows] == ["no compensation", *ORDER]
    assert all(r.n == 50 for r in found.rows)
    mean = {r.method: r.mean_mm for r in found.rows}
    assert mean["full"] < 0.5 * min(v for k, v in mean.items() if k != "full")
    assert "100 rows to fit, 50 to test" in found.split
    train, test = random_split(np.arange(9), 0)
    assert sorted([*train, *test]) == list(range(9)) and len(train) == 6


def test_a_comparison_tests_poses_that_no_method_has_seen() -> None:
    """A map that has read a pose predicts its next reading, and no other pose."""
    _, _, once = survey(60)
    rng = np.random.default_rng(3)
    thrice = once[np.repeat(np.arange(60), 3)]
    read = thrice.position + 1e-5 * rng.standard_normal(thrice.position.shape)
    found = compare(replace(thrice, position=read), NJ, seed=1)
    assert "40 rows to fit, 20 to test" in found.split
    usual = {r.method: r.min_mm for r in compare(once, NJ, seed=1).rows}
    least = {r.method: r.min_mm for r in found.rows}
    assert least["interpolation"] > 0.5 * usual["interpolation"]
    train, test = random_split(np.tile(np.arange(60), 3), 0)
    assert not set(train % 60) & set(test % 60) and len(train) + len(test) == 180


def test_cross_validation_holds_out_whole_poses() -> None:
    """Two rounds of the same poses: the other round of a pose is no other pose."""
    _, _, once = survey(60)
    twice = once[np.tile(np.arange(60), 2)]
    alone, both = (fit_method("kriging", r, NJ, 0).spread for r in (once, twice))
    assert np.linalg.norm(both) > 0.7 * np.linalg.norm(alone)


def test_a_layer_ignores_joints_that_never_moved() -> None:
    q = np.zeros((5, 6))
    q[:, 0] = np.linspace(0, 1, 5)
    layer = HiddenLayer.draw(make_states(q), 7, 0, directions=False)
    other = q.copy()
    other[:, 3] = 1.0
    np.testing.assert_array_equal(layer(make_states(q)), layer(make_states(other)))
    assert layer(make_states(q)).shape == (5, 7)
    with pytest.raises(ValueError, match="activation"):
        HiddenLayer(weights=(), bias=(), activation="step")


def test_a_comparison_does_not_cross_validate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its rows are errors on test rows, of one fit of every method."""
    calls: list[int] = []
    plain = TRAINERS["interpolation"]

    def counted(batch: ArmStates, error: Floats, seed: int) -> Trained:
        calls.append(len(batch))
        return plain(batch, error, seed)

    monkeypatch.setitem(TRAINERS, "interpolation", counted)
    compare(survey(60)[2], NJ, seed=1)
    assert calls == [40]


def within(half_deg: float, n: int = 300) -> Measurements:
    """Measure an arm in a working volume of its joints."""
    rng = np.random.default_rng(4)
    arm = random_arm(rng)
    states = random_states(n, rng)
    middle = np.deg2rad([20.0, 10.0, -100.0, 40.0, 50.0, -60.0])
    unit = (states.q - states.q.min(axis=0)) / np.ptp(states.q, axis=0)
    states = states.with_(q=middle + np.deg2rad(half_deg) * (2 * unit - 1))
    measured, _ = arm.measure(states, rng)
    return survey_of(states, measured)


@pytest.mark.parametrize("method", ["eja-elm", "elm"])
def test_a_fit_says_when_the_rows_span_more_than_a_method_follows(method: str) -> None:
    """Where it leaves more of unseen rows than the geometry alone of its own."""
    small, large = within(5.0), within(90.0)
    assert span_of(large.states) == pytest.approx([180.0] * 6)
    for rows, told in ((small, False), (large, True)):
        model = fit_method(method, rows, NJ, 0)  # type: ignore[arg-type]
        said = too_wide(model, rows, NJ)
        assert bool(said) is told, said
    assert re.fullmatch(
        rf"the rows span up to 180 deg \(joint \d\), more than {method} follows: ten "
        r"folds of cross-validation leave \d\.\d+ mm, geometry alone \d\.\d+ mm\. Fit "
        r"rows of one working volume \(about 40 deg\), or use --method full",
        said[0],
    )


def test_a_fit_of_a_method_tells_of_its_span() -> None:
    cell = load_cell(ROOT / "programs" / "cell.toml")
    found = fit_measurements(within(90.0), cell, method="eja-elm")
    assert any("more than eja-elm follows" in w for w in found.report.warnings)
    found = fit_measurements(within(5.0), cell, method="eja-elm")
    assert not any("follows" in w for w in found.report.warnings)


def test_a_comparison_tells_the_span_of_its_rows() -> None:
    found = compare(within(20.0, 60), NJ, seed=1)
    assert found.span_deg == pytest.approx((40.0,) * 6)
