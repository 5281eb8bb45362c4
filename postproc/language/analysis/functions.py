"""Functions of one number that every language has."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping, Sequence

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
