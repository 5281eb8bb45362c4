"""The numeric inverse: solutions by definition, and those of the closed form."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.robot.arm import load_arm
from postproc.robot.inverse import Inverse, NumericForm, wrap

UR10 = load_arm("ur10")


def drawn(n: int, seed: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (n, 6))


def test_what_is_found_leads_there_and_what_was_there_is_found():
    q = drawn(400)
    flange = UR10.flange(q)
    solved = UR10.inverse(flange).q
    found = ~np.isnan(solved[..., 0])
    again = UR10.flange(np.nan_to_num(solved).reshape(-1, 6)).reshape(400, 8, 4, 4)
    assert np.abs(again - flange[:, None])[found].max() < 1e-9
    assert set(found.sum(axis=1)) <= {2, 4, 6, 8}  # they vanish in pairs
    own = UR10.on_branch(flange, UR10.branch(q))
    assert np.abs(wrap(own - q)).max() < 1e-6
    slots = UR10.branch(np.nan_to_num(solved).reshape(-1, 6)).reshape(400, 8)
    assert (slots == np.arange(8))[found].all()


@pytest.mark.parametrize("name", ["nj220-2.7", "irb6640-185-2.8", "kr210-r2700-extra"])
def test_it_finds_what_the_closed_form_finds(name):
    arm = load_arm(name)
    low, high = np.maximum(arm.lower, -3.1), np.minimum(arm.upper, 3.1)
    flange = arm.flange(np.random.default_rng(5).uniform(low, high, (150, 6)))
    form = NumericForm(arm.dh.pack())
    numeric = Inverse(form, np.eye(6), arm.lower, arm.upper).branches(flange).q
    closed = arm.inverse(flange).q
    missed = 0
    for mine, theirs in zip(numeric, closed, strict=True):
        known = theirs[~np.isnan(theirs[:, 0])]
        for q in mine[~np.isnan(mine[:, 0])]:
            assert np.abs(wrap(known - q)).max(axis=1).min() < 1e-6
        missed += len(known) - int((~np.isnan(mine[:, 0])).sum())
    assert missed <= 0.01 * 8 * len(flange)  # it may miss, never invent


def test_a_branch_changes_at_singularities_alone():
    ends = drawn(120, 9)
    for begin, step in zip(ends[:60], wrap(ends[60:] - ends[:60]), strict=True):
        q = begin + np.linspace(0.0, 0.5, 400)[:, None] * step
        tip = np.zeros((400, 3))
        least = np.linalg.svd(UR10.jacobian(q, tip), compute_uv=False)[:, -1]
        slot = UR10.branch(q)
        for k in np.flatnonzero(np.diff(slot)):
            assert min(least[k : k + 2]) < 0.02


def test_a_place_out_of_reach_has_no_solution():
    flange = UR10.flange(drawn(5))
    flange[:, :3, 3] *= 3.0 / np.linalg.norm(flange[:, :3, 3], axis=1)[:, None]
    assert np.isnan(UR10.inverse(flange).q).all()
    flange[2] = np.nan
    assert np.isnan(UR10.inverse(flange).q).all()


def test_a_path_is_followed_on_its_branch():
    begin = np.deg2rad([20.0, -60.0, 80.0, -110.0, -70.0, 30.0])
    q = begin + np.linspace(0.0, 0.4, 500)[:, None] * [1, 0.5, -0.7, 0.3, 0.8, -1]
    slot = UR10.branch(q[:1])
    solved = UR10.on_branch(UR10.flange(q), np.repeat(slot, 500))
    assert np.abs(wrap(solved - q)).max() < 1e-8
