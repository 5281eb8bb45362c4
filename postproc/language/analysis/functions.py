"""Functions of one number that every language has."""

from __future__ import annotations

import math
from collections.abc import Sequence

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


def apply_operator(operator: str, parts: Sequence[float]) -> float:
    """Compute what an operator gives, NaN where that is no number.

    >>> apply_operator("-", [5.0]), apply_operator("*", [2.0, 4.0])
    (-5.0, 8.0)
    """
    match operator, parts:
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
    return math.nan
