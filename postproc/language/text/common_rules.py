"""What rules of a grammar mean that languages have alike, by their names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from postproc.language import ir
from postproc.language.text.template_parser import Children, Word


@dataclass(frozen=True)
class RulePart:
    """What a rule gives to the one around it, which knows it by a name.

    Attributes:
        name: As a rule that the statement is made by asks for it.
        value: What it says.
    """

    name: str
    value: Any


def part(name: str) -> Callable[[Children], RulePart]:
    """Give all that a rule holds to the one around it."""
    return lambda c: RulePart(name, tuple(c))


def parts(c: Children, name: str) -> list[Any]:
    """Return what the rules within one gave by a name."""
    return [one.value for one in c if isinstance(one, RulePart) and one.name == name]


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
    dimensions = next(iter(parts(c, "dimensions")), ())
    value = next((one for one in c if isinstance(one, ir.Operand)), None)
    return ir.DeclaredItem(low(c[0]), dimensions, value)


def build_call(make: Callable[[Any, tuple[ir.Argument, ...]], Any]) -> Any:
    """Build what is called with arguments, or without: its name, or an operand."""

    def build(c: Children) -> Any:
        called = low(c[0]) if isinstance(c[0], str) else c[0]
        return make(called, c[1] if len(c) > 1 else ())

    return build


_BLOCK_WORDS = {"endswitch": "endtest", "endselect": "endtest"}  # others are alike


def _block_word(c: Children) -> ir.BlockWord:
    return ir.BlockWord(_BLOCK_WORDS.get(low(c[0]), low(c[0])))


def _operation(c: Children) -> ir.Operation:
    operator = next(x for x in c if isinstance(x, Word))
    operands = tuple(x for x in c if not isinstance(x, Word))
    return ir.Operation(str(operator).upper(), operands)


COMMON: Mapping[str, Callable[[Children], Any]] = {
    "statement": lambda c: c[0],
    "end": lambda c: ir.BlockWord(low(c[0])),
    "block_word": _block_word,
    "parameters": tuple,
    "dimensions": part("dimensions"),
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
    "item": build_item,
    "instruction": build_call(ir.Instruction),
    "function_call": build_call(ir.FunctionCall),
    "arguments": tuple,
    "argument": lambda c: ir.Argument(c[0] if c else None),
    "composite": lambda c: ir.Composite(tuple(c)),
    "infix": _operation,
    "prefix": _operation,
    "number": lambda c: c[0],
    "string": lambda c: ir.StringLiteral(str(c[0])),
    "reference": lambda c: ir.DataObject(low(c[0]), tuple(c[1:])),
    "component": lambda c: low(c[0]),
    "element": lambda c: ir.ElementStep(c[0].value),
}
