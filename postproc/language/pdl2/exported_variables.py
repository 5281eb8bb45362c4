"""Variables that other programs may write: what is known of them, and how long."""

from __future__ import annotations

from collections.abc import Iterator

from postproc.files import base_name
from postproc.language.language import matches
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.abstract_state import root_of
from postproc.language.pdl2.job import World
from postproc.language.pdl2.program import Program, Variable
from postproc.language.pdl2.side_effects import rows_effects

IMPORTED = (
    "another program holds and may change it; if none does, name it under [variables] "
    "constant in the cell file"
)
_SCALARS = frozenset("integer real boolean string".split())


def changing_variables(world: World) -> frozenset[str]:
    """Return the exported numbers, texts and switches that nobody calls constant.

    Another program may write them whenever this one waits. Records may hold such.
    """
    found = {
        key
        for program in world.programs()
        for key, said in _of(program)
        if not (_is_constant(world, key) or _is_point(said.type))
    }
    found |= set(_list_exported_by_file(world))
    return frozenset(found)


def find_imported_points(world: World) -> frozenset[str]:
    """Return positions, and what may hold some, that belong to no file at hand.

    What the cell calls constant is left out, unless a file at hand writes it.
    """
    files = [program.lines.source.name for program in world.programs()]
    own = {program.name for program in world.programs()} | {*map(base_name, files)}
    imported = {
        key
        for program in world.programs()
        for key, said in _of(program)
        if said.exported not in own and said.type is not None
        if said.type.name not in _SCALARS or said.type.path
    }
    if not imported:
        return frozenset()
    kept = {key for key in imported if _is_constant(world, key)} - _find_written(world)
    return frozenset(imported - kept)


def _of(program: Program) -> Iterator[tuple[str, Variable]]:
    """Yield the exported variables of a program, constants of the text left out."""
    variables = program.variables
    for name in variables.which(lambda said: bool(said.exported)):
        said = variables[name]
        if not said.constant and said.type is not None:
            yield f"{said.exported}/{name}", said


def _list_exported_by_file(world: World) -> Iterator[str]:
    """Yield the variables that the variable file alone calls exported (Xport)."""
    if world.variables is None or world.main.main is None:
        return
    place = world.place(world.main, world.main.main)
    entries = world.variables.entries
    shared = [layout.shared and layout.kind in _KINDS for layout in entries.layouts]
    if any(shared):
        for name, row in entries.row.items():
            key = world.root(place, root_of(name))
            if shared[entries.layout[row]] and not _is_constant(world, key):
                yield key


_KINDS = frozenset({"INT", "REA", "BOO", "STR", "AINT", "AREA", "ABOO", "ASTR"})


def _is_point(type_: ast.Type | None) -> bool:
    """Tell whether a type holds positions and no more, in any number."""
    points = ("position", "xtndpos", "jointpos", "vector")
    return type_ is not None and (type_.path or type_.name in points)


def _is_constant(world: World, key: str) -> bool:
    """Tell whether the cell says that no other program changes a variable."""
    program, _, name = key.partition("/")
    return matches(world.start.constant, (name, f"{program}.{name}"))


def _find_written(world: World) -> set[str]:
    """Return the keys of exported variables that some file at hand writes."""
    found = set()
    for program in world.programs():
        assigned = rows_effects(program, 0, len(program.lines)).assigned
        for key, _ in _of(program):
            if key.partition("/")[2] in assigned:
                found.add(key)
    return found
