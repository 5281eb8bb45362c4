"""Pipes and devices of our own, for tests of what is no regular file."""

from __future__ import annotations

import os
import threading
from contextlib import contextmanager
from pathlib import Path


def made_pipe(path: Path) -> Path:
    """Make a pipe with a name."""
    os.mkfifo(path)
    return path


@contextmanager
def made_device():
    """Make a terminal of our own: a device that bytes pass through."""
    ours, theirs = os.openpty()
    yield Path(os.ttyname(theirs))
    os.close(ours)
    os.close(theirs)


@contextmanager
def reading(path):
    """Read a pipe in a thread; yield the list that its bytes come into."""
    found = []
    thread = threading.Thread(target=lambda: found.append(path.read_bytes()))
    thread.start()
    yield found
    thread.join(timeout=60)


def feed(path, data):
    """Write into a pipe in a thread."""
    threading.Thread(target=path.write_bytes, args=(data,), daemon=True).start()
