"""A tree of programs in, the same tree compensated out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from postproc.batch.crew import Crew, work_through
from postproc.batch.guard import check_room, locked, stoppable, sweep
from postproc.batch.journal import Entry, Journal, read_entries
from postproc.batch.plan import Plan
from postproc.batch.summary import Summary
from postproc.batch.target import Target, places_of
from postproc.batch.task import Result, Task, digest_of
from postproc.batch.tree import Tree, refuse_overlap, scan
from postproc.compensation.record import SUFFIX
from postproc.exceptions import DiskFullError, OutputError

STATUS = ("done", "left", "failed")  # by exit code

Told = Callable[[int, int], None]  # how many files are done, of how many
Gather = Callable[[Plan], Crew]


@dataclass(frozen=True)
class Order:
    """What the user wants.

    Attributes:
        source: The tree of programs.
        target: The tree to write.
        plan: Which cell and model each program is compensated with.
        log: Where the log goes, from which a later run resumes.
        resume: Keep what is done and unchanged.
    """

    source: Path
    target: Path
    plan: Plan
    log: Path
    resume: bool


def default_log(target: Path) -> Path:
    """Name the log of a target tree: beside it, so that the tree holds programs only.

    >>> default_log(Path("out/robots")).name
    'robots.batch.jsonl'
    """
    return target.with_name(f"{target.name}.batch.jsonl")


def batch(order: Order, gather: Gather, told: Told = lambda done, of: None) -> Summary:
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
    with locked(order.target), stoppable() as stop:
        present = sweep(order.target)
        tree = scan(order.source, order.plan)
        check_room(order.target, tree.size, present)
        run = Run(order, tree, told)
        with closing(run.journal):
            run.refuse()
            run.copy(stop)
            run.work(gather, stop)
            if not stop():
                run.tidy()
        run.summary.stopped, run.summary.notes = stop(), tree.notes
        return run.summary


class Run:
    """One run: what earlier ones did, what this one has done so far."""

    def __init__(self, order: Order, tree: Tree, told: Told) -> None:
        """Take over from earlier runs.

        Raises:
            OutputError: The log cannot be written.
        """
        self.order, self.tree, self.told = order, tree, told
        self.target = Target(order.target)
        self.earlier = read_entries(order.log)
        before = [e for e in self.earlier.values() if e.outputs]
        known = [Entry(e.place, "known", outputs=e.outputs) for e in before]
        self.journal = Journal(order.log, before if order.resume else known)
        self.summary = Summary()
        self.outputs: set[str] = set()  # all that belongs into the target tree
        self.digests: dict[str, str] = {}  # of the programs in work
        self.total = len(tree.units) + len(tree.copies) + len(tree.refused)

    def add(self, entry: Entry) -> None:
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
            self.add(Entry(place, "failed", 2, facts={"error": why}))

    def copy(self, stop: Callable[[], bool]) -> None:
        """Copy everything that is no program."""
        for place in self.tree.copies:
            if stop():
                return
            entry = Entry(place, "copied")
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
                entry = Entry(place, "failed", 2, facts={"error": str(exc)})
            self.add(entry)

    def _same(self, place: str, before: Entry) -> bool:
        """Tell whether a copied file is on both sides what it was."""
        digest = before.outputs.get(place, "")
        source = Target(self.tree.root)
        return source.holds({place: digest}) and self.target.holds({place: digest})

    def work(self, gather: Gather, stop: Callable[[], bool]) -> None:
        """Compensate what is new or has changed."""
        tasks = self.tasks()
        first = next(tasks, None)
        if first is None or stop():
            return
        with closing(gather(self.order.plan)) as crew:
            for result in work_through(_chain(first, tasks), crew, stop):
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
            if self.order.resume and before and before.digest == digest:
                if self.target.holds(before.outputs):
                    self.add(replace(before, skipped=True))
                    continue
            self.digests[unit.program] = digest
            yield Task(unit, sources)

    def deliver(self, result: Result) -> None:
        """Write what a worker made; of what failed nothing may be in the tree."""
        unit, facts = result.unit, {**result.facts, "seconds": round(result.seconds, 3)}
        digest = self.digests.pop(unit.program, "")
        outputs: dict[str, str] = {}
        exit_code = result.exit_code
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
        status = STATUS[exit_code]
        self.add(Entry(unit.program, status, exit_code, digest, outputs, facts))

    def tidy(self) -> None:
        """Remove what earlier runs wrote and this one did not, unless changed since."""
        for entry in self.earlier.values():
            old = {p: d for p, d in entry.outputs.items() if p not in self.outputs}
            for place in self.target.remove_untouched(old):
                self.journal.add(Entry(place, "removed"))
                self.summary.removed.append(place)


def _chain(first: Task, rest: Iterator[Task]) -> Iterator[Task]:
    """Put back what was taken to see whether there is anything."""
    yield first
    yield from rest
