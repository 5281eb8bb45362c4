"""Whatever the bytes of a job: refused or rewritten; `make fuzz` runs more."""

from __future__ import annotations

import random
from collections import Counter

import pytest

from postproc.language.text.stamp import read_stamp
from tests.fuzz.case import check_bytes, compensated, records_of, rewrite
from tests.fuzz.originals import cell, damaged_job, jobs, krl_moves
from tests.language import neutral_job

SEED = 1  # another one than that of `make fuzz`
READ, WHOLE = 240, 24


@pytest.mark.parametrize("first", range(0, READ, 20))
def test_damaged_jobs_are_refused_or_rewritten(first: int) -> None:
    found = {rewrite(damaged_job(SEED, n), cell()) for n in range(first, first + 20)}
    assert "rewritten" in found


def test_damaged_jobs_are_compensated_and_given_back(bench_cell, bench_model) -> None:
    numbers = range(READ, READ + WHOLE)
    some = (damaged_job(SEED, number) for number in numbers)
    found = Counter(compensated(files, bench_cell, bench_model) for files in some)
    assert found["compensated"] >= 4, found


def test_sound_jobs_are_compensated_and_given_back(bench_cell, bench_model) -> None:
    for files in jobs():
        assert compensated(files, bench_cell, bench_model) != "refused"


def test_a_byte_that_changes_besides_is_seen(bench_cell, bench_model) -> None:
    files = krl_moves(random.Random(3))
    done = neutral_job.compensated("job.src", files, bench_cell, bench_model)
    records = records_of(done.sidecar)
    check_bytes(files, done.outputs, records, done.visits)
    assert read_stamp(done.outputs["job.src"])
    for old, new in ((b"$TOOL=", b"$TOOL ="), (b"E1 0.0", b"E1 0.1")):
        other = {n: d.replace(old, new, 1) for n, d in done.outputs.items()}
        with pytest.raises(AssertionError):
            check_bytes(files, other, records, done.visits)
