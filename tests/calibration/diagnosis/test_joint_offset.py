"""A joint that was mastered again is named, and other poses get better by it."""

from functools import cache

import numpy as np
import pytest

from postproc.calibration.diagnosis.diagnose import extend_model
from postproc.calibration.diagnosis.result import Finding
from postproc.calibration.diagnosis.score import Score
from postproc.calibration.diagnosis.search import apart
from postproc.model.effects.effect import (
    FREE,
    NAMED,
    PART_MOTION,
    Candidate,
    Effect,
    Family,
)
from postproc.model.effects.joint_offset import JointOffset
from postproc.model.effects.part_motion import PartMotion
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.robot.pose import lengths
from postproc.simulation import Planted, VirtualArm, sample_survey, stream, virtual_arm
from tests.calibration.planted import (
    ARM,
    BASE,
    TRACKER,
    base_model,
    measurements,
    states_of,
    survey,
)
from tests.slow import slow

SEED, ROWS = 61, 60
NESTS = np.array([[0.1, 0.0, 0.2], [-0.08, 0.06, 0.2]])  # [m]


@cache
def surveyed() -> Model:
    """The model of an arm as it was, and its survey."""
    arm = virtual_arm(SEED, BASE, tracker=TRACKER)
    old = survey(arm, SEED, 200)
    position = arm.measure(old, TRACKER, stream(SEED, "old"))
    return base_model(measurements(states_of(old), position, "old"))


def remastered(joint: int) -> VirtualArm:
    """The same arm, one joint mastered again."""
    planted = Planted("joint_offset", joint, peak_mm=0.5)
    return virtual_arm(SEED, (*map(Planted, BASE), planted), tracker=TRACKER)


@pytest.mark.parametrize("joint", slow([1, 2, 3, 6]))
def test_it_is_named_and_unseen_poses_are_left_less(joint: int) -> None:
    arm, model = remastered(joint), surveyed()
    fresh = survey(arm, SEED + 1, ROWS)
    position = arm.measure(fresh, TRACKER, stream(SEED, "fresh"))
    rows = measurements(states_of(fresh), position, "fresh")
    found = extend_model(rows, ARM, model, tracker=TRACKER)
    named = [_named(f) for f in found.diagnosis.findings]
    assert [("joint_offset", joint) in names for names in named] == [True]
    tied = {1: ("base_shift", None), 6: ("tool_shift", None)}
    assert joint not in tied or tied[joint] in named[0]
    there = sample_survey(arm, 200, seed=SEED + 2)
    true, states = arm.error(there), states_of(there)
    before, after = (lengths(true - m.error(ARM, states)) for m in (model, found.model))
    assert after.mean() < 0.25 * before.mean() and after.max() < before.max()
    assert not found.model.ranges.outside(states[:0], frozenset())
    own = found.model.joint_offset(ARM) - model.joint_offset(ARM)
    assert np.argmax(np.abs(own)) == joint - 1


def _named(f: Finding) -> list[tuple[str, int | None]]:
    return [(f.effect, f.joint), *f.confusable_with]


def test_two_nests_tell_joint_6_from_a_tool() -> None:
    states = states_of(survey(remastered(6), SEED, 20))
    two = states.with_(tool=np.repeat(NESTS, 10, axis=0))
    six = JointOffset((6,))
    assert six.list_tied(ArmStates(ARM, states)) == ("tool_shift",)
    assert six.list_tied(ArmStates(ARM, two)) == ()


def _score(effect: Effect, name: str, joint: int | None, along: str) -> Score:
    tier = NAMED if joint else FREE
    family = Family(name, joint, None, tier, along or None)
    return Score(family, 9.0, Candidate(family, effect, "joint 1", 0.0), 9.0, 0.0)


def test_a_link_that_moves_as_the_joint_does_is_no_other_cause() -> None:
    """The flange of a spherical wrist turns about the axis of joint 5."""
    at = ArmStates(ARM, states_of(survey(remastered(6), SEED, 20)))
    own = _score(JointOffset((5,)), "joint_offset", 5, "").best
    rivals = [
        _score(PartMotion(c, law="constant"), PART_MOTION, None, c)
        for c in ("link 6 turn y", "link 6 turn x", "link 4 turn y")
    ]
    kept = apart(own, rivals, at)
    assert [str(s.family.along) for s in kept] == ["link 6 turn x", "link 4 turn y"]


@pytest.mark.slow
def test_joints_that_always_yielded_are_no_offsets() -> None:
    """The zeros of a model without compliance hold its mean: fresh rows know both."""
    yields = (Planted("compliance", j, mm) for j, mm in ((2, 0.5), (3, 0.3), (5, 0.15)))
    arm = virtual_arm(SEED, (*map(Planted, BASE), *yields), tracker=TRACKER)
    first, second = (
        measurements(
            states_of(rows), arm.measure(rows, TRACKER, stream(SEED, name)), name
        )
        for name, rows in (("old", survey(arm, 5, 300)), ("new", survey(arm, 6, 300)))
    )
    found = extend_model(second, ARM, base_model(first), tracker=TRACKER)
    named = {(f.effect, f.joint) for f in found.diagnosis.findings}
    assert named == {("compliance", 2), ("compliance", 3), ("compliance", 5)}
    assert found.diagnosis.verdict == "effect"
    there = sample_survey(arm, 200, seed=SEED + 2)
    off = lengths(arm.error(there) - found.model.error(ARM, states_of(there)))
    assert off.mean() < 0.02e-3
