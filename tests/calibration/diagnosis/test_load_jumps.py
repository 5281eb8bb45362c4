"""A jump at a load is placed together with the weights of links that decide where."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.load_jumps import place_load_jump
from postproc.calibration.diagnosis.score import Score, rank_some
from postproc.model.carrier import every_carrier
from postproc.model.covariate import covariate
from postproc.model.effects.effect import Candidate
from postproc.model.effects.part_motion import PartMotion, family_of
from tests.calibration.planted import campaign

LINK = next(c for c in every_carrier() if str(c) == "link 4 turn x")


@pytest.fixture(scope="module")
def projection() -> Projection:
    """What a fit leaves of an arm whose link turns where a load changes its sign."""
    planted = campaign(211003, ("rotation:link4:x by torque 3 sign",), 3.0, rows=300)
    return Projection.of(planted.base_fit())


def score(projection: Projection, law: str, source: str) -> Score:
    x = covariate(projection.at, source)
    at, half = float(np.quantile(x, 0.3)), float(np.ptp(x)) / 2
    cell = PartMotion(str(LINK), source=source, law=law, middle=at, half=half)
    candidate = Candidate(family_of(LINK, source), cell, source, 0.0)
    return rank_some(projection, [candidate])[0]


def test_weights_of_links_move_a_jump_to_where_it_is(projection: Projection) -> None:
    before = score(projection, "step", "torque 3")
    after = place_load_jump(projection, before)
    assert after.best.effect.heavier  # type: ignore[attr-defined]
    assert after.evidence > before.evidence + 20.0
    assert after.best_evidence > before.best_evidence + 20.0
    nominal = replace(after.best.effect, heavier=())
    same = rank_some(projection, [replace(after.best, effect=nominal)])[0]
    assert same.best_evidence < after.best_evidence - 20.0


def test_other_laws_and_other_drivers_stay_as_they_are(projection: Projection) -> None:
    for law, source in (("linear", "torque 3"), ("step", "joint 3")):
        before = score(projection, law, source)
        assert place_load_jump(projection, before) is before


def test_weights_are_charged_where_rows_do_not_show_them(
    projection: Projection,
) -> None:
    """Of noise alone a jump gains nothing by moments that may be any."""
    rng = np.random.default_rng(5)
    gained = []
    for _ in range(20):
        noise = projection.filter(rng.standard_normal(len(projection.rest)))
        view = replace(projection, rest=noise, seen={})
        before = score(view, "step", "torque 3")
        gained.append(place_load_jump(view, before).evidence - before.evidence)
    assert np.mean(np.array(gained) > 3.0) <= 0.1
