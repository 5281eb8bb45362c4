"""Axes near 0, where the bits of T change."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.outcome import Status
from postproc.diagnostics import Code
from postproc.language.krl.pose_encoding import KRL_DIALECT
from postproc.robot.cell import load_cell
from tests.compensation.curved import CELL, KR, drawn_arm, frame, surveyed, tool_pose

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


def test_targets_with_axis_4_at_0(tmp_path):
    """About half of them leave 0 on the side of their bit, and are corrected."""
    path = tmp_path / "cell.toml"
    path.write_text(CELL)
    cell, truth = load_cell(path), drawn_arm(16)
    model, rng, lines = surveyed(truth, 17), np.random.default_rng(3), []
    for _ in range(40):
        q = np.deg2rad([10, -80, 100, 0, 50, -30]) + np.deg2rad(
            rng.uniform(-1, 1, 6) * [30, 8, 8, 0, 15, 30]
        )
        pose = frame(KR.flange(q[None])[0] @ tool_pose())
        sign = [int(v < 0) << k for k, v in enumerate(q) if k != 3]
        turn = sum(sign) + (BIT if rng.random() < 0.5 else 0)
        lines.append(f"PTP {pose[:-1]},S 2,T {turn}}}")
    head = "DEF job ( )\n$TOOL={X 80,Y -40,Z 150,A 0,B 0,C 0}\n$BASE=$NULLFRAME\n"
    text = head + "PTP {A1 0,A2 -90,A3 90,A4 10,A5 30,A6 0}\n" + "\n".join(lines)
    done = compensate(f"{text}\nEND\n".encode(), cell, model, name="job.src")
    decided, v = done.decisions, done.visits
    moved = decided.status[1:] == Status.CORRECTED
    assert 8 < moved.sum() < 32
    codes = {decided.reasons[k].code for k in decided.why[1:][~moved]}
    assert codes == {Code.CONFIGURATION_BORDER}
    assert (decided.corrected[1:, 7] == v.values[1:, 7])[moved].all()
    user = KRL_DIALECT.poses(decided.corrected[1:][moved])
    near = np.deg2rad([10, -80, 100, 0, 50, -30])
    q = KR.inverse(user @ np.linalg.inv(tool_pose())).q
    q = q[:, int(KR.branch(near[None])[0]), 3]
    negative = (v.values[1:, 7][moved].astype(int) & BIT) > 0
    assert ((q < 0) == negative).all() and np.abs(q).max() < np.deg2rad(0.5)
