"""What is known of flanks: measurements close hypotheses, and open none at random."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.model.flank_hypotheses import (
    PRIOR,
    FlankKind,
    FlankOfJoint,
    flanks_of,
    nominal_widths,
)
from postproc.model.model import UNLIKE, UNTOLD, Model, Width
from postproc.robot.cell import Cell

ELASTIC, LATER, NEVER = FlankKind.ELASTIC, FlankKind.LATER, FlankKind.NEVER


def known(
    model: Model, cell: Cell, width: Width | None = None, in_motion: str = ""
) -> FlankOfJoint:
    """What is known of joint 1 after reversals and a measured path say so."""
    widths = () if width is None else (width,) * 6
    told = ({"in_motion": {"1": in_motion}},) if in_motion else ()
    model = replace(model, flank_widths=widths, history=told)
    return flanks_of(model, cell.arm)[0]


def test_priors_are_shares() -> None:
    assert sum(PRIOR) == pytest.approx(1.0)


def test_a_survey_leaves_elastic_flanks_open_alone(bench_model, bench_cell) -> None:
    flank = known(bench_model, bench_cell)
    assert flank.open_kinds == (ELASTIC,) and flank.widths[1] == 4.0
    assert known(bench_model, bench_cell, UNTOLD) == flank


@pytest.mark.parametrize(
    ("width", "open_kinds", "nominal"),
    [
        ((1.0, 1.5), (), 1.0),
        ((1.0, 2.5), (ELASTIC,), 1.0),
        ((2.0, 4.5), (ELASTIC,), 3.0),
    ],
)
def test_reversals_close_hypotheses(
    bench_model, bench_cell, width, open_kinds, nominal
) -> None:
    flank = known(bench_model, bench_cell, width)
    assert flank.open_kinds == open_kinds
    assert flank.nominal == pytest.approx(nominal)
    before = known(bench_model, bench_cell)
    assert all(flank.weight[kind] <= before.weight[kind] for kind in flank.weight)


def test_steps_that_are_not_the_models_open_hypotheses(bench_model, bench_cell) -> None:
    flank = known(bench_model, bench_cell, UNLIKE)
    assert NEVER in flank.open_kinds and FlankKind.EARLIER in flank.open_kinds


def test_a_measured_path_closes_or_refutes(bench_model, bench_cell) -> None:
    assert known(bench_model, bench_cell, None, "confirmed").open_kinds == ()
    assert not known(bench_model, bench_cell, None, "refuted").is_open(FlankKind.SHARP)
    elastic = known(bench_model, bench_cell, (2.0, 4.5), "confirmed")
    assert elastic.nominal > 1.0 and elastic.is_open(ELASTIC)


def test_links_ahead_of_their_drives_leave_all_open(bench_model, bench_cell) -> None:
    braked = replace(bench_model, values=np.where(
        [name.startswith("backlash.") for name in bench_model.effects.names],
        -bench_model.values, bench_model.values,
    ))  # fmt: skip
    flank = known(braked, bench_cell)
    every = {ELASTIC, FlankKind.EARLIER, LATER, NEVER, FlankKind.PUSHED}
    assert every == {*flank.open_kinds}
    assert flank.max_lag == 1.0
    assert FlankKind.PUSHED in known(braked, bench_cell, UNLIKE).open_kinds
    assert (
        FlankKind.PUSHED not in known(braked, bench_cell, None, "confirmed").open_kinds
    )


def test_slow_measurements_leave_it_open_that_links_run_on(
    bench_model, bench_cell
) -> None:
    for width in (None, (1.0, 1.5), (2.0, 4.5)):
        flank = known(bench_model, bench_cell, width)
        assert flank.is_open(FlankKind.RAN_ON)
        assert FlankKind.RAN_ON not in flank.open_kinds  # no way to cross a gap
    assert not known(bench_model, bench_cell, None, "confirmed").is_open(
        FlankKind.RAN_ON
    )
    braked = replace(bench_model, values=-bench_model.values)
    assert not known(braked, bench_cell).is_open(FlankKind.RAN_ON)


def test_a_wider_flank_lacks_more(bench_model, bench_cell) -> None:
    wide = [(1.0, 1.5), (1.0, 2.0), (1.0, 2.5), (1.0, 4.0)]
    lags = [known(bench_model, bench_cell, width).max_lag for width in wide]
    assert lags[0] == 0.0 and (np.diff(lags) > 0.0).all()
    assert nominal_widths(flanks_of(bench_model, bench_cell.arm)).tolist() == [1.0] * 6
