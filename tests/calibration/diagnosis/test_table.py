"""The table of causes: scored as its candidates are, and told by place and law."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.diagnosis.candidates import Library, Projection
from postproc.calibration.diagnosis.investigate import Investigation, no_progress, trace
from postproc.calibration.diagnosis.score import Null, rank_some
from postproc.calibration.diagnosis.search import Search, ranking, search
from postproc.calibration.diagnosis.table import Causes, Table
from postproc.calibration.regression import Fit
from postproc.model.carrier import carrier
from postproc.model.effects.effect import PART_MOTION
from postproc.model.effects.part_motion import PartMotion
from tests.calibration.planted import campaign

BENDS = "rotation:link3:x by temperature linear"


@pytest.fixture(scope="module")
def base() -> Fit:
    return campaign(461, (BENDS,), 1.0, rows=240).base_fit()


@pytest.fixture(scope="module")
def table(base: Fit) -> Table:
    return Table.of(base)


def test_a_cell_is_scored_as_its_own_candidate_is(base: Fit, table: Table) -> None:
    view = Projection.of(base)
    scores = table.scores(lambda _: view)
    for score in scores[:5]:
        alone = rank_some(view, [score.best])[0]
        assert score.best_evidence == pytest.approx(alone.best_evidence, rel=1e-6)
        # a family is its laws, each with a share: never above the sum of all
        assert score.evidence < alone.best_evidence + 1.0
    assert [s.evidence for s in scores] == sorted(s.evidence for s in scores)[::-1]


def test_the_cell_that_was_planted_comes_first(base: Fit, table: Table) -> None:
    view = Projection.of(base)
    best = table.scores(lambda _: view)[0].best.effect
    assert isinstance(best, PartMotion)
    assert (best.direction, best.source) == ("link 3 turn x", "temperature")


def test_cells_that_have_a_name_are_no_cells_of_the_table(table: Table) -> None:
    assert ("moment 5x", "linear") in table.named["link 5 turn x"]
    assert ("torque 2", "linear") in table.named["joint 2"]
    assert ("lambda 4", "linear") in table.named["joint 4"]
    laws = table.laws[""]
    of_five = [law for some, _, _ in laws.widths for law in some]
    share = table._shares(next(c for c in _carriers() if str(c) == "joint 2"), of_five)
    named = [law.cell for law, s in zip(of_five, share, strict=True) if np.isinf(s)]
    assert ("torque 2", "linear") in named
    assert ("torque 2", "curve") not in named


def _carriers():  # type: ignore[no-untyped-def]
    from postproc.model.carrier import every_carrier

    return every_carrier()


@pytest.fixture(scope="module")
def traced(base: Fit) -> Investigation:
    return trace(base, seed=0)


def test_it_is_told_by_place_driver_law_and_size(traced: Investigation) -> None:
    assert traced.verdict == "effect"
    (finding,) = traced.findings
    assert finding.effect == PART_MOTION
    assert finding.told.startswith(
        "link 3 turns about the x of its frame by temperature, "
    )
    assert finding.told.endswith("urad/deg C")
    assert finding.to_dict()["told"] == finding.told


def test_a_free_column_is_taken_out_as_one_of_any_size_is(base: Fit) -> None:
    """(I + X X^T + s^2 c c^T)^-1 for s to infinity, by its definition."""
    view = Projection.of(base)
    column = base.whiten(carrier("link 3 turn x").move(view.at))
    loose = view.beside(column)
    n = len(view.rest)
    once = view.filter(np.eye(n))
    wanted = once @ once
    along = wanted @ column
    wanted -= np.outer(along, along) / (column @ along)
    np.testing.assert_allclose(
        np.eye(n) - loose.squares @ loose.squares.T, wanted, atol=1e-8
    )
    np.testing.assert_allclose(loose.twice[:, 0], wanted @ base.target, atol=1e-6)
    assert loose.rest @ loose.rest == pytest.approx(base.target @ wanted @ base.target)


@pytest.mark.slow
def test_an_empty_campaign_adds_no_cell() -> None:
    for seed in range(462, 466):
        empty = campaign(seed, (), 0.0, rows=200).base_fit()
        assert trace(empty, seed=0).findings == ()


@pytest.fixture(scope="module")
def null(base: Fit) -> Null:
    """Thresholds of names and cells together."""
    return Causes.of(base).null(Projection.of(base), seed=0)


def test_a_threshold_holds_for_names_and_cells_together(base: Fit, null: Null) -> None:
    view, both = Projection.of(base), null
    assert both.cells is not None
    scores = ranking(view, Causes.of(base))
    cell = next(s for s in scores if s.family.effect == PART_MOTION)
    name = next(s for s in scores if s.family.effect != PART_MOTION)
    assert both.p_of(cell) == min(2.0 * both.cells.p_value(cell.evidence), 1.0)
    assert both.p_of(name) == min(2.0 * both.p_value(name.evidence), 1.0)


def test_several_names_stand_for_a_cell_only_where_they_explain_more(
    base: Fit, null: Null, traced: Investigation
) -> None:
    """A link that bends with the temperature is no chain of three other names."""
    names = Causes(Library.of(base))
    without: Search = search(base, names, null, no_progress)
    within = traced.search
    assert within.fit.log_evidence > without.fit.log_evidence
