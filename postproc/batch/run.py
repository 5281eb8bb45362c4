"""A tree of programs in, the same tree compensated out."""

from __future__ import annotations

import os
import shutil
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType

from postproc import operating_system
from postproc.batch.journal import Journal, JournalEntry, Summary, read_entries
from postproc.batch.plan import BatchPlan, Result, Task, Unit, digest_of
from postproc.batch.tree import Tree, refuse_overlap, scan
from postproc.batch.workers import WorkerPool, work_through
from postproc.compensation.output.sidecar import (
    EDITED,
    SUFFIX,
    file_sha256,
    list_edited,
    sha256,
)
from postproc.exceptions import DiskFullError, OutputError
from postproc.files import (
    TEMPORARY,
    disk_error,
    end_process,
    is_stream,
    replace_file,
    write_all,
)
from postproc.operating_system import ASKING

# Conditions of a run: alone on its tree, with room, and stopped in good order.

ROOM = 2.5  # bytes written for a byte of source: the program and its record
SPARE = 16_000_000  # bytes left over for the log and for others
HASTE = 1.5  # [s] that a run may take to stop in good order


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Hold a folder for this run alone; create it where it is missing.

    Nothing is left behind, and the lock is gone with this process, however that ends.

    Raises:
        OutputError: Another run holds it, or it cannot be created or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK):
            cure = "Give a folder that may be written to"
            raise OutputError(folder, "the folder is read-only", cure)
        unlock = operating_system.lock_folder(folder)
    except OSError as exc:
        raise disk_error(exc, folder) from None
    if unlock is None:
        problem = "another run is writing to it"
        raise OutputError(folder, problem, "Wait for its end, or stop it")
    try:
        yield
    finally:
        unlock()


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


class StopRequest:
    """Whether the user wants to stop: Ctrl-C or SIGTERM.

    The first one lets what is being written be finished, for `HASTE` seconds; a second
    one ends at once, which leaves no half-written file either.

    Attributes:
        number: The signal that asked, 0 for none.
    """

    def __init__(self) -> None:
        """Nobody has asked yet."""
        self.number = 0
        self._end: threading.Timer | None = None

    def __call__(self) -> bool:
        """Tell whether to stop."""
        return self.number > 0

    def _ask(self, number: int, frame: FrameType | None) -> None:
        if self.number:
            end_process(number)
        self.number = number
        self._end = threading.Timer(HASTE, end_process, [number])
        self._end.daemon = True
        self._end.start()


@contextmanager
def stoppable() -> Iterator[StopRequest]:
    """Listen to Ctrl-C and SIGTERM while the block runs."""
    stop = StopRequest()
    before = [signal.signal(number, stop._ask) for number in ASKING]
    try:
        yield stop
    finally:
        if stop._end is not None:
            stop._end.cancel()
        for number, handler in zip(ASKING, before, strict=True):
            signal.signal(number, handler)


# The target tree: what is written to it, and what must not stay in it.


@dataclass(frozen=True)
class TargetTree:
    """A tree that mirrors a source tree; paths below it are written with ``/``."""

    root: Path

    def write(self, outputs: Mapping[str, bytes]) -> dict[str, str]:
        """Write files, none before all are on the disk.

        Returns:
            Their SHA-256 by path.

        Raises:
            OutputError: They cannot be written.
        """
        for place in outputs:
            self._make_room(place)
        write_all({self.root / place: data for place, data in outputs.items()})
        return {place: sha256(data) for place, data in outputs.items()}

    def copy(self, source: Path, place: str) -> dict[str, str]:
        """Copy a file with its times and rights.

        Returns:
            Its SHA-256 by path.

        Raises:
            OutputError: It cannot be read or written.
        """
        self._make_room(place)
        try:
            with source.open("rb") as data, replace_file(self.root / place) as out:
                shutil.copyfileobj(data, out, 1 << 20)
            shutil.copystat(source, self.root / place)
        except OSError as exc:
            read = exc.filename == str(source)
            raise disk_error(exc, source if read else self.root / place) from None
        return {place: file_hash(self.root / place)}

    def holds(self, outputs: Mapping[str, str]) -> bool:
        """Tell whether files lie in the tree with the contents that they had."""
        try:
            return bool(outputs) and all(
                file_hash(self.root / place) == digest
                for place, digest in outputs.items()
            )
        except OSError:
            return False

    def remove(self, places: Iterable[str]) -> list[str]:
        """Remove files, and return those that were there.

        Raises:
            OutputError: One cannot be removed.
        """
        removed = []
        for place in places:
            try:
                (self.root / place).unlink()
            except (FileNotFoundError, NotADirectoryError):
                continue
            except OSError as exc:
                problem = f"cannot be removed ({exc.strerror})"
                cure = "Remove it: it is no output of this run"
                raise OutputError(self.root / place, problem, cure) from None
            removed.append(place)
        return removed

    def remove_untouched(self, outputs: Mapping[str, str]) -> list[str]:
        """Remove files of an earlier run that nobody has changed since."""
        same = {p: d for p, d in outputs.items() if self.holds({p: d})}
        return self.remove(same)

    def _make_room(self, place: str) -> None:
        """Make the folder of a file; refuse what stands there and is no file.

        A link may lead to a source; a pipe or a device is nothing that a tree holds.
        """
        path = self.root / place
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as exc:
            raise disk_error(exc, path.parent) from None
        if os.path.lexists(path) and (path.is_symlink() or not path.is_file()):
            problem = "is a link or no regular file: it is not replaced"
            raise OutputError(path, problem, "Remove it, then run the command again")


