"""Models: files, uncertainty, what is outside, what is never compensated."""

from __future__ import annotations

import errno
import json
import os
import pickle
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.regression import fit_effects
from postproc.exceptions import ModelError, OutputError
from postproc.model.effects import BASE_EFFECTS, BY_NAME, propose
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model, load_model, weight_of
from postproc.model.model_file import content_id
from postproc.model.provenance import Provenance
from postproc.robot.state import make_states
from tests.calibration.simulator import (
    NJ,
    PLATE,
    TOOL,
    covariates,
    random_arm,
    random_states,
    survey_of,
)


@cache
def model(points: int = 1, extra: tuple[str, ...] = (), seed: int = 0) -> Model:
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    states = covariates(random_states(300, rng, PLATE[:points]), rng)
    measured, _ = arm.measure(states, rng)
    survey = survey_of(states, measured)
    return model_of(fit_survey(survey, NJ, (*BASE_EFFECTS, *extra), None), survey)


def test_a_model_file_gives_back_the_model(tmp_path: Path) -> None:
    saved = model(3, ("compliance", "elm", "thermal", "probe"))
    saved.save(tmp_path / "m.json")
    loaded = load_model(tmp_path / "m.json")
    assert loaded.id == saved.id
    states = covariates(random_states(50, np.random.default_rng(1), PLATE),
                        np.random.default_rng(2))  # fmt: skip
    a, b = saved.predict(NJ, states), loaded.predict(NJ, states)
    np.testing.assert_array_equal(a.error, b.error)
    np.testing.assert_allclose(a.std_arrival, b.std_arrival, rtol=1e-9)


def test_free_forms_have_a_part_of_their_own() -> None:
    """What they predict alone, and its scatter over parameters as unsure as theirs."""
    saved = model(3, ("compliance", "elm", "joint_map"))
    assert saved.free_forms == ("elm", "joint_map")
    states = random_states(400, np.random.default_rng(3), PLATE)
    states = states[~saved.predict(NJ, states).any_outside][:40]
    part = saved.free_part(NJ, states)
    effects, values, covariance = saved.compensable()
    free = np.array([n.split(".")[0] in saved.free_forms for n in effects.names])
    batch = ArmStates(NJ, states)
    alone = effects.error(batch, np.where(free, values, 0.0))
    np.testing.assert_allclose(part.error, alone, rtol=0, atol=1e-12)
    at = effects.columns(effects.at(batch, values))[:, :, free]
    rng = np.random.default_rng(4)
    own = np.ix_(free, free)
    drawn = rng.multivariate_normal(np.zeros(free.sum()), covariance[own], 4000)
    np.testing.assert_allclose(part.std, (at @ drawn.T).std(axis=2), rtol=0.1)
    assert (part.std > 0).all()


def test_named_effects_leave_no_part_to_free_forms() -> None:
    states = random_states(10, np.random.default_rng(3))
    part = model().free_part(NJ, states)
    assert part.names == ()
    assert not part.error.any() and not part.std.any()


def test_a_model_file_of_an_older_release_keeps_its_id(tmp_path: Path) -> None:
    data = model().to_dict()
    del data["ranges"]["oriented"]  # a key that was added later
    data["id"] = content_id(data)
    path = tmp_path / "m.json"
    path.write_text(json.dumps(data))
    older = load_model(path)
    assert older.id == data["id"] != model().id
    assert pickle.loads(pickle.dumps(older)).id == older.id  # in every process
    assert replace(older, rows=7).id != older.id


HERE = Provenance("2026-11-27", "nj220-2.7", "A 17", "AT960", "postproc 0.2.0")


def test_equal_data_give_equal_ids_whatever_they_come_from(tmp_path: Path) -> None:
    path = tmp_path / "m.json"
    known = replace(model(), provenance=HERE)
    known.save(path)
    assert json.loads(path.read_bytes())["format"] == 2
    assert load_model(path).provenance == HERE
    assert load_model(path).id == known.id == model().id
    assert replace(known, rows=7).id != known.id
    text = str(HERE)
    assert "A 17" in text and "AT960" in text and "2026-11-27" in text


def test_a_file_of_format_1_is_read_with_its_own_id(tmp_path: Path) -> None:
    data = {**model().to_dict(), "format": 1}
    data["id"] = content_id(data)
    path = tmp_path / "m.json"
    path.write_text(json.dumps(data))
    old = load_model(path)
    assert old.id == data["id"] and old.provenance is None
    old.save(path)
    assert load_model(path).id == old.id  # the same model in format 2
    path.write_text(json.dumps({**data, "rows": 7}))
    with pytest.raises(ModelError, match="changed since it was made"):
        load_model(path)


