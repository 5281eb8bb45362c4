"""Numbers as they will be read, before anything is written and read."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.output.equivalence import equivalent
from postproc.compensation.output.rewrite import WrittenNumbers, read_back
from postproc.compensation.program import ParsedProgram, read_program
from postproc.robot.cell import Cell
from tests.language.pdl2.reachable import reachable
from tests.written import write_numbers


def changed(reading: ParsedProgram, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw new numbers for some literals that may be edited."""
    rng, visits = np.random.default_rng(seed), reading.visits
    used = np.unique(visits.target.literal[visits.target.literal >= 0])
    free = [k for k in used.tolist() if not visits.literals.pinned[k]]
    rows = np.array([k for k in free if rng.random() < 0.7], dtype=np.int64)
    first = [int(np.flatnonzero(visits.target.literal == k)[0]) for k in rows]
    values = visits.target.values[first] + rng.normal(0, 0.3, (len(rows), 6))
    known = np.isfinite(values).all(axis=1)
    return rows[known], values[known]


@pytest.mark.parametrize("seed", range(40))
def test_they_are_those_of_the_output(job_cell: Cell, seed: int) -> None:
    text = reachable(seed, exact=seed % 2 == 0, pages=False).text
    reading = read_program({"job.pdl": text.encode("latin-1")}, job_cell)
    rows, values = changed(reading, seed)
    output = write_numbers(reading, rows, values, "0" * 12)
    found = read_back(reading.visits, rows, output.edits)
    again = read_program(output.files, job_cell).visits
    direct = again.target.follows < 0
    np.testing.assert_array_equal(found[direct], again.target.values[direct])
    np.testing.assert_allclose(found, again.target.values, rtol=0, atol=1e-9)
    assert equivalent(reading.visits, again, rows, found) == ""


@pytest.mark.parametrize("seed", range(40))
def test_rounded_numbers_are_those_that_are_read(job_cell: Cell, seed: int) -> None:
    text = reachable(seed, exact=seed % 2 == 0, pages=False).text
    reading = read_program({"job.pdl": text.encode("latin-1")}, job_cell)
    rows, values = changed(reading, seed)
    own = reading.visits.target.literal
    plain = (own >= 0) & (reading.visits.target.shift < 0)
    new = np.array(reading.visits.target.values)
    at = np.searchsorted(rows, own[mine := np.flatnonzero(plain & np.isin(own, rows))])
    new[mine] = values[at]
    output = write_numbers(reading, rows, values, "0" * 12)
    found = read_back(reading.visits, rows, output.edits)
    rounded = WrittenNumbers.of(reading).round(new)
    np.testing.assert_array_equal(rounded[plain], found[plain])


def test_another_number_is_refused(job_cell: Cell) -> None:
    text = "PROGRAM job\nBEGIN\n  MOVE TO {0, 0, -90, 0, 60, 0}\n"
    text += "  MOVE TO {1, 0, -90, 0, 60, 0}\nEND job\n"
    visits = read_program({"job.pdl": text.encode()}, job_cell).visits
    literals, none = np.arange(2), np.arange(0)
    assert equivalent(visits, visits, none, visits.target.values) == ""
    other = np.array(visits.target.values)
    other[1, 0] = np.nextafter(1.0, 2.0)
    assert "as it was meant" in equivalent(visits, visits, literals, other)
    computed = visits.with_columns(literal=np.array([0, -1]), follows=np.array([-1, 0]))
    assert equivalent(computed, computed, literals, other) == ""
    other[1, 0] = 1.0 + 1e-5
    assert "computed target" in equivalent(computed, computed, literals, other)
