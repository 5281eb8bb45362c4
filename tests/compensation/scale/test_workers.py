"""Several processes do what one would have done."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from itertools import pairwise
from threading import Event, get_ident

import numpy as np
import pytest

from postproc.compensation.options import Clock, no_progress
from postproc.compensation.scale import workers
from postproc.compensation.scale.workers import in_processes, parts_of
from postproc.exceptions import PostprocError

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="one process does it where there is no fork"
)


@dataclass(frozen=True)
class Part:
    """What came of a number: the sum so far, who did it, and from which sum."""

    number: int
    end: int
    who: int
    begin: int


@dataclass(frozen=True)
class Sum:
    """Adds up numbers; windows are tuples of them, by their places."""

    numbers: tuple[int, ...]
    off: int = 0  # what foretelling is wrong by
    breaks_at: int = -1
    apart: int = -1  # a cut at which both sides never agree

    def correct(self, window, before, clock) -> Part:
        with clock("add"):
            foretold = sum(self.numbers[: window[0]])
            begin = before.end if before else foretold + (self.off if window[0] else 0)
            if self.breaks_at in window:
                raise PostprocError(f"{self.breaks_at} from {begin}")
            end = begin + sum(self.numbers[k] for k in window)
        return Part(window[0], end, os.getpid(), begin)

    def whole(self):
        return [tuple(range(len(self.numbers)))]

    def joins(self, before: Part, after: Part) -> bool:
        return before.end == after.begin and after.number != self.apart

    def merge(self, windows, cut):
        return [
            *windows[: cut - 1],
            windows[cut - 1] + windows[cut],
            *windows[cut + 1 :],
        ]


NUMBERS = (3, 1, 4, 1, 5, 9, 2)


def run(work: Sum, processes: int, clock: Clock | None = None) -> list[Part]:
    rows = [(k,) for k in range(len(work.numbers))]
    return in_processes(work, rows, clock or Clock(no_progress), processes)


@pytest.mark.parametrize("processes", [1, 2, 3, 7, 20])
def test_results_come_in_order_and_from_others(processes: int) -> None:
    found = run(Sum(NUMBERS), processes)
    assert [part.end for part in found] == np.cumsum(NUMBERS).tolist()
    workers = [part.who for part in found]
    assert len(set(workers)) == min(processes, len(NUMBERS))
    assert workers[0] == os.getpid()
    assert sum(a != b for a, b in pairwise(workers)) == len(set(workers)) - 1


def test_what_was_foretold_wrong_is_done_again() -> None:
    found = run(Sum(NUMBERS, off=1), 3)
    assert [part.end for part in found] == np.cumsum(NUMBERS).tolist()
    assert {part.who for part in found} == {os.getpid()}


def test_where_two_sides_never_agree_they_become_one_window() -> None:
    for processes in (1, 3):
        found = run(Sum(NUMBERS, apart=4), processes)
        assert [part.number for part in found] == [0, 1, 2, 3, 5, 6]
        assert found[-1].end == sum(NUMBERS)


@pytest.mark.parametrize("window", range(len(NUMBERS)))
def test_the_first_failure_is_told_from_where_the_work_really_stood(window) -> None:
    begin = sum(NUMBERS[:window])
    for processes in (1, 3):
        with pytest.raises(PostprocError, match=f"{window} from {begin}$"):
            run(Sum(NUMBERS, breaks_at=window), processes)


def test_threads_do_it_where_there_is_no_fork(monkeypatch) -> None:
    monkeypatch.setattr(workers, "can_fork", lambda: False)
    monkeypatch.setattr(os, "getpid", get_ident)
    for numbers in (NUMBERS, NUMBERS[:1]):
        found = run(Sum(numbers), 3)
        assert [part.end for part in found] == np.cumsum(numbers).tolist()
        assert len({part.who for part in found}) == min(3, len(numbers))


def test_threads_stop_where_the_first_window_fails(monkeypatch) -> None:
    begun: list[int] = []

    class Slow(Sum):
        def correct(self, window, before, clock) -> Part:
            begun.append(window[0])
            if window[0]:
                failed.wait(20.0)
                return Part(window[0], 0, 0, 0)
            try:
                raise KeyboardInterrupt
            finally:
                failed.set()

    failed = Event()
    monkeypatch.setattr(workers, "can_fork", lambda: False)
    with pytest.raises(KeyboardInterrupt):
        run(Slow(NUMBERS), 2)
    assert len(begun) < len(NUMBERS)


def test_seconds_of_all_processes_are_added() -> None:
    clock = Clock(no_progress)
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
