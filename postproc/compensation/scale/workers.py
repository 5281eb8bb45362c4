"""Windows of a program worked through by several processes, to the same bytes."""

from __future__ import annotations

import gc
import os
import pickle
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from itertools import pairwise, takewhile
from multiprocessing import parent_process
from queue import Queue
from threading import Event, Thread
from traceback import format_exc
from typing import IO, Any, NoReturn, Protocol, TypeVar

from postproc.arrays import release_memory
from postproc.compensation.options import Clock, no_progress
from postproc.exceptions import PostprocError
from postproc.operating_system import (
    ASKING,
    can_fork,
    count_cores,
    end_with_parent,
    hold_signals,
)
from postproc.threads import share_cores

# Work in a forked child: it sees all that was read before, and sends what it makes.
#
# A fork costs milliseconds and copies no page that nobody writes to, so that half of a
# job can be done on another core without handing over what it works on.

T = TypeVar("T")
K = TypeVar("K")

AHEAD = 16  # items that a child makes before anybody takes them
SIZE = 8  # bytes of the length before every message
LARGE = 1 << 20  # bytes of a message whose memory is given back at once
_ITEM, _RAISED, _END = range(3)


def available() -> int:
    """Return how many processes are worth using: the cores that we may run on.

    It is one in a process that shares its work with others already.
    """
    return count_cores() if parent_process() is None else 1


@contextmanager
def in_worker(
    work: Callable[[], Iterable[T]], ahead: int = AHEAD
) -> Iterator[Iterator[T]]:
    """Do work in a forked child that starts at once; yield what it makes, in order.

    What the work raises is raised where its items are taken. The child ends with the
    block, however that is left, and with this process, however that ends. Ctrl-C and
    SIGTERM are left to this process; nothing is flushed or cleaned up in the child.
    Where there is no room for another process, this one does the work; where a process
    cannot fork, a thread does, and shares the interpreter's lock.

    Args:
        work: Makes items that can be pickled.
        ahead: Items that wait in the child until they are taken; it pauses then.

    Raises:
        PostprocError: The child was ended from outside.
    """
    if not can_fork():
        with _in_thread(work) as items:
            yield items
        return
    parent = os.getpid()
    here, there = os.pipe()
    child: int | None = None
    try:
        with hold_signals(*ASKING):  # a child leaves them to its parent
            with suppress(OSError):  # where there is no room, the work is done here
                child = os.fork()
            if child == 0:
                os.close(here)
                _live(parent, work, there, ahead)
        os.close(there)
        with open(here, "rb") as pipe:
            yield _receive(pipe) if child else iter(work())
    finally:
        if child:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)


@contextmanager
def _in_thread(work: Callable[[], Iterable[T]]) -> Iterator[Iterator[T]]:
    """Do work in a thread, up to the item at which the block is left."""
    stop = Event()

    def do() -> list[T]:
        return list(takewhile(lambda _: not stop.is_set(), work()))

    def items() -> Iterator[T]:
        yield from done.result()

    with ThreadPoolExecutor(1) as pool:
        done = pool.submit(do)
        try:
            yield items()
        finally:
            stop.set()


def _live(
    parent: int, work: Callable[[], Iterable[T]], there: int, ahead: int
) -> NoReturn:
    """Be the child."""
    try:
        end_with_parent()
        if os.getppid() == parent:
            gc.freeze()  # pages with objects of the parent stay shared
            _make(work, there, ahead)
    finally:
        os._exit(1)


def _make(work: Callable[[], Iterable[T]], there: int, ahead: int) -> None:
    """Do the work; a thread sends what is made, so that the work goes on meanwhile."""
    messages: Queue[bytes] = Queue(ahead)
    sender = Thread(target=_send, args=(there, messages))
    sender.start()
    try:
        for item in work():
            messages.put(pickle.dumps((_ITEM, item), protocol=5))
        messages.put(pickle.dumps((_END, None)))
    except BaseException as exc:
        messages.put(_pickle_exception(exc))
    messages.put(b"")
    sender.join()


