"""Our own output, read again: whatever else differs is refused, and told in a line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc import cli as command_line
from postproc.compensation import compensate as compensation
from postproc.compensation.output import rewrite
from postproc.compensation.output.rewrite import (
    Output,
    VerificationError,
    check_output,
    read_back,
)
from postproc.compensation.program import ParsedProgram, read_program
from postproc.robot.cell import Cell
from tests.written import FIRST, POSE, program, write_numbers


@pytest.fixture(params=[1, 50_000], autouse=True)
def window(request, monkeypatch):
    """Check as many rows at a time."""
    monkeypatch.setattr("postproc.compensation.output.equivalence.ROWS", request.param)
    monkeypatch.setattr("postproc.language.text.number_edits.AT_ONCE", request.param)


SHIFTED = (
    "p := POS(100.0, 210.0, 150.0, 0.0, 175.0, 0.0, '')",
    "MOVE LINEAR TO p",
    "MOVE LINEAR TO POS_SHIFT(p, VEC(0, 0, 10))",
)


def written(cell: Cell) -> tuple[ParsedProgram, Output, np.ndarray]:
    """Write 1 mm more into the x of every pose."""
    reading = read_program({"job.pdl": program(FIRST, POSE, *SHIFTED)}, cell)
    rows = np.flatnonzero(~reading.visits.literals.joints)
    values = np.zeros((len(rows), 6))
    for at, row in enumerate(rows):
        visit = np.flatnonzero(reading.visits.target.literal == row)[0]
        values[at] = reading.visits.target.values[visit] + [1, 0, 0, 0, 0, 0]
    return reading, write_numbers(reading, rows, values, "0" * 16), rows


def check(
    reading: ParsedProgram, after: ParsedProgram, output: Output, rows: np.ndarray
) -> None:
    """Check an output that should be read as it was written."""
    values = read_back(reading.visits, rows, output.edits)
    check_output(reading, after, output, rows, values)


def with_text(output: Output, old: bytes, new: bytes) -> Output:
    files = {"job.pdl": output.files["job.pdl"].replace(old, new)}
    assert files != output.files
    return replace(output, files=files)


def test_what_was_meant_passes(job_cell: Cell) -> None:
    reading, output, rows = written(job_cell)
    check(reading, read_program(output.files, job_cell), output, rows)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"10.0, -95.0", b"10.5, -95.0"),
        (b"MOVE LINEAR TO p", b"MOVE JOINT TO p "),
        (b"VEC(0, 0, 10)", b"VEC(0, 0, 11)"),
        (b"END job", b"END  job"),
    ],
)
def test_another_byte_is_refused(job_cell: Cell, old: bytes, new: bytes) -> None:
    reading, output, rows = written(job_cell)
    other = with_text(output, old, new)
    with pytest.raises(VerificationError, match=r"job\.pdl"):
        check(reading, read_program(other.files, job_cell), output, rows)


def test_a_target_that_was_to_be_kept_is_refused(job_cell: Cell) -> None:
    reading, output, rows = written(job_cell)
    after = read_program(output.files, job_cell)
    with pytest.raises(VerificationError, match="was to be kept"):
        check(reading, after, output, rows[1:])
    values = np.array(reading.visits.target.values)
    with pytest.raises(VerificationError, match="as it was meant"):
        check_output(reading, after, output, rows, values)
    frames = after.visits.frame.poses + 1e-3
    moved = replace(after, visits=after.visits.with_columns(poses=frames))
    with pytest.raises(VerificationError, match="another frame: poses"):
        check(reading, moved, output, rows)
    fewer = replace(
        after, visits=read_program({"job.pdl": program(FIRST)}, job_cell).visits
    )
    with pytest.raises(VerificationError, match="other moves"):
        check(reading, fewer, output, rows)


@pytest.mark.parametrize("error", [VerificationError, ValueError])
def test_no_defect_of_ours_shows_a_trace(desk, monkeypatch, capsys, error) -> None:
    def fail(*_: object) -> None:
        raise error("job.pdl: another byte differs; nothing is written")

    monkeypatch.setattr("postproc.compensation.compensate.check_output", fail)
    source, out = desk.put("job.pdl", program(FIRST, POSE)), desk.folder / "out.pdl"
    if error is VerificationError:
        found = desk.compensate(source, "-o", out)
        assert found.exit_code == 2 and "another byte differs" in found.stderr
    given = ["compensate", source, "--cell", desk.cell, "--model", desk.model]
    monkeypatch.setattr("sys.argv", ["postproc", *map(str, [*given, "-o", out])])
    with pytest.raises(SystemExit) as left:
        command_line.main()
    told = capsys.readouterr().err
    assert left.value.code == 2
    assert "another byte differs" in told and "Traceback" not in told
    assert ("internal error" in told) == (error is ValueError)
    assert desk.names() == {"job.pdl"}


def test_what_another_process_finds_wrong_ends_the_run(
    job_cell: Cell, job_model, monkeypatch
) -> None:
    def fail(*_: object) -> None:
        raise VerificationError("job.pdl: another byte differs; nothing is written")

    monkeypatch.setattr(compensation, "LONG", 1)
    job = program(FIRST, POSE)
    done = compensation.compensate(job, job_cell, job_model, processes=2)
    assert "verify" in done.stages
    monkeypatch.setattr(compensation, "check_output", fail)
    with pytest.raises(VerificationError, match="another byte"):
        compensation.compensate(job, job_cell, job_model, processes=2)


def test_what_is_wrong_with_a_text_is_told_before_what_is_wrong_with_visits(
    job_cell: Cell, monkeypatch
) -> None:
    reading, output, rows = written(job_cell)
    after = read_program(output.files, job_cell)
    monkeypatch.setattr(rewrite, "equivalent", lambda *given: "visits")
    with pytest.raises(VerificationError, match=r"\.pdl: visits$"):
        check(reading, after, output, rows)
    monkeypatch.setattr(rewrite, "difference", lambda *given: "texts")
    with pytest.raises(VerificationError, match="texts; nothing is written"):
        check(reading, after, output, rows)
