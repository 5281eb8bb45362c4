"""A whole diagnosis: its report, its model, its held-out rows, few points."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from unittest.mock import MagicMock as Mock

import numpy as np
import pytest

from postproc.calibration.diagnosis import diagnose
from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.diagnose import (
    KEPT,
    Extension,
    dump_json,
    evidence_of,
    extend_model,
)
from postproc.calibration.diagnosis.held_out import (
    multi_directional,
    noise_floor,
    repeats,
    sides,
)
from postproc.calibration.diagnosis.next_poses import poses_that_sharpen
from postproc.calibration.diagnosis.result import periodogram, profile
from postproc.calibration.diagnosis.score import leftovers
from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.measurements import Measurements
from postproc.exceptions import ModelError, PostprocError
from postproc.model.covariate import covariate, loops, unit
from postproc.model.effects import BASE_EFFECTS
from postproc.model.effects.curve import Curve
from postproc.model.effects.probe import Probe
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model, load_model
from postproc.model.whitening import Whitener
from postproc.report.diagnosis import tell
from postproc.report.html import diagnosis_report
from postproc.report.plots import plot_diagnosis
from postproc.robot.arm import load_arm
from postproc.robot.state import make_states
from postproc.simulation import Planted, stream, virtual_arm
from tests.calibration.planted import (
    ARM,
    BASE,
    TRACKER,
    base_model,
    campaign,
    few_parts,
    measurements,
    states_of,
    survey,
)
from tests.calibration.simulator import NJ
from tests.calibration.test_direction_labels import flipped


@pytest.fixture(scope="module")
def planted() -> tuple[Measurements, Model]:
    c = campaign(330, ("transmission_free",), 1.5)
    rows = measurements(c.states, c.position, "planted")
    return rows, base_model(rows)


@pytest.fixture(scope="module")
def found(planted: tuple[Measurements, Model]) -> Extension:
    return extended(*planted)


def extended(rows: Measurements, model: Model) -> Extension:
    """Diagnose with fewer held-out parts, which takes half the time."""
    with few_parts():
        return extend_model(rows, ARM, model, tracker=TRACKER)


def test_report_has_the_keys_that_other_tools_read(found: Extension) -> None:
    report = json.loads(dump_json(evidence_of(found)))
    assert report["verdict"] == "effect"
    statistics = {"mean_mm", "std_mm", "p95_mm", "max_mm"}
    assert set(report["before"]) == set(report["after"]) == statistics
    assert report["vap_mm"] is None
    assert report["n_fit"] == 200
    assert report["n_held_out"] == 400
    (effect,) = report["effects"]
    assert effect["effect"] == "transmission"
    assert effect["kept"] is True
    assert 0 < effect["share"] < 1
    assert effect["p_value"] < 1e-6
    assert effect["joint"] in range(1, 7)
    assert effect["source"] == f"joint {effect['joint']}"
    assert all(len(v) == 3 for v in effect["parameters"].values())
    assert all(set(g) == {"effect", "joint"} for g in effect["confusable_with"])
    assert all(len(q) == 6 for q in report["next_measurements"])
    assert report["noise_floor_source"].startswith("tracker")


def test_report_holds_the_evidence_that_its_page_shows(found: Extension) -> None:
    report = json.loads(dump_json(evidence_of(found)))
    (effect,) = report["effects"]
    seen = effect["evidence"]
    assert seen["covariate"] == effect["source"]
    assert seen["unit"] == "deg"
    assert len(seen["x"]) == len(seen["before_mm"]) == len(seen["after_mm"]) == 400
    before, after = np.array(seen["before_mm"]), np.array(seen["after_mm"])
    assert np.hypot.reduce(before) > 1.2 * np.hypot.reduce(after)
    best = report["candidates"][0]
    assert (best["effect"], best["joint"]) == ("transmission", effect["joint"])
    p = [c["p_value"] for c in report["candidates"]]
    assert p == sorted(p)
    size = np.linalg.norm(report["rows"]["after_mm"], axis=1)
    assert size.mean() == pytest.approx(report["after"]["mean_mm"], abs=1e-4)
    assert report["history"][-1]["added"][0]["effect"] == "transmission"
    page = diagnosis_report(report)
    for shown in ("evidence-0", "candidates", "histogram"):
        assert f'"{shown}"' in page


def test_measuring_next_names_what_it_sharpens(found: Extension) -> None:
    fit = found.search.fit
    name, poses = poses_that_sharpen(fit, seed=0)
    assert name in fit.combination.names
    assert name in found.diagnosis.why_next
    assert np.array_equal(poses, found.diagnosis.next_measurements)


def test_held_out_errors_fall_to_the_noise(found: Extension) -> None:
    d = found.diagnosis
    assert d.after.mean_mm < 0.8 * d.before.mean_mm
    assert d.after.mean_mm < 1.1 * d.noise_floor_mm
    assert len(np.unique(found.held_out.rows)) == len(found.held_out.rows)


def test_extended_model_is_a_link_of_a_chain(
    planted: tuple[Measurements, Model], found: Extension, tmp_path: Path
) -> None:
    rows, model = planted
    assert found.model.parent == model.id
    found.model.save(tmp_path / "better.json")
    again = load_model(tmp_path / "better.json")
    (record,) = again.history
    assert record["parent"] == model.id
    assert record["data_sha256"] == rows.sha256
    assert record["added"][0]["effect"] == "transmission"
    assert record["after"]["mean_mm"] < record["before"]["mean_mm"]
    twice = extended(rows, again)
    assert twice.diagnosis.verdict == "noise"
    assert [r["verdict"] for r in twice.model.history] == ["effect", "noise"]


def test_next_measurements_stay_where_the_survey_was(
    planted: tuple[Measurements, Model], found: Extension
) -> None:
    q = found.diagnosis.next_measurements
    seen = planted[0].states.q
    assert (q >= seen.min(axis=0)).all()
    assert (q <= seen.max(axis=0)).all()
    assert len(np.unique(q.round(6), axis=0)) == len(q)


@pytest.mark.slow
def test_same_rows_same_answer(
    planted: tuple[Measurements, Model], found: Extension
) -> None:
    rows, model = planted
    assert extended(rows, model).model.id == found.model.id


def test_profile_and_periodogram_show_the_wave(found: Extension) -> None:
    search = found.search
    candidate = search.additions[0].candidate
    shown = profile(search.fit, search.place(0), candidate)
    assert shown.before.std() > 1.2 * shown.after.std()
    order = found.diagnosis.findings[0].parameters["order"][0]
    joint = candidate.family.joint
    assert joint is not None
    spectrum = periodogram(Projection.of(search.base), joint)
    assert abs(spectrum.orders[spectrum.power.argmax()] - order) < 0.7
    after = periodogram(Projection.of(search.fit), joint)
    assert after.power.max() < 0.2 * spectrum.power.max()


def test_other_methods_and_other_arms_are_refused(
    planted: tuple[Measurements, Model],
) -> None:
    rows, model = planted
    with pytest.raises(PostprocError, match="--method full"):
        extend_model(rows, ARM, replace(model, method="elm"))
    with pytest.raises(ModelError, match="was made for arm"):
        extend_model(rows, load_arm("ur10"), model)
    with pytest.raises(PostprocError, match="needs at least"):
        extend_model(rows[np.arange(5)], ARM, model)


@pytest.mark.slow
def test_few_points_revise_a_model_and_find_what_changed() -> None:
    seed = 333
    clean = virtual_arm(seed, BASE)
    old = survey(clean, seed, 250)
    rows = measurements(
        states_of(old), clean.measure(old, TRACKER, stream(seed, "old")), "old"
    )
    model = base_model(rows)
    changed = virtual_arm(
        seed, (*map(Planted, BASE), Planted("compliance", 2, peak_mm=0.5))
    )
    points = survey(changed, seed + 1, 40)
    fresh = measurements(
        states_of(points), changed.measure(points, TRACKER, stream(seed, "new")), "new"
    )
    found = extend_model(fresh, ARM, model, tracker=TRACKER)
    named = {(f.effect, f.joint) for f in found.diagnosis.findings}
    named |= {g for f in found.diagnosis.findings for g in f.confusable_with}
    assert ("compliance", 2) in named
    assert not any(e.name == "revision" for e in found.model.effects.effects)
    later = survey(changed, seed + 2, 100)
    truth = changed.error(later)
    errors = [
        np.linalg.norm(truth - m.error(ARM, states_of(later)), axis=1).mean()
        for m in (model, found.model)
    ]
    assert errors[1] < 0.4 * errors[0]


@pytest.mark.slow
def test_a_given_model_of_other_data_is_judged_as_it_is() -> None:
    seed = 334
    arm = virtual_arm(seed, BASE)
    old, new = survey(arm, seed, 250), survey(arm, seed + 1, 250)
    first, second = (
        measurements(states_of(a), arm.measure(a, TRACKER, stream(seed, name)), name)
        for a, name in ((old, "first"), (new, "second"))
    )
    model = base_model(first)
    found = extend_model(second, ARM, model, tracker=TRACKER)
    assert found.diagnosis.verdict == "noise"
    error = second.position - ArmStates(ARM, second.states).walk.tcp
    left = error - model.error(ARM, second.states)
    wanted = np.linalg.norm(left, axis=1).mean() * 1e3
    assert found.diagnosis.before.mean_mm == pytest.approx(wanted, rel=0.02)


@pytest.mark.parametrize("seed", [341, pytest.param(342, marks=pytest.mark.slow)])
def test_a_nest_that_is_new_leaves_an_unchanged_model_as_it_was(seed: int) -> None:
    arm = virtual_arm(seed, BASE)
    old, new = survey(arm, seed, 250), survey(arm, seed + 1, 60)
    first, fresh = (
        measurements(states_of(a), arm.measure(a, TRACKER, stream(seed, name)), name)
        for a, name in ((old, "first"), (new, "second"))
    )
    model, second = base_model(first), np.arange(60) % 2
    tool = fresh.states.tool + 2e-4 * second[:, None]  # stated 0.2 mm off per axis
    states = fresh.states.with_(tool=tool, tool_id=fresh.states.tool_id + second)
    with few_parts():
        found = extend_model(
            fresh.with_states(states), ARM, model, tracker=TRACKER, setup=(Probe.name,)
        )
    assert found.diagnosis.verdict == "noise" and KEPT in found.diagnosis.notes
    assert np.array_equal(found.model.values, model.values)
    expected = found.diagnosis.expected
    assert expected is not None and expected.covered > 0.9
    assert expected.error.mean_mm < found.diagnosis.before.mean_mm


def repeated(sides_of: np.ndarray) -> ArmStates:
    """Ten poses, each visited four times from the given sides."""
    rng = np.random.default_rng(0)
    q = np.repeat(rng.uniform(-1, 1, (10, 6)), 4, axis=0)
    return ArmStates(ARM, make_states(q, sides_of, np.array([0.1, 0.0, 0.2])))


def test_noise_floor_comes_from_repeats_where_there_are_any(found: Extension) -> None:
    batch = repeated(np.ones((40, 6)))
    assert sorted(len(r) for r in repeats(batch)) == [4] * 10
    rng = np.random.default_rng(1)
    sigma = 3e-5
    error = np.repeat(rng.normal(0, 1e-3, (10, 3)), 4, axis=0)
    error = error + rng.normal(0, sigma, (40, 3))
    fit = replace(found.search.fit, batch=batch, error=error)
    floor = noise_floor(fit, tracker_known=True)
    assert "30 repeats" in floor.source
    assert floor.size == pytest.approx(1.6 * sigma, rel=0.2)
    assert "estimated" in noise_floor(found.search.fit, tracker_known=False).source


def test_rows_in_motion_make_no_noise_of_what_they_do_not_tell(
    found: Extension,
) -> None:
    """Nothing is read along the motion; the floor was 900 mm where that counted."""
    fit, rng = found.search.fit, np.random.default_rng(2)
    heading = rng.normal(size=(len(fit.batch), 3))
    heading /= np.linalg.norm(heading, axis=1)[:, None]
    heading[::5] = np.nan
    batch = ArmStates(ARM, fit.batch.states.with_(heading=heading))
    whitener = Whitener.build(batch, fit.position, fit.noise.origin)
    moving = replace(fit, batch=batch, whitener=whitener)
    floor, usual = (noise_floor(one, tracker_known=False) for one in (moving, fit))
    assert floor.source == usual.source == "estimated from the rows"
    assert floor.size == pytest.approx(usual.size, rel=0.3)


@pytest.mark.parametrize("nats", [0.01, 1.0])
def test_poses_that_tell_nothing_apart_are_not_proposed(
    nats: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    poses = np.zeros((2, 6))
    monkeypatch.setattr(diagnose, "poses_that_separate", lambda *_: (nats, poses))
    monkeypatch.setattr(diagnose, "poses_that_sharpen", lambda *_: ("a_2", poses + 1))
    why, proposed = diagnose._next(Mock(standings=[Mock(confusable=[Mock()])]), 0)
    assert ("rounds of these poses" in why) == (nats > diagnose.TELLING)
    assert (proposed == 0.0).all() == (nats > diagnose.TELLING)


def test_multi_directional_variation_is_the_distance_between_the_sides() -> None:
    side = np.tile(np.repeat([[1.0], [-1.0]], 2, axis=0), (10, 6))
    batch = repeated(side)
    assert all(len(pose) == 2 for pose in sides(batch))
    gap = np.array([3e-5, 4e-5, 0.0])
    assert multi_directional(batch, side[:, :1] * gap) == pytest.approx(1e-4)
    assert multi_directional(repeated(np.ones((40, 6))), side[:, :3]) is None


def test_leftovers_see_maps_and_serial_correlation(found: Extension) -> None:
    projection = Projection.of(found.search.fit)
    assert min(x.p_value for x in leftovers(projection, seed=0)) > 1e-3
    rng = np.random.default_rng(2)
    slow = np.repeat(rng.normal(0, 1.0, (40, 3)), 10, axis=0)
    turned = projection.fit.whitener.rotate(slow).reshape(-1)
    drifting = replace(projection, rest=projection.rest + turned)
    first = leftovers(drifting, seed=0)[0]
    assert first.p_value < 1e-6
    assert "follow" in first.what


def test_loops_are_the_ways_that_the_gears_went() -> None:
    arrivals = survey(virtual_arm(335, BASE), 335, 120)
    batch = ArmStates(ARM, states_of(arrivals))
    for joint in range(6):
        known = ~np.isnan(loops(batch, joint))
        assert known.sum() > 110
        assert loops(batch, joint)[known] == pytest.approx(arrivals.loop[known, joint])
    with pytest.raises(ValueError, match="no covariate"):
        covariate(batch, "mood 3")
    assert unit("torque 2") == "N m"


def test_whole_curves_have_functions_of_each_covariate_alone() -> None:
    pair = ("joint 1", "joint 2")
    both = Curve("joint 3", pair, (-1.0, -1.0), (1.0, 1.0))
    whole = replace(both, whole=True)
    names = [p.name.split()[-1] for p in both.parameters()]
    assert "1.1" in names
    assert "0.1" not in names
    assert "0.1" in [p.name.split()[-1] for p in whole.parameters()]


@pytest.mark.slow
def test_what_has_no_name_is_told_by_where_it_lives(tmp_path: Path) -> None:
    c = campaign(341, ("joint_product",), 1.5, rows=200)
    rows = measurements(c.states, c.position, "nameless")
    found = extend_model(rows, ARM, base_model(rows), tracker=TRACKER)
    assert found.diagnosis.verdict == "unexplained"
    (curve,) = found.diagnosis.findings
    law = c.arm.laws[-1]
    pair = sorted(int(law.parameters[k]) for k in ("first", "second"))
    assert (curve.effect, curve.joint) == ("curve", 3)
    assert curve.source == f"joint {pair[0]} x joint {pair[1]}"
    told = tell(found.diagnosis)
    assert f"no effect with a name follows {curve.source} at joint 3" in told
    assert "still there" not in told
    names = [p.name for p in plot_diagnosis(found, tmp_path / "n.svg")]
    assert "n-finding1.svg" in names


@pytest.mark.slow
def test_wrong_directions_are_listed_and_held_out_rows_keep_theirs() -> None:
    clean, _ = flipped(2, 0.0)
    model = model_of(fit_survey(clean, NJ, BASE_EFFECTS, None), clean)
    rows, wrong = flipped(2, 0.05)
    found = extend_model(rows, NJ, model)
    listed = found.diagnosis.directions
    assert listed is not None and listed.turned > 20
    for likely in listed.likeliest[:20]:
        assert wrong[rows.ids.index(likely.id), likely.joint - 1]
    held, off = found.held_out, np.linalg.norm(found.held_out.after, axis=1)
    turned = found.search.fit.batch.states.direction == -rows.states.direction
    out = turned.any(axis=1)[held.rows]
    assert out.sum() > 20
    assert np.median(off[out]) > 4.0 * np.median(off[~out])
    assert "likeliest wrong: row " in tell(found.diagnosis)
    report = json.loads(dump_json(evidence_of(found)))
    assert report["directions"]["turned"] == listed.turned


def test_right_directions_are_not_asked_about(found: Extension) -> None:
    assert found.diagnosis.directions is None
    assert "likeliest wrong" not in tell(found.diagnosis)