def places_of(unit: Unit) -> tuple[str, ...]:
    """Name all that a unit may have in the target tree."""
    return (*unit.own, *(program + SUFFIX for program in unit.programs))


def file_hash(path: str | Path) -> str:
    """Hash a file's content.

    Raises:
        OSError: It cannot be read, or is no regular file.
    """
    if os.path.islink(path):
        raise OSError(f"{path} is a symbolic link")
    return file_sha256(path)


# A tree of programs in, the same tree compensated out.

STATUS = ("done", "uncorrected", "failed")  # by exit code

Told = Callable[[int, int], None]  # how many files are done, of how many
Gather = Callable[[BatchPlan], WorkerPool]


@dataclass(frozen=True)
class BatchOptions:
    """What the user wants.

    Attributes:
        source: The tree of programs.
        target: The tree to write.
        plan: Which cell and model each program is compensated with.
        log: Where the log goes, from which a later run resumes.
        resume: Keep what is done and unchanged.
        only: Programs that are made again whatever they are, all others that are there
            stay, see `TargetTree.holds`; None: all are made that have changed.
    """

    source: Path
    target: Path
    plan: BatchPlan
    log: Path
    resume: bool
    only: frozenset[str] | None = None


def default_log(target: Path) -> Path:
    """Name the log of a target tree: beside it, so that the tree holds programs only.

    >>> default_log(Path("out/robots")).name
    'robots.batch.jsonl'
    """
    return target.with_name(f"{target.name}.batch.jsonl")


def batch(
    order: BatchOptions, gather: Gather, told: Told = lambda done, of: None
) -> Summary:
    """Compensate a tree.

    Args:
        order: What is wanted.
        gather: Gets the workers, when there is something to do.
        told: Told about progress.

    Raises:
        OutputError: The target overlaps the source, is being written by another run,
            has no room or cannot be written at all.
        ProgramError: The source tree cannot be read.
    """
    refuse_overlap(order.source, order.target)
    with lock_folder(order.target), stoppable() as stop:
        present = sweep(order.target)
        tree = scan(order.source, order.plan)
        check_room(order.target, tree.size, present)
        run = BatchRun(order, tree, told)
        with closing(run.journal):
            run.refuse()
            run.copy(stop)
            run.work(gather, stop)
            if not stop():
                run.tidy()
        run.summary.stopped = stop.number
        run.summary.notes = (*tree.notes, *run.notes)
        return run.summary


