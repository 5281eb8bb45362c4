"""One branch in closed form: the same as the library's, everywhere."""

import numpy as np
import pytest

from postproc.robot.arm import load_arm
from postproc.robot.inverse import wrap

ARM = load_arm("nj220-2.7")


@pytest.fixture(scope="module")
def q() -> np.ndarray:
    low, high = np.maximum(ARM.lower, -3.1), np.minimum(ARM.upper, 3.1)
    return np.random.default_rng(7).uniform(low, high, (5000, 6))


@pytest.mark.parametrize("slot", range(8))
def test_every_branch_is_that_of_the_library(q: np.ndarray, slot: int) -> None:
    flange = ARM.flange(q)
    wanted = ARM.inverse(flange).q[:, slot]
    solved = ARM.on_branch(flange, np.full(len(q), slot))
    assert (np.isnan(wanted).any(axis=1) == np.isnan(solved).any(axis=1)).all()
    assert np.nanmax(np.abs(wrap(solved - wanted))) < 1e-10


def test_the_branch_of_joint_angles_leads_back_to_them(q: np.ndarray) -> None:
    again = ARM.on_branch(ARM.flange(q), ARM.branch(q))
    assert np.abs(wrap(again - q)).max() < 1e-9


def test_turns_do_not_change_the_branch(q: np.ndarray) -> None:
    turned = q + 2 * np.pi * np.array([0, 0, 0, 3, 0, -2])
    assert (ARM.branch(turned) == ARM.branch(q)).all()


def test_out_of_reach_is_nan_in_every_angle() -> None:
    flange = ARM.flange(np.zeros((1, 6)))
    flange[0, :3, 3] = 9.0
    assert np.isnan(ARM.on_branch(flange, np.array([0]))).all()
