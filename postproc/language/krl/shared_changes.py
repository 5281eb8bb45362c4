"""What other programs change of the data that all programs of a controller share.

``$config.dat`` and GLOBAL data keep what a program has given them: what another program
gives them is not known when this one begins.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from postproc.language import ir
from postproc.language.analysis.symbols import holds_odd
from postproc.language.analysis.uses import NamesUsed
from postproc.language.krl import syntax as said
from postproc.language.krl.program import KrlFile, literal_index

ACTUAL = "_act"  # ends names of data that programs set before each of their moves
_IMPORT = re.compile(  # of a name, from a list, by its name there
    rb"^[ \t]*(?:DECL[ \t]+)?IMPORT[ \t]+\w+[ \t]+(\w+)[^;\n]*?\bIS\b[^;\n]*?"
    rb"(\w+)[ \t]*\.\.[ \t]*(\w+)",
    re.IGNORECASE | re.MULTILINE,
)


@dataclass(frozen=True)
class ImportedDatum:
    """Data of the list of another program, by a name of its own.

    Attributes:
        name: What it is called where it is imported.
        module, original: The list that declares it, and its name there.
    """

    name: str
    module: str
    original: str


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


def list_imports(files: Sequence[KrlFile]) -> list[ImportedDatum]:
    """List what files import from lists of other programs."""
    found = (match for one in files for match in _IMPORT.findall(one.text.source.data))
    return [
        ImportedDatum(*(part.decode("ascii").lower() for part in one)) for one in found
    ]


def list_shared_changes(
    files: Sequence[KrlFile], uses: Callable[[], NamesUsed]
) -> Iterator[SharedChange]:
    """Yield what other programs change of data that they do not declare for themselves.

    Args:
        files: The programs and their data lists.
        uses: Makes what notes the names that statements change.
    """
    programs: dict[str, list[KrlFile]] = defaultdict(list)
    for file in files:
        programs[file.name].append(file)
    for own in programs.values():
        names = {one.name: one.original for one in list_imports(own)}
        hidden = _list_own(own)
        for file in (one for one in own if one.routines):
            for name, index, row in _list_changes(file, uses):
                if not (name in hidden or name[0] == "$" or name.endswith(ACTUAL)):
                    where = file.text.source.name.rpartition("/")[2]
                    at = where, file.text.line(row)
                    yield SharedChange(names.get(name, name), index, *at)


def _list_own(files: Sequence[KrlFile]) -> frozenset[str]:
    """Return the names that mean data of a program alone."""
    data = {d.name for file in files for d in file.data if d.scope != "global"}
    heads = (rows.head for file in files for rows in file.routines)
    return frozenset(data.union(*({p.name for p in h.parameters} for h in heads)))


def _list_changes(
    file: KrlFile, uses: Callable[[], NamesUsed]
) -> Iterator[tuple[str, tuple[int, ...], int]]:
    """Yield the names, indices and rows of what the statements of a file may change."""

    def list_targets(one: ir.SourceStatement) -> list[ir.DataObject]:
        noted = uses()
        noted.note(one)
        return noted.targets

    text = file.text
    for row in text.where(lambda one: bool(list_targets(one))):
        for target in list_targets(text.statement(row)):
            yield target.name, literal_index(text, row, target.steps[:1]) or (), row
    for row in text.of_kind(holds_odd):
        yield from ((name, (), row) for name in text.words([row], said.NAMES["move"]))
