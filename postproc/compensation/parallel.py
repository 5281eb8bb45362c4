"""Windows of a program worked through by several processes, to the same bytes."""

from __future__ import annotations

import ctypes
import gc
import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import fields, is_dataclass, replace
from functools import partial
from itertools import pairwise
from multiprocessing import parent_process
from queue import Queue
from threading import Thread
from traceback import format_exc
from typing import IO, Any, NoReturn, Protocol, TypeVar, cast

import numpy as np

from postproc.arrays import Map
from postproc.compensation.options import Clock, silent
from postproc.exceptions import PostprocError

# Work in a forked child: it sees all that was read before, and sends what it makes.
#
# A fork costs milliseconds and copies no page that nobody writes to, so that half of a
# job can be done on another core without handing over what it works on.

T = TypeVar("T")

AHEAD = 16  # items that a child makes before anybody takes them
SET_PDEATHSIG = 1  # of prctl(2): the signal that the death of the parent sends
ASKED = frozenset({signal.SIGINT, signal.SIGTERM})  # a child leaves them to its parent
SIZE = 8  # bytes of the length before every message
_ITEM, _RAISED, _END = range(3)


def can_fork() -> bool:
    """Tell whether this process may have forked children: on Linux."""
    return sys.platform == "linux"


def available() -> int:
    """Return how many processes are worth using: the cores that we may run on.

    It is one where there is no fork, and in a process that shares its work with others
    already.
    """
    if not can_fork() or parent_process() is not None:
        return 1
    return len(os.sched_getaffinity(0))


@contextmanager
def in_worker(
    work: Callable[[], Iterable[T]], ahead: int = AHEAD
) -> Iterator[Iterator[T]]:
    """Do work in a forked child that starts at once; yield what it makes, in order.

    What the work raises is raised where its items are taken. The child ends with the
    block, however that is left, and with this process, however that ends. Ctrl-C and
    SIGTERM are left to this process; nothing is flushed or cleaned up in the child.
    Where there is no room for another process, this one does the work.

    Args:
        work: Makes items that can be pickled.
        ahead: Items that wait in the child until they are taken; it pauses then.

    Raises:
        PostprocError: The child was ended from outside.
    """
    parent = os.getpid()
    here, there = os.pipe()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ASKED)
    child = _fork()
    if child == 0:
        os.close(here)
        _live(parent, work, there, ahead)
    try:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        os.close(there)
        with open(here, "rb") as pipe:
            yield _taken(pipe) if child else iter(work())
    finally:
        if child:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)


def _fork() -> int | None:
    """Fork, where there is room; return the child, 0 in it."""
    try:
        return os.fork()
    except OSError:
        return None


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


