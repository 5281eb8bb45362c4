"""A program run in time keeps to limits and speeds, and arrives as along its path."""

from __future__ import annotations

import random
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from postproc.compensation.options import DEFAULT_OPTIONS
from postproc.compensation.program import prepare_cell, read_program
from postproc.compensation.solver.targets import targets_from_visits
from postproc.motion.arrival_times import MOST_SAMPLES
from postproc.motion.cycle_time import ProgramCycle, run
from postproc.motion.directions_from_trajectory import disagreements, read_directions
from postproc.motion.ruckig import JointMoves
from postproc.motion.targets import TargetKind
from postproc.robot.arm import Arm
from tests.fuzz.originals import generated
from tests.made_targets import make_targets

ROOT = Path(__file__).parents[2]


def joint_moves(q: np.ndarray, **more: object) -> object:
    n = len(q)
    kind = np.full(n, int(TargetKind.JOINTS))
    return make_targets(kind, joints=q, **more)


def lines(arm: Arm, tool: np.ndarray, home: np.ndarray, speed: float, **more) -> object:
    """Go 200 mm along x and back, in lines between stops."""
    tcp = np.tile((arm.flange(home[None]) @ tool)[0], (3, 1, 1))
    tcp[1, 0, 3] += 0.2
    return make_targets(
        np.full(3, int(TargetKind.POSE)), tcp, move=np.array([0, 1, 1]),
        slot=np.zeros(3, dtype=int), tool=np.tile(tool, (3, 1, 1)),
        linear_speed=np.full(3, speed), **more,
    )  # fmt: skip


def test_joint_moves_take_what_each_takes_alone(arm: Arm, home: np.ndarray) -> None:
    rng = np.random.default_rng(2)
    q = home + rng.uniform(-0.4, 0.4, (6, 6))
    found = run(arm, joint_moves(q))
    moves = JointMoves(arm)
    alone = [moves.move(a, b).duration for a, b in pairwise(q)]
    assert found.seconds == pytest.approx(sum(alone))
    velocity, at = found.velocity_use
    assert (velocity <= 1 + 1e-6).all() and (
        found.acceleration_use[0] <= 1 + 1e-6
    ).all()
    assert found.acceleration_use[0].max() == pytest.approx(1, abs=0.02)
    assert (at >= 1).all() and len(found.slow_moves) == 0


def test_a_line_takes_its_length_by_its_speed(arm, tool, home) -> None:
    found = run(arm, lines(arm, tool, home, 0.1))
    assert 4.0 < found.seconds < 4.6  # 2 x 200 mm at 100 mm/s, and the ramps
    assert found.clock.speed.tolist() == [0, 0, 0] and not found.clock.untimed.any()
    assert (found.velocity_use[0] < 1).all()
    assert (found.acceleration_use[0] < 1.02).all()


def test_the_joints_cannot_follow_any_speed(arm, tool, home) -> None:
    found = run(arm, lines(arm, tool, home, 50.0))
    assert found.slow_moves.tolist() == [1, 2]
    assert (0 < found.clock.allowed[1:]).all() and (found.clock.allowed[1:] < 0.2).all()
    assert found.velocity_use[0].max() <= 1.02


def test_the_trajectory_is_sampled_through_its_waypoints(arm, tool, home) -> None:
    found = run(arm, lines(arm, tool, home, 0.1))
    runs = found.clock.runs
    q, visit = runs.sample(4e-3)
    assert len(q) >= found.seconds / 4e-3 and set(visit.tolist()) == {1, 2}
    steps = np.abs(np.diff(q, axis=0)).max(axis=0)
    assert (steps <= 1.05 * 4e-3 * arm.velocity).all()
    place = arm.tcp(q, np.tile(tool[:3, 3], (len(q), 1)))
    way = place - place[0]
    assert np.abs(way[:, 1:]).max() < 2e-5  # on the line, but for the spline
    ends = q[np.flatnonzero(np.diff(visit, append=9))]
    np.testing.assert_allclose(ends, found.path.q[1:], atol=1e-12)
    first = way[visit == 1, 0]
    assert (np.diff(first) > -1e-9).all() and first[-1] == pytest.approx(0.2, abs=1e-3)


def test_a_move_that_lasts_for_days_is_sampled_more_coarsely(arm, tool, home) -> None:
    runs = run(arm, lines(arm, tool, home, 1e-6)).clock.runs
    assert runs.since.max() > 1e5
    q, visit = runs.sample(4e-3)
    waypoints = len(runs.since)
    assert len(q) <= MOST_SAMPLES * waypoints and set(visit.tolist()) == {1, 2}


def test_directions_read_in_time_are_those_of_the_moves(arm: Arm, home) -> None:
    rng = np.random.default_rng(5)
    q = home + np.cumsum(rng.choice([-0.1, 0.1], (9, 6)), axis=0)
    cycle = run(arm, joint_moves(q))
    assert (read_directions(arm, cycle)[1:] == np.sign(np.diff(q, axis=0))).all()
    still = run(arm, joint_moves(np.tile(home, (3, 1))))
    assert not read_directions(arm, still).any()


def cycle_of(files: dict[str, bytes], cell) -> ProgramCycle:
    visits = read_program(files, cell).visits
    return run(cell.arm, targets_from_visits(visits, cell)[0])


def test_directions_in_time_are_those_along_the_path(bench_cell, bench_model) -> None:
    """All shipped programs and 200 generated ones: at 99.9 % of the arrivals."""
    cell = prepare_cell(bench_cell, bench_model, DEFAULT_OPTIONS)
    programs = []
    for path in sorted((ROOT / "programs").glob("*.pdl")):
        beside = path.with_suffix(".lsv")
        more = {beside.name: beside.read_bytes()} if beside.exists() else {}
        programs.append({path.name: path.read_bytes(), **more})
    programs += [dict(generated(random.Random(seed))) for seed in range(200)]
    known = wrong = 0
    for files in programs:
        cycle = cycle_of(files, cell)
        known += int((cycle.arrived.direction != 0).any(axis=1).sum())
        wrong += int(disagreements(cell.arm, cycle).any(axis=1).sum())
    assert known > 6_000 and wrong <= 1e-3 * known
