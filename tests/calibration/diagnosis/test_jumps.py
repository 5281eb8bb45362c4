"""Jumps: a step at one row may be one at a temperature that was passed once."""

from __future__ import annotations

from dataclasses import replace

import pytest

from postproc.calibration.diagnosis.jumps import jumps
from postproc.calibration.diagnosis.library import Projection
from postproc.calibration.diagnosis.trace import trace
from postproc.calibration.regression import Fit
from postproc.model.effects.tool_shift import ToolShift
from postproc.model.kinematics import Batch
from tests.calibration.planted import campaign

JUMPS = "rotation:tool:y by temperature sign"


@pytest.fixture(scope="module")
def base() -> Fit:
    return campaign(23014, (JUMPS,), 3.0, rows=240).base_fit()


def test_the_temperature_is_told_with_the_step(base: Fit) -> None:
    (finding,) = trace(base, seed=0).findings
    group = {str(f) for f in (finding.family, *finding.rivals)}
    assert "tool_shift" in group
    assert "tool turn y by temperature" in group


def test_a_step_back_and_forth_is_no_jump_of_the_temperature(base: Fit) -> None:
    states = base.batch.states
    order = states.order.copy()
    order[::2] = order[::2][::-1]  # half of the rows were read the other way round
    mixed = replace(base, batch=Batch(base.batch.arm, states.with_(order=order)))
    assert not jumps(ToolShift(100.0), Projection.of(mixed))


def test_only_parts_that_the_step_moves_jump(base: Fit) -> None:
    found = jumps(ToolShift(100.0), Projection.of(base))
    assert found
    assert {str(s.family.along).split()[0] for s in found} == {"tool"}
    assert {s.best.source for s in found} == {"temperature"}
