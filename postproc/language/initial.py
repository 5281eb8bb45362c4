"""What variables hold before a program assigns them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.language.diagnostic import Diagnostic
from postproc.language.entry_columns import POSITIONS, Entries, Entry
from postproc.language.evaluate import Point
from postproc.language.forms import lower
from postproc.language.initial_values import Points
from postproc.language.lsv import Variables as ValueFile
from postproc.language.program import Program
from postproc.language.store import Store, root_of
from postproc.language.values import Nothing, Position, Value, Vector
from postproc.language.variables import Variable, Variables
from postproc.language.world import Place, World, base_variable


def fill_initial(world: World) -> None:
    """Enter declared initial values, constants and the variable file's values."""
    for place, seen in world.declarations():
        _declared(world, place, seen)
    if world.variables is not None and world.main.main is not None:
        place = Place(world.main, world.main.main)
        _enter_all(world, place, world.variables)
        _report_drift(world, place, world.variables)


def _report_drift(world: World, place: Place, file: ValueFile) -> None:
    """Say where a program and its variable file have drifted apart."""
    for found in file.diagnostics:
        world.diagnostics[found] = None
    words, declared = place.program.statements.words(), place.program.variables.names
    names = _bases(file.entries)
    unused = [written for name, written in names.items() if name not in words]
    undeclared = [
        written
        for name, written in names.items()
        if name in words and name not in declared
    ]
    if names and len(unused) == len(names):
        _say(world, file, "lsv-other-program", "none of its variables is used by "
             f"{place.program.name}: is it the file of another program?")  # fmt: skip
    elif unused:
        _say(world, file, "lsv-unused", f"never used: {_some(unused)}")
    if undeclared:
        text = f"used by the program, but not declared there: {_some(undeclared)}"
        _say(world, file, "lsv-undeclared", text)


def _bases(entries: Entries) -> dict[str, str]:
    """Return how variables of a file are written, by name, without their parts."""
    written = [entries.name[row] for row in entries.row.values()]
    names = dict(zip(lower(written), written, strict=True))
    if entries.parts:
        return {base_variable(name): name.partition(".")[0] for name in written}
    return names


def _say(world: World, file: ValueFile, code: str, text: str) -> None:
    world.diagnostics[Diagnostic(file.source.name, 1, code, text)] = None


def _some(names: list[str]) -> str:
    rest = f" and {len(names) - 10} more" if len(names) > 10 else ""
    return ", ".join(names[:10]) + rest


def _declared(world: World, place: Place, seen: Variables) -> None:
    """Enter the initial values of declarations, one by one: most have none."""
    store = Store(world.initial.find)
    for variable in (*_with_value(seen), *_with_value(place.body.variables)):
        key = world.root(place, variable.name.lower())
        if variable.initial is None or key in world.initial:
            continue
        value = Point(world, place, variable.row, store).value(variable.initial)
        if isinstance(value, Position) and not value.name:
            value = replace(
                value,
                name=variable.name,
                taught=variable.taught,
                shared=bool(variable.exported),
            )
        world.initial[key] = value


def _with_value(seen: Variables) -> list[Variable]:
    return [seen[name] for name in seen.which(lambda said: said.initial is not None)]


def _enter_all(world: World, place: Place, file: ValueFile) -> None:
    """Enter what a variable file says: points as columns, the rest one by one."""
    entries, base = file.entries, world.slot_base[file.source.name]
    places = [layout.kind in POSITIONS for layout in entries.layouts]
    known = np.array(places, dtype=bool)[entries.layout]
    known &= np.isfinite(entries.numbers).all(axis=1)
    known &= np.isin(entries.arm, (0, world.arm))
    shared = np.array([layout.shared for layout in entries.layouts], dtype=bool)
    shared, taught = shared[entries.layout], np.zeros(len(known), dtype=bool)
    named = np.fromiter(entries.row.values(), np.int64, len(entries.row))
    own, other = known.copy(), {}
    for row in _told_by_declaration(place.program, entries):
        name = entries.name[row].lower()
        root = root_of(name)
        declared = place.program.variables[root]
        taught[row], shared[row] = (
            declared.taught,
            shared[row] | bool(declared.exported),
        )
        if known[row] and declared.exported:
            own[row] = False
            other[world.root(place, root) + name[len(root) :]] = row
    for row in named[~known[named]].tolist():
        name = entries.name[row].lower()
        root = root_of(name)
        key = world.root(place, root) + name[len(root) :]
        _enter(world, file, entries.entry(row), key)
    prefix = f"{place.program.name}/"
    world.initial.points = Points(prefix, own, other, entries, base, shared, taught)


def _told_by_declaration(program: Program, entries: Entries) -> list[int]:
    """List the rows of variables that are exported, or marked as taught."""
    marked = {*program.variables.which(lambda v: v.taught or bool(v.exported))}
    if not marked:
        return []
    return [row for name, row in entries.row.items() if root_of(name) in marked]


def _enter(world: World, file: ValueFile, entry: Entry, key: str) -> None:
    """Enter a value that is no known point, where there is any."""
    value: Value | None = entry.numbers[0] if entry.numbers else None
    if entry.kind in POSITIONS:
        value = Nothing(f"its value is not initialised in {file.source.name}")
    if entry.kind == "VEC":
        x, y, z = entry.numbers[:3]
        value = Vector((x, y, z))
    if value is None and "." in entry.name:  # that it is there counts, see `nodes`
        value = Nothing(f"its value in {file.source.name} is no number")
    if entry.arm not in (0, world.arm):
        value = Nothing(f"its value is one of arm {entry.arm}")
    if value is not None:
        world.initial[key] = value
