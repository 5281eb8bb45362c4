"""Undeclared effects of virtual arms are found, and nothing is found where nothing is.

A small seeded selection of what `make undeclared` does at full size.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.investigate import trace
from postproc.calibration.diagnosis.search import extend, predicts_elsewhere, ranking
from postproc.calibration.regression import fit_effects
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.kinematics import ArmStates
from tests.calibration.planted import ARM, TRACKER, campaign, states_of, survey
from tests.slow import slow
from tests.undeclared_score import close, ok
from tests.undeclared_trial import moved, run, without_rigid

PLANTED = [("compliance", 300, 0.5)]
MORE_PLANTED = [
    ("joint_step", 313, 0.3),
    ("payload", 301, 0.5),
    ("transmission_free", 302, 0.5),
    ("coupling", 303, 1.0),
    ("load_backlash", 304, 1.0),
    ("warmup", 305, 1.0),
    ("windup", 306, 1.0),
    ("tool_shift", 307, 0.5),
    ("tracker_drift", 308, 1.0),
    ("worn_spot", 309, 1.0),
    ("base_tilt", 314, 0.3),
    ("elastic_flank", 315, 0.5),
    ("azimuth", 316, 0.3),
    ("refraction", 317, 0.3),
    ("joint_product", 310, 1.0),
    ("hysteresis", 311, 1.0),
    ("two", 312, 1.0),
]


@pytest.mark.parametrize(("kind", "seed", "size"), [*PLANTED, *slow(MORE_PLANTED)])
def test_an_undeclared_effect_is_named(kind: str, seed: int, size: float) -> None:
    trial = run(kind, seed, size)
    assert ok(trial), trial
    assert all(len(f["group"]) <= 2 for f in trial.found)  # type: ignore[arg-type]
    assert trial.true_mm[1] < trial.true_mm[0]
    assert close(trial) or trial.true_mm[1] < 0.02, trial.true_mm


@pytest.mark.parametrize("drift", [True, *slow([False])])
@pytest.mark.parametrize(
    ("kind", "seed"), [("thermal", 6001), *slow([("warmup", 6009)])]
)
def test_a_warm_arm_follows_its_temperature(kind: str, seed: int, drift: bool) -> None:
    """Time explains both a little better: it counts where the tracker stands still."""
    fit = campaign(seed, (kind,), 0.5).base_fit()
    without = () if drift else ("tracker_drift",)
    traced = trace(fit, seed=0, without=without)
    (found,) = traced.findings
    assert (found.effect, found.of_setup) == ("thermal", not drift)
    assert found.source == ("temperature" if drift else "time")
    left = traced.search.ranking_under(fit)
    assert left[0].best.source == found.source


@pytest.mark.slow
@pytest.mark.parametrize("first", ["compliance", "load_backlash"])
def test_of_names_alike_the_one_that_predicts_other_regions_is_taken(
    first: str,
) -> None:
    """Whichever the rows were given first, as if they hardly told them apart."""
    traced = trace(campaign(300, ("compliance",), 2.0).base_fit(), seed=0).search
    effects = [a.candidate.family.effect for a in traced.additions]
    number = effects.index("compliance")
    added, place = traced.additions[number], traced.place(number)
    scores = ranking(Projection.of(traced.fit, without=place), traced.causes)
    joint = added.candidate.family.joint
    told = [
        replace(s, evidence=added.score.evidence)
        for name in ("compliance", "load_backlash")
        for s in scores
        if (s.family.effect, s.family.joint) == (name, joint)
    ]
    present = next(s for s in told if s.family.effect == first)
    fit = extend(traced.fit, present.best, instead_of=place)
    found = replace(traced, fit=fit)
    best = predicts_elsewhere(found, place, present, told)
    assert best.family.effect == "compliance"


def test_nothing_is_asked_of_visits_before_where_all_are_missing() -> None:
    """Where every other row was lost nobody knows where joints came from."""
    c = campaign(313, ("joint_step",), 1.0)
    lost = c.states.with_(order=2.0 * c.states.order)
    base = propose(BASE_EFFECTS, ARM, lost)
    fit = fit_effects(ArmStates(ARM, lost), c.position, base, tuple(TRACKER))
    traced = trace(fit, seed=0)
    assert [f.effect for f in traced.findings] == ["joint_step"]
    tried = [x for s in traced.search.causes.library.shelves for x in s.candidates]
    assert not any("before" in x.source for x in tried)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "seed", "size"), [("tracker_drift", 308, 2.0), ("azimuth", 405, 1.0)]
)
def test_a_tracker_leaves_only_where_the_base_stands_unsure(
    kind: str, seed: int, size: float
) -> None:
    """A drift begins, and a circle points, anywhere: one rigid motion is not told."""
    trial = run(kind, seed, size)
    assert trial.registered_mm[1] < 1.2 * trial.registered_mm[2]
    assert trial.true_mm[1] < 0.05


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "seed", "size"), [("azimuth", 410, 1.0), ("refraction", 411, 0.5)]
)
def test_a_tracker_that_stands_anywhere_is_named_and_not_compensated(
    kind: str, seed: int, size: float
) -> None:
    c = campaign(seed, (kind,), size)
    batch = ArmStates(ARM, c.states)
    fit = fit_effects(batch, c.position, propose(BASE_EFFECTS, ARM, c.states), None)
    found = trace(fit, seed=0)
    assert [f.effect for f in found.findings] == [kind]
    assert all(f.of_setup for f in found.findings)
    if kind == "azimuth":
        (place,) = (f.settings["tracker"] for f in found.findings)
        assert np.hypot(*(np.array(place) - TRACKER)[:2]) < 1.0  # [m]
    fresh = survey(c.arm, seed + 10**6, 200)
    at = ArmStates(ARM, states_of(fresh))
    left = c.arm.error(fresh) - moved(found.search.fit, at, ("arm", "state"))
    mean = np.linalg.norm(without_rigid(at, left), axis=1).mean() * 1e3
    assert mean < 1.2 * run("none", seed, 0.0).registered_mm[2]


@pytest.mark.parametrize("seed", [320, *slow([321, 322, 323, 324])])
def test_nothing_is_found_where_nothing_is(seed: int) -> None:
    trial = run("none", seed, 0.0)
    assert trial.verdict == "noise", trial
    assert not trial.found
