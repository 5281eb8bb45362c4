"""Findings of a program in several files name the file of every line."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np

from postproc.compensation.findings.findings import (
    SINGLY,
    missing_file,
    no_advice,
    report_uncertain_sides,
)
from postproc.compensation.findings.timing_comparison import InTime
from postproc.diagnostics import Code, Reason
from tests.made_visits import visits

N = SINGLY + 5
FILES = ("main.mod", "paths.mod")


def made(**more):
    """Make visits of which the first stand in the second file."""
    file = np.where(np.arange(N) < 3, 1, 0)
    given = {"files": FILES, "file": file, "line": np.arange(N) + 7}
    return visits([0] * N, [[0.0] * 6] * N, **(given | more))


def test_lines_of_other_files_have_their_names():
    v = made()
    assert v.list_lines(np.array([0, 4, 4, 1]), 0) == [
        "paths.mod:7",
        "11",
        "paths.mod:8",
    ]
    assert v.list_lines(np.array([0, 4]), 1) == ["7", "main.mod:11"]


def test_many_uncertain_directions_name_the_files_of_their_lines():
    error = np.zeros((N, 3))
    error[[0, 1, 9, 10, 11], 0] = 1e-3
    (found,) = report_uncertain_sides(
        made(), np.ones(N, bool), np.zeros((N, 6)), error, no_advice
    )
    assert (found.file, found.line) == ("paths.mod", 7)
    named = re.search(r"instance lines (.*?)\): start", found.message)
    assert named and named[1] == "main.mod:16, main.mod:17, main.mod:18, 7, 8"


def test_slow_moves_name_the_files_of_their_lines():
    slow = np.array([1, 4])
    clock = SimpleNamespace(allowed=np.full(N, 0.5), velocity=np.ones((N, 6)))
    after = SimpleNamespace(slow_moves=slow, clock=clock)
    told = SimpleNamespace(after=after, source=lambda rows: rows)
    (found,) = InTime._report_slowed(told, made())
    assert (found.file, found.line) == ("paths.mod", 8)
    assert found.message.endswith("(lines 8, main.mod:11)")


def test_a_missing_variable_file_is_missed_where_its_target_stands():
    none = Reason(Code.NO_VALUE, "has no value")
    (found,) = missing_file(made(files=("main.pdl", "page.pdl"), reasons=(none,)))
    assert (found.file, found.line) == ("page.pdl", 7)
