"""What variables hold before a program assigns them: by files, programs, runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from postproc.diagnostics import Code
from postproc.files import base_name
from postproc.language.analysis.shared_changes import describe_changes
from postproc.language.language import matches
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.abstract_state import (
    NEVER_SET,
    GivenValues,
    Store,
    root_of,
    wholes,
)
from postproc.language.pdl2.entries import POSITIONS, Entries
from postproc.language.pdl2.evaluate import Execution
from postproc.language.pdl2.job import Place, World, base_variable
from postproc.language.pdl2.machine import (
    OTHERS_WRITE,
)
from postproc.language.pdl2.other_programs import find_changes
from postproc.language.pdl2.program import Program, Variable, Variables
from postproc.language.pdl2.side_effects import (
    rows_effects,
)
from postproc.language.pdl2.values import (
    Nothing,
    Position,
    Value,
    Vector,
    add_unknown,
    join_components,
    may_be,
    points_of,
)
from postproc.language.pdl2.variable_file import VariableFile
from postproc.language.text.symbol_column import NameColumn
from postproc.language.visits import Diagnostic

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
    return type_ is not None and (type_.path or type_.name in ast.POINTS | {"vector"})


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


# What the files of the job say.


def fill_initial(world: World) -> None:
    """Enter declared initial values, constants and the variable file's values."""
    world.changed_elsewhere = {
        key: changes
        for key, changes in find_changes(world.beside).items()
        if not _is_constant(world, key)
    }
    world.changing = changing_variables(world) | world.changed_elsewhere.keys()
    world.imported = find_imported_points(world)
    for place, seen in world.declarations():
        _enter_declarations(world, place, seen)
    if world.variables is not None and world.main.main is not None:
        place = world.place(world.main, world.main.main)
        _enter_all(world, place, world.variables)
        _report_drift(world, place, world.variables)


def _report_drift(world: World, place: Place, file: VariableFile) -> None:
    """Say where a program and its variable file have drifted apart."""
    for found in file.diagnostics:
        world.diagnostics[found] = None
    entries, names = file.entries, file.entries.row.names
    written: Sequence[str] = entries.name.take(entries.row.rows.astype(np.int64))
    if entries.parts:
        bases = {base_variable(name): name.partition(".")[0] for name in written}
        names, written = NameColumn(bases), [*bases.values()]
    used = place.program.lines.said.tell(names)
    declared = place.program.variables.names.find(names) >= 0
    if used.all() and declared.all():  # as nearly always
        return
    unused = [written[k] for k in np.flatnonzero(~used).tolist()]
    undeclared = [written[k] for k in np.flatnonzero(used & ~declared).tolist()]
    if names and len(unused) == len(names):
        _say(world, file, Code.LSV_OTHER_PROGRAM, "none of its variables is used by "
             f"{place.program.name}: is it the file of another program?")  # fmt: skip
    elif unused:
        _say(world, file, Code.LSV_UNUSED, f"never used: {_some(unused)}")
    if undeclared:
        text = f"used by the program, but not declared there: {_some(undeclared)}"
        _say(world, file, Code.LSV_UNDECLARED, text)


def _say(world: World, file: VariableFile, code: Code, text: str) -> None:
    world.diagnostics[Diagnostic(file.source.name, 1, code, text)] = None


def _some(names: list[str]) -> str:
    rest = f" and {len(names) - 10} more" if len(names) > 10 else ""
    return ", ".join(names[:10]) + rest


def _enter_declarations(world: World, place: Place, seen: Variables) -> None:
    """Enter the initial values of declarations, one by one: most have none."""
    store = Store(world.initial.find)
    for variable in (*_with_value(seen), *_with_value(place.body.variables)):
        key = world.root(place, variable.name.lower())
        if variable.initial is None or key in world.initial:
            continue
        if why := _why_untrusted(world, key):
            world.initial[key] = Nothing(why)
            continue
        value = Execution(world, place, variable.row, store).value(variable.initial)
        if variable.arm not in (0, world.arm):
            value = Nothing(points_of(variable.arm))
        if isinstance(value, Position) and not value.name:
            value = replace(
                value, name=variable.name, shared=bool(variable.exported),
                taught=variable.taught or world.is_listed(variable.name),
            )  # fmt: skip
        world.initial[key] = value


def _with_value(seen: Variables) -> list[Variable]:
    return [seen[name] for name in seen.which(lambda said: said.initial is not None)]


