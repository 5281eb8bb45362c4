"""Generated programs with clones, executed from their text on the virtual arm."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.options import Options
from postproc.language.visits import Meaning, Visits
from postproc.report.simulation import setup_of
from postproc.robot.trajectory import Motion
from postproc.simulation import land, virtual_arm
from tests.compensation.shared_points import SWEEP, Writer
from tests.compensation.test_orientation import LOST, errors
from tests.conftest import SEED
from tests.made_visits import visits
from tests.running import Executed, Runner

PROGRAMS = 12


def visits_of(moves: list[Executed], cell) -> Visits:
    """Make visits of a sequence of moves, in the cell's frames."""
    frames = np.array([cell.tool.pose, cell.base.pose, cell.uframe.pose])
    return visits(
        [int(Meaning.JOINTS if m.joints else Meaning.POSE) for m in moves],
        [list(m.numbers) for m in moves],
        kind=np.array([int(Motion[m.motion]) for m in moves]),
        configs=("",),
        poses=frames,
    )


def compensated(
    seed: int, cell, model, options: Options
) -> tuple[Visits, Visits, np.ndarray]:
    """Compensate a program; return the moves that it and its output make.

    And which targets have new numbers that are meant for them alone, the sweep apart.
    """
    program, values = Writer(seed).program()
    outcome = compensate(program, cell, model, name="job.pdl",
                         variables=values, options=options)  # fmt: skip
    new, new_values = (
        outcome.outputs.get(name, given).decode()
        for name, given in (("job.pdl", program), ("job.lsv", values))
    )
    asked = Runner.of(program.decode(), values.decode()).run()
    done = Runner.of(new, new_values).run()
    assert len(asked) == len(done) == len(outcome.visits)
    assert "cloned" in {d.code for d in outcome.diagnostics}
    before, after = (visits_of(moves, cell) for moves in (asked, done))
    moved = (before.target.values != after.target.values).any(axis=1)
    moved[: len(SWEEP)] = False
    assert moved.sum() > 0.5 * len(moved)
    return before, after, moved & (outcome.decisions.why == 0)


@pytest.mark.parametrize("seed", range(PROGRAMS))
def test_compensated_visits_land_where_they_should(seed, job_cell, job_model):
    options = Options(shared_points="clone")
    asked, done, moved = compensated(seed, job_cell, job_model, options)
    landing = land(virtual_arm(SEED), setup_of(job_cell), asked, done)
    error = 1e3 * np.linalg.norm(landing.error, axis=1)
    assert error[moved[landing.visit]].mean() < 0.03


@pytest.mark.parametrize("seed", range(4))
def test_clones_are_turned_as_written_too(seed, job_cell, job_model):
    options = Options(shared_points="clone", orientation=True)
    asked, done, moved = compensated(seed, job_cell, job_model, options)
    moved = moved[LOST:]
    before, after = (errors(job_cell, asked, ran) for ran in (asked, done))
    assert before[1][moved].mean() > 1.0
    assert after[0][moved].mean() < 0.03
    assert after[1][moved].mean() < 0.1
