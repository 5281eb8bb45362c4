"""Jumps: a step at one row may be one at a temperature that was passed once."""

from __future__ import annotations

from dataclasses import replace

import pytest

from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.investigate import trace
from postproc.calibration.diagnosis.jumps import jumps
from postproc.calibration.regression import Fit
from postproc.model.carrier import every_carrier
from postproc.model.effects.tool_shift import ToolShift
from postproc.model.kinematics import ArmStates
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
    mixed = replace(base, batch=ArmStates(base.batch.arm, states.with_(order=order)))
    assert not jumps(ToolShift(100.0), Projection.of(mixed))


def test_any_part_may_jump_at_what_varies_smoothly(base: Fit) -> None:
    found = jumps(ToolShift(100.0), Projection.of(base))
    moved = {s.family.along or f"joint {s.family.joint}" for s in found}
    assert moved == set(map(str, every_carrier()))
    assert {s.best.source for s in found} == {"temperature"}


@pytest.mark.slow
def test_one_jump_comes_before_steps_of_two_joints() -> None:
    bends = campaign(50178, ("rotation:link4:y by temperature sign",), 2.0, rows=240)
    (finding,) = trace(bends.base_fit(), seed=0).findings
    assert str(finding.family) == "link 4 turn y by temperature"


def test_what_is_no_step_does_not_jump(base: Fit) -> None:
    assert not jumps(base.combination.effects[0], Projection.of(base))
