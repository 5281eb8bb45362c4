"""The grammar of RAPID: one statement's form in, what it says out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

from postproc.language import ir
from postproc.language.rapid import syntax as said
from postproc.language.text.common_rules import COMMON, build_item, low
from postproc.language.text.template_parser import Children, FormParser, Word

# From trees to statements, rule by rule. Every function here is named after a rule of
# ``grammars/rapid.lark`` and takes what its children gave.


class ScopePart(str):
    """LOCAL or TASK."""


class OptionPart(tuple[ir.Argument, ...]):
    """Optional arguments and what stands before them."""


BY_REFERENCE = object()  # stands for VAR, PERS or INOUT before a parameter


def _split_scope(c: Children) -> tuple[str, Children]:
    """Return LOCAL or TASK, "" for neither, and what follows it."""
    return (low(c[0]), c[1:]) if isinstance(c[0], ScopePart) else ("", c)


def _routine(kind: str) -> Callable[[Children], ir.RoutineHead]:
    def build(c: Children) -> ir.RoutineHead:
        scope, rest = _split_scope(c)
        name = [low(x) for x in rest if isinstance(x, Word)][-1]
        parameters = rest[-1] if isinstance(rest[-1], tuple) else ()
        return ir.RoutineHead(kind, name, parameters, scope == "local")

    return build


def _data(c: Children) -> ir.Declaration:
    scope, (kind, type_, item) = _split_scope(c)
    return ir.Declaration(low(type_), (item,), low(kind), scope)


def _parameter(c: Children) -> ir.RoutineParameter:
    type_, name = [low(x) for x in c if isinstance(x, Word)]
    array = None in c
    by_reference = any(x is BY_REFERENCE for x in c)
    return ir.RoutineParameter(name, by_reference, type="" if array else type_)


def _optional(c: Children) -> ir.RoutineParameter:
    name = [low(x) for x in c if isinstance(x, Word)][-1]
    return ir.RoutineParameter(name.lstrip("\\"), True, True)


def _part(c: Children) -> OptionPart:
    return OptionPart(x if isinstance(x, ir.Argument) else ir.Argument(x) for x in c)


def _option(name: str, value: Any = None, passed_on: bool = False) -> ir.Argument:
    return ir.Argument(value, low(name).lstrip("\\"), passed_on)


def _with_arguments(
    make: Callable[[Any, tuple[ir.Argument, ...]], Any],
) -> Callable[[Children], Any]:
    def build(c: Children) -> Any:
        first = low(c[0]) if isinstance(c[0], str) else c[0]
        return make(first, c[1] if len(c) > 1 else ())

    return build


RULES: Mapping[str, Callable[[Children], Any]] = {
    **COMMON,
    "header": lambda c: said.FileHeader(),
    "module": lambda c: said.ModuleHead(low(c[0]), tuple(map(low, c[1:]))),
    "procedure": _routine("proc"),
    "function": _routine("func"),
    "trap": _routine("trap"),
    "record": lambda c: said.RecordHead(low(_split_scope(c)[1][0])),
    "scope": lambda c: ScopePart(c[0]),
    "parameter": _parameter,
    "optional": _optional,
    "mode": lambda c: BY_REFERENCE,
    "open_dimensions": lambda c: None,
    "data": _data,
    "item": build_item,
    "kind": lambda c: c[0],
    "alias": lambda c: said.TypeAlias(*map(low, _split_scope(c)[1])),
    "compact_if": lambda c: said.CompactIf(*c),
    "on_error": lambda c: said.ErrorHandler(tuple(c)),
    "on_undo": lambda c: ir.BlockWord("undo"),
    "on_backward": lambda c: ir.BlockWord("backward"),
    "instruction": _with_arguments(ir.Instruction),
    "late_binding": _with_arguments(said.LateCall),
    "raise_error": lambda c: ir.Leave("raise", *c),
    "connect": lambda c: said.ConnectTrap(c[0], low(c[1])),
    "leave": lambda c: ir.Leave(low(c[0])),
    "nothing": lambda c: ir.SourceStatement(),
    "arguments": lambda c: tuple(argument for part in c for argument in part),
    "part": _part,
    "switch": lambda c: _option(c[0]),
    "named": lambda c: _option(c[0], c[1]),
    "conditional": lambda c: _option(c[0], ir.DataObject(low(c[1])), True),
    "function_call": _with_arguments(ir.FunctionCall),
    "composite": lambda c: ir.Composite(tuple(c)),
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
    return _PARSER.parse_statement(form)
