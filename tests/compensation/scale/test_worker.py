"""Work in a forked child: the same items and errors, and nobody left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from postproc.compensation.scale import workers
from postproc.compensation.scale.workers import available, in_worker
from postproc.exceptions import PostprocError, ProgramError

PATIENCE = 20.0  # [s] until a process must be gone or be there

SCRIPT = """
import os, sys, time
from postproc.compensation.scale.workers import in_worker

def work():
    print("never flushed", end="")
    yield os.getpid()
    while True:
        time.sleep(0.01)

print("once")
with in_worker(work) as items:
    sys.stderr.write(f"{next(items)}\\n")
    next(items)
"""


def until(true: Callable[[], bool]) -> None:
    """Wait until something is true."""
    end = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


def is_gone(process: int) -> bool:
    """Tell whether a process has ended (a zombie has)."""
    try:
        stat = Path(f"/proc/{process}/stat").read_text(encoding="ascii")
    except FileNotFoundError:
        return True
    return stat.rpartition(")")[2].split()[0] == "Z"


def children() -> set[str]:
    """Name the children that were not waited for; other tests may have left servers."""
    tasks = Path("/proc/self/task").glob("*/children")
    return {name for task in tasks for name in task.read_text(encoding="ascii").split()}


def test_items_arrive_in_order_and_whole() -> None:
    big = np.random.default_rng(1).random((300, 1000))
    seen = {"what was read": [big]}

    def work() -> Iterator[object]:
        assert os.getpid() != parent
        yield seen["what was read"][0][::2]
        yield from range(100)
        seen.clear()  # here only

    parent = os.getpid()
    before = children()
    with in_worker(work) as items:
        first, *rest = items
    np.testing.assert_array_equal(first, big[::2])
    assert rest == list(range(100)) and seen
    assert children() <= before


def test_child_works_ahead_as_far_as_it_may(tmp_path) -> None:
    def work() -> Iterator[bytes]:
        for k in range(40):
            (tmp_path / str(k)).touch()
            yield bytes(1_000_000)  # no pipe holds one

    def made() -> int:
        return len(list(tmp_path.iterdir()))

    with in_worker(work, ahead=5) as items:
        until(lambda: made() == 7)  # five wait, one is being sent, one is held
        time.sleep(0.1)
        assert made() == 7
        assert sum(map(len, items)) == 40_000_000


@pytest.mark.parametrize(
    "error",
    [
        ProgramError("a.pdl", "is odd", "Mend it", line=3, column=5),
        KeyError("name"),
        MemoryError(),
        OSError(28, "No space left on device"),
    ],
)
def test_errors_arrive_with_all_they_carry(error) -> None:
    def work() -> Iterator[int]:
        yield 1
        raise error

    with in_worker(work) as items:
        assert next(items) == 1
        with pytest.raises(type(error)) as caught:
            next(items)
    told = dict(vars(caught.value))
    assert "raise error" in told.pop("__notes__")[0]
    assert (str(caught.value), told) == (str(error), vars(error))


def test_error_that_cannot_be_pickled_is_told_in_words() -> None:
    class OwnError(Exception):
        pass

    def work() -> Iterator[int]:
        raise OwnError("of a kind that nobody else knows")
        yield

    with in_worker(work) as items, pytest.raises(RuntimeError, match="OwnError: of a"):
        next(items)


def test_item_that_cannot_be_pickled_is_an_error() -> None:
    with in_worker(lambda: iter([lambda: 0])) as items:
        with pytest.raises(Exception, match="pickle"):
            next(items)


def test_child_that_is_killed_is_an_error_with_a_cure() -> None:
    def work() -> Iterator[int]:
        yield 1
        os.kill(os.getpid(), signal.SIGKILL)
        yield 2

    before = children()
    with in_worker(work) as items, pytest.raises(PostprocError, match="memory"):
        list(items)
    assert children() <= before


@pytest.mark.parametrize("error", [None, KeyboardInterrupt, BrokenPipeError])
def test_child_ends_with_the_block(error) -> None:
    def work() -> Iterator[int]:
        yield os.getpid()
        while True:
            yield 0

    def leave() -> Iterator[int]:
        with in_worker(work) as items:
            yield next(items)
            if error:
                raise error

    run = leave()
    child = next(run)
    with pytest.raises(error or StopIteration):
        next(run)
    assert not Path(f"/proc/{child}").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_child_ends_with_its_parent(number) -> None:
    run = subprocess.Popen(
        [sys.executable, "-c", SCRIPT],
        env={k: v for k, v in os.environ.items() if k != "PYTHONUNBUFFERED"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    child = int(run.stderr.readline())
    run.send_signal(number)
    out, said = run.communicate(timeout=PATIENCE)  # the child holds both ends, too
    until(lambda: is_gone(child))
    assert run.returncode == -number
    assert out in (b"once\n", b"")  # a killed process flushes nothing
    assert said.count(b"Traceback") == (number == signal.SIGINT)  # the parent's own


def test_signals_to_all_are_left_to_the_parent(tmp_path) -> None:
    def work() -> Iterator[int]:
        yield os.getpid()
        until((tmp_path / "sent").exists)
        yield from range(3)

    with in_worker(work) as items:
        child = next(items)
        os.kill(child, signal.SIGINT)
        os.kill(child, signal.SIGTERM)
        (tmp_path / "sent").touch()
        assert list(items) == [0, 1, 2]
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_without_room_for_a_process_the_work_is_done_here(monkeypatch) -> None:
    def refuse() -> int:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(os, "fork", refuse)
    with in_worker(lambda: iter([os.getpid()])) as items:
        assert list(items) == [os.getpid()]
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_processes_worth_using(monkeypatch) -> None:
    own = len(os.sched_getaffinity(0))
    assert available() == own
    monkeypatch.setattr(workers, "parent_process", object)  # a worker of others
    assert available() == 1
