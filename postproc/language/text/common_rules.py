"""What rules of a grammar mean that languages have alike, by their names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from postproc.language import ir
from postproc.language.text.template_parser import Children, Word


class SizePart(tuple[Any, ...]):
    """Indices, or the dimensions of an array."""


def low(text: str) -> str:
    """Return a name as all statements spell it."""
    return str(text).lower()


def branch(word: str) -> Callable[[Children], ir.Branch]:
    """Build a statement that ways part at, by what it is to blocks."""
    return lambda c: ir.Branch(word, tuple(c))


def count(c: Children) -> ir.ForLoop:
    """Build a loop that counts: its variable, first, last and step."""
    return ir.ForLoop(low(c[0]), c[1], c[2], c[3] if len(c) > 3 else None)


def build_item(c: Children) -> ir.DeclaredItem:
    """Build what is declared: its name, its dimensions and its value."""
    name, *rest = c
    sized = bool(rest) and isinstance(rest[0], SizePart)
    dimensions = tuple(rest[0]) if sized else ()
    return ir.DeclaredItem(low(name), dimensions, rest[-1] if rest[sized:] else None)


def _operation(c: Children) -> ir.Operation:
    operator = next(x for x in c if isinstance(x, Word))
    operands = tuple(x for x in c if not isinstance(x, Word))
    return ir.Operation(str(operator).upper(), operands)


COMMON: Mapping[str, Callable[[Children], Any]] = {
    "statement": lambda c: c[0],
    "end": lambda c: ir.BlockWord(low(c[0])),
    "block_word": lambda c: ir.BlockWord(low(c[0])),
    "parameters": lambda c: tuple(c),
    "dimensions": SizePart,
    "if_then": branch("if"),
    "else_if": branch("elseif"),
    "while_do": branch("while"),
    "loop": branch("loop"),
    "repeat": branch("repeat"),
    "until": branch("until"),
    "test": branch("test"),
    "case": branch("case"),
    "default": branch("default"),
    "for_to": count,
    "label": lambda c: ir.LabelMark(low(c[0])),
    "goto": lambda c: ir.JumpTo(low(c[0])),
    "return_value": lambda c: ir.Leave("return", *c),
    "assignment": lambda c: ir.Assignment(*c),
    "infix": _operation,
    "prefix": _operation,
    "number": lambda c: c[0],
    "string": lambda c: ir.StringLiteral(str(c[0])),
    "reference": lambda c: ir.DataObject(low(c[0]), tuple(c[1:])),
    "component": lambda c: low(c[0]),
    "element": lambda c: ir.ElementStep(tuple(c[0])),
}
