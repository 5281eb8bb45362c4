"""Generated programs with clones, executed from their text on the virtual arm."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensate import compensate
from postproc.language.visits import Motion, Target, Visits
from postproc.options import Options
from postproc.simulate import setup_of
from postproc.virtual import land, virtual_arm
from tests.conftest import SEED
from tests.made_visits import visits
from tests.running import Executed, Runner
from tests.shared_points import SWEEP, Writer

PROGRAMS = 12


def visits_of(moves: list[Executed], cell) -> Visits:
    """Make visits of a sequence of moves, in the cell's frames."""
    frames = np.array([cell.tool.record, cell.base.record, cell.uframe.record])
    return visits(
        [int(Target.JOINTS if m.joints else Target.POSE) for m in moves],
        [list(m.numbers) for m in moves],
        motion=np.array([int(Motion[m.motion]) for m in moves]),
        configs=("",),
        frames=frames,
    )


@pytest.mark.parametrize("seed", range(PROGRAMS))
def test_compensated_visits_land_where_they_should(seed, job_cell, job_model):
    program, values = Writer(seed).program()
    outcome = compensate(program, job_cell, job_model, name="job.pdl",
                         variables=values, options=Options(clone=True))  # fmt: skip
    new, new_values = (
        outcome.outputs.get(name, given).decode()
        for name, given in (("job.pdl", program), ("job.lsv", values))
    )
    asked = Runner.of(program.decode(), values.decode()).run()
    done = Runner.of(new, new_values).run()
    assert len(asked) == len(done) == len(outcome.visits)
    assert "cloned" in {d.code for d in outcome.diagnostics}
    landing = land(virtual_arm(SEED), setup_of(job_cell), visits_of(asked, job_cell),
                   visits_of(done, job_cell))  # fmt: skip
    moved = [a.numbers != b.numbers for a, b in zip(asked, done, strict=True)]
    rows = [k for k, i in enumerate(landing.visit) if moved[i] and i >= len(SWEEP)]
    error = 1e3 * np.linalg.norm(landing.error, axis=1)[rows]
    assert len(rows) > 0.5 * len(asked)
    assert error.mean() < 0.03
