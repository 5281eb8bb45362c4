"""What variables hold before a program assigns them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from postproc.language.diagnostic import Diagnostic
from postproc.language.entry_columns import POSITIONS
from postproc.language.evaluate import Point
from postproc.language.initial_values import Points
from postproc.language.lsv import Entry, Variables
from postproc.language.program import Body, Program, Variable
from postproc.language.store import Store, root_of
from postproc.language.values import Nothing, Position, Value, Vector
from postproc.language.world import Place, World, base_variable


def fill_initial(world: World) -> None:
    """Enter declared initial values, constants and the variable file's values."""
    for program in world.programs():
        bodies = [b for b in (program.main, *program.routines.values()) if b]
        for body in bodies:
            seen: Mapping[str, Variable] = program.variables
            if body is not bodies[0]:  # it sees the rest as the first body does
                hidden = bodies[0].own_names | body.own_names
                seen = {name: seen[name] for name in hidden if name in seen}
            _declared(world, program, body, seen)
    if world.variables is not None and world.main.main is not None:
        place = Place(world.main, world.main.main)
        _enter_all(world, place, world.variables)
        _report_drift(world, place, world.variables)


def _report_drift(world: World, place: Place, file: Variables) -> None:
    """Say where a program and its variable file have drifted apart."""
    for found in file.diagnostics:
        world.diagnostics[found] = None
    words = place.program.statements.words()
    written = [file.entries.name[row] for row in file.entries.row.values()]
    names = {base_variable(name): name.partition(".")[0] for name in written}
    unused = [written for name, written in names.items() if name not in words]
    undeclared = [
        written
        for name, written in names.items()
        if name in words and world.declared(place, name) is None
    ]
    if names and len(unused) == len(names):
        _say(world, file, "lsv-other-program", "none of its variables is used by "
             f"{place.program.name}: is it the file of another program?")  # fmt: skip
    elif unused:
        _say(world, file, "lsv-unused", f"never used: {_some(unused)}")
    if undeclared:
        text = f"used by the program, but not declared there: {_some(undeclared)}"
        _say(world, file, "lsv-undeclared", text)


def _say(world: World, file: Variables, code: str, text: str) -> None:
    world.diagnostics[Diagnostic(file.source.name, 1, code, text)] = None


def _some(names: list[str]) -> str:
    rest = f" and {len(names) - 10} more" if len(names) > 10 else ""
    return ", ".join(names[:10]) + rest


def _declared(
    world: World, program: Program, body: Body, seen: Mapping[str, Variable]
) -> None:
    place = Place(program, body)
    store = Store(world.initial.find)
    for variable in (*seen.values(), *body.variables.values()):
        key = world.root(place, variable.name.lower())
        world.spelling.setdefault(key, variable.name)
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


def _enter_all(world: World, place: Place, file: Variables) -> None:
    """Enter what a variable file says: points as columns, the rest one by one."""
    entries, base = file.entries, world.slot_base[file.source.name]
    places = [layout.kind in POSITIONS for layout in entries.layouts]
    known = np.array(places, dtype=bool)[entries.layout]
    known &= np.isfinite(entries.numbers).all(axis=1)
    known &= np.isin(entries.arm, (0, world.arm))
    shared = np.array([layout.shared for layout in entries.layouts], dtype=bool)
    points = Points(
        {}, entries, base, shared[entries.layout], np.zeros(len(known), dtype=bool)
    )
    told = known.tolist()
    for name, row in entries.row.items():
        root = root_of(name)
        key = world.root(place, root) + name[len(root) :]
        declared = world.declared(place, root)
        if told[row]:
            points.row[key] = row
            if declared is not None and declared.taught:
                points.taught[row] = True
            if declared is not None and declared.exported:
                points.shared[row] = True
        elif not _entered(world, file, entries.entry(row), key):
            continue
        world.spelling.setdefault(key, entries.name[row])
    world.initial.points = points


def _entered(world: World, file: Variables, entry: Entry, key: str) -> bool:
    """Enter a value that is no known point; tell whether there is any."""
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
    return value is not None