def _send(there: int, messages: Queue[bytes]) -> None:
    """Send messages up to an empty one, while somebody listens; then end the child."""
    try:
        with open(there, "wb") as pipe:
            while message := messages.get():
                pipe.write(len(message).to_bytes(SIZE, "little"))
                pipe.write(message)
                pipe.flush()
                size = len(message)
                del message
                _give_back(size)
    finally:
        os._exit(1)


def _give_back(size: int) -> None:
    """Return the room of a large message to the system, once nobody holds it."""
    if size > LARGE:
        release_memory()


def _pickle_exception(exc: BaseException) -> bytes:
    """Pickle an exception; one that cannot be is told in words."""
    exc.add_note(f"in a child process:\n{format_exc()}")
    try:
        if not isinstance(exc, Exception):
            raise TypeError("ends a process, but not the one that receives it")
        told = pickle.dumps((_RAISED, exc))
        pickle.loads(told)
    except Exception:
        lost = RuntimeError(f"{type(exc).__name__}: {exc}")
        return pickle.dumps((_RAISED, lost))
    return told


def _receive(pipe: IO[bytes]) -> Iterator[Any]:
    """Take what a child sends."""
    while True:
        size = int.from_bytes(pipe.read(SIZE), "little")
        message = pipe.read(size)
        if not size or len(message) < size:
            raise PostprocError(
                "a process that did a part of the work was ended from outside, most "
                "likely for want of memory. Free some, then run the command again"
            )
        kind, content = pickle.loads(message)
        del message
        _give_back(size)
        if kind == _RAISED:
            raise content
        if kind == _END:
            return
        yield content


# Windows of a program worked through by several processes, to the bytes of one window.
#
# A window depends on its neighbours in two ways. Forwards, over where the arm stands at
# its beginning and what the joints remember: that is known from the window before. A
# process that works ahead foretells it from many targets before; the joints take up
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


def in_processes(
    work: Work[W, D], windows: Sequence[W], clock: Clock, processes: int
) -> list[D]:
    """Work through windows, a part of them in every process.

    Args:
        work: What is to be done.
        windows: In their order.
        clock: Given the seconds of all processes.
        processes: How many at the most, this one included.

    Raises:
        PostprocError: As the work does, for the first window that fails.
    """
    own, *others = parts_of(windows, processes)
    found: list[D] = []
    with ExitStack() as children:
        children.callback(share_cores, 1)
        share_cores(1 + len(others))
        ahead = [
            children.enter_context(
                in_worker(partial(_work_ahead, work, part), len(part))
            )
            for part in others
        ]
        for window in own:
            before = found[-1] if found else None
            found.append(work.correct(window, before, clock))
        for part, made in zip(others, ahead, strict=True):
            for window, (done, stages) in zip(part, made, strict=True):
                clock.add(stages)
                if done is None:
                    done = work.correct(window, found[-1], clock)
                found.append(done)
    return _join_windows(work, list(windows), found, clock)


def parts_of(windows: Sequence[W], processes: int) -> list[Sequence[W]]:
    """Give every process its part, each one window at least.

    >>> parts_of("abcde", 2)
    ['ab', 'cde']
    """
    k = max(min(processes, len(windows)), 1)
    ends = [len(windows) * i // k for i in range(k + 1)]
    return [windows[a:b] for a, b in pairwise(ends)]


def _work_ahead(
    work: Work[W, D], part: Sequence[W]
) -> Iterator[tuple[D | None, dict[str, float]]]:
    """Work through windows, foretelling where the first begins; yield seconds too.

    What fails of an invention tells nothing: from there on there is nothing to yield.
    """
    before: D | None = None
    lost = False
    for window in part:
        clock = Clock(no_progress)
        if not lost:
            try:
                before = work.correct(window, before, clock)
            except Exception:
                lost = True
        yield None if lost else before, clock.stages


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
