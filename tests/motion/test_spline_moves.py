"""Which joints may turn shortly before the points of a curve."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from postproc.motion.spline_moves import turns_unsure
from postproc.motion.targets import Targets
from postproc.robot.arm import load_arm
from tests.made_targets import make_targets

ARM = load_arm("kr210-r2700-extra")
COUNT = 12


def curve(rng: np.random.Generator) -> tuple[Targets, np.ndarray]:
    """Draw points of a smooth curve: the targets, and their joint angles."""
    at = np.linspace(0.0, 1.0, COUNT) + rng.uniform(-0.02, 0.02, COUNT)
    q = np.tile(np.deg2rad([0.0, -80.0, 100.0, 0.0, 50.0, 0.0]), (COUNT, 1))
    for turns in (0.3, 0.7, 1.4):
        phase, size = rng.uniform(0, 2 * np.pi, 6), rng.normal(0.0, 0.05 / turns, 6)
        q += size * np.sin(2 * np.pi * turns * at[:, None] + phase)
    tcp = np.tile(np.eye(4), (COUNT, 1, 1))
    tcp[:, :3, 3] = ARM.flange(q)[:, :3, 3]
    inside = np.arange(COUNT) > 0
    targets = make_targets(
        np.zeros(COUNT), tcp, move=np.ones(COUNT), block=np.where(inside, 1, -1),
        curved=inside, fly=inside & (np.arange(COUNT) < COUNT - 1),
    )  # fmt: skip
    return targets, q


def test_joints_that_go_on_have_not_turned_whatever_the_curve():
    rng, wrong, sure = np.random.default_rng(30), np.zeros(2, int), 0
    for _ in range(60):
        targets, q = curve(rng)
        drive = q @ ARM.coupling.T
        place = targets.tcp[:, :3, 3]
        way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1)))
        came = np.diff(drive, axis=0)
        known = ~turns_unsure(ARM, targets, q)[1:]
        # Two controllers: one that is smooth in its curvature, one that is not.
        rates = (
            CubicSpline(way, drive, bc_type="natural")(way, 1)[1:],
            np.gradient(drive, way, axis=0)[1:],
        )
        for k, rate in enumerate(rates):
            wrong[k] += np.count_nonzero(known & (rate * came < 0.0))
        sure += np.count_nonzero(known)
    assert sure > 0.7 * 60 * (COUNT - 1) * 6
    assert wrong[0] < 0.01 * sure and wrong[1] < 0.005 * sure


def test_a_joint_that_turns_at_a_point_is_not_sure():
    q = np.zeros((4, 6))
    q[:, 4] = 0.5
    q[:, 0] = [0.0, 0.1, 0.2, 0.1]
    tcp = np.tile(np.eye(4), (4, 1, 1))
    tcp[:, :3, 3] = ARM.flange(q)[:, :3, 3]
    inside = np.array([False, True, True, True])
    targets = make_targets(
        np.zeros(4), tcp, move=np.ones(4), block=np.where(inside, 1, -1), curved=inside
    )
    found = turns_unsure(ARM, targets, q)
    assert found[:, 0].tolist() == [False, False, True, False]
    assert not found[:, 1:3].any()
    straight = make_targets(np.zeros(4), tcp, move=np.ones(4))
    assert not turns_unsure(ARM, straight, q).any()