class BatchRun:
    """One run: what earlier ones did, what this one has done so far."""

    def __init__(self, order: BatchOptions, tree: Tree, told: Told) -> None:
        """Take over from earlier runs.

        Raises:
            OutputError: The log cannot be written.
        """
        if is_stream(order.log):
            problem = "is no file that a later run could read"
            raise OutputError(order.log, problem, "Remove it, or name another DST")
        self.order, self.tree, self.told = order, tree, told
        self.target = TargetTree(order.target)
        self.earlier = read_entries(order.log)
        before = [e for e in self.earlier.values() if e.outputs]
        known = [JournalEntry(e.place, "known", outputs=e.outputs) for e in before]
        self.journal = Journal(order.log, before if order.resume else known)
        self.summary = Summary()
        self.outputs: set[str] = set()  # all that belongs into the target tree
        self.digests: dict[str, str] = {}  # of the programs in work
        self.notes: list[tuple[str, str]] = []  # what a person should know
        self.total = len(tree.units) + len(tree.copies) + len(tree.refused)

    def add(self, entry: JournalEntry) -> None:
        """Log what came of a unit or a file, and tell about it."""
        if not entry.skipped:
            self.journal.add(entry)
        self.summary.add(entry)
        self.outputs.update(entry.outputs)
        self.told(self.summary.files, self.total)

    def refuse(self) -> None:
        """List what cannot be compensated, and see to it that it is not there."""
        for place, why in self.tree.refused.items():
            self.target.remove([place, place + SUFFIX])
            self.add(JournalEntry(place, "failed", 2, facts={"error": why}))

    def copy(self, stop: Callable[[], bool]) -> None:
        """Copy everything that is no program."""
        for place in self.tree.copies:
            if stop():
                return
            entry = JournalEntry(place, "copied")
            try:
                before = self.earlier.get(place)
                if self.order.resume and before and self._same(place, before):
                    self.add(replace(before, skipped=True))
                    continue
                outputs = self.target.copy(self.tree.root / place, place)
                entry = replace(entry, outputs=outputs)
            except DiskFullError:
                raise
            except OutputError as exc:
                entry = JournalEntry(place, "failed", 2, facts={"error": str(exc)})
            self.add(entry)

    def _same(self, place: str, before: JournalEntry) -> bool:
        """Tell whether a copied file is on both sides what it was."""
        digest = before.outputs.get(place, "")
        source = TargetTree(self.tree.root)
        return source.holds({place: digest}) and self.target.holds({place: digest})

    def work(self, gather: Gather, stop: Callable[[], bool]) -> None:
        """Compensate what is new or has changed."""
        tasks = self.tasks()
        first = next(tasks, None)
        if first is None or stop():
            return
        with closing(gather(self.order.plan)) as pool:
            for result in work_through(_chain(first, tasks), pool, stop):
                self.deliver(result)

    def tasks(self) -> Iterator[Task]:
        """Read the programs; those that are done and unchanged are passed over."""
        for unit in self.tree.units:
            try:
                sources = tuple((self.tree.root / f).read_bytes() for f in unit.files)
            except OSError as exc:
                problem = f"{exc.filename} cannot be read ({exc.strerror})"
                self.deliver(Result(unit, 2, facts={"error": problem}))
                continue
            setup = self.order.plan.setups[unit.setup]
            digest = digest_of(unit.files, sources, setup.digest)
            before = self.earlier.get(unit.program)
            if before and self._stays(unit.program, before, digest):
                self.add(replace(before, skipped=True))
                continue
            self.digests[unit.program] = digest
            yield Task(unit, sources)

    def _stays(self, program: str, before: JournalEntry, digest: str) -> bool:
        """Return True if a program that is there need not be made again."""
        only = self.order.only
        unchanged = self.order.resume and before.digest == digest
        stays = unchanged if only is None else program not in only
        return stays and self.target.holds(before.outputs)

    def deliver(self, result: Result) -> None:
        """Write what a worker made; of what failed nothing may be in the tree."""
        unit, facts = result.unit, {**result.facts, "seconds": round(result.seconds, 3)}
        digest = self.digests.pop(unit.program, "")
        outputs: dict[str, str] = {}
        exit_code, edited = result.exit_code, self._list_edited(unit)
        try:
            if result.outputs:
                outputs = self.target.write(result.outputs)
            else:
                self.target.remove(places_of(unit))
        except DiskFullError:
            raise
        except OutputError as exc:
            exit_code, facts = 2, {"error": str(exc)}
        if len(unit.files) > 1:
            facts["with"] = unit.files[1:]
        if edited:
            facts["overwritten"] = edited
            self.notes += [(place, EDITED) for place in edited]
        status = STATUS[exit_code]
        self.add(JournalEntry(unit.program, status, exit_code, digest, outputs, facts))

    def _list_edited(self, unit: Unit) -> list[str]:
        """Return the outputs of a unit that were edited since they were made."""
        root = self.order.target
        found = (list_edited(root / (place + SUFFIX)) for place in unit.programs)
        return [path.relative_to(root).as_posix() for some in found for path in some]

    def tidy(self) -> None:
        """Remove what earlier runs wrote and this one did not, unless changed since."""
        for entry in self.earlier.values():
            old = {p: d for p, d in entry.outputs.items() if p not in self.outputs}
            for place in self.target.remove_untouched(old):
                self.journal.add(JournalEntry(place, "removed"))
                self.summary.removed.append(place)


def _chain(first: Task, rest: Iterator[Task]) -> Iterator[Task]:
    """Put back what was taken to see whether there is anything."""
    yield first
    yield from rest
