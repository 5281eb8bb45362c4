"""Axes near 0, where the bits of T change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.eligibility.flag_borders import turns_moving
from postproc.compensation.outcome import Status
from postproc.diagnostics import Code
from postproc.language.krl.pose_encoding import BORDER, KRL_DIALECT
from postproc.language.visits import Meaning
from postproc.robot.cell import load_cell
from postproc.robot.pose import rotation_from_vector, rotation_vector
from tests.compensation.curved import (  # noqa: F401
    CELL,
    KR,
    curved_cell,
    curved_model,
    frame,
    tool_pose,
)

BIT = 1 << 3  # of T: axis 4 is negative
NEAR = [  # degrees of axis 4 in the source and corrected, its bit, and what is not sure
    (0.0, 0.01, 0, False), (0.0, -0.01, 0, True), (0.0, 0.01, BIT, True),
    (0.0, -0.01, BIT, False), (0.005, 0.015, 0, False), (0.015, 0.005, 0, True),
    (-0.005, -0.015, BIT, False), (-0.005, 0.004, 0, True), (0.0, 0.0, 0, True),
    (0.0, 0.0002, 0, True), (-0.0002, 0.01, 0, False), (0.5, 0.01, 0, True),
    (0.0, 0.03, 0, False), (0.0, 0.03, BIT, False),
]  # fmt: skip


@pytest.mark.parametrize(("source", "corrected", "bits", "unsure"), NEAR)
def test_an_axis_that_leaves_0_on_its_own_side_is_sure(source, corrected, bits, unsure):
    values = np.array([[0, 0, 0, 0, 0, 0, 2, bits]], float)
    q, before = np.full((2, 1, 6), 1.0)
    before[0, 3], q[0, 3] = np.deg2rad([source, corrected])
    found = KRL_DIALECT.near_border(values, q, before)
    assert found[0].tolist() == [False] * 3 + [unsure] + [False] * 2


AROUND = np.deg2rad([10, -80, 100, 0, 50, -30])
HEAD = """DEF job ( )
$TOOL={X 80,Y -40,Z 150,A 0,B 0,C 0}
$BASE=$NULLFRAME
$APO.CDIS=60
PTP {A1 0,A2 -90,A3 90,A4 10,A5 30,A6 0}
"""
BETWEEN = "PTP {A1 40,A2 -70,A3 80,A4 -30,A5 80,A6 20}"


def straight_points(seed, count):
    """Draw points with axis 4 at 0, and T as it is or with the bit of the axis."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(count):
        q = AROUND + np.deg2rad(rng.uniform(-1, 1, 6) * [30, 8, 8, 0, 15, 30])
        pose = frame(KR.flange(q[None])[0] @ tool_pose())
        turn = sum(int(v < 0) << k for k, v in enumerate(q) if k != 3)
        turn += BIT if rng.random() < 0.5 else 0
        found.append(f"{pose[:-1]},S 2,T {turn}}}")
    return found


def corrected(lines, cell, model, points=()):
    """Compensate a job; return its outcome, and its PTPs to poses that are corrected.

    Of those the numbers before, the numbers after, and the sign of axis 4 that T says.
    """
    text = HEAD + "\n".join(lines) + "\nEND\n"
    declared = (f"DECL E6POS P{k}={one}" for k, one in enumerate(points))
    page = "\n".join(("DEFDAT job", *declared, "ENDDAT", ""))
    pages = {"job.dat": page.encode()} if points else {}
    done = compensate(text.encode(), cell, model, name="job.src", pages=pages)
    v, d = done.visits, done.decisions
    rows = (
        v.target.config_given
        & (v.target.meaning == Meaning.POSE)
        & (d.status == Status.CORRECTED)
    )
    signs = np.where(v.target.values[rows, 7].astype(int) & BIT, -1, 1)
    return done, v.target.values[rows], d.corrected[rows], signs


def axis_4(values, arm=KR):
    """Solve numbers of points for axis 4, (k,) [rad]."""
    flange = KRL_DIALECT.poses(values) @ np.linalg.inv(tool_pose())
    branch = np.repeat(arm.branch(AROUND[None]), len(values))
    return arm.nearest(flange, np.repeat(AROUND[None], len(values), axis=0), branch)[
        :, 3
    ]


