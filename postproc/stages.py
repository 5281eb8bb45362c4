"""What is being done, told to a person who waits; others load nothing for it."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

from postproc.exceptions import printable

PATIENCE = 2.0  # [s] before a person is shown what is being done


@contextmanager
def stages(out: TextIO | None = None) -> Iterator[Callable[[str], None]]:
    """Show what is being done when it lasts, on a terminal only.

    Args:
        out: Where to; default: stderr.

    Yields:
        A function to be told the name of every stage.
    """
    out = out or sys.stderr
    if not out.isatty():
        yield lambda stage: None
        return
    told = _Told(out)
    timer = threading.Timer(PATIENCE, told.show)
    timer.daemon = True
    timer.start()
    try:
        yield told
    finally:
        timer.cancel()
        timer.join()  # it may be about to show something
        told.hide()


class _Told:
    """The stage that was told last, shown from some time on."""

    def __init__(self, out: TextIO) -> None:
        self._out, self._stage = out, "starting"
        self._update: Callable[[str], None] = lambda stage: None
        self.hide: Callable[[], None] = lambda: None

    def __call__(self, stage: str) -> None:
        self._stage = printable(stage)
        self._update(self._stage)

    def show(self) -> None:
        """Begin to show it."""
        from postproc.report.terminal import (
            show_status,  # slow to load, and seldom wanted
        )

        self._update, self.hide = show_status(self._out, self._stage)
        self._update(self._stage)  # another one may have been told just now
