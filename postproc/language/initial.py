"""What variables hold before a program assigns them."""

from __future__ import annotations

from dataclasses import replace

from postproc.language.evaluate import Point
from postproc.language.lsv import Entry, Variables
from postproc.language.store import Store
from postproc.language.structure import Body, Program
from postproc.language.values import Nothing, Position, Value
from postproc.language.world import Place, World

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
    at = min((i for i in map(name.find, "[.") if i > 0), default=len(name))
    key = world.root(place, name[:at]) + name[at:]
    declared = world.declared(place, name[:at])
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
    if entry.arm not in (0, world.arm):
        value = Nothing(f"its value is one of arm {entry.arm}")
    if isinstance(value, Position) and not value.complete:
        value = Nothing(f"its value is not initialised in {file.source.name}")
    if value is not None:
        world.initial[key] = value
        world.spelling.setdefault(key, entry.name)
