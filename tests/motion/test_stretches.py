"""Stretches followed all together lead where they lead one by one."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.program import read_program
from postproc.compensation.solver.targets import targets_from_visits
from postproc.motion import joint_path as module
from postproc.motion.joint_path import Trace, trace
from postproc.motion.targets import TargetKind, Targets
from postproc.robot.arm import Arm
from postproc.robot.cell import load_cell
from postproc.robot.trajectory import Motion
from tests.bench.made import drilling, handling, milling
from tests.conftest import ROOT
from tests.language.pdl2.reachable import reachable
from tests.made_targets import make_targets

SINGULAR = 4  # of the paths below, the one through the wrist singularity


def one_by_one(arm: Arm, targets: Targets, monkeypatch: pytest.MonkeyPatch) -> Trace:
    with monkeypatch.context() as patched:
        patched.setattr(
            module, "trace_stretches", lambda work, smooth: np.zeros_like(smooth)
        )
        return trace(arm, targets)


def assert_same(found: Trace, wanted: Trace) -> None:
    for name in ("slot", "reason", "overruled"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))
    np.testing.assert_array_equal(found.edges.source, wanted.edges.source)
    for a, b in (
        (found.q, wanted.q), (found.flange, wanted.flange),
        (found.edges.path, wanted.edges.path),
    ):  # fmt: skip
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "files",
    [
        *({"p.pdl": make(300).source} for make in (milling, drilling, handling)),
        *(reachable(seed, exact=seed % 2 == 0).files for seed in range(12)),
    ],
)
def test_programs(files: dict[str, bytes], monkeypatch: pytest.MonkeyPatch) -> None:
    cell = load_cell(ROOT / "programs" / "cell.toml")
    targets = targets_from_visits(read_program(files, cell).visits, cell)[0]
    wanted = one_by_one(cell.arm, targets, monkeypatch)
    assert_same(trace(cell.arm, targets), wanted)


LOOP = b"""PROGRAM job PROG_ARM=1
BEGIN
  $TOOL := POS(0, 0, 300, 0, 0, 0, '')
  $UFRAME := POS(0, 0, 0, 0, 0, 0, '')
  MOVE JOINT TO {0, 0, -90, 190, 60, 0}
  MOVE LINEAR TO POS(1500, 100, 1500, 0, 150, 0, '')
  WHILE $DIN[1] DO
    MOVE LINEAR TO POS(1500, 200, 1500, 0, 150, 0, '')
    MOVE LINEAR TO POS(1550, 200, 1450, 0, 150, 0, '')
    MOVE JOINT TO {0, 0, -90, 0, 60, 0}
    MOVE LINEAR TO POS(1500, 300, 1300, 0, 150, 0, '')
  ENDWHILE
  MOVE LINEAR TO POS(1500, 400, 1300, 0, 150, 0, '')
END job
"""


def test_a_loop_is_entered_before_its_end_is_known(monkeypatch) -> None:
    """The way back comes with axis 4 a turn off; what goes in is followed."""
    cell = load_cell(ROOT / "programs" / "cell.toml")
    visits = read_program({"job.pdl": LOOP}, cell).visits
    targets = targets_from_visits(visits, cell)[0]
    found = trace(cell.arm, targets)
    assert_same(found, one_by_one(cell.arm, targets, monkeypatch))
    assert not np.isnan(found.q[:-1]).any()  # the last one is reached on two ways


def lines(arm: Arm, tool: np.ndarray, q: np.ndarray, starts: np.ndarray) -> Targets:
    """LINEAR moves through the places of joint angles; JOINT moves to starts."""
    n = len(q)
    kind = np.where(starts, TargetKind.JOINTS, TargetKind.POSE)
    move = np.where(starts, Motion.JOINT, Motion.LINEAR)
    tcp = arm.flange(q) @ tool
    tools = np.tile(tool, (n, 1, 1))
    return make_targets(kind, tcp, np.where(starts[:, None], q, np.nan), move=move,
                        tool=tools, slot=np.where(starts, -1, 0))  # fmt: skip


def test_other_turns_and_other_branches(
    arm: Arm, tool: np.ndarray, home: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends = np.deg2rad(
        [[0, 0, 0, 0, 0, 60], [0, 0, 0, 0, 0, 230], [0, 0, 0, 300, 0, 0],
         [9, 4, 3, 2, 9, 8], [0, 0, 0, -20, -100, 0], [3, 0, 0, 170, 0, -400]]
    )  # fmt: skip
    u = np.linspace(0, 1, 40)[:, None]
    q = np.concatenate([home + u * end for end in ends])
    starts = np.arange(len(q)) % 40 == 0
    targets = lines(arm, tool, q, starts)
    wanted = one_by_one(arm, targets, monkeypatch)
    asked: list[int] = []
    stretch = module._stretch
    monkeypatch.setattr(
        module,
        "_stretch",
        lambda work, v, *more: asked.append(v) or stretch(work, v, *more),
    )
    found = trace(arm, targets)
    assert_same(found, wanted)
    # All but one kept to their branch, and were followed together.
    assert {v // 40 for v in asked} == {SINGULAR}
    far = np.arange(len(q)) // 40 != SINGULAR
    np.testing.assert_allclose(found.q[far], q[far], atol=1e-6)