def end_with_parent() -> None:
    """Let the system kill this process when its parent ends, on Linux."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(SET_PDEATHSIG, signal.SIGKILL)


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
        messages.put(_told(exc))
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
    finally:
        os._exit(1)


def _told(exc: BaseException) -> bytes:
    """Pickle an exception; one that cannot be is told in words."""
    exc.add_note(f"in a child process:\n{format_exc()}")
    try:
        if not isinstance(exc, Exception):
            raise TypeError("ends a process, but not the one that is told")
        told = pickle.dumps((_RAISED, exc))
        pickle.loads(told)
    except Exception:
        lost = RuntimeError(f"{type(exc).__name__}: {exc}")
        return pickle.dumps((_RAISED, lost))
    return told


def _taken(pipe: IO[bytes]) -> Iterator[Any]:
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
        if kind == _RAISED:
            raise content
        if kind == _END:
            return
        yield content


# Windows of a program worked through by several processes, to the same bytes.
#
# A window depends on those before only through where the arm stands at its beginning. A
# process that works ahead foretells that from the targets right before: the joints take
# up their play within a few moves, and what was before is forgotten. Whether it was
# right, to the last bit, is seen when the windows before are done; where it was not,
# its windows are done again from where the arm does stand. So the result is that of one
# process.

W_contra = TypeVar("W_contra", contravariant=True)
K_co = TypeVar("K_co", covariant=True)
W = TypeVar("W")
S = TypeVar("S")
K = TypeVar("K")

DIGITS = 12  # of [rad] and [m]: sums in blocks of other lengths differ behind these


class Work(Protocol[W_contra, S, K_co]):
    """What is done with windows W, between stops S, for results K."""

    def correct(self, window: W_contra, begin: S, clock: Clock) -> tuple[K_co, S]:
        """Work through one window; return its result, and how it ends."""

    def foretell(self, window: W_contra) -> S | None:
        """Tell from where a window will begin; None where that cannot be told."""


def in_processes(
    work: Work[W, S, K],
    windows: Sequence[W],
    begin: S,
    clock: Clock,
    processes: int,
) -> Iterator[K]:
    """Work through windows, a part of them in every process; yield the results.

    Args:
        work: What is to be done.
        windows: In their order.
        begin: From where the first one begins.
        clock: Given the seconds of all processes.
        processes: How many at the most, this one included.

    Raises:
        PostprocError: As the work does, for the first window that fails.
    """
    own, *others = parts_of(windows, processes if can_fork() else 1)
    with ExitStack() as children:
        ahead = [
            children.enter_context(
                in_worker(partial(_speculate, work, part), len(part) + 1)
            )
            for part in others
        ]
        stop = begin
        for window in own:
            kept, stop = work.correct(window, stop, clock)
            yield kept
        for part, found in zip(others, ahead, strict=True):
            right = identical(next(found), stop)
            for window in part:
                if right:
                    kept, stop, seconds = next(found)
                    clock.add(seconds)
                else:
                    kept, stop = work.correct(window, stop, clock)
                yield kept


def parts_of(windows: Sequence[W], processes: int) -> list[Sequence[W]]:
    """Give every process its part, each one window at least.

    >>> parts_of("abcde", 2)
    ['ab', 'cde']
    """
    k = max(min(processes, len(windows)), 1)
    ends = [len(windows) * i // k for i in range(k + 1)]
    return [windows[a:b] for a, b in pairwise(ends)]


def _speculate(work: Work[W, S, K], part: Sequence[W]) -> Iterator[Any]:
    """Foretell where some windows begin, and work through them; yield both.

    First the stop that was foretold, or None; then, for every window, its result, its
    end and the seconds of its stages.
    """
    stop = work.foretell(part[0])
    yield stop
    if stop is None:
        return
    for window in part:
        clock = Clock(silent)
        kept, stop = work.correct(window, stop, clock)
        yield kept, stop, clock.stages


def rounded(stop: S) -> S:
    """Round a tree of dataclasses and arrays to `DIGITS`."""
    found: Any = stop
    if isinstance(found, np.ndarray):
        found = np.round(found, DIGITS)
    elif is_dataclass(found) and not isinstance(found, type):
        own = {f.name: rounded(getattr(found, f.name)) for f in fields(found)}
        found = replace(found, **own)
    return cast(S, found)


def identical(a: Any, b: Any) -> bool:
    """Tell whether two trees of dataclasses and arrays agree, to the last bit."""
    if type(a) is not type(b):
        return False
    if is_dataclass(a) and is_dataclass(b):
        return all(identical(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, np.ndarray):
        if a.dtype != b.dtype or a.shape != b.shape:
            return False
        return a.tobytes() == np.asarray(b).tobytes()
    return bool(a == b)


# Long work on two cores: some of it in a forked child, the results as if it were not.
#
# What is short is done here: a child would cost more than it gains.

LONG = 20  # tasks from which on they are shared out


def map_with(processes: int) -> Map:
    """Return how to make something of every task with so many processes at most."""
    return map if processes < 2 else parallel_map


def parallel_map(
    make: Callable[[K], T], tasks: Sequence[K], every: int = 2
) -> Iterator[T]:
    """Make something of every task, in order.

    Both processes go through the tasks together, so that neither holds much of what
    the other has to wait for.

    Args:
        make: Makes it; a child does so for most tasks, and sends what it made.
        tasks: Each is worth some milliseconds.
        every: Every second, third.. task is done here; more of them leave more time
            here for what is done with the results.
    """
    if len(tasks) < LONG or available() < 2:
        yield from map(make, tasks)
        return
    theirs = [task for number, task in enumerate(tasks) if number % every]
    with in_worker(lambda: map(make, theirs)) as made:
        for number, task in enumerate(tasks):
            yield next(made) if number % every else make(task)


@contextmanager
def in_background(work: Callable[[], T], *, worth: bool) -> Iterator[Callable[[], T]]:
    """Begin work that nothing waits for yet; yield how to ask for its result, once.

    Args:
        work: What to do; what it raises is raised when its result is asked for.
        worth: It takes long enough for a process of its own.
    """
    if not worth or available() < 2:
        yield work
        return
    with in_worker(lambda: [work()]) as made:
        yield lambda: next(made)
