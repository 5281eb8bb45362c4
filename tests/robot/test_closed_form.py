"""The closed form against the library of its formulas, and on its own."""

import numpy as np
import py_opw_kinematics as opw
import pytest
from scipy.spatial.transform import RigidTransform

from postproc.robot.arm import load_arm
from postproc.robot.inverse import wrap

ARM = load_arm("nj220-2.7")


@pytest.fixture(scope="module")
def q() -> np.ndarray:
    low, high = np.maximum(ARM.lower, -3.1), np.minimum(ARM.upper, 3.1)
    return np.random.default_rng(7).uniform(low, high, (5000, 6))


def by_library(flange: np.ndarray) -> np.ndarray:
    """All branches as py-opw-kinematics gives them, (n, 8, 6), on no special turn."""
    p = ARM.file.opw
    lengths = {name[:-3]: value for name, value in p if name.endswith("_mm")}
    model = opw.KinematicModel(
        **lengths,
        offsets=tuple(np.deg2rad(p.offsets_deg)),
        flip_axes=tuple(p.flip_axes),
    )
    poses = flange.copy()
    poses[:, :3, 3] *= 1e3
    reached = opw.Robot(model, degrees=False).reach(RigidTransform.from_matrix(poses))
    q = np.asarray(reached.joints, dtype=float).reshape(len(flange), 8, 6)
    return q @ np.linalg.inv(ARM.dh.mix).T


def test_all_branches_are_those_of_the_library(q):
    flange = ARM.flange(q)
    wanted, solved = by_library(flange), ARM.inverse(flange).q
    assert (np.isnan(wanted) == np.isnan(solved)).all()
    assert np.nanmax(np.abs(wrap(solved - wanted))) < 1e-10


@pytest.mark.parametrize("slot", range(8))
def test_one_branch_is_that_of_all(q, slot):
    flange = ARM.flange(q)
    wanted = ARM.inverse(flange).q[:, slot]
    solved = ARM.on_branch(flange, np.full(len(q), slot))
    assert (np.isnan(wanted) == np.isnan(solved)).all()
    assert np.nanmax(np.abs(wrap(solved - wanted))) < 1e-12


def test_the_branch_of_joint_angles_leads_back_to_them(q):
    again = ARM.on_branch(ARM.flange(q), ARM.branch(q))
    assert np.abs(wrap(again - q)).max() < 1e-9


def test_turns_do_not_change_the_branch(q):
    turned = q + 2 * np.pi * np.array([0, 0, 0, 3, 0, -2])
    assert (ARM.branch(turned) == ARM.branch(q)).all()


def test_a_straight_wrist_is_reached(q):
    straight = np.where(np.arange(6) == 4, 0.0, q)
    flange = ARM.flange(straight)
    solved = ARM.on_branch(flange, ARM.branch(straight))
    assert np.abs(ARM.flange(solved) - flange).max() < 1e-9


def test_out_of_reach_is_nan_in_every_angle():
    flange = ARM.flange(np.zeros((1, 6)))
    flange[0, :3, 3] = 9.0
    assert np.isnan(ARM.inverse(flange).q).all()
