"""Expressions of PDL2, with number slots.

Names are lower case (PDL2 does not tell cases apart). A `Number` knows only which
number of its line it is, so that one expression serves every line of its shape.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Number:
    """The number in a slot of the line."""

    slot: int


@dataclass(frozen=True, slots=True)
class Text:
    """A string, without its quotes and otherwise verbatim."""

    value: str


@dataclass(frozen=True, slots=True)
class Index:
    """``[i, j]`` after a name; a pair is a range."""

    subscripts: tuple[Expression | tuple[Expression, Expression], ...]


@dataclass(frozen=True, slots=True)
class Reference:
    """A variable: its name, then fields and indices."""

    name: str
    steps: tuple[str | Index, ...] = ()


@dataclass(frozen=True, slots=True)
class Invoke:
    """A call that returns a value; an argument may be missing."""

    name: str
    arguments: tuple[Expression | None, ...]


@dataclass(frozen=True, slots=True)
class Unary:
    """An operator before its operand; ``()`` is a variable in parentheses.

    As an argument that is the variable's value, not the variable itself.
    """

    operator: str
    operand: Expression


@dataclass(frozen=True, slots=True)
class Binary:
    """An operator between two operands."""

    operator: str
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True)
class Aggregate:
    """``{j1, .., jn}``."""

    items: tuple[Expression, ...]


Expression = Number | Text | Reference | Invoke | Unary | Binary | Aggregate
