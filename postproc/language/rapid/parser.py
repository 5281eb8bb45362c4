"""The grammar of RAPID: one statement's form in, what it says out."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from postproc.language import ir
from postproc.language.rapid import syntax as said
from postproc.language.text.template_parser import Children, FormParser, Word

# From trees to statements, rule by rule. Every function here is named after a rule of
# ``grammars/rapid.lark`` and takes what its children gave.


class ScopePart(str):
    """LOCAL or TASK."""


class OptionPart(tuple[ir.Argument, ...]):
    """Optional arguments and what stands before them."""


class DimensionsPart(tuple[Any, ...]):
    """The dimensions of an array."""


BY_REFERENCE = object()  # stands for VAR, PERS or INOUT before a parameter


def _last_name(c: Children) -> str:
    return [_low(x) for x in c if isinstance(x, Word)][-1]


def _low(text: str) -> str:
    return str(text).lower()


def _scope(c: Children) -> str:
    return _low(c[0]) if isinstance(c[0], ScopePart) else ""


def _after_scope(c: Children) -> Children:
    return c[1:] if isinstance(c[0], ScopePart) else c


def _routine(kind: str) -> Callable[[Children], said.RoutineHead]:
    def build(c: Children) -> said.RoutineHead:
        rest = list(_after_scope(c))
        parameters = rest.pop() if isinstance(rest[-1], tuple) else ()
        returns = _low(rest[0]) if kind == "func" else ""
        local = _scope(c) == "local"
        return said.RoutineHead(kind, _low(rest[-1]), parameters, local, returns)

    return build


def _data(c: Children) -> said.DataDeclaration:
    kind, type_, name, *rest = _after_scope(c)
    sized = bool(rest) and isinstance(rest[0], DimensionsPart)
    dimensions = tuple(rest[0]) if sized else ()
    value = rest[-1] if len(rest) > sized else None
    names = _low(kind), _low(type_), _low(name)
    return said.DataDeclaration(*names, _scope(c), dimensions, value)


def _branch(word: str) -> Callable[[Children], ir.Branch]:
    return lambda c: ir.Branch(word, tuple(c))


def _for(c: Children) -> ir.ForLoop:
    return ir.ForLoop(_low(c[0]), c[1], c[2], c[3] if len(c) > 3 else None)


def _part(c: Children) -> OptionPart:
    return OptionPart(x if isinstance(x, ir.Argument) else ir.Argument(x) for x in c)


def _option(name: str, value: Any = None, passed_on: bool = False) -> ir.Argument:
    return ir.Argument(value, _low(name).lstrip("\\"), passed_on)


def _with_arguments(
    make: Callable[[Any, tuple[ir.Argument, ...]], Any], c: Children
) -> Any:
    first = _low(c[0]) if isinstance(c[0], str) else c[0]
    return make(first, c[1] if len(c) > 1 else ())


def _operation(c: Children) -> ir.Operation:
    operator = next(x for x in c if isinstance(x, Word))
    return ir.Operation(
        str(operator).upper(), tuple(x for x in c if not isinstance(x, Word))
    )


def _reference(c: Children) -> ir.DataObject:
    return ir.DataObject(_low(c[0]), tuple(c[1:]))


def _join_arguments(c: Children) -> tuple[ir.Argument, ...]:
    return tuple(argument for part in c for argument in part)


RULES: dict[str, Callable[[Children], Any]] = {
    "statement": lambda c: c[0],
    "header": lambda c: said.FileHeader(),
    "module": lambda c: said.ModuleHead(_low(c[0]), tuple(map(_low, c[1:]))),
    "procedure": _routine("proc"),
    "function": _routine("func"),
    "trap": _routine("trap"),
    "record": lambda c: said.RecordHead(_low(_after_scope(c)[0])),
    "end": lambda c: ir.BlockWord(_low(c[0])),
    "scope": lambda c: ScopePart(c[0]),
    "parameters": lambda c: tuple(c),
    "parameter": lambda c: said.RoutineParameter(
        _last_name(c), any(x is BY_REFERENCE for x in c)
    ),
    "optional": lambda c: said.RoutineParameter(_last_name(c).lstrip("\\"), True, True),
    "mode": lambda c: BY_REFERENCE,
    "open_dimensions": lambda c: None,
    "data": _data,
    "kind": lambda c: c[0],
    "alias": lambda c: said.TypeAlias(*map(_low, _after_scope(c))),
    "dimensions": DimensionsPart,
    "if_then": _branch("if"),
    "else_if": _branch("elseif"),
    "while_do": _branch("while"),
    "test": _branch("test"),
    "case": _branch("case"),
    "default": _branch("default"),
    "compact_if": lambda c: said.CompactIf(*c),
    "for_do": _for,
    "label": lambda c: ir.LabelMark(_low(c[0])),
    "branch_word": lambda c: ir.BlockWord(_low(c[0])),
    "on_error": lambda c: said.ErrorHandler(tuple(c)),
    "on_undo": lambda c: ir.BlockWord("undo"),
    "on_backward": lambda c: ir.BlockWord("backward"),
    "assignment": lambda c: ir.Assignment(*c),
    "instruction": lambda c: _with_arguments(ir.Instruction, c),
    "late_binding": lambda c: _with_arguments(said.LateCall, c),
    "goto": lambda c: ir.JumpTo(_low(c[0])),
    "return_value": lambda c: ir.Leave("return", *c),
    "raise_error": lambda c: ir.Leave("raise", *c),
    "connect": lambda c: said.ConnectTrap(c[0], _low(c[1])),
    "leave": lambda c: ir.Leave(_low(c[0])),
    "nothing": lambda c: ir.SourceStatement(),
    "arguments": _join_arguments,
    "part": _part,
    "switch": lambda c: _option(c[0]),
    "named": lambda c: _option(c[0], c[1]),
    "conditional": lambda c: _option(c[0], ir.DataObject(_low(c[1])), True),
    "infix": _operation,
    "prefix": _operation,
    "number": lambda c: c[0],
    "string": lambda c: ir.StringLiteral(str(c[0])),
    "function_call": lambda c: _with_arguments(ir.FunctionCall, c),
    "composite": lambda c: ir.Composite(tuple(c)),
    "reference": _reference,
    "component": lambda c: _low(c[0]),
    "element": lambda c: ir.ElementStep(tuple(c)),
}

LONGEST = 1 << 18  # characters of a form; arrays of a thousand targets have 60,000
DEEPEST = 200  # operators or brackets within each other; followed by recursion


RESERVED = frozenset(
    "alias and backward case connect const default div do else elseif endfor endfunc "
    "endif endmodule endproc endrecord endtest endtrap endwhile error exit for from "
    "func goto if inout local mod module not or pers proc raise record retry "
    "return step test then to trap trynext undo var while with xor".split()
)
"""Words that name nothing, but for attributes of a module."""

_PARSER = FormParser("rapid", RULES, RESERVED, LONGEST, DEEPEST)


@lru_cache(maxsize=8192)
def parse_statement(form: str) -> ir.SourceStatement:
    """Parse the form of a statement, `NotUnderstood` where the grammar cannot."""
    found = _PARSER.parse(form)
    if found is None:
        return ir.NotUnderstood()
    return found if isinstance(found, ir.SourceStatement) else ir.SourceStatement()
