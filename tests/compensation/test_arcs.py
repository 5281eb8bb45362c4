"""Arcs whose circle hangs by a hair: their three points are left alone."""

from __future__ import annotations

import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.eligibility.configuration_flags import STRANDED
from postproc.compensation.outcome import Status
from postproc.compensation.program import read_program
from postproc.compensation.scale.windowing import cut_points

START = (300.0, 100.0, 200.0)


def point(x: float, y: float, z: float) -> str:
    return f"POS({x:.4f}, {y:.4f}, {z:.4f}, 0.0, 175.0, 0.0, '')"


def program(via: str, end: str, start: str = point(*START)) -> bytes:
    lines = (
        f"MOVE JOINT TO {point(250, 150, 250)}",
        f"MOVE LINEAR TO {start}",
        f"MOVE CIRCULAR TO {end} VIA {via}",
        f"MOVE LINEAR TO {point(250, 50, 250)}",
    )
    return "\n".join(["PROGRAM job", "BEGIN", *lines, "END job", ""]).encode()


@pytest.fixture
def run(job_cell, job_model):
    def status(source: bytes) -> list[str]:
        done = compensate(source, job_cell, job_model, name="job.pdl")
        d = done.decisions
        return ["" if d.status[k] == Status.CORRECTED else d.reasons[d.why[k]].text
                for k in range(5)]  # fmt: skip

    return status


def test_an_arc_whose_points_lie_well_is_corrected(run):
    assert run(program(point(350, 150, 200), point(300, 200, 200))) == [""] * 5


@pytest.mark.parametrize(
    ("via", "end", "reason"),
    [
        ((350, 150, 200), START, "nearer than 0.1 mm"),
        (START, (350, 150, 200), "nearer than 0.1 mm"),
        ((350, 150, 200), (350.05, 150, 200), "nearer than 0.1 mm"),
        ((350, 100, 200), (400, 100, 200), "on one line"),
        ((350, 150, 200), (300.4, 100, 200), "a very different circle"),
    ],
)
def test_all_three_points_are_left_alone(run, via, end, reason):
    found = run(program(point(*via), point(*end)))
    assert found[0] == "" and found[4] in ("", STRANDED.text)
    assert reason in found[1] and "points of" in found[1]
    assert all("points of" in why for why in found[2:4])
    assert "VIA" in found[1]


@pytest.mark.parametrize("step", ["RELATIVE VEC(0, 0, 5) IN BASE", "AWAY 5"])
def test_a_program_is_not_cut_where_a_step_begins(job_cell, step):
    lines = [f"MOVE LINEAR TO {point(*START)}", f"MOVE LINEAR {step}", NEXT]
    visits = read_program({"job.pdl": job(*lines)}, job_cell).visits
    assert cut_points(visits).tolist() == [True, False, True, True, False]


def test_a_program_is_not_cut_where_an_arc_begins(job_cell):
    source = program(point(350, 150, 200), point(300, 200, 200))
    visits = read_program({"job.pdl": source}, job_cell).visits
    assert cut_points(visits).tolist() == [True, False, False, True, False]


NEXT = f"MOVE LINEAR TO {point(250, 50, 250)}"
SET = f"p := {point(300, 100, 220)}"
START_BY = [
    "MOVE LINEAR TO POS_SHIFT(p, VEC(0, 0, -20))",
    "MOVE LINEAR TO POS(p.X, p.Y, p.Z - 20, p.A, p.E, p.R, '')",
    "MOVE LINEAR RELATIVE VEC(0, 0, -20) IN BASE",
    "MOVE LINEAR RELATIVE VEC(0, 0, -10) IN BASE\nMOVE LINEAR RELATIVE VEC(0, 0, -10) "
    "IN UFRAME",
    "MOVE LINEAR NEAR p BY -20",
]


def whys(done) -> list[str]:
    d = done.decisions
    why = [d.reasons[k].text for k in d.why]
    return [
        "" if status == Status.CORRECTED else text
        for status, text in zip(d.status, why, strict=True)
    ]


def job(*lines: str) -> bytes:
    head = ["PROGRAM job", "VAR p : POSITION", "BEGIN"]
    begin = f"MOVE JOINT TO {point(250, 150, 250)}"
    return "\n".join([*head, begin, *lines, NEXT, "END job", ""]).encode()


@pytest.mark.parametrize("begin", START_BY)
def test_a_start_that_moves_along_counts(job_cell, job_model, begin):
    for x, left in ((300.4, True), (340, False)):
        arc = f"MOVE CIRCULAR TO {point(x, 100, 200)} VIA {point(350, 150, 200)}"
        source = job(SET, "MOVE LINEAR TO p", begin, f"{arc} -- TAUGHT")
        found = whys(compensate(source, job_cell, job_model, name="job.pdl"))
        assert found[0] == found[-1] == ""
        assert ("a very different circle" in found[1]) == left
        assert left or found[1] == ""


def test_points_that_all_move_alike_make_the_same_circle(job_cell, job_model):
    x, y, z = START
    via = "VIA POS_SHIFT(p, VEC(0.5, 0.5, -20))"
    arc = f"MOVE CIRCULAR TO {point(x, y + 1, z)} {via}"
    source = job(SET, "MOVE LINEAR TO p", f"MOVE LINEAR TO {point(*START)}", arc)
    found = whys(compensate(source, job_cell, job_model, name="job.pdl"))
    assert found[1] == found[2] == found[4] == "", found


def test_an_arc_whose_point_on_the_way_is_its_end_says_so(job_cell, job_model):
    lines = [SET, f"MOVE LINEAR TO {point(*START)}", "MOVE CIRCULAR TO p VIA p"]
    found = whys(compensate(job(*lines), job_cell, job_model, name="job.pdl"))
    assert "two of them are one" in found[2] and "two of them are one" in found[3]
