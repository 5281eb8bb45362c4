"""Moves that go a distance towards a pose."""

import numpy as np

from postproc.compensation.program import plan_visits, read_program

POINT = "POS(150, 150, 250, 0, 170, 0, '')"


def test_a_pose_that_is_nearer_than_the_move_goes_is_not_known(job_cell):
    lines = ["PROGRAM job", "BEGIN", "MOVE JOINT TO {-10, 15, -100, 20, 60, 0}"]
    lines += [f"MOVE LINEAR FOR {far} TO {POINT}" for far in (20, 5000)]
    lines += [f"MOVE LINEAR TO {POINT}", "END job"]
    reading = read_program({"job.pdl": "\n".join(lines).encode()}, job_cell)
    planned = plan_visits(reading.visits, job_cell).plan
    known = np.isfinite(planned.q).all(axis=1)
    assert known[:3].tolist() == [True, True, False]
    assert not planned.direction[3].any()
