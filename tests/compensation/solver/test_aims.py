"""Sides are settled in the order of a program: aim and arrival are the same at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.options import DEFAULT_OPTIONS, Clock, Job, no_progress
from postproc.compensation.program import (
    plan_visits,
    prepare_cell,
    read_program,
    states_of,
)
from postproc.compensation.solver.aims import NextAims, next_aims
from postproc.compensation.solver.iterate import SAME, Iteration, Replanner, SolverState
from postproc.motion.joint_path import NOWHERE
from postproc.motion.replan import Replanned
from postproc.robot.direction import NO_SIDES
from tests.bench.made import unbroken
from tests.compensation.scale.test_micro_batch import crowded
from tests.conftest import ROOT


@dataclass
class Course:
    """A program that is corrected, and looked at."""

    iteration: Iteration
    replanner: Replanner

    def look(self, current: SolverState) -> Replanned:
        """Find where it leads."""
        values = self.iteration.propose(current).decisions.corrected
        return self.replanner.after(values, NO_SIDES, 0.0)

    def find(
        self, current: SolverState, looked: Replanned, free: np.ndarray, missed=None
    ) -> NextAims:
        """Find other sides to correct for."""
        it = self.iteration
        states = it.states.with_(tool=it.planned.plan.tool[:, :3, 3])
        missed = np.zeros((len(free), 3)) if missed is None else missed
        given = it.setting.model, current.solved, states, looked
        every, away = np.ones(len(free), bool), off(current, looked) > SAME
        return next_aims(*given, every, free, away, missed)

    def aims(self, *given) -> np.ndarray:
        """Return the sides alone."""
        return self.find(*given).sides


def course(source: bytes, cell, model) -> Course:
    """Plan a program whose moves are not much longer than the play of the joints."""
    cell = prepare_cell(cell, model, DEFAULT_OPTIONS)
    reading = read_program({"job.pdl": source}, cell)
    planned = plan_visits(reading.visits, cell)
    job = Job(cell, model, DEFAULT_OPTIONS, Clock(no_progress), 1)
    states = states_of(planned.plan, cell, job.temperature, reading.visits)
    iteration = Iteration(reading, planned, states, job, False)
    return Course(iteration, Replanner(reading.visits, planned.targets, cell, NOWHERE))


def off(current: SolverState, looked: Replanned) -> np.ndarray:
    """Return by how much arrivals differ from their aims, (n,)."""
    return np.abs(looked.side - current.solved.direction).max(axis=1)


def test_most_sides_are_settled_in_one_go(job_cell, job_model) -> None:
    before, after = 0, 0
    for seed in range(6):
        job = course(crowded("job", seed), job_cell, job_model)
        current = job.iteration.first_aim()
        looked = job.look(current)
        moved = off(current, looked) > SAME
        aims = job.find(current, looked, np.ones(len(moved), dtype=bool))
        settled = job.iteration.next_aim(current, aims, np.zeros((len(moved), 3)))
        before += np.count_nonzero(moved)
        after += np.count_nonzero(off(settled, job.look(settled)) > SAME)
    assert before > 40 and after <= before / 9


def test_arrivals_are_foretold(bench_cell, bench_model) -> None:
    """On straight moves, by corners that become others as targets move."""
    made = unbroken(3000)
    job = course(made.source, bench_cell, bench_model)
    current = job.iteration.first_aim()
    looked, every = job.look(current), np.ones(len(current.held), bool)
    missed = looked.aside - current.aside
    found = job.find(current, looked, every, missed)
    now = job.iteration.next_aim(current, found, missed)
    came = job.look(now)
    away = np.abs(came.side - looked.side).max(axis=1) > SAME
    off = np.abs(came.side - found.reached).max(axis=1)
    assert away.sum() > 200 and (off > SAME).sum() < away.sum() / 20
    beside, least = np.linalg.norm(came.aside - now.aside, axis=1), 5e-6
    assert (np.linalg.norm(missed, axis=1) > least).sum() > 50
    assert (beside > least).sum() < 10


def test_who_is_not_free_keeps_its_sides(job_cell, job_model) -> None:
    job = course(crowded("job", 0), job_cell, job_model)
    current = job.iteration.first_aim()
    looked = job.look(current)
    n = len(looked.side)
    none, missed = np.zeros(n, dtype=bool), np.full((n, 3), 1e-4)
    aims = job.aims(current, looked, none, missed)
    np.testing.assert_array_equal(aims, current.solved.direction)
    one = np.arange(n) == np.flatnonzero(off(current, looked) > SAME)[0]
    changed = (job.aims(current, looked, one) != current.solved.direction).any(axis=1)
    np.testing.assert_array_equal(changed, one)


def test_bent_corners_count_before_they_are_bent(job_cell, job_model) -> None:
    """Where a place is missed, joints lie elsewhere in their play once it is not."""
    job = course(crowded("job", 1), job_cell, job_model)
    current = job.iteration.first_aim()
    looked = job.look(current)
    n = len(looked.side)
    every, missed = np.ones(n, dtype=bool), np.zeros((n, 3))
    missed[5] = 1e-4
    plain, bent = (
        job.aims(current, looked, every, m) for m in (np.zeros((n, 3)), missed)
    )
    np.testing.assert_array_equal(plain[:5], bent[:5])
    assert np.abs(plain[5] - bent[5]).max() > SAME


def test_columns_of_other_lengths_are_refused(job_cell, job_model) -> None:
    job = course(crowded("job", 0), job_cell, job_model)
    current = job.iteration.first_aim()
    looked = job.look(current)
    with pytest.raises(IndexError, match="not there"):
        job.aims(current, looked, np.zeros(3, dtype=bool))


def test_targets_at_stops_are_settled_on_the_flank_that_agrees(
    bench_cell, bench_model
) -> None:
    """Joint 1 rests there, and the arrival answers by more than the aim changes."""
    done = compensate(ROOT / "programs" / "handling.pdl", bench_cell, bench_model)
    assert done.before.n > 40 and done.after.max_mm < 0.001
