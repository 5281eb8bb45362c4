"""Work grows as the program does, told by counting calls; `make growth` takes times."""

from __future__ import annotations

import sys
from collections.abc import Mapping

import pytest

from postproc.compensation.program import read_program
from tests.bench.growth import KINDS

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
