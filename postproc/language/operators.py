"""Operators and functions on values as far as they are known."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from dataclasses import replace

from postproc.language.values import (
    COMPONENTS,
    Nothing,
    Position,
    Value,
    Vector,
    composed,
)

RUN_TIME = Nothing("it is known only at run time")

FUNCTIONS = frozenset("abs sqrt sin cos tan round trunc".split())
_ARITHMETIC: dict[str, Callable[[float, float], float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "DIV": lambda a, b: float(math.trunc(a / b)),
    "MOD": math.fmod,
}
_COMPARE: dict[str, Callable[[float, float], bool]] = {
    "=": operator.eq,
    "<>": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


def part_of(held: Value, component: tuple[str, int] | tuple[()] | None) -> Value:
    """Return a component of a position or vector."""
    if not isinstance(held, Position | Vector):
        return held if isinstance(held, Nothing) else RUN_TIME
    number: float | None = None
    match component:
        case ("pos", _) if isinstance(held, Position):
            return replace(held, aux=())
        case ("aux", axis) if isinstance(held, Position) and held.aux is not None:
            number = dict(held.aux).get(axis)
        case ("joint", axis) if 1 <= axis <= len(held.numbers):
            number = held.numbers[axis - 1]
        case (str(name), _) if COMPONENTS.get(name, 9) < len(held.numbers):
            number = held.numbers[COMPONENTS[name]]
    return RUN_TIME if number is None else number


def unary(sign: str, value: Value) -> Value:
    """Return what an operator makes of its operand."""
    if sign == "NOT" and isinstance(value, bool):
        return not value
    if isinstance(value, float):
        return -value if sign == "-" else value
    if isinstance(value, Vector) and sign == "-" and None not in value.numbers:
        x, y, z = (-n for n in value.numbers if n is not None)
        return Vector((x, y, z))
    return value if isinstance(value, Nothing) else RUN_TIME


def binary(sign: str, a: Value, b: Value) -> Value:
    """Return what an operator makes of its operands."""
    if sign in ("AND", "OR"):
        decisive = sign == "OR"
        if a is decisive or b is decisive:
            return decisive
        if isinstance(a, bool) and isinstance(b, bool):
            return not decisive
    if isinstance(a, Position) and isinstance(b, Position) and sign == ":":
        return composed(a, b)
    if isinstance(a, Vector) and isinstance(b, Vector) and sign in "+-":
        return _add(a, b, sign)
    if sign in _COMPARE and type(a) is type(b) and isinstance(a, float | str | bool):
        return _COMPARE[sign](a, b)  # type: ignore[arg-type]
    if isinstance(a, float) and isinstance(b, float) and sign in _ARITHMETIC:
        try:
            return _ARITHMETIC[sign](a, b)
        except (ArithmeticError, ValueError):
            return Nothing("the arithmetic has no result")
    return next((v for v in (a, b) if isinstance(v, Nothing)), RUN_TIME)


def _add(a: Vector, b: Vector, sign: str) -> Value:
    if None in a.numbers or None in b.numbers:
        return RUN_TIME
    x, y, z = (
        _ARITHMETIC[sign](m, n)  # type: ignore[arg-type]
        for m, n in zip(a.numbers, b.numbers, strict=True)
    )
    return Vector((x, y, z))


def function(name: str, x: float) -> Value:
    """Return what a built-in function of one number gives (angles in degrees)."""
    if name in ("sin", "cos", "tan"):
        return float(getattr(math, name)(math.radians(x)))
    if name == "sqrt":
        return math.sqrt(x) if x >= 0 else Nothing("the root of a negative number")
    if name == "round":
        return float(math.floor(x + 0.5))
    return abs(x) if name == "abs" else float(math.trunc(x))
