"""The planner against the virtual arm's own controller and gears."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from postproc.compensation.solver.targets import targets_from_visits
from postproc.language.visits import Meaning, Visits
from postproc.motion.planner import plan
from postproc.robot.cell import Cell, load_cell
from postproc.robot.pose import pose_from_record, record_from_pose
from postproc.robot.trajectory import Motion
from postproc.simulation.controller import VirtualCell
from postproc.simulation.draw import virtual_arm
from postproc.simulation.program import run_program
from tests.made_visits import FRAMES, visits

HOME_DEG = [0.0, 0.0, -90.0, 0.0, 45.0, 0.0]
HOLES = 25


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Cell:
    path: Path = tmp_path_factory.mktemp("cell") / "cell.toml"
    path.write_text(
        f'[robot]\narm = "nj220-2.7"\n[home]\njoints_deg = {HOME_DEG}\n',
    )
    return load_cell(path)


def program(cell: Cell, rng: np.random.Generator) -> Visits:
    """Holes drilled along lines, arcs between, JOINT moves to the next one."""
    tool, base, uframe = pose_from_record(FRAMES)
    to_user = np.linalg.inv(uframe) @ base
    target, values, motion, via, branch = (
        [int(Meaning.HOME)],
        [[np.nan] * 6],
        [0],
        [0],
        [0],
    )
    for _ in range(HOLES):
        q = np.deg2rad(
            rng.uniform([-40, -20, -110, -80, 25, -80], [40, 20, -80, 80, 70, 80])
        )
        if rng.uniform() < 0.3:
            q[4] *= -1
        hole = (cell.arm.flange(q[None]) @ tool)[0]
        back, aside, over = hole.copy(), hole.copy(), hole.copy()
        back[:3, 3] -= 0.15 * hole[:3, 2]
        aside[:3, 3] += 0.1 * hole[:3, 0]
        over[:3, 3] += 0.1 * hole[:3, 1] + 0.1 * hole[:3, 0]
        for T, kind, on_way in (
            (back, Motion.JOINT, 0), (hole, Motion.LINEAR, 0), (back, Motion.LINEAR, 0),
            (hole, Motion.LINEAR, 0), (aside, Motion.CIRCULAR, 1),
            (over, Motion.CIRCULAR, 0),
        ):  # fmt: skip
            target.append(int(Meaning.POSE))
            values.append(record_from_pose(to_user @ T).tolist())
            motion.append(int(kind))
            via.append(on_way)
            branch.append(int(q[4] < 0))
    return visits(
        target, values, kind=np.array(motion), via=np.array(via, dtype=bool),
        config=np.array(branch), configs=("T1:0 T2:0", "W"),
        linear=np.full(len(target), 0.1),
    )  # fmt: skip


def with_steps(cell: Cell, rng: np.random.Generator) -> Visits:
    """After every joint target three moves that only say how far to go."""
    nan = float("nan")
    target, values, motion = [], [], []
    for _ in range(HOLES):
        q = rng.uniform([-40, -20, -110, -80, 25, -80], [40, 20, -80, 80, 70, 80])
        xyz = rng.uniform(-80, 80, 3).tolist()
        steps: list[tuple[Meaning, list[float]]] = [
            (Meaning.RELATIVE_TOOL, [*xyz, nan, nan, nan]),
            (Meaning.RELATIVE_BASE, [*xyz, nan, nan, nan]),
            (Meaning.RELATIVE_UFRAME, [*xyz, nan, nan, nan]),
            (Meaning.AWAY, [90.0, nan, nan, nan, nan, nan]),
            (Meaning.ABOUT, [*xyz, 15.0, float(rng.integers(4, 7)), nan]),
            (Meaning.BY, [2.0, -1.0, 3.0, -4.0, 5.0, 6.0]),
        ]
        chosen = [steps[k] for k in rng.permutation(6)[:3]]
        for kind, numbers in [(Meaning.JOINTS, q.tolist()), *chosen]:
            joints = kind in (Meaning.JOINTS, Meaning.BY)
            target.append(int(kind))
            values.append(numbers)
            motion.append(int(Motion.JOINT if joints else Motion.LINEAR))
    return visits(target, values, kind=np.array(motion))


def with_parts(cell: Cell, rng: np.random.Generator) -> Visits:
    """After every joint target two moves that go only a part of the way to a pose."""
    tool, base, uframe = pose_from_record(FRAMES)
    to_user = np.linalg.inv(uframe) @ base
    target, values, distance = [], [], []
    for _ in range(HOLES):
        q = rng.uniform([-40, -20, -110, -80, 25, -80], [40, 20, -80, 80, 70, 80])
        target.append(int(Meaning.JOINTS))
        values.append(q.tolist())
        distance.append(np.nan)
        for _ in range(2):
            there = np.deg2rad(q + rng.uniform(3.0, 8.0, 6) * rng.choice([-1, 1], 6))
            T = (cell.arm.flange(there[None]) @ tool)[0]
            target.append(int(Meaning.FOR))
            values.append(record_from_pose(to_user @ T).tolist())
            distance.append(rng.uniform(0.0, 40.0))
    joints = np.array(target) == Meaning.JOINTS
    motion = np.where(joints, Motion.JOINT, Motion.LINEAR)
    return visits(target, values, kind=motion, distance_mm=np.array(distance))


def with_gaps(cell: Cell, rng: np.random.Generator) -> Visits:
    """After every joint target moves to places of which numbers are missing."""
    tool, base, uframe = pose_from_record(FRAMES)
    to_user = np.linalg.inv(uframe) @ base
    target, values, motion = [], [], []
    for _ in range(HOLES):
        q = rng.uniform([-40, -20, -110, -80, 25, -80], [40, 20, -80, 80, 70, 80])
        place = to_user @ (cell.arm.flange(np.deg2rad(q)[None]) @ tool)[0]
        xyz = place[:3, 3] * 1e3 + rng.uniform(-80, 80, 3)
        angles = q + rng.uniform(-10, 10, 6)
        xyz[rng.permutation(3)[: rng.integers(0, 3)]] = np.nan
        angles[rng.permutation(6)[: rng.integers(1, 6)]] = np.nan
        moves = [
            (Meaning.PARTIAL_POSE, [*xyz, np.nan, np.nan, np.nan], Motion.LINEAR),
            (Meaning.PARTIAL_JOINTS, angles.tolist(), Motion.JOINT),
        ]
        chosen = [moves[k] for k in rng.permutation(2)]
        for kind, numbers, how in [(Meaning.JOINTS, q.tolist(), Motion.JOINT), *chosen]:
            target.append(int(kind))
            values.append(numbers)
            motion.append(int(how))
    return visits(target, values, kind=np.array(motion))


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("write", [program, with_steps, with_parts, with_gaps])
def test_joint_angles_and_directions_agree(
    cell: Cell, seed: int, write: Callable[[Cell, np.random.Generator], Visits]
) -> None:
    made = write(cell, np.random.default_rng(seed))
    targets, _ = targets_from_visits(made, cell)
    planned = plan(cell.arm, targets, np.deg2rad(cell.limits.wrist_deg))
    setup = VirtualCell(home=cell.home)
    ran = run_program(virtual_arm(seed, effects="backlash"), setup, made)
    assert len(ran.visit) > 0.9 * len(made)
    same = ran.visit[planned.reason[ran.visit] == 0]
    assert len(same) > 0.8 * len(made)
    row = np.searchsorted(ran.visit, same)
    np.testing.assert_allclose(planned.q[same], ran.arrivals.q[row], atol=1e-7)
    direction, side = planned.direction[same], ran.arrivals.side[row]
    assert (direction[3:] != 0).mean() > 0.98
    # A turn by less than one play is jitter, even where it crosses a small gap.
    sure = (direction != 0) & (ran.arrivals.travel[row] > cell.arm.play)
    sure &= np.abs(side) == 1
    assert sure[3:].mean() > 0.96
    np.testing.assert_array_equal(direction[sure], side[sure])
    # The virtual arm has a past before the program, a long way without a reversal.
    recent = sure & (ran.arrivals.travel[row] < 0.5)
    travel, really = planned.travel[same][recent], ran.arrivals.travel[row][recent]
    # A turn by less than one play is one for a gear whose gap is smaller, not for us.
    assert np.mean(np.abs(travel - really) <= cell.arm.play.max()) > 0.98