def test_a_model_file_is_written_whole_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "m.json"
    path.write_text("what was there")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "no space")

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        with pytest.raises(OutputError, match=r"m\.json: the disk is full"):
            model().save(path)
    assert path.read_text() == "what was there"
    assert [p.name for p in tmp_path.iterdir()] == ["m.json"]
    model().save(path)
    assert load_model(path).id == model().id


def test_files_that_do_not_hold_together_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "m.json"
    model().save(path)
    good = json.loads(path.read_text())

    def refused(match: str) -> None:
        with pytest.raises(ModelError, match=match):
            load_model(path)

    path.write_text(json.dumps({**good, "rows": 7}))
    refused("changed since it was made")
    path.write_text(json.dumps({**good, "colour": "red"}))
    refused(r"\$\.colour")
    path.write_text('{"format": 1, "id": NaN')
    refused("not valid JSON")
    with pytest.raises(ModelError, match=r"nowhere\.json.*cannot be read"):
        load_model(tmp_path / "nowhere.json")
    with pytest.raises(ModelError, match="not for other"):
        model().check_arm(replace(NJ, name="other", id="0"), path)


def test_a_model_holds_for_the_mounting_that_it_was_fitted_in(tmp_path: Path) -> None:
    path, wall = tmp_path / "m.json", NJ.mount(np.array([1.0, 0.0, 0.0]))
    model().save(path)
    assert "weight" not in json.loads(path.read_text())  # a floor is no news
    with pytest.raises(
        ModelError, match=r"along \[0, 0, -1\] .* 90 deg from \[1, 0, 0\]"
    ):
        load_model(path).check_arm(wall)
    replace(model(), weight=weight_of(wall)).save(path)
    on_wall = load_model(path)
    assert on_wall.weight == (1.0, 0.0, 0.0)
    on_wall.check_arm(wall)
    on_wall.check_arm(NJ.mount(np.array([1.0, 0.0, 0.015])))  # less than 1 deg
    with pytest.raises(ModelError, match="mounting under"):
        on_wall.check_arm(NJ)


def test_an_unknown_side_is_the_middle_and_costs_the_backlash() -> None:
    m = model()
    q = random_states(20, np.random.default_rng(3)).q
    sides = {
        s: m.predict(NJ, make_states(q, np.full((20, 6), s), TOOL)) for s in (-1, 0, 1)
    }
    middle = (sides[-1].error + sides[1].error) / 2
    np.testing.assert_allclose(sides[0].error, middle, atol=2e-7)
    assert (sides[0].std_model > 3 * sides[1].std_model).all()
    # One unknown joint alone: its standard error is half the gap that it makes.
    one, other = np.ones((20, 6)), np.ones((20, 6))
    one[:, 1], other[:, 1] = 0.0, -1.0
    p = m.predict(NJ, make_states(q, one, TOOL))
    back = m.error(NJ, make_states(q, other, TOOL))
    gap = np.abs(sides[1].error - back) / 2
    known = m.predict(NJ, make_states(q, np.ones((20, 6)), TOOL)).std_model
    np.testing.assert_allclose(p.std_model, np.hypot(gap, known), atol=1e-6)


def test_repeatability_is_told_apart_from_the_model() -> None:
    states = random_states(50, np.random.default_rng(4), TOOL[None])
    p = model().predict(NJ, states)
    assert (p.std_arrival >= p.std_model).all()
    noise = model().noise
    J = ArmStates(NJ, states).jacobian
    extra = p.std_arrival**2 - p.std_model**2
    np.testing.assert_allclose(extra, noise.arrival_variance(J), rtol=0.05)


def test_what_was_not_surveyed_is_said() -> None:
    m = model()
    rng = np.random.default_rng(5)
    inside = random_states(40, rng, TOOL[None])
    assert not m.predict(NJ, inside).any_outside.any()
    longer = inside.with_(tool=inside.tool + np.array([0.0, 0.0, 0.1]))
    p = m.predict(NJ, longer)
    assert p.any_outside.all()
    assert "the tool was not surveyed" in p.why(0)[0]
    q = np.array(inside.q)
    q[3, 0] = 2.5
    p = m.predict(NJ, inside.with_(q=q))
    assert np.flatnonzero(p.any_outside).tolist() == [3]
    assert p.why(3)[0].startswith("axis 1 is outside the surveyed")
    turned = inside.with_(q=inside.q + 2 * np.pi * np.eye(6)[3])
    assert not m.predict(NJ, turned).any_outside.any()
    heavy = inside.with_(payload=np.full(40, 300.0))
    assert any("payload is outside" in why for why in m.predict(NJ, heavy).outside)
    assert not model(3).predict(NJ, longer).any_outside.any()


