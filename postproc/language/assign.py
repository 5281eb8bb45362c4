"""Assignments: what a variable, a component or a setting holds afterwards."""

from __future__ import annotations

from dataclasses import replace

from postproc.language import pdl2 as ast
from postproc.language.copies import copied, forget_key, owned
from postproc.language.evaluate import FRAMES, component_index
from postproc.language.machine import Here
from postproc.language.target import Target
from postproc.language.values import Nothing, Position, Value, Written


def assign(here: Here, statement: ast.Assign, taught: bool) -> None:
    """Let an assignment have its effect; `taught` marks the literal in it."""
    new = statement.value
    if statement.operator != ":=":
        new = ast.Binary(statement.operator[0], statement.target, statement.value)
    if _assigns_component(here, statement.target):
        _assign_component(here, statement.target, here.written(new))
        return
    if not statement.target.name.startswith("$") and copied(
        here, new, statement.target
    ):
        return
    value = here.value(new)
    if taught and isinstance(value, Position):
        value = replace(value, taught=True)
    if statement.target.name.startswith("$"):
        part = here.frame_part(statement.target)
        if part is None:
            _setting(here, statement.target, value)
        else:
            _frame_part(here, *part, value, taught)
        return
    target = here.locate(statement.target)
    if not target.exact:
        for key in target.keys:
            forget_key(here, key, "an element known only at run time is assigned")
        return
    held = _new_value(here, statement, target, value)
    if isinstance(held, Position):
        held = owned(here, statement.target.name, target.key, held)
    if isinstance(held, Nothing) and target.component == ():
        here.store.forget(target.key, held.why)
    else:
        here.store.write(target.key, held)


def _assigns_component(here: Here, reference: ast.Reference) -> bool:
    """Tell whether a reference means one of a position's six numbers."""
    if reference.name.startswith("$"):
        return False
    target = here.locate(reference)
    return target.exact and component_index(target) >= 0


def _assign_component(here: Here, reference: ast.Reference, new: Written) -> None:
    """Replace one of the six numbers of a position."""
    target = here.locate(reference)
    held = here.store.read(target.key)
    if not isinstance(held, Position):
        held = _blank(here, reference.name, held)
    held = held.with_component(component_index(target), new)
    here.store.write(target.key, owned(here, reference.name, target.key, held))


def _setting(here: Here, reference: ast.Reference, value: Value) -> None:
    """Change a frame or motion variable of our arm."""
    name = here.setting_name(reference)
    if name is None:
        if reference.name[1:] in FRAMES:
            why = f"a part of {reference.name.upper()} is assigned"
            here.store.set(**{reference.name[1:]: Nothing(why)})
        elif reference.name == "$arm_data" and _whose(here, reference) is None:
            field = str((*reference.steps, "")[1]).lstrip("$")
            here.store.set(**{field: Nothing("it is set for an arm known at run time")})
        return
    here.world.pin(value, f"${name.upper()} is set to it")
    if f"${name}" in here.volatile:
        value = Nothing("a condition handler changes it")
    here.store.set(**{name: value})


def _frame_part(here: Here, name: str, at: int, value: Value, taught: bool) -> None:
    """Change one of the six numbers of a frame of our arm.

    The cell may say of its own frames that they were taught: what comes of one whose
    numbers change is not known then.
    """
    held = here.store.settings.get(name)
    if not isinstance(held, Position):
        held = Position()
    number = value if isinstance(value, float) else None
    new: Value = replace(
        held.with_component(at, Written(number)), taught=held.taught or taught
    )
    if any(held.numbers) and held.numbers in here.world.start.records:
        new = Nothing(f"a part of ${name.upper()}, which the cell gives, is assigned")
    if f"${name}" in here.volatile:
        new = Nothing("a condition handler changes it")
    here.store.set(**{name: new})


def _whose(here: Here, reference: ast.Reference) -> int | None:
    """Return the arm that ``$ARM_DATA[n]`` names, None where it is not known."""
    first = reference.steps[0] if reference.steps else None
    if isinstance(first, ast.Index) and not isinstance(first.subscripts[0], tuple):
        return here.integer(first.subscripts[0])
    return 0


def _new_value(
    here: Here, statement: ast.Assign, target: Target, value: Value
) -> Value:
    if target.component == ():
        return value
    held = here.store.read(target.key)
    if not isinstance(held, Position):
        held = _blank(here, statement.target.name, held)
    number = value if isinstance(value, float) else None
    match target.component:
        case ("pos", _):
            if not isinstance(value, Position):
                why = value.why if isinstance(value, Nothing) else "it is no position"
                return Nothing(why)
            return replace(value, aux=held.aux, taught=value.taught or held.taught)
        case ("aux", axis):
            return held.with_aux(axis, number)
        case ("joint", axis):
            return held.with_aux(axis - 6, number)
    return Nothing("a part of it known only at run time is assigned")


def _blank(here: Here, name: str, held: Value) -> Position:
    """Return a position of which nothing is known yet."""
    type_ = here.world.type_of(here.place, name)
    joints = type_ is not None and type_.name == "jointpos"
    never = isinstance(held, Nothing) and held.why.startswith("it has no value")
    return Position(joints, aux=() if never else None)