def _enter_all(world: World, place: Place, file: VariableFile) -> None:
    """Enter what a variable file says: points as columns, the rest one by one."""
    entries, base = file.entries, world.numbering.first[-2]
    places = [layout.kind in POSITIONS for layout in entries.layouts]
    known = np.array(places, dtype=bool)[entries.layout]
    known &= np.isfinite(entries.numbers).all(axis=1)
    known &= np.isin(entries.arm, (0, world.arm))
    of_other_arm = _list_rows_where(
        lambda v: v.arm not in (0, world.arm), place.program, entries
    )
    known[of_other_arm] = False
    shared = np.array([layout.shared for layout in entries.layouts], dtype=bool)
    shared, taught = shared[entries.layout], np.zeros(len(known), dtype=bool)
    named = entries.row.rows
    own, exported = known.copy(), dict[str, int]()
    elsewhere = {key.partition("/")[2] for key in world.changed_elsewhere}
    marked = _list_rows_where(
        lambda v: v.taught or bool(v.exported) or v.name.lower() in elsewhere,
        place.program, entries,
    )  # fmt: skip
    if world.start.taught:
        taught |= [world.is_listed(name) for name in entries.name]
    for row in marked:
        name = entries.name[row].lower()
        root = root_of(name)
        declared = place.program.variables[root]
        taught[row] |= declared.taught
        shared[row] |= bool(declared.exported)
        key = world.root(place, root)
        why = _why_untrusted(world, key)
        if known[row] and (declared.exported or why):
            own[row] = False
            if why:
                world.initial[key + name[len(root) :]] = Nothing(why)
            else:
                exported[key + name[len(root) :]] = row
    for row in named[~known[named]].tolist():
        name = entries.name[row].lower()
        root = root_of(name)
        key = world.root(place, root) + name[len(root) :]
        arm = world.other_arm(place, root)
        _enter(world, file, row, key, arm)
    initial = world.initial
    initial.prefix = f"{place.program.name}/"
    initial.entries, initial.base, initial.own = entries, base, own
    initial.shared, initial.taught = shared, taught
    initial.used = np.zeros(len(own), bool)
    for key, row in exported.items():
        initial[key] = initial.position(row)


def _list_rows_where(
    holds: Callable[[Variable], bool], program: Program, entries: Entries
) -> list[int]:
    """List the rows of variables whose declaration fulfils a condition."""
    names = {*program.variables.which(holds)}
    if not names:
        return []
    return [row for name, row in entries.row.items() if root_of(name) in names]


def _enter(world: World, file: VariableFile, row: int, key: str, arm: int) -> None:
    """Enter a value that is no known point, where there is any, or another arm's."""
    entries, kind = file.entries, file.entries.layout_of(row).kind
    numbers, own = entries.numbers_of(row), int(entries.arm[row])
    value: Value | None = None if math.isnan(numbers[0]) else numbers[0]
    if kind in POSITIONS:
        value = Nothing(
            f"its value is not initialised in {file.source.name}",
            code=Code.LSV_UNINITIALISED,
        )
    if kind == "VEC":
        x, y, z = numbers[:3]
        value = Vector((x, y, z))
    if value is None and "." in entries.name[row]:  # that it is there counts
        value = Nothing(f"its value in {file.source.name} is no number")
    if arm or own not in (0, world.arm):
        value = Nothing(points_of(arm or own))
    if value is not None:
        why = _why_untrusted(world, root_of(key))
        world.initial[key] = Nothing(why) if why else value


def _why_untrusted(world: World, root: str) -> str:
    """Say why the first value of a variable is not taken from a file, else ""."""
    if root in world.imported:
        return IMPORTED
    if others := world.changed_elsewhere.get(root):
        return f"it {describe_changes(others)}"
    return OTHERS_WRITE if root in world.changing else ""


# What an earlier run has left.

CHANGED = (
    "the program changes it, and the next run begins with what this one leaves: assign "
    "all of it before it is used"
)
RUNS = 4  # that are followed one by one; what they change is then taken for anything


def keep_values(world: World, given: GivenValues, runs: int) -> bool:
    """Let a job begin also with what a run of it may leave; tell if that is new.

    A run may end anywhere, so that a variable may begin with all that it is ever given.
    Only what the program takes before it assigns it is looked at.

    Args:
        world: The job, as it was followed.
        given: What its variables are given at any time.
        runs: How often it was followed.
    """
    found: dict[str, Value] = {}
    for key, value in _list_endings(world, given):
        found[key] = join_components(found.get(key, value), value)
    if runs >= RUNS:
        every = frozenset().union(*map(given.numbers, given))
        found = dict.fromkeys(found, Nothing(CHANGED, every))
    changed = False
    for key, value in found.items():
        numbers = given.numbers(key) | may_be(value)
        before = world.initial.find(key)
        after = _either(before, value, numbers)
        if after is None or after == before:
            continue
        lost = (numbers | may_be(before)) - may_be(after)
        world.pin(Nothing(CHANGED, lost), CHANGED)
        world.initial.change(key, after)
        changed = True
    return changed


def _list_endings(world: World, given: GivenValues) -> Iterator[tuple[str, Value]]:
    """Yield keys that a run takes as it finds them, and what it may leave there."""
    # Variables of routines begin anew with every call.
    kept = {key for key in given if ":" not in key.partition("/")[0]}
    asked = {*world.initial.asked}
    for key in kept:
        value = given.value(key)
        if world.initial.is_asked(key) or not asked.isdisjoint(wholes(key)):
            yield key, value
        if isinstance(value, Nothing):  # it hides its elements and fields
            parts = filter(world.initial.is_asked, world.first_parts(key))
            yield from ((part, value) for part in parts)
    for key in asked:
        for whole in kept.intersection(wholes(key)):
            value = given.value(whole)
            if isinstance(value, Nothing):
                yield key, value


def _either(before: Value | None, left: Value, numbers: frozenset[int]) -> Value | None:
    """Return what a key holds that begins with one value or another, None for none.

    Args:
        before: What the files say.
        left: What a run leaves.
        numbers: Numbers of the positions that it may leave.
    """
    if before is None:
        return replace(NEVER_SET, of=numbers) if numbers else None
    found = join_components(before, left)
    if isinstance(found, Nothing):
        why = found if isinstance(before, Nothing) else Nothing(CHANGED, found.of)
        return add_unknown(why, Nothing("", numbers))
    return found
