"""Values that are known before a program runs, and what functions make of them."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property


@dataclass(frozen=True, slots=True)
class WrittenNumber:
    """A number: its value, and where it is written.

    Attributes:
        value: Its value, NaN where it is not known.
        slot: Index of the number among those of the job, -1 where it is computed.
        along: It is the number of its slot plus a constant.
    """

    value: float
    slot: int = -1
    along: bool = False


@dataclass(frozen=True)
class KnownRecord:
    """The components of an aggregate by name, those that are known.

    Attributes:
        fields: Names and values.
        whole: All that are written are known.
    """

    fields: tuple[tuple[str, Value], ...]
    whole: bool = True

    @cached_property
    def by_name(self) -> Mapping[str, Value]:
        """The components by their names."""
        return dict(self.fields)

    def get(self, name: str) -> Value | None:
        """Return a component, None where it is not there."""
        return self.by_name.get(name)

    def number(self, name: str) -> float:
        """Return a component that is a number, NaN where it is none."""
        return number_in(self.get(name))


Value = WrittenNumber | KnownRecord | str | tuple["Value", ...]
"""A tuple is an array, or a record whose components go by their order."""

Layout = Mapping[str, "Layout"]
"""The components of a record in their order, and their own; a value has none."""


def number_in(found: Value | None) -> float:
    """Return a number, NaN where there is none."""
    return found.value if isinstance(found, WrittenNumber) else math.nan


def leaves_of(layout: Layout, prefix: str = "") -> list[str]:
    """Spell the values of a record in their order, with all that they are in."""
    found: list[str] = []
    for name, inside in layout.items():
        found += leaves_of(inside, f"{prefix}{name}.") if inside else [prefix + name]
    return found


def spell_components(layout: Layout, component: str) -> list[str]:
    """Return the values of a record, or of a part of it, as they are spelt.

    That of data that are no record is "".

    >>> pose = {"trans": {"x": {}, "y": {}}, "rot": {"q1": {}}}
    >>> spell_components(pose, "trans"), spell_components(pose, "x")
    (['trans.x', 'trans.y'], [])
    """
    every = leaves_of(layout)
    if not component:
        return every or [""]
    return [one for one in every if f"{one}.".startswith(f"{component}.")]


def list_leaves(found: Value | None) -> Iterator[WrittenNumber | KnownRecord | str]:
    """Yield the values of a record or an array in their order."""
    if isinstance(found, tuple):
        for one in found:
            yield from list_leaves(one)
    elif found is not None:
        yield found


def list_slots_in(found: Value | None) -> Iterator[int]:
    """Yield where the numbers of a value are written."""
    if isinstance(found, KnownRecord):
        found = tuple(one for _, one in found.fields)
    for one in found if isinstance(found, tuple) else ():
        yield from list_slots_in(one)
    if isinstance(found, WrittenNumber) and found.slot >= 0:
        yield found.slot


def without_places(found: Value | None) -> Value | None:
    """Return values without where they are written."""
    if isinstance(found, tuple):
        parts = [without_places(one) for one in found]
        return tuple(one for one in parts if one is not None)
    if isinstance(found, KnownRecord):
        fields = [(name, without_places(one)) for name, one in found.fields]
        known = tuple((name, one) for name, one in fields if one is not None)
        return replace(found, fields=known)
    return WrittenNumber(found.value) if isinstance(found, WrittenNumber) else found


def is_written(found: Value | None) -> bool:
    """Tell whether all numbers of a value stand in a text."""
    if isinstance(found, KnownRecord):
        return all(is_written(one) for _, one in found.fields)
    if isinstance(found, tuple):
        return all(map(is_written, found))
    return not isinstance(found, WrittenNumber) or found.slot >= 0


def take_apart(found: Value | None, names: list[str]) -> dict[str, Value]:
    """Return the values in a record by their names, nothing where it has others.

    Args:
        found: The record.
        names: How its values are spelt, in their order.
    """
    if isinstance(found, KnownRecord):
        return dict(found.fields)
    own = [*list_leaves(found)]
    return dict(zip(names, own, strict=True)) if len(own) == len(names) else {}


def put_together(found: Mapping[str, Value], layout: Layout, prefix: str = "") -> Value:
    """Put the values of a record together; those of other data are their only one."""
    if not layout:
        return found[prefix.rstrip(".")]
    return tuple(
        put_together(found, inside, f"{prefix}{name}.")
        for name, inside in layout.items()
    )


def step_into(
    value: Value | None, step: str | tuple[int, ...] | None, layout: Layout
) -> tuple[Value | None, Layout]:
    """Return a component or an element of a value, None without; and its layout.

    Args:
        value: The value.
        step: The name of a component, or the index of an element from 1.
        layout: Of the value, where it is a record.
    """
    if isinstance(step, str):
        inside = layout.get(step, {})
        if isinstance(value, KnownRecord):
            return value.get(step), inside
        step, layout = ([*layout].index(step) + 1,) if step in layout else (), inside
    for index in step or (0,):
        if not isinstance(value, tuple) or not 1 <= index <= len(value):
            return None, layout
        value = value[index - 1]
    return value, layout


# Functions of one number, and operators, that every language has.

ALIKE = frozenset("abs sqrt sin cos tan".split())  # the same in all languages
FUNCTIONS = ALIKE | {"round", "trunc"}


def apply_function(name: str, x: float) -> float:
    """Return what a function gives, NaN where that is no number.

    Args:
        name: Of the function, in lower case.
        x: Its argument [deg] where that is an angle.

    >>> round(apply_function("cos", 60.0), 12), apply_function("round", 2.5)
    (0.5, 3.0)
    """
    if not math.isfinite(x) or name not in FUNCTIONS:
        return math.nan
    if name in ("sin", "cos", "tan"):
        return float(getattr(math, name)(math.radians(x)))
    if name == "sqrt":
        return math.sqrt(x) if x >= 0 else math.nan
    if name == "round":
        return float(math.floor(x + 0.5))
    return abs(x) if name == "abs" else float(math.trunc(x))


def apply_operator(sign: str, parts: Sequence[float]) -> float:
    """Compute what an operator gives, NaN where that is no number; truth is 0 or 1.

    >>> apply_operator("-", [5.0]), apply_operator("*", [2.0, 4.0])
    (-5.0, 8.0)
    >>> apply_operator("<", [2.0, 4.0]), apply_operator("AND", [0.0, math.nan])
    (1.0, 0.0)
    """
    if sign in COMPARISONS and len(parts) == 2:
        return _compare(sign, *parts)
    match sign, parts:
        case "-", [a]:
            return -a
        case "+", [a]:
            return a
        case "+", [a, b]:
            return a + b
        case "-", [a, b]:
            return a - b
        case "*", [a, b]:
            return a * b
        case "/", [a, b] if b:
            return a / b
        case "DIV", [a, b] if b and math.isfinite(a / b):
            return float(math.trunc(a / b))
        case "MOD", [a, b] if b and math.isfinite(a):
            return math.fmod(a, b)
        case "NOT", [a]:
            return 1.0 - a
        case "INCR", [a]:
            return a + 1.0
        case "DECR", [a]:
            return a - 1.0
        case "CLEAR", [_]:
            return 0.0
        case "AND", [a, b]:
            return 0.0 if 0.0 in parts else a * b
        case "OR", [a, b]:
            return 1.0 if 1.0 in parts else a + b
    return math.nan


COMPARISONS: Mapping[str, Callable[[float, float], bool]] = {
    "=": operator.eq,
    "==": operator.eq,
    "<>": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
CLOSE = 1e-5  # of numbers that controllers, which round otherwise, may take for equal


def _compare(sign: str, a: float, b: float) -> float:
    """Compare two numbers; NaN where they are so close that rounding decides."""
    whole = a.is_integer() and b.is_integer()
    close = abs(a - b) <= CLOSE * max(1.0, abs(a), abs(b))
    if math.isnan(a + b) or (close and not whole):
        return math.nan
    return float(COMPARISONS[sign](a, b))
