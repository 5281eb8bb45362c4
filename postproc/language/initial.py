"""What variables hold before a program assigns them."""

from __future__ import annotations

import re
from dataclasses import replace

from postproc.language.diagnostic import Diagnostic
from postproc.language.evaluate import Point
from postproc.language.lsv import Entry, Variables
from postproc.language.program import Body, Program
from postproc.language.store import Store
from postproc.language.values import Nothing, Position, Value, Vector
from postproc.language.world import Place, World, base_variable

_WORD = re.compile(r"[A-Za-z_]\w*")
_POSITIONS = ("POS", "XTND", "JNTP")


def fill_initial(world: World) -> None:
    """Enter declared initial values, constants and the variable file's values."""
    for program in world.programs():
        bodies = [b for b in (program.main, *program.routines.values()) if b]
        for body in bodies:
            _declared(world, program, body)
    if world.variables is not None and world.main.main is not None:
        place = Place(world.main, world.main.main)
        for entry in world.variables.entries.values():
            _entered(world, place, world.variables, entry)
        _report_drift(world, place, world.variables)


def _report_drift(world: World, place: Place, file: Variables) -> None:
    """Say where a program and its variable file have drifted apart."""
    for found in file.diagnostics:
        world.diagnostics[found] = None
    words = {
        word.lower()
        for mask in place.program.lines.shapes
        for word in _WORD.findall(mask)
    }
    names = {base_variable(entry.name): entry.name for entry in file.entries.values()}
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


def _declared(world: World, program: Program, body: Body) -> None:
    place = Place(program, body)
    store = Store(world.initial.get)
    for variable in (*program.variables.values(), *body.variables.values()):
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


def _entered(world: World, place: Place, file: Variables, entry: Entry) -> None:
    name = entry.name.lower()
    root = base_variable(name)
    key = world.root(place, root) + name[len(root) :]
    declared = world.declared(place, root)
    base = world.slot_base[file.source.name]
    value: Value | None = entry.numbers[0] if entry.numbers else None
    if entry.kind in _POSITIONS:
        value = Position(
            entry.kind == "JNTP",
            entry.numbers,
            tuple(base + s if s >= 0 else -1 for s in entry.slots),
            entry.config,
            entry.aux,
            entry.name,
            taught=bool(declared and declared.taught),
            shared=entry.shared or bool(declared and declared.exported),
        )
    if entry.kind == "VEC":
        x, y, z = entry.numbers[:3]
        value = Vector((x, y, z))
    if entry.arm not in (0, world.arm):
        value = Nothing(f"its value is one of arm {entry.arm}")
    if isinstance(value, Position) and not value.complete:
        value = Nothing(f"its value is not initialised in {file.source.name}")
    if value is not None:
        world.initial[key] = value
        world.spelling.setdefault(key, entry.name)
