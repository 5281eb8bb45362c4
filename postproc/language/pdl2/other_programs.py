"""Other programs of a folder that change variables which a program exports."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path

from postproc.exceptions import ProgramError
from postproc.files import FolderListing, base_name, read_if_readable
from postproc.language.analysis.shared_changes import SharedChange
from postproc.language.pdl2.files import Pdl2FileName
from postproc.language.pdl2.program import Program, parse
from postproc.language.pdl2.side_effects import rows_effects
from postproc.language.text.source import (
    KEPT_FILES,
    Source,
    parse_shared,
    source_from_bytes,
)
from postproc.language.text.stamp import read_stamp

READ_BEFORE = 8192  # programs of which is known what they change


def changing_programs(program: Path, listing: FolderListing) -> tuple[Path, ...]:
    """Return other programs beside one that change variables which it exports.

    Outputs do not count, nor does what only the word IMPORT makes known.
    """
    changing = listing.beside(program, _find_changing)
    return tuple(changing.get(base_name(program.name), ()))


def _find_changing(
    folder: Path, listing: FolderListing, but: str
) -> Mapping[str, Sequence[Path]]:
    """Find the programs of a folder that change what others export, by these."""
    found = defaultdict[str, list[Path]](list)
    for one in listing.ending(folder, Pdl2FileName.programs):
        if one.name.lower() != but:
            exporters = _list_exporters(one, *_version(one))
            for exporter in exporters - {base_name(one.name)}:
                found[exporter].append(one)
    return found


def _version(path: Path) -> tuple[int, int]:
    """Return what tells a file from what it was before."""
    status = path.stat()
    return status.st_mtime_ns, status.st_size


@lru_cache(READ_BEFORE)
def _list_exporters(path: Path, changed: int, size: int) -> frozenset[str]:
    """Return the programs whose variables a program may change."""
    data = read_if_readable(path)
    if b"exported" not in data.lower() or read_stamp(data) is not None:
        return frozenset()
    try:
        changes = _list_changes(source_from_bytes(path.name, data))
    except ProgramError:
        return frozenset()
    return frozenset(key.partition("/")[0] for key in changes)


def find_changes(others: Sequence[Program]) -> Mapping[str, Sequence[SharedChange]]:
    """Find what other programs change of exported variables, by their keys."""
    found = defaultdict[str, list[SharedChange]](list)
    for other in others:
        for key, line in _list_changes(other.lines.source).items():
            change = SharedChange(key, (), other.lines.source.name, line)
            found[key].append(change)
    return dict(found)


@lru_cache(KEPT_FILES)
def _list_changes(source: Source) -> dict[str, int]:
    """Return the exported variables that a program may change, and the first lines."""
    program = parse_shared(parse, source)
    variables = program.variables
    exported = {
        name: f"{variables[name].exported}/{name}"
        for name in variables.which(lambda said: bool(said.exported))
        if variables[name].exported != program.name
    }
    rows = range(len(program.lines)) if exported else ()
    found: dict[str, int] = {}
    for row in rows:
        for name in rows_effects(program, row, row + 1).assigned & exported.keys():
            found.setdefault(exported[name], program.lines.line(row))
    return found
