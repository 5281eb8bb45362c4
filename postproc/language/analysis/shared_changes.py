"""What other programs change of the data that all programs of a controller share.

Such data keep what a program has given them: what another program gives them is not
known when this one begins.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from postproc.language import ir
from postproc.language.analysis.assigned_points import Scope
from postproc.language.analysis.declarations import TaskFile
from postproc.language.analysis.symbols import TaskSymbols, holds_odd
from postproc.language.language import Start, matches


@dataclass(frozen=True)
class SharedChange:
    """A statement that changes data that all programs share.

    Attributes:
        name: Of the data.
        index: Of the element, () where all may be meant.
        file, line: Where the statement stands.
    """

    name: str
    index: tuple[int, ...]
    file: str
    line: int


@dataclass(frozen=True)
class OutsideCall:
    """A call of a routine that the program does not hold.

    Attributes:
        name: Of the routine.
        file, line: Where the call stands.
    """

    name: str
    file: str
    line: int


def list_outside_calls(task: TaskSymbols[Any]) -> Iterator[OutsideCall]:
    """Yield the first call of each routine that other programs may hold."""
    for file in (one for one in task.files if one.routines):
        names = {*ir.names_called(*file.text.said.said)} - task.routines.keys()
        for row in file.text.where(lambda one: bool(ir.names_called(one))):
            for name in ir.names_called(file.text.statement(row)) & names:
                names.discard(name)
                at = file.text.source.name, file.text.line(row)
                yield OutsideCall(name, *at)
            if not names:
                break


def describe_call(call: OutsideCall) -> str:
    """Say why a routine begins anywhere, and what to do about it."""
    where = f"{call.file.rpartition('/')[2]} (line {call.line})"
    return (
        f"{call.name.upper()} is called by {where} too: place, frames, load and modes "
        "at its beginning are not known. Set them in it, and begin with a move by "
        "joint angles"
    )


def describe_changes(
    changes: Sequence[SharedChange], index: tuple[int, ...] = ()
) -> str:
    """Say why data are not known that others change, and what to do about it.

    Args:
        changes: All changes of the data.
        index: Of the element that is meant.
    """
    own = (one for one in changes if not index or one.index in ((), index))
    first = next(own, changes[0])
    where = f"{first.file.rpartition('/')[2]} (line {first.line})"
    return (
        f"may be changed by {where}: set it before the moves that take it, or, if that "
        "program never runs, name it under [variables] constant in the cell file"
    )


def collect_changes(
    changes: Iterable[SharedChange], shared: Container[str], start: Start
) -> Mapping[str, Sequence[SharedChange]]:
    """Collect changes of some shared data by name.

    Args:
        changes: All that other programs change.
        shared: Names of the data.
        start: What the cell says: it may call data constant.
    """
    found = defaultdict[str, list[SharedChange]](list)
    for one in changes:
        if one.name in shared and not _is_constant(one, start):
            found[one.name].append(one)
    return dict(found)


def _is_constant(change: SharedChange, start: Start) -> bool:
    """Tell whether the cell says that data keep what the files give them."""
    element = f"{change.name}[{','.join(map(str, change.index))}]"
    return element in start.constant or matches(start.constant, (change.name,))


def list_shared_changes(task: TaskSymbols[Any]) -> Iterator[SharedChange]:
    """Yield what the routines of a program change of data that it does not declare."""
    for number, file in enumerate(task.files):
        for name, index, row in _list_changes(task, number) if file.routines else ():
            if meant := task.name_for_others(name):
                at = file.text.source.name, file.text.line(row)
                yield SharedChange(meant, index, *at)


def _list_changes(
    task: TaskSymbols[Any], number: int
) -> Iterator[tuple[str, tuple[int, ...], int]]:
    """Yield names, indices and rows of what the statements of a file may change."""
    file: TaskFile = task.files[number]
    for row in file.text.of_kind(lambda one: bool(task.list_changes(one))):
        here = _find_scope(task, number, row)
        for target in task.list_changes(file.text.statement(row)):
            if not _is_own(task, target.name, here):
                yield target.name, task.index_of(target, here), row
    for row in file.text.of_kind(holds_odd):
        here = _find_scope(task, number, row)
        words = file.text.words([row], task.still_words)
        yield from ((name, (), row) for name in words if not _is_own(task, name, here))


def _find_scope(task: TaskSymbols[Any], number: int, row: int) -> Scope:
    """Return where a statement stands."""
    routine = task.routine_around(number, row)
    return (task.scope_of(routine) if routine else Scope(number, "", "")).at(row)


def _is_own(task: TaskSymbols[Any], name: str, here: Scope) -> bool:
    """Tell whether a name means data that the program declares."""
    return name in here.parameters or task.place(name, here) is not None
