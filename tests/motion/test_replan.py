"""A course looked at again where targets have moved is the course traced anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.program import read_program
from postproc.compensation.solver.targets import targets_from_visits
from postproc.motion import replan as replan_module
from postproc.motion.replan import Replanned, replan, replan_all
from postproc.motion.targets import TargetKind, Targets
from postproc.robot.cell import Cell, load_cell
from postproc.robot.trajectory import Motion
from tests.bench.made import drilling, handling, milling
from tests.conftest import ROOT
from tests.language.pdl2.reachable import reachable

SHIFT = 3e-4  # [m]


@pytest.fixture(scope="module")
def cell() -> Cell:
    return load_cell(ROOT / "programs" / "cell.toml")


def read(cell: Cell, text: bytes) -> Targets:
    return targets_from_visits(read_program({"p.pdl": text}, cell).visits, cell)[0]


def shifted(targets: Targets, moved: np.ndarray, seed: int) -> Targets:
    """Shift the moved targets, joint targets by small angles."""
    rng, rows = np.random.default_rng(seed), np.flatnonzero(moved)
    tcp, joints = np.array(targets.tcp[rows]), np.array(targets.joints[rows])
    pose = targets.kind[rows] == TargetKind.POSE
    tcp[pose, :3, 3] += rng.uniform(-SHIFT, SHIFT, (int(pose.sum()), 3))
    joints += rng.uniform(-SHIFT, SHIFT, joints.shape)
    return targets.move_to(rows, tcp, joints)


def test_columns_of_one_value_move_like_others(cell: Cell) -> None:
    slim = read(cell, milling(60).source).part(*window(20, 30))
    full = replace(slim, **{k: np.array(v) for k, v in vars(slim).items()})
    slim = slim.slim()
    rows = np.array([2, 5])
    for joints in (np.full((2, 6), np.nan), np.ones((2, 6))):
        moved, meant = (t.move_to(rows, t.tcp[:2], joints) for t in (slim, full))
        for name, column in vars(meant).items():
            np.testing.assert_array_equal(getattr(moved, name), column, name)
    assert slim.joints.strides[0] == slim.tool.strides[0] == 0


def window(begin: int, end: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut out moves one after the other, from an unknown place on."""
    rows = np.arange(begin, end)
    return rows, np.arange(end - begin + 1), rows - begin - 1


def picked(targets: Targets, share: float, seed: int) -> np.ndarray:
    """Pick some of the targets that a correction may move."""
    fixed = ~np.isin(targets.kind, (TargetKind.POSE, TargetKind.JOINTS))
    rng = np.random.default_rng(seed)
    return np.asarray((rng.random(len(targets)) < share) & ~fixed)


def assert_same(found: Replanned, wanted: Replanned) -> None:
    """Compare all that a course holds; 1e-11 is what summing in blocks rounds off."""
    for name in ("first", "source"):
        np.testing.assert_array_equal(
            getattr(found.passages, name), getattr(wanted.passages, name), name
        )
    np.testing.assert_array_equal(found.slot, wanted.slot)
    edges, meant = found.edges.join(), wanted.edges.join()
    for name in ("first", "source", "start"):
        np.testing.assert_array_equal(getattr(edges, name), getattr(meant, name), name)
    for a, b in (
        (edges.path, meant.path),
        (found.passages.clamps.lo, wanted.passages.clamps.lo),
        (found.passages.clamps.hi, wanted.passages.clamps.hi),
        (found.exact.q, wanted.exact.q),
        (found.exact.flange, wanted.exact.flange),
        (found.passed, wanted.passed),
        (found.reached.tcp, wanted.reached.tcp),
        (found.reached.aside, wanted.reached.aside),
    ):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.side, wanted.side, rtol=0, atol=1e-6)


def compared(cell: Cell, targets: Targets, share: float, seed: int) -> None:
    """Move some targets, then some others; look again each time."""
    course = replan_all(cell.arm, targets)
    for k in range(2):
        moved = picked(targets, share, seed + k)
        targets = shifted(targets, moved, seed + k)
        course = replan(cell.arm, course, targets, moved)
        assert_same(course, replan_all(cell.arm, targets))


