"""Work grows as the program does, told by counting calls; `make growth` takes times."""

from __future__ import annotations

import sys
import tracemalloc
from collections.abc import Mapping

import pytest

from postproc.compensation.program import read_program
from postproc.language import ir
from postproc.language.pdl2 import parser
from postproc.language.text import template_parser
from postproc.language.visits import ELSEWHERE
from tests.bench.growth import KINDS, Files, chain, routines, terms, tree

SMALL = 150


def calls_to_read(files: Mapping[str, bytes], cell) -> int:
    """Count the Python functions that run."""
    count = 0

    def tell(frame: object, event: str, argument: object) -> None:
        nonlocal count
        count += event == "call"

    before = sys.getprofile()
    sys.setprofile(tell)
    try:
        read_program(files, cell)
    finally:
        sys.setprofile(before)
    return count


@pytest.mark.parametrize("name", KINDS)
def test_twice_the_program_is_twice_the_work(name, job_cell):
    write, _ = KINDS[name]
    half, whole = write(SMALL), write(2 * SMALL)
    for files in (half, whole):
        read_program(files, job_cell)  # what is remembered between programs
    assert calls_to_read(whole, job_cell) < 2.3 * calls_to_read(half, job_cell)


def memory_to_read(files: Files, cell) -> int:
    """Return the bytes that are held at once, those of arrays too."""
    tracemalloc.start()
    read_program(files, cell)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


@pytest.mark.parametrize("write", [routines, chain])
def test_twice_the_routines_take_twice_the_memory(write, job_cell):
    read_program(write(SMALL), job_cell)
    half, whole = (memory_to_read(write(n), job_cell) for n in (300, 600))
    assert whole < 2.3 * half


def test_calls_however_deep_are_followed_to_the_last(job_cell):
    visits = read_program(chain(1500), job_cell).visits
    assert len(visits) == 1500
    assert visits.graph.pred.tolist() == list(range(-1, 1499))
    assert len(read_program(tree(1 << 10), job_cell).visits) == (1 << 10) - 1


@pytest.mark.parametrize("n", [300, 5000])
def test_a_line_of_more_terms_than_are_followed_is_listed(n, job_cell):
    found = read_program(terms(n), job_cell)
    assert [d.code for d in found.diagnostics] == ["unknown-statement"]
    assert read_program(terms(150), job_cell).diagnostics == ()


def test_a_line_that_no_program_has_is_not_even_parsed(monkeypatch):
    monkeypatch.setattr(template_parser, "line_parser", lambda *named: pytest.fail())
    text = "n := " + "n + " * (template_parser.LONGEST // 4) + "n"
    assert isinstance(parser.parse_form(text), ir.NotUnderstood)


def test_a_program_beyond_the_limit_is_listed_once_and_left(job_cell, monkeypatch):
    monkeypatch.setattr("postproc.language.analysis.interpreter.MOST_STEPS", 5000)
    found = read_program(tree(1 << 14), job_cell)
    assert [d.code for d in found.diagnostics] == ["too-complex"]
    assert "too many ways, or calls" in found.diagnostics[0].message
    visits = found.visits
    lines = [k + 1 for k, line in enumerate(tree(1 << 14)["job.pdl"].splitlines())
             if b"MOVE" in line]  # fmt: skip
    assert visits.place.line.tolist() == lines and len(lines) == 14
    assert all("too complex" in visits.reasons[k].text for k in visits.reason)
    assert (visits.graph.pred == ELSEWHERE).all()
