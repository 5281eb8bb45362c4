"""What operating systems differ in: signals, locks, processes, rights, folders.

No other module asks which system this is, or uses what only one of them has.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from multiprocessing.context import BaseContext


def _signals(*names: str) -> tuple[signal.Signals, ...]:
    """Return those signals that this system has."""
    return tuple(getattr(signal, n) for n in names if hasattr(signal, n))


# Signals.

ASKING = _signals("SIGINT", "SIGTERM", "SIGBREAK")  # a user asks a command to stop
ENDING = (*ASKING, *_signals("SIGHUP"))  # they end a process that nobody handles

_SET_PDEATHSIG = 1  # of prctl(2): the signal that the death of the parent sends


@contextmanager
def hold_signals(*numbers: signal.Signals) -> Iterator[None]:
    """Let signals wait for the end of a block, where the system can."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, numbers)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


# Processes.


def can_fork() -> bool:
    """Return True if a process with threads may fork: on Linux."""
    return sys.platform == "linux"


def count_cores() -> int:
    """Return the number of cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def end_with_parent() -> None:
    """Let the system kill this process when its parent ends, on Linux."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(_SET_PDEATHSIG, signal.SIGKILL)


def start_worker_server(module: str) -> BaseContext:
    """Return how worker processes begin, and do not wait for anything.

    Where there is a fork, workers are forked from a process that has loaded a module
    already, and that is started here. Elsewhere every worker loads it by itself.

    Args:
        module: Name of the module.
    """
    import multiprocessing

    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    from multiprocessing import forkserver, resource_tracker

    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([module])
    # Ctrl-C goes to the whole group, and is for us to answer. The tracker comes first:
    # starting it ends all blocking of that signal.
    resource_tracker.ensure_running()
    with hold_signals(signal.SIGINT):
        forkserver.ensure_running()
    return context


# Files and folders.

_OTHERS_WRITE = 0o022  # permission bits of group and others
LOCK = ".postproc-lock"  # in a folder that is locked, where a folder itself cannot be


def set_mode(file: IO[bytes], mode: int) -> None:
    """Give an open file its permission bits, where the system has them."""
    if sys.platform != "win32":
        os.fchmod(file.fileno(), mode)


def sync_folder(folder: Path) -> None:
    """Make renames in a folder durable, where a folder can be opened."""
    if sys.platform != "win32":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def is_private(status: os.stat_result) -> bool:
    """Return True if only this user can write to a file or a folder.

    Windows has no such bits: a folder of the user's profile is the user's own.
    """
    if sys.platform == "win32":
        return True
    return status.st_uid == os.geteuid() and not status.st_mode & _OTHERS_WRITE


if sys.platform == "win32":
    import msvcrt

    def _open_lock(folder: Path) -> int:
        return os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_TEMPORARY)

    def _take_lock(handle: int) -> None:
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def _open_lock(folder: Path) -> int:
        return os.open(folder, os.O_RDONLY | os.O_DIRECTORY)

    def _take_lock(handle: int) -> None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def lock_folder(folder: Path) -> Callable[[], None] | None:
    """Lock a folder for this process, until it ends or unlocks it; leave nothing there.

    The lock lies on the folder itself. On Windows it lies on a file in it, which the
    system removes when the process that has opened it ends, however that is.

    Args:
        folder: An existing folder.

    Returns:
        How to unlock it; None where another process holds it.

    Raises:
        OSError: The folder cannot be opened.
    """
    try:
        handle = _open_lock(folder)
    except PermissionError:
        if (folder / LOCK).exists():  # it goes away just now
            return None
        raise
    try:
        _take_lock(handle)
    except OSError:
        os.close(handle)
        return None
    return lambda: os.close(handle)


# Consoles.


def print_any_text(*streams: TextIO | None) -> None:
    """Let a stream write a question mark for what its encoding lacks, as cp1252 does.

    A console of Windows, or a file that output is sent to there, has 256 characters.
    """
    for stream in streams:
        with suppress(AttributeError, ValueError, OSError):
            if stream is not None and stream.errors == "strict":
                stream.reconfigure(errors="replace")  # type: ignore[attr-defined]


# Disks.

_SHARED = ("nfs", "cifs", "smb", "fuse.sshfs", "9p", "afs", "ceph", "gluster", "lustre")
_REMOTE = 4  # of GetDriveTypeW: a drive of the network


def is_shared_disk(path: Path) -> bool:
    """Return True if a place is known to lie on a disk of the network."""
    place = path.absolute().parent
    if sys.platform == "win32":
        import ctypes

        return bool(ctypes.windll.kernel32.GetDriveTypeW(place.anchor) == _REMOTE)
    try:
        mounts = Path("/proc/mounts").read_text("utf-8", "replace").splitlines()
    except OSError:
        return False
    found = [line.split()[1:3] for line in mounts if len(line.split()) > 2]
    around = [(len(at), kind) for at, kind in found if place.is_relative_to(at)]
    return max(around, default=(0, ""))[1].startswith(_SHARED)
