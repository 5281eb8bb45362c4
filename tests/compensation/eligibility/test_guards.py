"""Guards hold back corrections that are not to be trusted, and say why."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.eligibility.guards import guard_size, guard_solutions
from postproc.compensation.eligibility.reasons import Reasons
from postproc.robot.arm import load_arm
from postproc.robot.cell import LimitSection

ARM = load_arm("nj220-2.7")
LIMITS = LimitSection(correction_mm=2.0, correction_step_mm=0.1, wrist_deg=3.0)
HOME = np.deg2rad([5.0, 10.0, -95.0, 20.0, 50.0, 30.0])


def solutions(command, corrected):
    reasons = Reasons(1)
    guard_solutions(reasons, ARM, LIMITS, command[None], corrected[None])
    return reasons[0].text


def moved(joint, angle):
    q = HOME.copy()
    q[joint] = angle
    return q


def test_a_small_correction_passes():
    assert solutions(HOME, HOME + 1e-3) == ""


@pytest.mark.parametrize("joint", range(6))
def test_joint_limits_hold_for_the_corrected_angles(joint):
    inside = moved(joint, ARM.upper[joint] - 1e-4)
    beyond = moved(joint, ARM.upper[joint] + 1e-4)
    assert "joint limit" in solutions(inside, beyond)
    assert solutions(inside, inside) == ""


def test_the_wrist_must_stay_clear_of_its_singularity():
    near, clear = (moved(4, np.deg2rad(v)) for v in (2.9, 3.1))
    assert "wrist singularity" in solutions(clear, near)
    assert solutions(clear, clear + 1e-4) == ""


def test_what_cannot_be_reached_on_its_branch_is_told():
    assert "out of reach" in solutions(HOME, np.full(6, np.nan))


def sizes(correction_mm, residual):
    reasons = Reasons(len(correction_mm))
    correction = np.zeros((len(correction_mm), 3))
    correction[:, 0] = np.array(correction_mm) * 1e-3
    guard_size(reasons, LIMITS, correction, np.array(residual))
    return [reasons[i].text for i in range(len(correction))]


def test_the_cap_on_a_correction():
    found = sizes([1.999, 2.001], [0.0, 0.0])
    assert found[0] == "" and "correction_mm = 2" in found[1]


def test_what_did_not_converge_is_held():
    found = sizes([1.0, 1.0, 1.0], [0.9e-6, 1.1e-6, np.nan])
    assert found[0] == "" and all("1 um" in text for text in found[1:])
