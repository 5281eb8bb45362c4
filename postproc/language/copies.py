"""Whole records, arrays and nodes: what they hold is copied part by part."""

from __future__ import annotations

from dataclasses import replace

from postproc.language import pdl2 as ast
from postproc.language.evaluate import Point
from postproc.language.values import Nothing, Position, Value, unsure

SINGLE = frozenset(
    "integer real boolean string vector position jointpos xtndpos semaphore".split()
)


def copied(here: Point, value: ast.Expression, target: ast.Reference) -> bool:
    """Let a variable hold the parts of another one; tell whether it has parts."""
    origin = bare(value)
    if origin is None or not _may_have_parts(here, origin):
        return False
    parts = parts_of(here, origin)
    place, source = here.locate(target), here.locate(origin)
    if not parts or place.component != () or source.component != ():
        return False
    if place.exact and source.exact and origin.name not in here.volatile:
        fill(here, place.key, target.name, origin.name, parts)
        return True
    for part in parts.values():
        here.world.pin(part, f"{origin.name} is copied, to where only the run tells")
    for key in place.keys:
        forget_key(here, key, f"a copy of {origin.name} is assigned")
    return True


def bare(value: ast.Expression | None) -> ast.Reference | None:
    """Return the variable that an expression is, with or without parentheses."""
    if isinstance(value, ast.Unary) and value.operator == "()":
        value = value.operand
    named = isinstance(value, ast.Reference) and not value.name.startswith("$")
    return value if named and isinstance(value, ast.Reference) else None


def _may_have_parts(here: Point, origin: ast.Reference) -> bool:
    type_ = here.world.type_of(here.place, origin.name)
    if type_ is None or type_.array or type_.path:
        return True
    return type_.name not in SINGLE


def parts_of(here: Point, origin: ast.Reference) -> dict[str, Value]:
    """Return what is known of the elements and fields of a variable.

    Standard fields of nodes count too where what they hold is not known.

    Returns:
        Values by what follows the variable's own key: ``[2]``, ``.place``.
    """
    found: dict[str, Value] = {}
    for key in sorted(here.locate(origin).keys):
        for part in parts_under(here, key):
            value = here.store.read(part)
            if not isinstance(value, Nothing) or is_standard(part):
                found[part[len(key) :]] = value
    return found


def parts_under(here: Point, key: str) -> list[str]:
    """Return the keys of elements and fields that a key has or ever had."""
    return here.world.first_parts(key) + here.store.parts(key)


def is_standard(key: str) -> bool:
    """Tell whether a key is that of a standard field of a node: ``n.$main_pos``."""
    return key.rpartition(".")[2].startswith("$")


def forget_key(here: Point, key: str, why: str) -> None:
    """Forget what a key and its parts hold: any of it may still be there."""
    if key in here.store.compound or here.world.first_parts(key):
        here.world.loosen(key, why)
    here.store.forget(key, why)


def fill(
    here: Point, key: str, name: str, origin: str, parts: dict[str, Value]
) -> None:
    """Let a key hold parts, and nothing else."""
    here.store.forget(key, f"{origin}, of which it is a copy, has no value for it")
    for suffix, value in parts.items():
        if isinstance(value, Position):
            value = owned(here, name, key + suffix, value)
        if isinstance(value, Nothing):
            value = unsure(value, here.store.read(key + suffix))
        here.store.write(key + suffix, value)


def owned(here: Point, name: str, key: str, value: Position) -> Position:
    """Say which variable a literal is the value of."""
    declared = here.world.declared(here.place, name)
    shared = value.shared or bool(declared and declared.exported)
    taught = value.taught or bool(declared and declared.taught)
    owner = value.name or here.world.written(key)
    here.world.hold(key, value)
    return replace(value, name=owner, shared=shared, taught=taught)
