"""Jumps: a step at one row may be one at a temperature that was passed once."""

from __future__ import annotations

from dataclasses import replace

import pytest

from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.investigate import trace
from postproc.calibration.diagnosis.jumps import jumps
from postproc.calibration.diagnosis.score import Score, rank_some
from postproc.calibration.regression import Fit
from postproc.model.carrier import every_carrier
from postproc.model.effects.effect import FREE, Candidate, Effect, Family
from postproc.model.effects.part_motion import PartMotion
from postproc.model.effects.tool_shift import ToolShift
from postproc.model.kinematics import ArmStates
from tests.calibration.planted import campaign

JUMPS = "rotation:tool:y by temperature sign"


def score(effect: Effect, projection: Projection) -> Score:
    family = Family(effect.name, None, None, FREE)
    (found,) = rank_some(projection, [Candidate(family, effect, "order", 0.0)])
    return found


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
    projection = Projection.of(mixed)
    assert not jumps(score(ToolShift(100.0), projection), projection)


def test_any_part_may_jump_at_what_varies_smoothly(base: Fit) -> None:
    projection = Projection.of(base)
    step = score(ToolShift(100.0), projection)
    found = jumps(replace(step, evidence=step.best_evidence - 5.0), projection)
    moved = {s.family.along or f"joint {s.family.joint}" for s in found}
    assert moved == set(map(str, every_carrier()))
    assert {s.best.source for s in found} == {"temperature"}
    assert all(s.evidence == pytest.approx(s.best_evidence - 5.0) for s in found)


@pytest.mark.slow
def test_one_jump_comes_before_steps_of_two_joints() -> None:
    bends = campaign(50178, ("rotation:link4:y by temperature sign",), 2.0, rows=240)
    (finding,) = trace(bends.base_fit(), seed=0).findings
    assert str(finding.family) == "link 4 turn y by temperature"


def test_what_is_no_step_does_not_jump(base: Fit) -> None:
    projection = Projection.of(base)
    bends = PartMotion("tool turn x", source="temperature", middle=25.0, half=3.0)
    assert not jumps(score(bends, projection), projection)


@pytest.mark.slow
def test_a_jump_comes_before_a_step_that_explains_less() -> None:
    """A tool that slips moves in any way; this one jumps along one axis alone."""
    base = campaign(171068, ("shift:link6:z by temperature sign",), 1.0).base_fit()
    (finding,) = trace(base, seed=0).findings
    assert str(finding.family) in (
        "link 6 shift z by temperature", "tool shift z by temperature",
    )  # fmt: skip
    assert "tool_shift" in {str(f) for f in finding.rivals}


def test_a_step_of_a_joint_comes_before_a_jump_that_is_the_same() -> None:
    base = campaign(171501, ("joint_step",), 2.0).base_fit()
    (finding,) = trace(base, seed=0).findings
    assert finding.effect == "joint_step"
    assert f"joint {finding.joint} by temperature" in {str(f) for f in finding.rivals}
