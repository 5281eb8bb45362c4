"""The grammar of KRL: one statement's form in, what it says out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from postproc.language import ir
from postproc.language.analysis.control_flow import EXIT
from postproc.language.krl import syntax as said
from postproc.language.text.common_rules import COMMON, low, part, parts
from postproc.language.text.template_parser import Children, FormParser, Word

# From trees to statements, rule by rule. Every function here is named after a rule of
# ``grammars/krl.lark`` and takes what its children gave.


def _tokens(c: Children, kind: str) -> list[str]:
    return [low(x) for x in c if isinstance(x, Word) and x.kind == kind]


def _routine(kind: str) -> Callable[[Children], ir.RoutineHead]:
    def build(c: Children) -> ir.RoutineHead:
        parameters = next((x for x in c if type(x) is tuple), ())
        local = not _tokens(c, "GLOBAL")
        return ir.RoutineHead(kind, _tokens(c, "NAME")[0], parameters, local)

    return build


def _build_declaration(c: Children) -> ir.Declaration:
    flags, ((type_,),) = _words(c, "flag"), parts(c, "type")
    items = tuple(x for x in c if isinstance(x, ir.DeclaredItem))
    kind = "const" if "const" in flags else "var"
    scope = "global" if "global" in flags else ""
    return ir.Declaration(low(type_), items, kind, scope)


def _build_builtin(c: Children) -> ir.SourceStatement:
    found = _build_declaration(c)
    return found if found.type in said.NAMES["type"] else ir.NotUnderstood()


def _move(c: Children) -> said.KrlMove:
    word = next(low(x) for x in c if isinstance(x, Word))
    operands = [x for x in c if isinstance(x, ir.Operand)]
    arc = word.split("_")[0] in ("circ", "scirc")
    via, to = operands[:2] if arc else (None, operands[0])
    angle = operands[2] if arc and len(operands) > 2 else None
    return said.KrlMove(word, to, via, angle, _words(c, "blend"), _settings(c))


def _build_switch(c: Children) -> said.InterruptSwitched:
    number = next((x for x in c if isinstance(x, ir.Operand)), None)
    return said.InterruptSwitched(low(c[0]), number)


def _trigger(c: Children) -> said.PathTrigger:
    action = next(x for x in c if isinstance(x, ir.SourceStatement))
    return said.PathTrigger(action, tuple(x for x in c if isinstance(x, ir.Operand)))


def _words(c: Children, name: str) -> tuple[str, ...]:
    """Return what parts of a name say, one word each."""
    return tuple(low(word) for (word,) in parts(c, name))


def _settings(c: Children) -> tuple[ir.Assignment, ...]:
    return tuple(one for x in c if type(x) is tuple for one in x)


def _spline(c: Children) -> said.SplineBlock:
    return said.SplineBlock(low(c[0]), _words(c, "blend"), _settings(c))


def _arguments(c: Children) -> tuple[ir.Argument, ...]:
    """Return what is given; one that is left out alone is none."""
    return () if len(c) == 1 and c[0].value is None else tuple(c)


def _aggregate(c: Children) -> said.KrlAggregate:
    names = _tokens(c, "NAME")
    fields = tuple(x for x in c if isinstance(x, said.NamedField))
    return said.KrlAggregate(names[0] if names else "", fields)


def _field(c: Children) -> said.NamedField:
    return said.NamedField(low(c[0]), c[-1])


def _parameter(name: str, way: str = "out") -> ir.RoutineParameter:
    return ir.RoutineParameter(name, way != "in")


RULES: Mapping[str, Callable[[Children], Any]] = {
    **COMMON,
    "header": lambda c: ir.SourceStatement(),
    "procedure": _routine("def"),
    "function": _routine("deffct"),
    "data_list": lambda c: ir.ScopeHead("defdat", low(c[0])),
    "type": part("type"),
    "parameter": lambda c: _parameter(*_tokens(c, "NAME")),
    "empty_dimensions": lambda c: None,
    "declared": _build_declaration,
    "built_in": _build_builtin,
    "flag": part("flag"),
    "exit_loop": lambda c: ir.Leave(EXIT),
    "halt": lambda c: said.Waiting(),
    "continue_": lambda c: said.ContinueWord(),
    "wait": lambda c: said.Waiting(c[0]),
    "speed_part": lambda c: ir.SourceStatement(),
    "interrupt_declared": lambda c: said.InterruptDeclared(*c[-3:]),
    "interrupt_switched": _build_switch,
    "brake": lambda c: said.InterruptSwitched("brake"),
    "resume": lambda c: said.InterruptSwitched("resume"),
    "trigger": _trigger,
    "move": _move,
    "arc": _move,
    "relative": _move,
    "arc_relative": _move,
    "spline": _spline,
    "spline_end": _spline,
    "blend": part("blend"),
    "settings": tuple,
    "setting": lambda c: ir.Assignment(*c),
    "proceed": lambda c: ir.Instruction("on_error_proceed", ()),
    "arguments": _arguments,
    "enumerated": lambda c: said.EnumValue(low(c[0])),
    "aggregate": _aggregate,
    "field": _field,
}

_parse = FormParser("krl", RULES, said.NAMES["reserved"]).statements


def parse_statement(form: str) -> ir.SourceStatement:
    """Parse a statement; those that only name things say nothing that runs."""
    words = form.lower().split(" ", 2)
    if words[0] == "global" and len(words) > 1:
        words = words[1:]
    if words[0] in said.NAMES["outside"] and len(words) > 1:
        return ir.SourceStatement()
    return _parse(form)
