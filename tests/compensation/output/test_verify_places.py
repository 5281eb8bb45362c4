"""The output as it is read again: other bytes, places or numbers are refused."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.output.rewrite import (
    VerificationError,
    check_output,
    read_back,
)
from postproc.compensation.program import read_program
from postproc.language.text.number_edits import Skeleton, difference
from postproc.language.text.source import Replacements, Source, Span, apply
from postproc.robot.cell import load_cell
from tests.bench.__main__ import CELL
from tests.bench.made import spot
from tests.written import write_numbers

POSES = b"""PROGRAM a
VAR p : POSITION := POS(7, 8, 9, 0, 0, 0, '') -- x
BEGIN
  MOVE LINEAR TO POS(1.5, 2.25, -3.125, 4, 5, 6, '') -- 12
  MOVE JOINT TO {1, 2, 3, 4, 5, 6}
  MOVE LINEAR TO p
  MOVE LINEAR TO POS(1.5, 2.25, -3.125, 4, 5, 6, '') WITH $LIN_SPD = 0.5
END a
"""


@pytest.fixture(scope="module")
def cell():
    return load_cell(CELL)


@pytest.fixture(params=["poses", "crlf", "mark", "spot"])
def job(request, cell):
    """Return a reading, its output with all literals moved, those, all numbers."""
    files = {"a.pdl": POSES}
    if request.param == "crlf":
        files = {"a.pdl": POSES.replace(b"\n", b"\r\n")}
    if request.param == "mark":
        files = {"a.pdl": b"\xef\xbb\xbf" + POSES}
    if request.param == "spot":
        made = spot(12)
        files = {"spot.pdl": made.source, "spot.lsv": made.variables}
    reading = read_program(files, cell)
    v = reading.visits
    rows = np.arange(len(v.literals))
    first = [int(np.flatnonzero(v.target.literal == row)[0]) for row in rows]
    moved = v.target.values[first] + np.array([0.25, -11.5, 100.0, 0.5, 0.25, 0.125])
    output = write_numbers(reading, rows, moved, "m")
    return reading, output, rows, read_back(v, rows, output.edits)


def test_what_was_meant_is_accepted(job, cell) -> None:
    reading, output, rows, values = job
    check_output(reading, read_program(output.files, cell), output, rows, values)


@pytest.mark.parametrize("old, new", [(b"5", b"6"), (b"MOVE", b"MOVE "), (b"\n", b" ")])
def test_another_byte_is_refused(job, cell, old, new) -> None:
    reading, output, rows, values = job
    for name in output.stamps:
        head, _, rest = output.files[name].rpartition(old)
        if not head:
            continue
        files = {**output.files, name: head + new + rest}
        with pytest.raises(VerificationError):
            check_output(reading, read_program(files, cell), output, rows, values)


def test_a_number_that_reads_otherwise_is_refused(job, cell) -> None:
    reading, output, rows, values = job
    after = read_program(output.files, cell)
    read = after.visits.target.values.copy()
    read[after.visits.target.literal >= 0, 3] += 1e-4
    wrong = replace(after, visits=after.visits.with_columns(values=read))
    with pytest.raises(VerificationError, match="not read as it was meant"):
        check_output(reading, wrong, output, rows, values)


def test_a_number_elsewhere_is_refused() -> None:
    before = Skeleton.read(Source("a.pdl", POSES))
    start = before.numbers.start[2:3].astype(np.int64)
    edits = Replacements(start, start + 1, np.array([b"9.500"]))
    data = POSES[: start[0]] + b"9.500" + POSES[start[0] + 1 :]
    after = Skeleton.read(Source("a.pdl", data))
    assert difference(before, after, edits) == ""
    assert difference(before, after, edits, Span(0, 1))
    for places in ("offset", "length"):
        moved = getattr(after.numbers, places).copy()
        moved[5] += 1
        wrong = replace(after, numbers=replace(after.numbers, **{places: moved}))
        assert "elsewhere" in difference(before, wrong, edits)
    half = Replacements(start, start, np.array([b"9.5"]))
    after = Skeleton.read(Source("a.pdl", apply(POSES, half)))
    assert "one whole number" in difference(before, after, half)
    none = Replacements(start[:0], start[:0], np.array([], dtype="S1"))
    fewer = replace(before, numbers=Skeleton.read(Source("a", b"END a")).numbers)
    assert "other lines or numbers" in difference(before, fewer, none)
    assert difference(before, before, none) == ""


def test_a_stamp_may_stand_before_any_line() -> None:
    """Nothing but the stamp is passed over, and what is behind it moves."""
    before, stamp = Skeleton.read(Source("a.pdl", POSES)), b"-- stamp 1 2\n"
    start = before.numbers.start[2:9:3]
    new = np.array([b"9.500", b"-0.25", b"1"])
    edits = Replacements(start, before.numbers.end[2:9:3], new)
    edited = apply(POSES, edits)
    for at in Source("a.pdl", edited).line_starts.tolist():
        stamped = Source("a.pdl", edited[:at] + stamp + edited[at:])
        span = Span(at, at + len(stamp))
        assert difference(before, Skeleton.read(stamped), edits, span) == ""
        assert difference(before, stamped, edits, Span(at, span.end - 1))
        unstamped = Skeleton.read(Source("a.pdl", edited))
        elsewhere = replace(Skeleton.read(stamped), numbers=unstamped.numbers)
        last = at > unstamped.numbers.start[-1]
        assert bool(difference(before, elsewhere, edits, span)) != last
