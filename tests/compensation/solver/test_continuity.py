"""Corrections along continuous paths: steps per way, flanks, arcs, nothing lonely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.findings.findings import flank_steps
from postproc.compensation.outcome import Status
from postproc.compensation.program import read_program
from postproc.compensation.solver.continuity import (
    ARC,
    BENT,
    PathCorrection,
    PathLimits,
    on_path,
    path_correction,
)
from postproc.model.validity import MARGIN
from postproc.robot.arm import load_arm
from tests.compensation.test_arcs import START, job, point, whys

ARM = load_arm("nj220-2.7")
HOME = np.deg2rad([5.0, 10.0, -95.0, 20.0, 50.0, 30.0])
STEP_MM = 0.5


def read(job_cell, *lines):
    source = "\n".join(["PROGRAM p", "BEGIN", *lines, "END p", ""]).encode()
    return read_program({"p.pdl": source}, job_cell).visits


def fly(trajectory, x):
    return f"MOVEFLY {trajectory} TO POS({x}, 100, 1200, 0, 180, 0, '') ADVANCE"


def stop(trajectory, x):
    return f"MOVE {trajectory} TO POS({x}, 100, 1200, 0, 180, 0, '')"


@pytest.mark.parametrize(
    ("first", "second", "continuous"),
    [
        (fly("LINEAR", 1000), stop("LINEAR", 1100), True),
        (fly("JOINT", 1000), fly("JOINT", 1100), False),
        (fly("JOINT", 1000), stop("LINEAR", 1100), True),
        (fly("JOINT", 1000), stop("JOINT", 1100), False),
        (stop("LINEAR", 1000), stop("LINEAR", 1100), False),
    ],
)
def test_where_a_path_is_continuous(job_cell, first, second, continuous):
    visits = read(job_cell, first, second)
    assert on_path(visits).tolist() == [-1, 0 if continuous else -1]


def corrections(job_cell, way_mm, steps_mm, side=None, gap=0.0):
    """Correct a line of fly points, `way_mm` apart, by (n,) [mm] in z."""
    n = len(steps_mm)
    lines = [fly("LINEAR", 1000 + way_mm * k) for k in range(n)]
    tcp = np.tile(np.eye(4), (n, 1, 1))
    tcp[:, 0, 3] = np.arange(n) * way_mm * 1e-3
    correction = np.zeros((n, 3))
    correction[:, 2] = np.array(steps_mm) * 1e-3
    sides = np.ones((n, 6)) if side is None else np.tile(np.array(side)[:, None], 6)
    q, tool = np.tile(HOME, (n, 1)), np.zeros((n, 3))
    visits = read(job_cell, *lines)
    gaps = np.full(6, gap)
    limits = PathLimits.of(visits, tcp, STEP_MM)
    return path_correction(limits, ARM, q, tool, correction, sides, gaps)


@pytest.mark.parametrize(
    ("way_mm", "step_mm", "far"),
    [(1.0, 0.09, False), (1.0, 0.11, True), (370.0, 1.8, False), (370.0, 1.9, True)],
)
def test_a_step_counts_for_the_way_that_it_is_made_on(job_cell, way_mm, step_mm, far):
    path = corrections(job_cell, way_mm, [1.0, 1.0 + step_mm])
    assert path.steps.tolist() == [False, far]


def test_a_change_of_flank_is_limited_by_the_gap_at_the_tool(job_cell):
    gap = 1e-4  # [rad] half of it at every joint, all of which turn
    levers = np.linalg.norm(ARM.jacobian(HOME[None], np.zeros((1, 3)))[0, :3], axis=0)
    most = 2 * gap * levers.sum() * 1e3 + 0.1
    for step, far in ((most - 0.01, False), (most + 0.01, True)):
        path = corrections(job_cell, 1.0, [0.0, step], [1.0, -1.0], gap)
        assert path.steps[1] == far


def test_a_flank_whose_gap_the_model_does_not_tell_is_free(job_cell):
    assert not corrections(job_cell, 1.0, [0.0, 3.0], [1.0, -1.0]).steps.any()


def test_nothing_is_left_lonely_along_a_path(job_cell):
    """Five points 1 mm apart that move by 1 mm, and two that hardly do."""
    path = corrections(job_cell, 1.0, [1.0] * 5 + [0.05] * 2)
    left = np.zeros(7, dtype=bool)
    left[2] = True
    bent = path.find_bent(left, ~left)
    assert bent.tolist() == [True, True, False, True, True, False, False]


def test_a_long_path_is_gone_along_once():
    n = 200_000
    before = np.arange(n) - 1
    path = PathCorrection(before, np.ones((n, 3)), np.full(n, 1e-4), np.zeros(n))
    left = np.zeros(n, dtype=bool)
    left[n // 2] = True
    assert path.find_bent(left, ~left).sum() == n - 1


def surveyed_up_to(model, q1):
    """Return the model as if axis 1 had been surveyed up to an angle [rad]."""
    lower = model.ranges.lower[0]
    most = lower + (float(q1) - lower) / (1 + MARGIN)  # and some more is believed
    upper = (most, *model.ranges.upper[1:])
    return replace(model, ranges=replace(model.ranges, upper=upper))


def reasons(done):
    return [done.decisions.reasons[k].text for k in done.decisions.why]


def test_an_arc_is_left_as_a_whole(job_cell, job_model):
    """Its start and VIA point lie inside of the survey, its end does not."""
    via = f"VIA {point(350, 150, 200)}"
    arc = f"MOVE CIRCULAR TO {point(300, 40, 200)} {via}"
    source = job(f"MOVE LINEAR TO {point(*START)}", arc)
    done = compensate(source, job_cell, job_model, name="job.pdl")
    assert whys(done)[2:4] == ["", ""]
    inner, end = done.decisions.q[2:4, 0]
    model = surveyed_up_to(job_model, (inner + end) / 2)
    assert inner < end, "the end is the one that lies outside"
    done = compensate(source, job_cell, model, name="job.pdl")
    assert done.decisions.status[2:4].tolist() == [Status.REJECTED] * 2
    assert reasons(done)[2] == ARC.text


def test_a_guarded_fly_point_takes_its_neighbours_along(job_cell, job_model):
    """One point lies outside of the survey; those 2 mm before it would make a step."""
    lines = [
        f"MOVEFLY LINEAR TO {point(300, y, 200)} ADVANCE"
        for y in (300, 150, 104, 102, 100)
    ]
    done = compensate(job(*lines), job_cell, job_model, name="p.pdl")
    assert set(whys(done)[:6]) == {""}
    last = done.decisions.q[4:6, 0]
    assert last[0] < last[1], "the last is the one that lies outside"
    model = surveyed_up_to(job_model, last.mean())
    done = compensate(job(*lines), job_cell, model, name="p.pdl")
    why = reasons(done)
    assert "is outside the surveyed" in why[5]
    assert why[3] == why[4] == BENT.format(STEP_MM)
    assert why[0] == "", "a stop does not bend"


def test_a_weld_that_joints_lead_to_is_not_held_back_by_a_step(job_cell, job_model):
    """370 mm behind a fly point whose correction differs by more than 0.5 mm."""
    limits = job_cell.limits.model_copy(update={"correction_step_mm": 0.001})
    cell = replace(job_cell, limits=limits)
    lines = [
        f"MOVEFLY JOINT TO {point(300, 450, 420)} ADVANCE",
        f"MOVE JOINT TO {point(300, 100, 300)}",
        f"MOVEFLY JOINT TO {point(300, 450, 420)} ADVANCE",
    ]
    done = compensate(job(*lines), cell, job_model, name="job.pdl")
    step = np.diff(done.decisions.correction[1:3], axis=0)
    assert np.linalg.norm(step) > 0.2e-3, "there is a step to hold it back for"
    assert done.decisions.status[:4].tolist() == [Status.CORRECTED] * 4


@pytest.mark.parametrize(("speed", "axes"), [(0.001, 0), (1.0, 6)])
def test_a_change_of_flank_that_is_too_fast_is_told(job_cell, speed, axes):
    """1 mm at 1 m/s is 1 ms: a gap of 2 mrad asks for 8,000 rad/s^2."""
    visits = read(
        job_cell, f"$LIN_SPD := {speed}", fly("LINEAR", 1000), fly("LINEAR", 1001)
    )
    place = np.array([[1.0, 0.1, 1.2], [1.001, 0.1, 1.2]])
    side = np.array([[1.0] * 6, [-1.0] * 6])
    corrected = np.ones(2, dtype=bool)
    found = flank_steps(visits, corrected, place, side, np.full(6, 1e-3), ARM)
    assert [d.code for d in found] == ["flank-acceleration"] * axes
    assert all(d.line == 5 for d in found)
    if found:
        times = 8000.0 / ARM.acceleration[0]
        assert f"here {times:.1f} times" in found[0].message
    still = flank_steps(visits, corrected, place, side * 0, np.full(6, 1e-3), ARM)
    assert still == []
