"""What a search may add, when, and beside what: each rule by its definition."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.calibration.diagnosis import search
from postproc.calibration.diagnosis.candidates import Library, Projection
from postproc.calibration.diagnosis.held_out import RUN, Gain, compare_held_out, deal
from postproc.calibration.diagnosis.investigate import Investigation, no_progress
from postproc.calibration.diagnosis.score import Null, ResidualTest, Score
from postproc.calibration.diagnosis.search import NEAR, Search, choose, ranking, stand
from postproc.calibration.diagnosis.table import Causes
from postproc.calibration.regression import Fit, fit_effects
from postproc.model.effects.effect import FREE, NAMED, Candidate, Family
from postproc.model.effects.scale import Scale
from postproc.model.kinematics import ArmStates
from tests.calibration.planted import ARM, TRACKER, Campaign, campaign


def score(effect: str, joint: int | None, evidence: float, tier: int = NAMED) -> Score:
    family = Family(effect, joint, None, tier)
    made = Candidate(family, Scale((joint or 1,)), f"joint {joint or 1}", 0.0)
    return Score(family, evidence, made, evidence, 1e-9)


@pytest.fixture(scope="module")
def two() -> Campaign:
    return campaign(360, ("scale", "transmission_free"), 1.5, rows=200)


@pytest.fixture(scope="module")
def found(two: Campaign) -> Search:
    base = two.base_fit()
    causes = Causes(Library.of(base))
    null = causes.null(Projection.of(base), seed=0)
    return search.search(base, causes, null, no_progress)


def test_everything_is_refitted_after_each_addition(
    two: Campaign, found: Search
) -> None:
    names = [a.candidate.family.effect for a in found.additions]
    assert sorted(names) == ["scale", "transmission"]
    batch = ArmStates(ARM, two.states)
    effects = found.fit.combination.effects
    anew = fit_effects(batch, two.position, effects, tuple(TRACKER))
    assert np.abs(found.fit.residual - anew.residual).max() < 1e-6
    first = len(found.base.values)
    assert np.abs(found.fit.values[:first] - found.base.values).max() > 1e-6


def test_every_addition_gains_more_than_its_standard_error(found: Search) -> None:
    for number, addition in enumerate(found.additions):
        gain = compare_held_out(found.fit, found.place(number), addition.candidate)
        assert gain.mean > gain.std_error
        assert addition.gain.mean == pytest.approx(gain.mean, rel=0.2)


def test_nothing_is_added_whose_gain_is_within_its_standard_error(
    found: Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(search, "compare_held_out", lambda *_: Gain(0.1, 0.11))
    nothing = search.search(found.base, found.causes, found.null, no_progress)
    assert nothing.additions == ()
    assert nothing.fit is found.base
    assert nothing.refused is not None
    assert nothing.refused.score.evidence > found.null.threshold(0.01)


def test_an_addition_that_stops_predicting_is_taken_out(
    found: Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(search, "compare_held_out", lambda *_: Gain(0.1, 0.11))
    fewer = search._confirm_addition(found, 0)
    assert fewer.additions == found.additions[1:]
    assert len(fewer.fit.values) < len(found.fit.values)


def parametric_draw(fit: Fit, seed: int) -> Fit:
    """Refit the model to rows drawn from the model itself."""
    rng = np.random.default_rng(seed)
    std = np.sqrt(fit.whitener.variance(fit.noise))
    turned = rng.standard_normal(std.shape) * std
    noise = np.einsum("nij,ni->nj", fit.whitener.turn, turned)
    position = fit.batch.walk.tcp + fit.error - fit.residual + noise
    return fit_effects(fit.batch, position, fit.combination.effects, tuple(TRACKER))


def test_one_threshold_holds_for_the_whole_library_with_grids_and_steps() -> None:
    """Draw rows from the model, refit them, rank with refined grids: level kept."""
    base = campaign(361, (), 0.0, rows=120).base_fit()
    library = Library.of(base)
    kinds = {c.family.effect for s in library.shelves for c in s.candidates}
    assert {"tool_shift", "base_shift", "transmission", "thermal", "curve"} <= kinds
    causes = Causes(library)
    null = causes.null(Projection.of(base), seed=0)
    limit, draws = null.threshold(0.1), 30
    above = 0
    for seed in range(draws):
        drawn = parametric_draw(base, seed)
        above += ranking(Projection.of(drawn), causes)[0].evidence > limit
    assert above <= 8  # Binomial(30, 0.1): 8 or fewer in 99.8 % of all runs


def test_folds_are_runs_along_what_drives_the_candidate(found: Search) -> None:
    batch = found.base.batch
    for source, wanted in (
        ("joint 4", batch.states.q[:, 3]),
        ("order", batch.states.order),
        ("time", batch.states.order),
        ("temperature", batch.states.order),
        ("speed", batch.states.speed),
    ):
        made = replace(score("scale", 4, 1.0).best, source=source)
        driver = made.driver(batch)
        assert np.array_equal(driver, wanted)
        fold = deal(driver, 10, seed=0)[np.argsort(driver, kind="stable")]
        runs = fold[: len(fold) // RUN * RUN].reshape(-1, RUN)
        assert (runs == runs[:, :1]).all()


def test_groups_hold_what_is_within_three_nats_and_never_more_than_three(
    found: Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = found.additions[0].score.family
    here = replace(found.additions[0].score, evidence=50.0)
    near, far = 50.0 - 0.9 * NEAR, 50.0 - 1.1 * NEAR
    ranked = [
        score("curve", 1, 51.0, FREE), here, score("curve", 1, 49.5, FREE),
        score(own.effect, own.joint, 48.5), score("payload", 5, near),
        score("thermal", None, near), score("compliance", 2, far),
    ]  # fmt: skip
    monkeypatch.setattr(search, "ranking", lambda *_: ranked)
    rivals = stand(found, 0).confusable
    assert [s.family.effect for s in rivals] == ["curve", "payload"]
    monkeypatch.setattr(search, "ranking", lambda *_: [here, *ranked[-1:]])
    assert stand(found, 0).confusable == ()


def test_a_free_form_must_be_clearly_ahead_of_the_best_name() -> None:
    name = score("transmission", 1, 100.0)
    for evidence, taken in ((109.0, "transmission"), (111.0, "curve")):
        free = score("curve", 1, evidence, FREE)
        ranked = sorted([name, free], key=lambda s: -s.evidence)
        assert choose(ranked).family.effect == taken
    small = [score("curve", 1, 17.0, FREE), score("scale", 1, 10.0)]
    assert choose(small).family.effect == "scale"


def test_two_names_stand_for_the_free_form_that_one_cannot_reach(
    found: Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    null = Null(np.linspace(0.0, 5.0, 100))
    free = score("curve", 3, 100.0, FREE)
    first, second = score("compliance", 3, 70.0), score("coupling", 3, 25.0)
    elsewhere = score("scale", 1, 80.0)
    start = [free, elsewhere, first, second]
    monkeypatch.setattr(search, "extend", lambda fit, _: fit)

    def after(*left: float) -> Score | None:
        rankings = iter(
            [replace(free, evidence=e), elsewhere, replace(second, evidence=25.0)]
            for e in left
        )
        monkeypatch.setattr(search, "ranking", lambda *_: next(rankings))
        return search.names_instead(found.base, found.causes, null, 0.01, start)

    assert after(28.0, 3.0) is first
    assert after(60.0, 55.0, 50.0) is None


def test_both_questions_together_are_wrong_in_1_of_100(found: Search) -> None:
    nothing = replace(found, additions=())
    for p_value, verdict in ((0.0075, "noise"), (0.0025, "unexplained")):
        left = (ResidualTest("rows err alike", 3.0, p_value),)
        assert Investigation(nothing, (), left).verdict == verdict
    null = Null(np.sort(np.random.default_rng(0).exponential(1.0, 10**5)))
    wrong = np.exp(-null.threshold(search.LEVEL)) + 0.005
    assert wrong == pytest.approx(0.01, abs=1e-3)
