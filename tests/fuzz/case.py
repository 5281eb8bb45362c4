"""What must hold for any bytes: refused, or nothing changed outside of targets."""

from __future__ import annotations

import re
import signal
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from postproc.compensation.compensate import compensate
from postproc.compensation.options import Options
from postproc.compensation.output.rewrite import check_output, read_back
from postproc.compensation.output.sidecar import FileRecord, Sidecar, restore
from postproc.compensation.program import read_program
from postproc.exceptions import PostprocError
from postproc.language.visits import Visits
from postproc.model.model import Model
from postproc.robot.cell import Cell
from tests.written import write_numbers

LIMIT = 2.0  # [s] of processor time, for files of up to
SIZE = 100_000  # bytes
BOM = b"\xef\xbb\xbf"
SHIFT = (0.25, -1.75, 3.125)  # of a position, or of the first three joints
_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d+)?")


class HangError(Exception):
    """It takes too long."""


@contextmanager
def limited(files: Mapping[str, bytes]) -> Iterator[None]:
    """Stop what uses too much processor time for files of this size."""
    size = sum(map(len, files.values()))
    seconds = LIMIT * max(1.0, size / SIZE)

    def stop(*_: Any) -> None:
        raise HangError(f"more than {seconds:g} s")

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def rewrite(files: Mapping[str, bytes], cell: Cell) -> str:
    """Read a program, give every literal other numbers, and check what is written.

    Returns:
        ``refused`` or ``rewritten``.

    Raises:
        AssertionError: A byte outside of the targets changed.
        HangError: It took too long.
    """
    try:
        with limited(files):
            reading = read_program(files, cell)
    except PostprocError:
        return "refused"
    visits = reading.visits
    rows = np.arange(len(visits.literals))
    example = np.zeros(len(rows), dtype=np.int64)
    own = visits.target.literal >= 0
    example[visits.target.literal[own]] = np.flatnonzero(own)
    known = np.isfinite(visits.target.values[example]).all(axis=1)
    known &= np.array([not why for why in visits.literals.pinned], dtype=bool)
    rows, example = rows[known], example[known]
    new = visits.target.values[example]
    new[:, : len(SHIFT)] += SHIFT
    output = write_numbers(reading, rows, new, "0" * 12)
    values = read_back(visits, rows, output.edits)
    check_output(reading, read_program(output.files, cell), output, rows, values)
    record = output.sidecar("0" * 12, {}, {name: {} for name in output.stamps})
    check_bytes(files, output.files, record.files, visits)
    return "rewritten"


def compensated(files: Mapping[str, bytes], cell: Cell, model: Model) -> str:
    """Compensate a program, check what is written, and give it back.

    Returns:
        ``refused``, ``left`` (no target was corrected) or ``compensated``.

    Raises:
        AssertionError: A byte outside of the targets changed, or is not given back.
        HangError: It took too long.
    """
    main = next(iter(files))
    try:
        with limited(files):
            done = compensate(
                files[main], cell, model, name=main,
                variables=files.get("job.lsv"), pages=pages_of(files),
                options=Options(timing=True),
            )  # fmt: skip
    except PostprocError:
        return "refused"
    records = records_of(done.sidecar)
    check_bytes(files, done.outputs, records, done.visits)
    for name, record in records.items():
        assert restore(done.outputs[name], record, name) == files[name], name
    return "compensated" if (done.decisions.status == 0).any() else "left"


def pages_of(files: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the pages of a job, which are neither its program nor its values."""
    first = next(iter(files))
    return {n: data for n, data in files.items() if n not in (first, "job.lsv")}


def records_of(sidecar: str) -> dict[str, FileRecord]:
    """Return the records of a sidecar's text."""
    import json

    files = json.loads(sidecar)["files"]
    return {name: FileRecord.read(record) for name, record in files.items()}


def check_bytes(
    before: Mapping[str, bytes],
    after: Mapping[str, bytes],
    records: Mapping[str, FileRecord],
    visits: Visits,
) -> None:
    """Check that files differ in the numbers of targets and one stamp line only.

    Args:
        before: The original files.
        after: What was written.
        records: The files that changed.
        visits: Where the numbers of targets stand.
    """
    literals = visits.literals
    for number, name in enumerate(visits.files):
        if name not in records:
            assert after.get(name, before[name]) == before[name], name
            continue
        mine = literals.file == number
        places = np.stack(
            [literals.places.start[mine], literals.places.end[mine]], axis=-1
        )
        spans = sorted({(a, b) for a, b in places.reshape(-1, 2).tolist() if a >= 0})
        rest = unstamped(name, before[name], after[name])
        at = end = 0
        for start, stop in spans:
            piece = before[name][end:start]
            assert rest.startswith(piece, at), f"{name}: byte {end} to {start}"
            at, end = at + len(piece), stop
            if rest.startswith(before[name][start:stop], at):
                old = stop - start
                new = _NUMBER.match(rest, at)
                longer = new is not None and new.end() - at > old
                at = new.end() if new is not None and longer else at + old
            else:
                found = _NUMBER.match(rest, at)
                assert found, f"{name}: no number at byte {start}"
                at = found.end()
        assert rest[at:] == before[name][end:], f"{name}: after byte {end}"


def unstamped(name: str, before: bytes, after: bytes) -> bytes:
    """Take out the stamp; files in which nothing was corrected have none."""
    return after if after == before else without_stamp(name, after)


def without_stamp(name: str, data: bytes) -> bytes:
    """Take out the stamp: line 1, or the line behind the header of a module."""
    if name.endswith(".pdl") or name.endswith(".lsv"):
        line = re.compile(rb"-- postproc [^\r\n]*(?:\r\n|\n|\r)")
        found = line.match(data, len(BOM) * data.startswith(BOM))
    else:
        line = rb"[!;] postproc \S+ model=\S+ source=[0-9a-f]{64}(?:\r\n|\n|\r)"
        found = re.match(line, data) or re.search(rb"(?<=[\r\n%])[ \t]*" + line, data)
    assert found, f"{name}: no stamp"
    return data[: found.start()] + data[found.end() :]


__all__ = ["HangError", "Sidecar", "check_bytes", "compensated", "limited", "rewrite"]
