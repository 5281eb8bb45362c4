"""Other programs of a folder that change or call what a program exports."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from postproc.exceptions import ProgramError
from postproc.files import FolderListing, base_name, read_if_readable
from postproc.language.analysis.shared_changes import OutsideCall, SharedChange
from postproc.language.file_name import list_led
from postproc.language.outputs import HEAD, is_beside_source, version_of
from postproc.language.pdl2.files import Pdl2FileName
from postproc.language.pdl2.program import Program, parse
from postproc.language.pdl2.side_effects import rows_effects
from postproc.language.text.source import (
    Source,
    keep_short,
    parse_shared,
    source_from_bytes,
)

READ_BEFORE = 8192  # programs of which is known what they change


@dataclass(frozen=True)
class OutsideActs:
    """What a program does to others.

    Attributes:
        changes: Exported variables of others that it may change, by their keys, with
            the first lines.
        calls: Likewise programs (``program/``) and routines (``program/routine``).
    """

    changes: Mapping[str, int]
    calls: Mapping[str, int]

    @property
    def programs(self) -> frozenset[str]:
        """The programs that are concerned."""
        every = (*self.changes, *self.calls)
        return frozenset(key.partition("/")[0] for key in every)


NOTHING = OutsideActs({}, {})


def find_other_programs(program: Path, listing: FolderListing) -> tuple[Path, ...]:
    """Return other programs beside one that change or call what it, or a page, holds.

    Outputs beside their sources do not count.
    """
    found = listing.beside(program, _find_acting)
    if not found:
        return ()
    led, own = list_led(Pdl2FileName(str(program)), listing), base_name(program.name)
    concerned = (p for one in led for p in found.get(base_name(one.name), ()))
    others = (one for one in concerned if base_name(one.name) != own)
    return tuple(dict.fromkeys(others))


def _find_acting(
    folder: Path, listing: FolderListing, but: str
) -> Mapping[str, Sequence[Path]]:
    """Find the programs of a folder that change or call others, by these."""
    found = defaultdict[str, list[Path]](list)
    for one in listing.ending(folder, Pdl2FileName.programs):
        if one.name.lower() != but and not is_beside_source(one, listing):
            for name in _read_acts(one, *version_of(one)).programs:
                found[name].append(one)
    return found


@lru_cache(READ_BEFORE)
def _read_acts(path: Path, changed: int, size: int) -> OutsideActs:
    """Return what a program may do to others, as it is now."""
    data = read_if_readable(path)
    text = data.lower()
    if not any(word in text for word in (b"exported", b"call", b"import")):
        return NOTHING
    try:
        return _list_acts(source_from_bytes(path.name, data))
    except ProgramError:
        return NOTHING


def find_changes(others: Sequence[Program]) -> Mapping[str, Sequence[SharedChange]]:
    """Find what other programs change of exported variables, by their keys."""
    found = defaultdict[str, list[SharedChange]](list)
    for source in (one.lines.source for one in others):
        for key, line in _list_acts(source).changes.items():
            found[key].append(SharedChange(key, (), source.name, line))
    return dict(found)


def find_calls(main: Program, others: Sequence[Program]) -> Mapping[str, OutsideCall]:
    """Find what other programs of the arm of a program call, by its keys."""
    found, arm = dict[str, OutsideCall](), _arm_of(main.lines.source)
    sources = (one.lines.source for one in others)
    for source in (one for one in sources if arm in (0, _arm_of(one) or 1)):
        for key, line in _list_acts(source).calls.items():
            name = key.strip("/").rpartition("/")[2]
            found.setdefault(key, OutsideCall(name, source.name, line))
    return found


def _arm_of(source: Source) -> int:
    """Return the arm that a program says it is for, 0 where it says none."""
    return Pdl2FileName(source.name).arm(source.data[:HEAD])


@keep_short
def _list_acts(source: Source) -> OutsideActs:
    """Return what a program may do to others."""
    program = parse_shared(parse, source)
    variables, whole = program.variables, rows_effects(program, 0, len(program.lines))
    exported = {
        name: f"{variables[name].exported}/{name}"
        for name in variables.which(lambda said: bool(said.exported))
        if variables[name].exported != program.name
    }
    exported = {n: key for n, key in exported.items() if n in whole.assigned}
    called = {name: _keys_of(program, name) for name in whole.calls}
    changes, calls = dict[str, int](), dict[str, int]()
    for row in range(len(program.lines)):
        if not (exported or called):
            break
        own, line = rows_effects(program, row, row + 1), program.lines.line(row)
        changes |= {exported.pop(n): line for n in own.assigned & exported.keys()}
        for name in own.calls & called.keys():
            calls |= dict.fromkeys(called.pop(name), line)
    return OutsideActs(changes, calls)


def _keys_of(program: Program, name: str) -> list[str]:
    """Name what a call may mean: a program, or a routine that others export."""
    exporter = program.outside.get(name)
    holders = [exporter] if exporter else [*map(base_name, program.imports)]
    return [f"{name}/", *(f"{holder}/{name}" for holder in holders)]
