"""Several processes do what one would have done."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest

from postproc.compensation import compensate as compensate_module
from postproc.compensation import parallel
from postproc.compensation import windows as cuts
from postproc.compensation.compensate import compensate
from postproc.compensation.options import Clock, silent
from postproc.compensation.outcome import Outcome
from postproc.compensation.parallel import identical, in_processes, parts_of
from postproc.exceptions import PostprocError
from tests.bench import made

LEAST, RUN_UP = 60, 150

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="one process does it where there is no fork"
)


@dataclass(frozen=True)
class Sum:
    """Adds up numbers: a stop is the sum so far, a result the sum and who did it."""

    numbers: tuple[int, ...]
    off: int = 0  # what foretelling is wrong by
    never: bool = False
    breaks_at: int = -1

    def correct(self, window: int, begin: int, clock: Clock):
        with clock("add"):
            if window == self.breaks_at:
                raise PostprocError(f"{window} from {begin}")
            end = begin + self.numbers[window]
        return (end, os.getpid()), end

    def foretell(self, window: int) -> int | None:
        return None if self.never else sum(self.numbers[:window]) + self.off


NUMBERS = (3, 1, 4, 1, 5, 9, 2)


def run(work: Sum, processes: int, clock: Clock | None = None):
    rows = range(len(work.numbers))
    return list(in_processes(work, rows, 0, clock or Clock(silent), processes))


@pytest.mark.parametrize("processes", [1, 2, 3, 7, 20])
def test_results_come_in_order_and_from_others(processes: int) -> None:
    found = run(Sum(NUMBERS), processes)
    assert [end for end, _ in found] == np.cumsum(NUMBERS).tolist()
    workers = [who for _, who in found]
    assert len(set(workers)) == min(processes, len(NUMBERS))
    assert workers[0] == os.getpid()
    assert sum(a != b for a, b in pairwise(workers)) == len(set(workers)) - 1


@pytest.mark.parametrize("work", [Sum(NUMBERS, off=1), Sum(NUMBERS, never=True)])
def test_what_was_foretold_wrong_is_done_again(work: Sum) -> None:
    found = run(work, 3)
    assert [end for end, _ in found] == np.cumsum(NUMBERS).tolist()
    assert {who for _, who in found} == {os.getpid()}


@pytest.mark.parametrize("window", range(len(NUMBERS)))
def test_the_first_failure_is_told_from_where_the_work_really_stood(window) -> None:
    begin = sum(NUMBERS[:window])
    for off in (0, 1):
        with pytest.raises(PostprocError, match=f"{window} from {begin}$"):
            run(Sum(NUMBERS, off=off, breaks_at=window), 3)


def test_one_process_does_it_where_there_is_no_fork(monkeypatch) -> None:
    monkeypatch.setattr(parallel, "can_fork", lambda: False)
    assert {who for _, who in run(Sum(NUMBERS), 3)} == {os.getpid()}


def test_seconds_of_all_processes_are_added() -> None:
    clock = Clock(silent)
    run(Sum(NUMBERS), 2, clock)
    assert set(clock.stages) == {"add"} and clock.stages["add"] > 0


def test_shares_are_all_windows_in_their_order() -> None:
    for n in range(1, 9):
        for processes in range(1, 11):
            parts = parts_of(range(n), processes)
            assert [k for part in parts for k in part] == list(range(n))
            assert len(parts) == min(n, processes)
            sizes = [len(part) for part in parts]
            assert max(sizes) - min(sizes) <= 1


def test_the_last_bit_counts() -> None:
    stop = compensate_module.WindowState()
    places = np.full((1, 6), 0.1)
    one = replace(stop, planned=replace(stop.planned, q=places))
    other = replace(stop, planned=replace(stop.planned, q=np.nextafter(places, 1.0)))
    assert identical(one, replace(stop, planned=replace(stop.planned, q=places.copy())))
    for unlike in (other, stop, None, replace(one, doubtful=True)):
        assert not identical(one, unlike)


def test_rounding_leaves_the_rest_of_a_stop_alone() -> None:
    stop = compensate_module.WindowState(doubtful=True)
    stop = replace(stop, planned=replace(stop.planned, q=np.full((1, 6), 1 / 3)))
    found = parallel.rounded(stop)
    assert found.doubtful and len(found.corrected.wanted) == 0
    assert 0 < np.abs(found.planned.q - 1 / 3).max() <= 0.5 * 10.0**-parallel.DIGITS


@pytest.fixture
def job(bench_cell, bench_model, monkeypatch):
    monkeypatch.setattr(cuts, "LEAST", LEAST)
    monkeypatch.setattr(cuts, "RUN_UP", RUN_UP)
    monkeypatch.setattr(made, "ROW", 40)
    monkeypatch.setattr(made, "ROWS", 5)

    def run(kind: str, processes: int) -> Outcome:
        program = made.KINDS[kind](900)
        return compensate(
            program.source,
            bench_cell,
            bench_model,
            name=program.name,
            variables=program.variables,
            processes=processes,
        )

    return run


def assert_alike(a: Outcome, b: Outcome) -> None:
    assert a.outputs == b.outputs
    assert "".join(a.record.to_json()) == "".join(b.record.to_json())
    assert identical(a.decisions, b.decisions)
    assert (a.before, a.after) == (b.before, b.after)
    assert list(map(str, a.diagnostics)) == list(map(str, b.diagnostics))


@pytest.mark.parametrize("kind", ["milling", "spot", "drilling", "handling"])
def test_programs_come_out_as_from_one_process(job, monkeypatch, kind: str) -> None:
    right = []

    def watched(foretold, stop) -> bool:
        same = identical(foretold, stop)
        if isinstance(stop, compensate_module.WindowState):
            right.append(same)
        return same

    alone = job(kind, 1)
    monkeypatch.setattr(parallel, "identical", watched)
    assert_alike(job(kind, 3), alone)
    assert right == [True, True]


def test_and_where_the_wrong_place_was_foretold(job, monkeypatch) -> None:
    alone = job("drilling", 1)
    nowhere = compensate_module.WindowState()
    monkeypatch.setattr(compensate_module._WindowWork, "foretell", lambda *_: nowhere)
    assert_alike(job("drilling", 3), alone)
