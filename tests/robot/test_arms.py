"""Every shipped arm against the chain of a URDF, and its closed form against itself."""

import numpy as np
import pytest

from postproc.robot.arm import load_arm
from postproc.robot.arm_file import ARMS, list_shipped_arms
from postproc.robot.inverse import wrap
from tests.reference import urdf
from tests.robot.urdfs import LIMITS, NJ130_SERIAL, URDFS

CLOSED = sorted(set(list_shipped_arms()) - {"ur10"})  # its wrist is not spherical
OLDER = {"nj220-2.7", "ur10"}  # held by their published poses


def angles(arm, n=400):
    """Draw joint angles within the limits, at most a turn away from zero."""
    low, high = np.maximum(arm.lower, -2 * np.pi), np.minimum(arm.upper, 2 * np.pi)
    return np.random.default_rng(5).uniform(low, high, (n, 6))


def test_every_arm_but_the_older_ones_has_a_chain_to_be_held_against():
    assert set(list_shipped_arms()) == set(URDFS) | OLDER


@pytest.mark.parametrize("name", URDFS)
def test_the_flange_is_where_the_urdf_places_it(name):
    arm = load_arm(name)
    q = angles(arm)
    np.testing.assert_allclose(arm.flange(q), urdf.flange(URDFS[name], q), atol=1e-12)


@pytest.mark.parametrize("name", CLOSED)
def test_the_closed_form_finds_the_angles_again(name):
    arm = load_arm(name)
    q = angles(arm)
    flange = arm.flange(q)
    np.testing.assert_allclose(arm.nearest(flange, q, arm.branch(q)), q, atol=1e-7)
    slots = arm.inverse(flange).q
    gap = np.abs(wrap(slots - q[:, None, :])).max(2)
    assert np.nanmin(gap, axis=1).max() < 1e-7
    exists = ~np.isnan(slots).any(2)
    wanted = np.repeat(flange[:, None], 8, 1)[exists]
    np.testing.assert_allclose(arm.flange(slots[exists]), wanted, atol=1e-9)


@pytest.mark.parametrize("name", LIMITS)
def test_limits_and_velocities_are_those_of_the_urdf(name):
    arm = load_arm(name)
    lower, upper, velocity = np.array(LIMITS[name])
    np.testing.assert_allclose(arm.lower, lower, atol=3e-3)
    np.testing.assert_allclose(arm.upper, upper, atol=3e-3)
    np.testing.assert_allclose(arm.velocity, velocity, atol=2e-3)


def test_axis_3_of_the_nj_130_does_not_follow_axis_2():
    """Comau's own chain is serial: its axis 3 is the sum of the controller's two."""
    arm = load_arm("nj130-2.6")
    q = angles(arm)
    serial = q.copy()
    serial[:, 2] += q[:, 1]
    wanted = urdf.flange(NJ130_SERIAL, serial)
    np.testing.assert_allclose(arm.flange(q), wanted, atol=1e-12)


@pytest.mark.parametrize("name", URDFS)
def test_every_arm_names_its_source_and_calls_guesses_guesses(name):
    text = (ARMS / f"{name}.toml").read_text(encoding="utf-8")
    assert "https://github.com/" in text.partition("name = ")[0]
    assert "not published: guesses" in text
    joints = load_arm(name).file.joints
    known = "machine.dat of https://" in text
    assert (joints.drive_coupling is not None) == known
    assert (joints.gear_ratio is not None) == known
