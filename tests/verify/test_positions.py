"""Targets as Pinocchio sees them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.findings.second_opinion import facts_of
from postproc.robot.arm import load_arm
from postproc.robot.arm_file import list_shipped_arms
from postproc.robot.cell import load_cell
from postproc.verify.pinocchio_arm import PinocchioArm
from postproc.verify.positions import branch_bits, posture_of
from tests.verify.judged import PROGRAMS, SHIPPED, row, shipped


def drawn(arm, count: int, seed: int = 3) -> np.ndarray:
    rng = np.random.default_rng(seed)
    wide = np.clip(arm.upper - arm.lower, None, 6.0) / 2
    return (arm.lower + arm.upper) / 2 + rng.uniform(-1, 1, (count, 6)) * wide


def facts(name: str):
    cell = load_cell(PROGRAMS / "cell.toml")
    return facts_of(replace(cell, arm=load_arm(name)))


@pytest.mark.parametrize("name", list_shipped_arms())
def test_the_two_kinematics_agree_on_every_arm(name: str) -> None:
    arm, theirs = load_arm(name), PinocchioArm.build(facts(name))
    for q in drawn(arm, 50):
        np.testing.assert_allclose(theirs.flange(q), arm.flange(q[None])[0], atol=1e-9)
        J = arm.jacobian(q[None], np.zeros(3))[0]
        np.testing.assert_allclose(theirs.jacobian(q), J, atol=1e-9)


@pytest.mark.parametrize("name", list_shipped_arms())
def test_the_branch_is_told_by_where_the_joints_are(name: str) -> None:
    arm = load_arm(name)
    if arm.file.opw is None:
        pytest.skip("no closed form: nobody names its branches")
    q = drawn(arm, 400)
    bits, sure = branch_bits(posture_of(PinocchioArm.build(facts(name)), q), arm.file)
    rows = sure.all(axis=1)
    assert rows.mean() > 0.9
    slots = bits @ [4, 2, 1]
    np.testing.assert_array_equal(slots[rows], arm._solver.slot(q)[rows])
    assert len(np.unique(slots)) == 8


def test_gravity_pulls_as_it_does_for_the_effects() -> None:
    cell = load_cell(PROGRAMS / "cell.toml")
    arm = load_arm("nj220-2.7").mount(np.array([0.3, -0.5, -0.8]))
    load = np.array([80.0, 0.1, -0.05, 0.2])
    theirs = PinocchioArm.build(facts_of(replace(cell, arm=arm)), load)
    q = drawn(arm, 50)
    ours = arm.gravity_torque(q, load[0], load[1:])
    assert np.abs(ours).max() > 1000.0
    np.testing.assert_allclose([theirs.torque(x) for x in q], ours, atol=1e-6)


@pytest.mark.parametrize("name", [n for n in SHIPPED if n != "milling.pdl"])
def test_the_shipped_programs_agree(name: str, models) -> None:
    opinion = shipped(name, models).opinion()
    assert opinion.agrees, opinion.to_dict()
    for label in ("source", "output"):
        found = row(opinion, f"{label}: place")
        assert found.compared > 5 and not found.skipped
        assert 0 < found.largest < 1e-6  # [mm]
    assert row(opinion, "swing of the elbow").largest > 0.5  # [mm]: it does look
