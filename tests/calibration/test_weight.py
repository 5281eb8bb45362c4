"""What weight does to an arm is fitted by its names, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.diagnosis.investigate import trace
from postproc.calibration.effect_selection import fit_best
from postproc.model.kinematics import ArmStates
from postproc.simulation import Planted, stream, virtual_arm
from tests.calibration.planted import (
    ARM,
    BASE,
    TRACKER,
    campaign,
    states_of,
    survey,
)
from tests.slow import slow

FLOOR, WALL = (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)
BY_WEIGHT = ("compliance", "bending", "load_backlash", "base_tilt")


def left(seed: int, pulls: tuple[float, ...], *planted: Planted):
    """Fit an arm, and return what weight does by name, and the mean true error [mm]."""
    weight = np.array(pulls)
    every = (*map(Planted, BASE), *planted)
    arm = virtual_arm(seed, every, rows=250, tracker=TRACKER, gravity=9.80665 * weight)
    rows, other = (survey(arm, s, 250) for s in (seed, seed + 1))
    position = arm.measure(rows, TRACKER, stream(seed, "tracker"))
    mounted = ARM.mount(weight)
    fitted = fit_best(mounted, states_of(rows), position, tuple(TRACKER))
    own = fitted.combination
    names = {
        (e.name, j) for e in own.effects if e.name in BY_WEIGHT
        for j in {p.joint for p in e.parameters()}
    }  # fmt: skip
    error = own.error(ArmStates(mounted, states_of(other)), fitted.values)
    off = np.linalg.norm(arm.error(other) - error, axis=1)
    return names, float(off.mean() * 1e3)


def test_an_arm_on_a_wall() -> None:
    yields = (Planted("compliance", 1, 0.6), Planted("compliance", 2, 0.5))
    names, mm = left(31, WALL, *yields)
    assert names == {("compliance", 1), ("compliance", 2)} and mm < 0.02


@pytest.mark.parametrize("joint", [2, 3, 6, *slow([4, 5])])
def test_bending_behind_a_joint(joint: int) -> None:
    names, mm = left(40 + joint, FLOOR, Planted("bending", joint, 0.3))
    assert names == {("bending", joint)} and mm < 0.02


@pytest.mark.parametrize("seed", [51, *slow([52])])
def test_nothing_yields_that_does_not(seed: int) -> None:
    names, _ = left(seed, FLOOR)
    assert names == set()


@pytest.mark.slow
def test_the_law_of_a_torque_comes_before_its_curve() -> None:
    c = campaign(402, ("compliance",), 2.0)
    found = trace(c.base_fit(), seed=0).findings
    assert {f.effect for f in found} == {"compliance"}
    assert {f.joint for f in found} <= set(c.arm.laws[-1].joints)