ARC = b"""PROGRAM arcs
BEGIN
  $UFRAME := POS(1500, 0, 900, 0, 0, 0, '')
  $TOOL := POS(0, 0, 200, 0, 45, 0, '')
  $FLY_TYPE := FLY_CART
  $FLY_DIST := 2
  MOVE JOINT TO POS(0, 0, 0, 0, 150, 0, '')
  MOVEFLY LINEAR TO POS(30, 10, 5, 0, 150, 0, '') ADVANCE
%s
  MOVE LINEAR TO POS(0, -200, 100, 0, 150, 0, '')
END arcs
"""
VIA = b"VIA POS(%d, 60, 0, 0, 150, 0, '') ADVANCE"
ONE_ARC = b"""  MOVEFLY CIRCULAR TO POS(%d, 40, 0, 0, 150, 0, '') {VIA}
  MOVEFLY LINEAR TO POS(%d, 10, 5, 0, 150, 0, '') ADVANCE
  MOVE AWAY 20
  MOVE RELATIVE VEC(0, 5, 0) IN UFRAME
  MOVEFLY LINEAR TO POS(%d, -20, 5, 0, 150, 0, '') ADVANCE"""
ONE_ARC = ONE_ARC.replace(b"{VIA}", VIA)


def arcs() -> bytes:
    """Make a program of arcs, steps and lines one after the other."""
    bodies = [ONE_ARC % (x + 30, x + 15, x + 40, x + 2) for x in range(0, 240, 12)]
    return ARC % b"\n".join(bodies)


@pytest.mark.parametrize("share", [0.002, 0.02, 0.1, 0.4])
@pytest.mark.parametrize(
    "source",
    [milling(1500).source, drilling(600).source, handling(400).source, arcs()],
    ids=["milling", "drilling", "handling", "arcs"],
)
def test_the_same_as_traced_anew(cell: Cell, source: bytes, share: float) -> None:
    compared(cell, read(cell, source), share, seed=7)


@pytest.mark.parametrize("seed", range(24))
def test_random_flow(cell: Cell, seed: int) -> None:
    made = reachable(seed, exact=seed % 2 == 0, pages=seed % 3 == 0)
    visits = read_program(made.files, cell).visits
    compared(cell, targets_from_visits(visits, cell)[0], 0.08, seed)


@pytest.mark.parametrize("row", range(6))
def test_the_ends_of_a_program(cell: Cell, row: int) -> None:
    targets = read(cell, milling(300).source)
    course, moved = replan_all(cell.arm, targets), np.zeros(len(targets), dtype=bool)
    for at in (row, len(targets) - 1 - row):
        moved[:] = False
        moved[at] = True
        new = shifted(targets, moved, 3)
        assert_same(replan(cell.arm, course, new, moved), replan_all(cell.arm, new))


def test_only_what_moved_is_traced(cell: Cell, monkeypatch) -> None:
    targets = read(cell, milling(1500).source)
    course, traced = replan_all(cell.arm, targets), []
    original = replan_module.trace

    def counting(arm, part, known=None):
        traced.append(len(part))
        return original(arm, part, known)

    monkeypatch.setattr(replan_module, "trace", counting)
    monkeypatch.setattr(
        replan_module, "replan_all", lambda *_: pytest.fail("all was traced anew")
    )
    moved = np.zeros(len(targets), dtype=bool)
    moved[[100, 103, 900]] = True
    replan(cell.arm, course, shifted(targets, moved, 1), moved)
    assert traced == [17]


def test_branching_flow_is_traced_anew(cell: Cell) -> None:
    targets = read(cell, milling(200).source)
    # The last move also leads back to the middle, as a loop does.
    pred = np.insert(targets.pred, 100, len(targets) - 1)
    start = targets.pred_start + (np.arange(len(targets) + 1) > 100)
    looped = replace(targets, pred=pred, pred_start=start)
    course = replan_all(cell.arm, looped)
    for row in (20, 98, 100, 101, 150):
        moved = np.zeros(len(targets), dtype=bool)
        moved[row] = True
        new = shifted(looped, moved, row)
        assert_same(replan(cell.arm, course, new, moved), replan_all(cell.arm, new))


def test_a_stretch_that_changes_its_branch_is_traced_anew(cell: Cell) -> None:
    targets = read(cell, milling(300).source)
    course = replan_all(cell.arm, targets)
    # Without a string a JOINT move ends where it is nearest: on another turn of axis 6.
    row = 150
    move, kind = np.array(targets.move), np.array(targets.kind)
    move[row], kind[row] = Motion.JOINT, TargetKind.JOINTS
    jointed = replace(targets, move=move, kind=kind)
    joints = np.array(course.exact.q[row])
    joints[5] += 2 * np.pi * (-1 if joints[5] > 0 else 1)
    moved = np.zeros(len(targets), dtype=bool)
    moved[row] = True
    new = jointed.move_to(np.array([row]), targets.tcp[[row]], joints[None])
    assert_same(replan(cell.arm, course, new, moved), replan_all(cell.arm, new))