def test_a_tool_that_was_not_surveyed_costs_the_unseen_rotations() -> None:
    inside = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        arm = random_arm(rng)
        states = random_states(300, rng)
        measured, _ = arm.measure(states, rng)
        survey = survey_of(states, measured)
        m = model_of(fit_survey(survey, NJ, BASE_EFFECTS, None), survey)
        held = random_states(60, rng, TOOL[None] + np.array([0.0, 0.0, 0.1]))
        truth = arm.tcp(held.q, held.direction, held.tool)
        p = m.predict(NJ, held)
        gap = truth - ArmStates(NJ, held).walk.tcp - p.error
        inside.append(np.abs(gap) < 1.96 * p.std_model)
        assert np.median(p.std_model) > 2e-5  # far from the surveyed 5 um
    assert np.mean(inside) > 0.85  # 8 arms: their rotations are drawn once each


def test_three_points_transfer_to_another_tool() -> None:
    there, here = [], []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        arm = random_arm(rng)
        states = random_states(300, rng, PLATE)
        measured, _ = arm.measure(states, rng)
        survey = survey_of(states, measured)
        m = model_of(fit_survey(survey, NJ, BASE_EFFECTS, None), survey)
        for shift, out in ((0.0, here), (0.1, there)):
            held = random_states(200, rng, PLATE + np.array([0, 0, shift]))
            truth = arm.tcp(held.q, held.direction, held.tool)
            gap = truth - ArmStates(NJ, held).walk.tcp - m.error(NJ, held)
            out.append(np.linalg.norm(gap, axis=1).mean())
    assert np.mean(there) < 1.5 * np.mean(here)


def test_the_set_up_is_fitted_and_never_compensated() -> None:
    rng = np.random.default_rng(6)
    arm = random_arm(rng)
    states = covariates(random_states(300, rng), rng)
    measured, _ = arm.measure(states, rng)
    drifting = measured + np.linspace(0.0, 4e-4, 300)[:, None] * [1.0, 0.5, 0.0]
    slipped = drifting.copy()
    R = ArmStates(NJ, states).walk.flange
    slipped[:150] += 3e-4 * R[:150, :, 0]
    survey = survey_of(states, slipped)
    effects = propose((*BASE_EFFECTS, "tracker_drift"), NJ, states)
    slip = BY_NAME["tool_shift"](row=150.0)
    fit = fit_effects(ArmStates(NJ, states), slipped, (*effects, slip))
    m = model_of(fit, survey)
    kept, _, _ = m.compensable()
    assert {e.name for e in kept.effects} == set(BASE_EFFECTS)
    # The survey is explained with them ..
    left = slipped - ArmStates(NJ, states).walk.tcp - m.predict_measured(NJ, states)
    assert np.linalg.norm(left, axis=1).mean() < 8e-5
    # .. and the arm is compensated without them.
    held = random_states(200, rng)
    truth = arm.tcp(held.q, held.direction, held.tool) - ArmStates(NJ, held).walk.tcp
    assert np.linalg.norm(truth - m.error(NJ, held), axis=1).mean() < 4e-5


def test_a_state_effect_needs_its_state() -> None:
    rng = np.random.default_rng(7)
    m = model(1, ("payload",))
    assert m.needs == {"payload"}
    states = random_states(10, rng, TOOL[None])
    p = m.predict(NJ, states)
    assert p.any_outside.all() and "payload is not known" in p.why(0)[0]


def test_states_beyond_the_survey_are_unsure_when_both_sides_are_known() -> None:
    m = model()
    states = random_states(30, np.random.default_rng(8), TOOL[None])
    p = m.predict(NJ, states)
    np.testing.assert_array_equal(m.std_error(NJ, states), p.std_model)
    middle = np.median(p.std_model.max(axis=1))  # half of them beyond three times
    worst = middle / 3
    strict = replace(m, statistics={**m.statistics, "worst_std_mm": worst * 1e3})
    std = strict.predict_on_flanks(NJ, states).std
    found = strict.unsure(std)
    np.testing.assert_array_equal(std, p.std_model)
    np.testing.assert_array_equal(found, p.std_model.max(axis=1) > middle)
    assert 0 < found.sum() < 30
    direction = np.array(states.direction)
    direction[found, 2] = 0.5
    between = strict.predict_on_flanks(NJ, states.with_(direction=direction)).std
    assert np.isnan(between[found]).all() and not strict.unsure(between).any()
