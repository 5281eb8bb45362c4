"""Workers on this machine: processes that are given every cell and model once."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool

from postproc import __version__
from postproc.batch.crew import Working
from postproc.batch.pace import Chunk
from postproc.batch.server import start_server
from postproc.batch.setup import Setup
from postproc.batch.task import Result
from postproc.batch.work import run_tasks

_setups: Sequence[Setup] = ()


class LocalCrew:
    """Worker processes of this machine.

    They are forked from a clean server process that has loaded the package already:
    no lock or thread of this process is copied, and a new worker is there at once.
    """

    losses: tuple[type[BaseException], ...] = (BrokenProcessPool,)

    def __init__(self, setups: Sequence[Setup], jobs: int) -> None:
        """Start workers.

        Args:
            setups: What units mean by their `setup`.
            jobs: Number of processes.
        """
        self._setups, self._jobs = tuple(setups), jobs
        self._context = start_server()
        self._before = set(multiprocessing.active_children())
        self._pool = self._open()

    def _open(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            self._jobs, self._context, initializer=_begin, initargs=(self._setups,)
        )

    def lanes(self) -> int:
        """Return the number of processes."""
        return self._jobs

    def submit(self, chunk: Chunk) -> Working:
        """Give a chunk to a process."""
        return self._pool.submit(_run, chunk)

    def renew(self) -> None:
        """Start new processes: a pool that lost one is of no use."""
        self.close()
        self._pool = self._open()

    def close(self) -> None:
        """End the processes; what they were doing is lost."""
        own = set(multiprocessing.active_children()) - self._before
        # The pool's own thread must have ended before the interpreter does: both would
        # close the same pipe. It ends when the processes have, so wait beside it.
        ending = threading.Thread(
            target=self._pool.shutdown, kwargs={"cancel_futures": True}
        )
        ending.start()
        for process in own:
            process.terminate()
        for process in own:
            process.join()
        ending.join()


def _begin(setups: Sequence[Setup]) -> None:
    """Make a new process a worker."""
    global _setups
    _setups = setups
    # Ctrl-C goes to the whole group: the parent decides what becomes of us.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_follow_parent, daemon=True).start()


def _follow_parent() -> None:
    """End when the parent does, killed or not: nobody else would end us."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run(chunk: Chunk) -> list[Result]:
    """Do a chunk in a worker."""
    return run_tasks(chunk, _setups[chunk[0].unit.setup], __version__)