def arm_of_other_data(rng):
    """Draw an arm whose machine data differ by some hundredths of mm and deg."""
    d, a = KR.dh.d, KR.dh.a
    return replace(KR, dh=replace(
        KR.dh, a=a + rng.normal(0, 2e-5, 6) * (a != 0),
        d=d + rng.normal(0, 2e-5, 6) * (d != 0),
        offset=KR.dh.offset + np.deg2rad(rng.normal(0, 0.005, 6)),
    ))  # fmt: skip


def test_targets_with_axis_4_at_0(cell, model):
    """The tool turns a little, so that axis 4 ends on the side of its bit."""
    points = [f"PTP {point}" for point in straight_points(3, 40)]
    done, before, after, signs = corrected(points, cell, model)
    d, v = done.decisions, done.visits
    assert len(before) > 30
    codes = {d.reasons[k].code for k in d.why[1:] if d.reasons[k].code}
    assert codes <= {Code.CONFIGURATION_BORDER}  # those would have to turn too far
    assert (before[:, 7] == after[:, 7]).all()
    assert ((axis_4(after) - axis_4(before)) * signs > np.deg2rad(0.0004)).all()
    turned = np.swapaxes(KRL_DIALECT.poses(before), 1, 2) @ KRL_DIALECT.poses(after)
    angle = np.rad2deg(np.linalg.norm(rotation_vector(turned[:, :3, :3]), axis=1))
    assert 0.0 < angle.max() < 0.0052
    assert len(v) == 41


def test_axis_4_keeps_its_side_on_arms_whose_data_differ_a_little(cell, model):
    """Where T fits the source there, it fits the output."""
    points = [f"PTP {point}" for point in straight_points(5, 40)]
    _, before, after, signs = corrected(points, cell, model)
    rng, fitted = np.random.default_rng(6), 0
    for _ in range(50):
        arm = arm_of_other_data(rng)
        fits = axis_4(before, arm) * signs > 0
        assert (axis_4(after, arm) * signs > 0)[fits].all()
        fitted += int(fits.sum())
    assert fitted > 500


@pytest.mark.parametrize(
    "lines", [("PTP P#", BETWEEN, "LIN P#"), ("PTP P# C_DIS", BETWEEN)]
)
def test_numbers_that_are_written_are_on_the_side_of_the_bit(lines, tmp_path, model):
    """They are a mean of what arrivals need, or make up for a corner."""
    path = tmp_path / "cell.toml"
    path.write_text(CELL + "[limits]\nconflict_mm = 0.5\n")
    cell = load_cell(path)
    points = straight_points(7, 60)
    moves = [line.replace("#", str(k)) for k in range(60) for line in lines]
    _, before, after, signs = corrected(moves, cell, model, points)
    assert len(before) > 10
    moved = (axis_4(after) - axis_4(before)) * signs
    far = np.abs(axis_4(after)) > BORDER
    assert ((moved > -1e-7) | far).all()
    assert (axis_4(after) * signs > -1e-7)[~far].all()


def test_a_tool_turns_about_its_tcp_to_move_a_joint():
    rng = np.random.default_rng(8)
    q = AROUND + rng.uniform(-0.2, 0.2, (9, 6))
    tool = np.repeat(tool_pose()[None, :3, 3], 9, axis=0)
    moves = np.zeros((9, 6))
    moves[:, 3], moves[4:, 5] = 1e-5, -2e-5
    turn = turns_moving(KR, q, tool, moves)
    pose = KR.flange(q) @ tool_pose()
    wanted = np.array(pose)
    wanted[:, :3, :3] = rotation_from_vector(turn) @ pose[:, :3, :3]
    found = KR.nearest(wanted @ np.linalg.inv(tool_pose()), q, KR.branch(q))
    np.testing.assert_allclose((found - q)[:, 3], 1e-5, atol=1e-9)
    np.testing.assert_allclose((found - q)[4:, 5], -2e-5, atol=1e-9)
    assert (np.abs(found - q)[:4, 5] > 1e-9).any()  # it is free there
