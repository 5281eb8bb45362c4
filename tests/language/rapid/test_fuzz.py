"""Whatever the bytes of a task: refused or rewritten; `make fuzz` runs more."""

from __future__ import annotations

from collections import Counter

import pytest

from postproc.language.text.stamp import read_stamp
from tests.fuzz.case import check_bytes, compensated, rewrite
from tests.fuzz.originals import cell, damaged_of, damaged_task, moves, tasks

SEED = 1  # another one than that of `make fuzz`
READ, WHOLE = 240, 24


@pytest.mark.parametrize("first", range(0, READ, 20))
def test_damaged_tasks_are_refused_or_rewritten(first: int) -> None:
    found = {rewrite(damaged_task(SEED, n), cell()) for n in range(first, first + 20)}
    assert "rewritten" in found


def test_damaged_tasks_are_compensated_and_given_back(bench_cell, bench_model) -> None:
    numbers = range(READ, READ + WHOLE)
    tasks = (damaged_task(SEED, number) for number in numbers)
    found = Counter(compensated(files, bench_cell, bench_model) for files in tasks)
    assert found["compensated"] >= 4, found


def test_sound_tasks_are_compensated_and_given_back(bench_cell, bench_model) -> None:
    for files in tasks():
        assert compensated(files, bench_cell, bench_model) != "refused"


def test_a_byte_that_changes_besides_is_seen(bench_cell, bench_model) -> None:
    import random

    from postproc.compensation.compensate import compensate
    from tests.fuzz.case import records_of

    files = moves(random.Random(3))
    name, *pages = files
    done = compensate(
        files[name], bench_cell, bench_model, name=name,
        pages={page: files[page] for page in pages},
    )  # fmt: skip
    records = records_of(done.sidecar)
    check_bytes(files, done.outputs, records, done.visits)
    assert read_stamp(done.outputs[name])
    for old, new in ((b"tWork:=", b"tWerk:="), (b"ENDPROC", b"ENDPROC ")):
        other = {**done.outputs, name: done.outputs[name].replace(old, new, 1)}
        with pytest.raises(AssertionError):
            check_bytes(files, other, records, done.visits)


def test_all_languages_are_drawn() -> None:
    drawn = Counter(next(iter(damaged_of(0, n))).split(".")[-1] for n in range(40))
    assert drawn == {"pdl": 20, "mod": 10, "src": 10}
