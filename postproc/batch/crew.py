"""Giving chunks to workers, here or on a cluster, and taking back what they did."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from typing import Protocol

from postproc import __version__
from postproc.batch.pace import Chunk, Pace, chunks
from postproc.batch.task import Result, Task, failed
from postproc.exceptions import PostprocError

WAIT = 0.2  # [s] between two looks at whether the user wants to stop
AHEAD = 2  # chunks for every worker: one in work, one at hand
_LOST = "its worker died over it twice: too little memory, or a defect of a library"

Working = Future[list[Result]]


class Crew(Protocol):
    """Workers that take chunks.

    Attributes:
        losses: What a future raises when its worker was lost.
    """

    losses: tuple[type[BaseException], ...]

    def lanes(self) -> int:
        """Return how many chunks are worked on at the same time."""

    def submit(self, chunk: Chunk) -> Working:
        """Give a chunk to a worker."""

    def renew(self) -> None:
        """Replace workers that were lost."""

    def close(self) -> None:
        """Send the workers home, whatever they are doing."""


def work_through(
    tasks: Iterator[Task], crew: Crew, stopped: Callable[[], bool]
) -> Iterator[Result]:
    """Have tasks done by workers, and yield what comes of them, as it comes.

    The tasks of a worker that was lost are done again one at a time, with nothing
    beside them, so that the one that kills its worker is known: that one has failed.

    Args:
        tasks: Taken when there is a place for them, so that memory stays flat.
        crew: The workers.
        stopped: Tells whether the user wants to stop.
    """
    pace = Pace()
    waiting = chunks(tasks, pace)
    running: dict[Working, Chunk] = {}
    lost: list[Task] = []
    more = True
    while (more or running) and not stopped():
        while more and not lost and len(running) < AHEAD * crew.lanes():
            chunk = next(waiting, None)
            more = chunk is not None
            if chunk is not None:
                running[crew.submit(chunk)] = chunk
        done = wait(running, timeout=WAIT, return_when=FIRST_COMPLETED).done
        for future in done:
            chunk = running.pop(future)
            try:
                results = _results(future, crew)
            except crew.losses:
                lost += chunk
                continue
            pace.learn(sum(t.size for t in chunk), sum(r.seconds for r in results))
            yield from results
        if lost and not running:
            yield from _one_by_one(lost, crew, stopped)
            lost = []


def _results(future: Working, crew: Crew) -> list[Result]:
    """Return what a worker made.

    Raises:
        PostprocError: Workers cannot be reached, or cannot take tasks at all.
    """
    try:
        return future.result()
    except crew.losses:
        raise
    except CancelledError:
        raise PostprocError(
            "the workers cannot be reached any more. Go on with --resume"
        ) from None
    except Exception as exc:
        raise PostprocError(
            f"a worker cannot take tasks ({type(exc).__name__}: {exc}). "
            f"Is postproc {__version__} installed where it runs?"
        ) from exc


def _one_by_one(
    tasks: list[Task], crew: Crew, stopped: Callable[[], bool]
) -> Iterator[Result]:
    """Do tasks again that were lost with their worker."""
    crew.renew()
    for task in tasks:
        future = crew.submit((task,))
        while not future.done() and not stopped():
            wait([future], timeout=WAIT)
        if stopped():
            return
        try:
            yield from _results(future, crew)
        except crew.losses:
            crew.renew()
            yield failed(task.unit, _LOST)
