"""Workers: processes that take programs in chunks and survive the loss of one."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Future,
    ProcessPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, replace
from importlib import import_module
from multiprocessing.context import BaseContext
from pathlib import PurePosixPath
from time import perf_counter
from typing import Any, Protocol

import numpy as np

from postproc import __version__
from postproc.batch.plan import JobSetup, Result, Task, Unit, make_failure
from postproc.compensation.findings.headline import headline
from postproc.compensation.findings.tolerance import JobTolerance
from postproc.compensation.outcome import Outcome, Status
from postproc.compensation.output.sidecar import SUFFIX
from postproc.compensation.scale.micro_batch import Given, compensate_batch
from postproc.exceptions import PostprocError
from postproc.language.languages import file_named
from postproc.operating_system import end_with_parent, start_worker_server
from postproc.robot.pose import MM
from postproc.threads import share_cores, start_no_threads

# Tasks in chunks that last about a second each.

LASTING = 1.0  # [s] of a chunk: long against sending it, short against the whole run
MOST = 256  # tasks of a chunk
FIRST = 8_000  # bytes of a chunk while nothing is known of the speed

Chunk = tuple[Task, ...]


@dataclass
class ThroughputEstimate:
    """How fast a worker is, learned from what it has done.

    Attributes:
        size: Bytes done, those of long ago counted less.
        seconds: Seconds that they took.
    """

    size: float = 0.0
    seconds: float = 0.0

    def learn(self, size: int, seconds: float) -> None:
        """Take in a chunk that is done."""
        self.size = 0.8 * self.size + size
        self.seconds = 0.8 * self.seconds + seconds

    @property
    def chunk(self) -> float:
        """Return the bytes that take about `LASTING` seconds."""
        return LASTING * self.size / self.seconds if self.seconds > 0 else FIRST


def chunks(tasks: Iterator[Task], pace: ThroughputEstimate) -> Iterator[Chunk]:
    """Join tasks of the same setup, as many as last about a second by now."""
    waiting: list[Task] = []
    size = 0
    for task in tasks:
        other = bool(waiting) and task.unit.setup != waiting[0].unit.setup
        full = size + task.size > pace.chunk or len(waiting) == MOST
        if waiting and (other or full):
            yield tuple(waiting)
            waiting, size = [], 0
        waiting.append(task)
        size += task.size
    if waiting:
        yield tuple(waiting)


# Giving chunks to workers, here or on a cluster, and taking back what they did.

WAIT = 0.2  # [s] between two looks at whether the user wants to stop
AHEAD = 2  # chunks for every worker: one in work, one at hand
_LOST = "its worker died over it twice: too little memory, or a defect of a library"

Working = Future[list[Result]]


class WorkerPool(Protocol):
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
    tasks: Iterator[Task], pool: WorkerPool, stopped: Callable[[], bool]
) -> Iterator[Result]:
    """Have tasks done by workers, and yield what comes of them, as it comes.

    The tasks of a worker that was lost are done again one at a time, with nothing
    beside them, so that the one that kills its worker is known: that one has failed.

    Args:
        tasks: Taken when there is a place for them, so that memory stays flat.
        pool: The workers.
        stopped: Tells whether the user wants to stop.
    """
    pace = ThroughputEstimate()
    waiting = chunks(tasks, pace)
    running: dict[Working, Chunk] = {}
    lost: list[Task] = []
    more = True
    while (more or running) and not stopped():
        while more and not lost and len(running) < AHEAD * pool.lanes():
            chunk = next(waiting, None)
            more = chunk is not None
            if chunk is not None:
                running[pool.submit(chunk)] = chunk
        done = wait(running, timeout=WAIT, return_when=FIRST_COMPLETED).done
        for future in done:
            chunk = running.pop(future)
            try:
                results = _results(future, pool)
            except pool.losses:
                lost += chunk
                continue
            pace.learn(sum(t.size for t in chunk), sum(r.seconds for r in results))
            yield from results
        if lost and not running:
            yield from _one_by_one(lost, pool, stopped)
            lost = []


def _results(future: Working, pool: WorkerPool) -> list[Result]:
    """Return what a worker made.

    Raises:
        PostprocError: Workers cannot be reached, or cannot take tasks at all.
    """
    try:
        return future.result()
    except pool.losses:
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
    tasks: list[Task], pool: WorkerPool, stopped: Callable[[], bool]
) -> Iterator[Result]:
    """Do tasks again that were lost with their worker."""
    pool.renew()
    for task in tasks:
        future = pool.submit((task,))
        while not future.done() and not stopped():
            wait([future], timeout=WAIT)
        if stopped():
            return
        try:
            yield from _results(future, pool)
        except pool.losses:
            pool.renew()
            yield make_failure(task.unit, _LOST)


# The process that workers are forked from, where there is a fork.
#
# It loads the package by itself: started first, it does so while this process loads
# what it needs on its own.

READY = "postproc.batch.ready"


def start_server() -> BaseContext:
    """Start the process unless it runs already, and do not wait for it."""
    start_no_threads()
    return start_worker_server(READY)


# What a worker does with a task: the same on this machine and on a cluster.

LISTED = 50  # findings of a program that the log lists; the rest is counted


def run_tasks(tasks: Sequence[Task], setup: JobSetup, version: str) -> list[Result]:
    """Compensate programs; one that fails stops no other.

    Args:
        tasks: The programs.
        setup: What they are compensated with.
        version: Version of this tool where the run was started.
    """
    if version != __version__:
        text = f"the worker has postproc {__version__}, the run {version}: make equal"
        return [make_failure(task.unit, text) for task in tasks]
    start = perf_counter()
    found = outcomes_of(tasks, setup)
    results = [_result(*pair) for pair in zip(tasks, found, strict=True)]
    seconds = (perf_counter() - start) / max(len(tasks), 1)
    return [replace(result, seconds=seconds) for result in results]


def outcomes_of(tasks: Sequence[Task], setup: JobSetup) -> list[Outcome | Exception]:
    """Compensate the programs of tasks; what fails for all of them is told of each."""
    given = [_name_files(task) for task in tasks]
    try:
        found = compensate_batch(given, setup.cell, setup.model, setup.options)
        wanted = JobTolerance.of_cell(setup.cell)
        return [
            one.with_tolerance(wanted) if isinstance(one, Outcome) else one
            for one in found
        ]
    except Exception as exc:
        return [exc for _ in tasks]


def _name_files(task: Task) -> Given:
    """Name the files of a task as its programs name each other."""
    unit, sources = task.unit, task.files
    pages = {_file_name(page): sources[page] for page in unit.pages}
    program = PurePosixPath(unit.program)
    named = {file_named(one).name_for(program): one for one in unit.reads}
    reads = {name: sources[one] for name, one in named.items()}
    return Given(
        name=_file_name(unit.program),
        source=task.sources[0],
        variables=None if unit.variables is None else sources[unit.variables],
        pages=pages | reads,
    )


def _result(task: Task, found: Outcome | Exception) -> Result:
    """Say what came of a task; whatever went wrong is a result too."""
    unit = task.unit
    match found:
        case Outcome():
            record = replace(found.record, read=task.digests)
            outputs = _outputs(unit, task.files, replace(found, record=record))
            return Result(unit, found.exit_code, outputs, facts_of(found))
        case PostprocError():
            return make_failure(unit, str(found))
        case RecursionError():
            return make_failure(unit, "is nested too deeply")
        case MemoryError():
            return make_failure(unit, "needs more memory than there is")
    # A defect of ours, or of a library.
    what = f"internal error: {type(found).__name__}: {found}"
    return make_failure(unit, f"{what}; please report it with the program")


def _outputs(
    unit: Unit, sources: Mapping[str, bytes], outcome: Outcome
) -> dict[str, bytes]:
    """Name all files of the target tree, each program behind its own record.

    What did not change comes out as it went in.
    """
    place_of = {_file_name(place): place for place in unit.programs}
    if unit.variables is not None:
        place_of[file_named(_file_name(unit.program)).variables] = unit.variables
    new = {place_of[name]: data for name, data in outcome.outputs.items()}
    outputs: dict[str, bytes] = {}
    for place in reversed(unit.programs):
        belongs = [place]
        if place == unit.program and unit.variables is not None:
            belongs.insert(0, unit.variables)
        own = {n: _file_name(b) for n, b in place_of.items() if b in belongs}
        record = outcome.record.rename_files(own)
        outputs[place + SUFFIX] = b"".join(record.to_json())
        outputs |= {b: new.get(b, sources[b]) for b in belongs}
    return outputs


def facts_of(outcome: Outcome) -> dict[str, Any]:
    """Sum up an outcome for the log."""
    statuses = outcome.decisions.status
    left = outcome.list_uncorrected()
    return {
        "version": __version__,
        "model": outcome.model,
        "visits": len(statuses),
        "corrected": outcome.decisions.count(Status.CORRECTED),
        "uncorrected": len(left),
        "uncorrected_lines": left[:LISTED],
        "findings": [*map(str, outcome.diagnostics[:LISTED])],
        "largest_mm": _largest(outcome),
        "before_mm": _figures(asdict(outcome.before)),
        "after_mm": _figures(asdict(outcome.after)),
        **_error_facts(outcome),
    }


def _error_facts(outcome: Outcome) -> dict[str, Any]:
    """Sum up the expected true errors, and the verdict against a tolerance."""
    if outcome.errors is None:
        return {}
    found = headline(outcome.errors)
    figures = {
        "before": found.before_mm,
        "after": found.after_mm,
        "below_95": found.below_mm,
        "worst_95": found.bound_mm,
    }
    check = outcome.tolerance
    facts: dict[str, Any] = {} if check is None else {"tolerance": check.to_record()}
    return {"expected_mm": _figures(figures), "worst": found.first, **facts}


def _largest(outcome: Outcome) -> float | None:
    """Return the largest correction [mm], None where nothing was corrected."""
    lengths = np.linalg.norm(outcome.decisions.correction, axis=1) / MM
    known = lengths[np.isfinite(lengths)]
    return round(float(known.max()), 5) if len(known) else None


def _figures(statistics: Mapping[str, float]) -> dict[str, float | None]:
    """Round figures for a person; JSON has no NaN."""
    return {
        name.removesuffix("_mm"): None if value != value else round(value, 5)
        for name, value in statistics.items()
    }


def _file_name(place: str) -> str:
    """Return the last part of a path with ``/``."""
    return place.rpartition("/")[2]


# Workers on this machine: processes that are given every cell and model once.

_setups: Sequence[JobSetup] = ()


class LocalPool:
    """Worker processes of this machine.

    Where there is a fork they come from a clean server process that has loaded the
    package already: no lock or thread of this process is copied, and a new worker is
    there at once. Elsewhere they are new processes.
    """

    losses: tuple[type[BaseException], ...] = (BrokenProcessPool,)

    def __init__(self, setups: Sequence[JobSetup], jobs: int) -> None:
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
        given = self._setups, self._jobs
        return ProcessPoolExecutor(
            self._jobs, self._context, initializer=_begin, initargs=given
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


def _begin(setups: Sequence[JobSetup], jobs: int) -> None:
    """Make a new process one of some workers."""
    global _setups
    _setups = setups
    share_cores(jobs)
    import_module(READY)  # a worker that was not forked has not loaded it
    # Ctrl-C goes to the whole group: the parent decides what becomes of us.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    end_with_parent()
    threading.Thread(target=_follow_parent, daemon=True).start()


def _follow_parent() -> None:
    """End when the parent does, killed or not: nobody else would end us."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run(chunk: Chunk) -> list[Result]:
    return run_tasks(chunk, _setups[chunk[0].unit.setup], __version__)
