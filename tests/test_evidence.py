"""The claims of tests/evidence.py, at a size that every test run can afford."""

from __future__ import annotations

import re

import pytest

from tests import evidence


def test_stated_intervals_hold(monkeypatch):
    # 6 arms and 3,600 coordinates: arms differ by some 3 %, so 1.2 % of their mean.
    monkeypatch.setattr(evidence, "ARMS", range(2001, 2007))
    share = float(re.search(r"([\d.]+)%", evidence.coverage()).group(1))
    assert 90.0 < share < 99.0


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    return evidence._surveyed(tmp_path_factory.mktemp("survey"), 42)


def test_direction_matters_on_the_drilling_job(survey):
    ours, blind = (
        evidence._drilled(survey, 42, {"effects": effects})
        for effects in (evidence.BASE_EFFECTS, ("geometry",))
    )
    assert blind.mean() >= 3 * ours.mean()
    assert ours.mean() <= 0.03 and ours.max() <= 0.1


def test_solving_leaves_1_um_and_digits_add_2(survey):
    cell = evidence.load_cell(evidence.CELL)
    model = evidence.fit(survey, cell=cell, effects=evidence.BASE_EFFECTS).model
    left, added = evidence.solved_and_written(cell, model)
    assert len(left) > 600
    assert left.max() <= 1.0 and added.max() <= 2.0
