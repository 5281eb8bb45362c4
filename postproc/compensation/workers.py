"""Windows of a program worked through by several threads, to the same bytes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import pairwise
from multiprocessing import parent_process
from threading import Event, Thread
from typing import Protocol, TypeVar

from postproc.compensation.options import Clock, no_progress
from postproc.operating_system import count_cores

T = TypeVar("T")


def available() -> int:
    """Return how many threads are worth using: one for a core that we may run on.

    It is one in a process that shares its work with others already.
    """
    return count_cores() if parent_process() is None else 1


# Windows of a program worked through by several threads, to the bytes of one window.
#
# A window depends on its neighbours in two ways. Forwards, over where the arm stands at
# its beginning and what the joints remember: that is known from the window before. A
# thread that works ahead foretells it from many targets before; the joints take up
# their play within a few moves, and what was before is forgotten. Both ways, over what
# acts on the targets next to it: that is what halos are for. Both are checked: at every
# cut the windows before and behind must have found the same at the targets on both
# sides, round by round. Whatever rule makes a target depend on the ones next to it then
# holds at all targets, as in one window, so that the result is that of one window.
# Where something does not agree, a window is worked through again from what is known
# now; where that does not help, something reaches farther than a halo, and the windows
# on both sides become one.

W = TypeVar("W")
D = TypeVar("D")

AGAIN = 3  # times that a window is worked through again, at the most
MERGES = 8  # times that windows become one, before all of them do


class Work(Protocol[W, D]):
    """What is done with windows W, each for a result D."""

    def correct(self, window: W, before: D | None, clock: Clock) -> D:
        """Work through one window.

        Args:
            window: The window.
            before: What came of the one before; None: not known, or it is the first.
            clock: Given the seconds.
        """

    def whole(self) -> list[W]:
        """Return the program as one window."""

    def joins(self, before: D, after: D) -> bool:
        """Tell whether two windows found the same at the cut between them."""

    def merge(self, windows: Sequence[W], cut: int) -> list[W]:
        """Make one window of those on both sides of a cut, and what goes on there."""


def in_threads(
    work: Work[W, D], windows: Sequence[W], clock: Clock, threads: int
) -> list[D]:
    """Work through windows, a part of them in every thread.

    Args:
        work: What is to be done.
        windows: In their order.
        clock: Given the seconds of all threads.
        threads: How many at the most, this one included.

    Raises:
        PostprocError: As the work does, for the first window that fails.
    """
    own, *others = parts_of(windows, threads)
    found: list[D] = []
    stop = Event()
    with ThreadPoolExecutor(len(others) or 1) as pool:
        try:
            ahead = [pool.submit(_work_ahead, work, part, stop) for part in others]
            for window in own:
                found.append(work.correct(window, found[-1] if found else None, clock))
            for part, made in zip(others, ahead, strict=True):
                for window, (done, stages) in zip(part, made.result(), strict=True):
                    clock.add(stages)
                    if done is None:
                        done = work.correct(window, found[-1], clock)
                    found.append(done)
        finally:
            stop.set()
    return _join_windows(work, list(windows), found, clock)


def parts_of(windows: Sequence[W], processes: int) -> list[Sequence[W]]:
    """Give every thread its part, each one window at least.

    >>> parts_of("abcde", 2)
    ['ab', 'cde']
    """
    k = max(min(processes, len(windows)), 1)
    ends = [len(windows) * i // k for i in range(k + 1)]
    return [windows[a:b] for a, b in pairwise(ends)]


def _work_ahead(
    work: Work[W, D], part: Sequence[W], stop: Event
) -> list[tuple[D | None, dict[str, float]]]:
    """Work through windows, foretelling where the first begins; return seconds too.

    What fails of an invention tells nothing: from there on there is nothing to return.
    """
    found: list[tuple[D | None, dict[str, float]]] = []
    before: D | None = None
    lost = False
    for window in part:
        clock = Clock(no_progress)
        lost = lost or stop.is_set()
        if not lost:
            try:
                before = work.correct(window, before, clock)
            except Exception:
                lost = True
        found.append((None if lost else before, clock.stages))
    return found


def _join_windows(
    work: Work[W, D], windows: list[W], found: list[D], clock: Clock
) -> list[D]:
    """Work through windows again until all of them agree."""
    tries, merges = dict.fromkeys(windows, 0), 0
    while True:
        again, cut = _again(work, windows, found, tries, clock)
        if cut is None and not again:
            return found
        if cut is None:
            continue
        merges += 1
        old = dict(zip(windows, found, strict=True))
        windows = work.merge(windows, cut) if merges < MERGES else work.whole()
        tries.update({w: tries.get(w, 0) for w in windows})
        found = []
        for window in windows:
            before = found[-1] if found else None
            done = old.get(window)
            if done is None:
                done = work.correct(window, before, clock)
            found.append(done)


def _again(
    work: Work[W, D],
    windows: Sequence[W],
    found: list[D],
    tries: dict[W, int],
    clock: Clock,
) -> tuple[bool, int | None]:
    """Work through those windows again that do not agree, in place.

    Returns:
        Whether there were any, and the first one that does not agree whatever is done.
    """
    again = False
    for k, window in enumerate(windows[1:], start=1):
        if work.joins(found[k - 1], found[k]):
            continue
        if tries[window] == AGAIN:
            return again, k
        tries[window] += 1
        found[k], again = work.correct(window, found[k - 1], clock), True
        if not work.joins(found[k - 1], found[k]):
            tries[window] = AGAIN
    return again, None


# Work beside other work that leaves the interpreter's lock alone.


def at_once(work: Callable[[], T]) -> Callable[[], T]:
    """Do work; return how to ask for its result, as `in_background` does."""
    done = work()
    return lambda: done


def in_background(work: Callable[[], T]) -> Callable[[], T]:
    """Begin work that nothing waits for yet; return how to ask for its result.

    Args:
        work: What to do; what it raises is raised when its result is asked for.
    """
    future = Future[T]()

    def run() -> None:
        try:
            future.set_result(work())
        except BaseException as problem:
            future.set_exception(problem)

    Thread(target=run, daemon=True).start()
    return future.result
