"""Conditions of a run: alone on its tree, with room, and stopped in good order."""

from __future__ import annotations

import fcntl
import os
import shutil
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from postproc.exceptions import DiskFullError, OutputError
from postproc.files import TEMPORARY, disk_error

ROOM = 2.5  # bytes written for a byte of source: the program and its record
SPARE = 16_000_000  # bytes left over for the log and for others


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder for this run alone; create it where it is missing.

    The lock lies on the folder itself: nothing is left behind, and it is gone with
    this process, however that ends.

    Raises:
        OutputError: Another run holds it, or it cannot be created or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as exc:
        raise disk_error(exc, folder) from None
    if not os.access(folder, os.W_OK):
        os.close(handle)
        cure = "Give a folder that may be written to"
        raise OutputError(folder, "the folder is read-only", cure)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        problem = "another run is writing to it"
        raise OutputError(folder, problem, "Wait for its end, or stop it") from None
    try:
        yield
    finally:
        os.close(handle)


def sweep(folder: Path) -> int:
    """Remove temporary files that a killed run has left, under the lock.

    Returns:
        Bytes of all other files in the tree.
    """
    size = 0
    for parent, _, names in os.walk(folder):
        for name in names:
            path = os.path.join(parent, name)
            if name.startswith(".") and name.endswith(TEMPORARY):
                os.unlink(path)
            else:
                size += os.lstat(path).st_size
    return size


def check_room(folder: Path, sources: int, present: int) -> None:
    """Refuse to begin where the disk cannot hold the result.

    Args:
        folder: The target tree.
        sources: Bytes of the source tree.
        present: Bytes that lie in the target tree already.

    Raises:
        DiskFullError: There is too little room.
    """
    free = shutil.disk_usage(folder).free
    need = max(int(ROOM * sources) - present, 0) + SPARE
    if free < need:
        raise DiskFullError(
            folder,
            f"{free / 1e6:.0f} MB are free, about {need / 1e6:.0f} MB are needed",
            "Make room, or give a folder on another disk",
        )


class Stop:
    """Whether the user wants to stop: Ctrl-C or SIGTERM.

    The first one lets the file in hand be finished; a second one ends at once, which
    leaves no half-written file either.
    """

    def __init__(self) -> None:
        """Nobody has asked yet."""
        self.asked = False

    def __call__(self) -> bool:
        """Tell whether to stop."""
        return self.asked

    def _ask(self, number: int, frame: FrameType | None) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True


@contextmanager
def stoppable() -> Iterator[Stop]:
    """Listen to Ctrl-C and SIGTERM while the block runs."""
    stop = Stop()
    signals = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, stop._ask) for number in signals]
    try:
        yield stop
    finally:
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)
