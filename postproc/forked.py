"""Work in a forked child: it sees all that was read before, and sends what it makes.

A fork costs milliseconds and copies no page that nobody writes to, so that half of a
job can be done on another core without handing over what it works on.
"""

from __future__ import annotations

import ctypes
import gc
import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from multiprocessing import parent_process
from queue import Queue
from threading import Thread
from traceback import format_exc
from typing import IO, Any, NoReturn, TypeVar

from postproc.exceptions import PostprocError

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
def in_child(
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
        ctypes.CDLL(None).prctl(SET_PDEATHSIG, signal.SIGKILL)
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
