"""The grammar of RAPID: one statement's form in, what it says out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from postproc.language import ir
from postproc.language.rapid import syntax as said
from postproc.language.rapid.instructions import NAMES
from postproc.language.text.common_rules import COMMON, build_call, low, part, parts
from postproc.language.text.template_parser import Children, FormParser, Word

# From trees to statements, rule by rule. Every function here is named after a rule of
# ``grammars/rapid.lark`` and takes what its children gave.


def _scope(c: Children) -> str:
    """Return local or task, "" for neither."""
    return "".join(low(word) for (word,) in parts(c, "scope"))


def _words(c: Children) -> list[str]:
    return [low(x) for x in c if isinstance(x, Word)]


def _routine(kind: str) -> Callable[[Children], ir.RoutineHead]:
    def build(c: Children) -> ir.RoutineHead:
        parameters = c[-1] if isinstance(c[-1], tuple) else ()
        local = _scope(c) == "local"
        return ir.RoutineHead(kind, _words(c)[-1], parameters, local)

    return build


def _data(c: Children) -> ir.Declaration:
    kind, type_, item = c[-3:]
    return ir.Declaration(low(type_), (item,), low(kind), _scope(c))


def _parameter(c: Children) -> ir.RoutineParameter:
    type_, name = _words(c)
    array, by_reference = None in c, bool(parts(c, "mode"))
    return ir.RoutineParameter(name, by_reference, type="" if array else type_)


def _optional(c: Children) -> ir.RoutineParameter:
    return ir.RoutineParameter(_words(c)[-1].lstrip("\\"), True, True)


def _part(c: Children) -> tuple[ir.Argument, ...]:
    return tuple(x if isinstance(x, ir.Argument) else ir.Argument(x) for x in c)


def _option(name: str, value: Any = None, passed_on: bool = False) -> ir.Argument:
    return ir.Argument(value, low(name).lstrip("\\"), passed_on)


RULES: Mapping[str, Callable[[Children], Any]] = {
    **COMMON,
    "header": lambda c: ir.SourceStatement(),
    "module": lambda c: ir.ScopeHead("module", low(c[0]), tuple(map(low, c[1:]))),
    "procedure": _routine("proc"),
    "function": _routine("func"),
    "trap": _routine("trap"),
    "record": lambda c: ir.ScopeHead("record", low(c[-1])),
    "scope": part("scope"),
    "parameter": _parameter,
    "optional": _optional,
    "mode": part("mode"),
    "open_dimensions": lambda c: None,
    "data": _data,
    "kind": lambda c: c[0],
    "alias": lambda c: said.TypeAlias(*map(low, c[-2:])),
    "compact_if": lambda c: ir.CompactIf(*c),
    "on_error": lambda c: said.ErrorHandler(tuple(c)),
    "on_undo": lambda c: ir.BlockWord("undo"),
    "on_backward": lambda c: ir.BlockWord("backward"),
    "late_binding": build_call(said.LateCall),
    "raise_error": lambda c: ir.Leave("raise", *c),
    "connect": lambda c: said.ConnectTrap(c[0], low(c[1])),
    "leave": lambda c: ir.Leave(low(c[0])),
    "nothing": lambda c: ir.SourceStatement(),
    "arguments": lambda c: tuple(argument for part in c for argument in part),
    "part": _part,
    "switch": lambda c: _option(c[0]),
    "named": lambda c: _option(c[0], c[1]),
    "conditional": lambda c: _option(c[0], ir.DataObject(low(c[1])), True),
}

parse_statement = FormParser("rapid", RULES, NAMES["reserved"]).statements
