"""Waves and gaps of gears: the orders that are tried, and what coupled drives move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.calibration.diagnosis.result import not_excluded
from postproc.exceptions import PostprocError
from postproc.model.effects import BY_NAME, propose
from postproc.model.effects.drive import DriveTransmission
from postproc.model.effects.transmission import Orders, Transmission
from postproc.model.effects.windup import Windup
from postproc.model.kinematics import ArmStates
from tests.calibration.simulator import COUPLED, GEARED, NJ, covariates, random_states

RNG = np.random.default_rng(3)
STATES = covariates(random_states(300, RNG), RNG)
UNKNOWN = float("nan")


def test_orders_reach_twice_the_ratio_and_hold_those_of_the_motor() -> None:
    angle = STATES.q[:, 0]
    assert Orders.of(angle, UNKNOWN).told == 60.0
    known = Orders.of(angle, 121.0)
    assert known.told == 262.0 and known.motor == [121.0, 242.0]
    shares = [share for _, share in known.list_orders()]
    assert np.exp(shares).sum() == pytest.approx(1.0)


@pytest.mark.parametrize("degrees", [5.0, 10.0, 20.0])
def test_no_order_is_offered_that_a_grid_of_poses_cannot_tell(degrees: float) -> None:
    """Waves of orders k and 360 / spacing - k are the same numbers on a grid."""
    angle = np.radians(np.arange(-100.0, 101.0, degrees).repeat(5))
    orders = Orders.of(angle, 121.0)
    nyquist = 180.0 / degrees
    assert nyquist * 0.93 < orders.told <= nyquist
    assert max(k for k, _ in orders.list_orders()) < nyquist and not orders.motor


def test_an_error_of_a_drive_moves_the_joints_through_the_inverse_coupling() -> None:
    batch = ArmStates(COUPLED, STATES)
    effect = DriveTransmission(tuple(map(tuple, COUPLED.coupling)), ((5, 7.0),))
    p, step = np.array([0.6, -0.8]), 1e-6
    drives = STATES.q @ COUPLED.coupling.T
    wave = p[0] * np.sin(7 * drives[:, 4]) + p[1] * np.cos(7 * drives[:, 4])
    moved = drives.copy()
    moved[:, 4] += step * wave
    q = np.linalg.solve(COUPLED.coupling, moved.T).T
    there = ArmStates(COUPLED, STATES.with_(q=q)).tcp
    slope = (there - batch.tcp) / step
    assert np.abs(effect.columns(batch) @ p - slope).max() < 1e-4  # [m/rad]
    assert np.abs(q - STATES.q)[:, 5].max() > 0.5 * step  # joint 6 is dragged along


def test_drives_are_offered_where_the_file_couples_them() -> None:
    names = {"drive_backlash", "drive_transmission", "drive_load"}
    for arm, wanted in ((NJ, set()), (GEARED, set()), (COUPLED, names)):
        batch = ArmStates(arm, STATES)
        found = {c.family.effect for n in names for c in BY_NAME[n].candidates(batch)}
        assert found == wanted
    with pytest.raises(PostprocError, match="drive_coupling"):
        propose(("drive_backlash",), NJ, STATES)


def test_the_motor_of_a_coupled_joint_turns_with_its_drive() -> None:
    batch = ArmStates(COUPLED, STATES)
    assert Transmission.orders(batch, 4).motor == [80.0, 160.0]
    assert not Transmission.orders(batch, 6).motor
    assert DriveTransmission.orders(batch, 6).motor == [80.0, 160.0]


def test_what_noise_does_not_exclude_follows_the_arm_file() -> None:
    plain, told = (
        " / ".join(not_excluded(ArmStates(a, STATES))) for a in (NJ, COUPLED)
    )
    assert "more than 60 a turn" in plain and "no gear_ratio" in plain
    assert "no drive_coupling" in plain and "two joints finer than 20%" in plain
    assert "no gear_ratio" not in told and "no drive_coupling" not in told
    assert "more than 262 a turn of joints 1, 2, 3" in told


def test_what_noise_does_not_exclude_names_ways_that_rows_do_not_tell() -> None:
    """An elastic flank is no candidate where nobody knows how far a joint came."""
    n = len(STATES.q)
    way = np.linspace(0.0, 1.0, n)[:, None] * np.ones(6)
    for travel, missing in ((np.full((n, 6), np.nan), True), (way, False)):
        batch = ArmStates(NJ, STATES.with_(travel=travel))
        said = any("since they turned" in what for what in not_excluded(batch))
        assert said == missing
        assert bool(Windup.candidates(batch)) != missing


def test_a_ratio_of_0_is_not_known() -> None:
    ratio = np.where(np.arange(6) < 3, 121.0, np.nan)
    batch = ArmStates(replace(NJ, gear_ratio=ratio), STATES)
    assert Transmission.orders(batch, 6).told == 60.0
