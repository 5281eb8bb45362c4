"""Whatever the bytes: refused or rewritten, and no traceback; `make fuzz` runs more."""

import time

import pytest

from postproc.exceptions import PostprocError
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.program import parse
from postproc.language.text.source import source_from_bytes
from tests.fuzz import parsers
from tests.fuzz.case import compensated, rewrite
from tests.fuzz.originals import damaged

SEED = 1  # another one than that of `make fuzz`
READ, WHOLE = 400, 30


@pytest.mark.parametrize("first", range(0, READ, 20))
def test_damaged_programs_are_refused_or_rewritten(first: int, job_cell) -> None:
    found = {rewrite(damaged(SEED, n), job_cell) for n in range(first, first + 20)}
    assert "rewritten" in found


@pytest.mark.parametrize("number", range(READ, READ + WHOLE))
def test_damaged_programs_are_compensated_and_given_back(
    number: int, job_cell, job_model
) -> None:
    compensated(damaged(SEED, number), job_cell, job_model)


@pytest.mark.parametrize("first", range(0, READ, 20))
def test_the_numbers_of_damaged_files_can_be_written_anew(first: int) -> None:
    for number in range(first, first + 20):
        files = damaged(SEED, number)
        parsers.program(files["job.pdl"])
        parsers.variables(files.get("job.lsv", b""))


@pytest.mark.parametrize("text", ["((((" * 3000, "a+" * 3000, "'" * 9999, "{" * 5000])
def test_deep_and_long_lines(text: str) -> None:
    source = source_from_bytes("f", f"PROGRAM a\nBEGIN\nx := {text}\nEND a".encode())
    begun = time.process_time()
    try:
        resolve(parse(source))
    except PostprocError:
        pass
    assert time.process_time() - begun < 2.0
