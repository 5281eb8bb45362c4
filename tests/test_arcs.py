"""Arcs whose circle hangs by a hair: their three points are left alone."""

from __future__ import annotations

import pytest

from postproc.compensate import compensate
from postproc.language.windows import quiet_stops
from postproc.planning import read_program
from postproc.report import Status

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
        return ["" if d.status[k] == Status.SAFE else d.reasons[d.why[k]]
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
        ((350, 150, 200), (300.4, 100, 200), "quite another circle"),
    ],
)
def test_all_three_points_are_left_alone(run, via, end, reason):
    found = run(program(point(*via), point(*end)))
    assert found[0] == found[4] == ""
    assert reason in found[1] and "three points of" in found[1]
    assert all("three points of" in why for why in found[2:4])
    assert "VIA" in found[1]


def test_a_program_is_not_cut_where_an_arc_begins(job_cell):
    source = program(point(350, 150, 200), point(300, 200, 200))
    visits = read_program({"job.pdl": source}, job_cell).visits
    assert quiet_stops(visits).tolist() == [True, False, False, True, False]
