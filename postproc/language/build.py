"""Turn the grammar's trees into the statements of `pdl2`, rule by rule.

Every function here is named after a rule of ``grammars/pdl2.lark`` and takes the
rule's children: tokens (strings that know their type) and what other rules gave.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from postproc.language import pdl2 as ast
from postproc.language.parts import (
    ArmPart,
    BesidePart,
    DestinationPart,
    ExportedPart,
    Mark,
    NamesPart,
    SettingPart,
    SyncPart,
    TilPart,
)

Children = Sequence[Any]
Rule = Callable[[Children], Any]


def _name(mark: str) -> str:
    return str(mark).lower()


def _of(children: Children, kind: type) -> tuple[Any, ...]:
    return tuple(c for c in children if isinstance(c, kind) and type(c) is not Mark)


def _statement(children: Children) -> ast.Statement | None:
    found = _of(children, ast.Statement)
    return found[0] if found else None


def _unquoted(mark: str) -> str:
    return str(mark)[1:-1]


def _declared(children: Children, first: int) -> tuple[str, tuple[str, ...]]:
    """Return the exporting program and the other attributes."""
    rest = children[first:]
    exported = [str(c) for c in rest if isinstance(c, ExportedPart)]
    words = tuple(_name(c) for c in rest if type(c) is Mark)
    return (exported[0] if exported else ""), words


def _program_attribute(c: Children) -> int:
    """Return the slot of ``PROG_ARM=n``, -1 for any other attribute."""
    arm = len(c) == 2 and _name(c[0]) == "prog_arm" and isinstance(c[1], ast.Number)
    return c[1].slot if arm else -1


def _routine(c: Children) -> ast.Routine:
    parameters = _of(c, list)
    exported, _ = _declared(c, 1)
    return ast.Routine(
        _name(c[0]), tuple(parameters[0]) if parameters else (), exported
    )


def _variables(c: Children) -> ast.Declare:
    initial = c[2] if len(c) > 2 and isinstance(c[2], ast.Expression) else None
    exported, words = _declared(c, 2)
    return ast.Declare(tuple(c[0]), c[1], initial, exported, words)


def _node_fields(c: Children) -> ast.NodeFields:
    names = (str(part).lower() for part in c if isinstance(part, str))
    return ast.NodeFields(tuple(name for name in names if name.startswith("$")))


def _parameters(c: Children) -> list[ast.Parameter]:
    return [p for group in c for p in group]


def _motion(c: Children) -> ast.Move:
    return _move(c[0].kind == "MOVEFLY", c[1:])


def _move(fly: bool, c: Children) -> ast.Move:
    arm = _of(c, ArmPart)
    how, where, via, frame = _of(c, DestinationPart)[0]
    trajectory = [str(m).upper() for m in c if type(m) is Mark]
    return ast.Move(
        fly=fly,
        arm=arm[0][0] if arm else None,
        trajectory=trajectory[0] if trajectory else "",
        how=how,
        where=where,
        via=via,
        frame=frame,
        settings=tuple((s[0], s[1]) for s in _of(c, SettingPart)),
        conditions=tuple(b[0] for b in _of(c, BesidePart)),
        til=bool(_of(c, TilPart)),
        sync=tuple(replace(s[0], fly=fly) for s in _of(c, SyncPart)),
    )


def _absolute(c: Children) -> DestinationPart:
    to: list[Any] = []
    via = None
    for word, place in zip(c[0::2], c[1::2], strict=True):
        if word.kind == "VIA":
            via = place
        else:
            to.append(place)
    return DestinationPart(("TO", tuple(to), via, ""))


def _destination(c: Children) -> DestinationPart:
    frame = str(c[-1]).upper() if type(c[-1]) is Mark else ""
    where = tuple(x for x in c[1:] if type(x) is not Mark)
    return DestinationPart((c[0].kind, where, None, frame))


def _clause(c: Children) -> Any:
    return TilPart() if c and isinstance(c[0], ast.Still) else None


def _reference(c: Children) -> ast.Reference:
    steps = tuple(_name(s) if isinstance(s, str) else s for s in c[1:])
    return ast.Reference(_name(c[0]), steps)


def _one_or_pair(c: Children) -> Any:
    return c[0] if len(c) == 1 else tuple(c)


def _for(c: Children) -> ast.For:
    step = c[4] if len(c) > 4 else None
    return ast.For(_name(c[0]), c[1], c[3], step, c[2].kind == "DOWNTO")


def _beside(c: Children) -> BesidePart:
    inside = c[0] if len(c) == 1 else ast.Invoke(_name(c[0]), c[1])
    return BesidePart((inside,))


def _io(c: Children) -> ast.Transfer:
    return ast.Transfer(str(c[0]).upper(), tuple(c[1:]))


def _case(c: Children) -> ast.Case:
    choices = tuple(x for x in c if not isinstance(x, ast.Statement))
    return ast.Case(choices, _statement(c))


def _call(c: Children) -> ast.Call:
    return ast.Call(_name(c[0]), c[1] if len(c) > 1 else ())


RULES: dict[str, Rule] = {
    "line": _statement,
    "labelled": lambda c: ast.Label(_name(c[0]).rstrip(": "), _statement(c)),
    "program": lambda c: ast.Program(_name(c[0]), max([-1, *_of(c, int)])),
    "program_attribute": _program_attribute,
    "import": lambda c: ast.Import(_unquoted(c[0])),
    "section": lambda c: ast.Section(_statement(c)),
    "begin": lambda c: ast.Begin(),
    "end": lambda c: ast.End(_name(c[0]) if c else ""),
    "routine": _routine,
    "parameters": _parameters,
    "parameter": lambda c: [ast.Parameter(n.lower(), c[1]) for n in c[0]],
    "variables": _variables,
    "constant": lambda c: ast.Constant(_name(c[0]), c[1]),
    "structure": lambda c: ast.Structure(_name(c[0])),
    "node_fields": _node_fields,
    "end_structure": lambda c: ast.EndStructure(),
    "names": lambda c: NamesPart(str(n) for n in c),
    "exported": lambda c: ExportedPart(_name(c[0])),
    "attribute": lambda c: c[0],
    "simple_type": lambda c: ast.Type(_name(c[0])),
    "array_type": lambda c: ast.Type(c[-1].name, array=True),
    "path_type": lambda c: ast.Type(_name(c[0]), path=True),
    "dimensions": lambda c: None,
    "dimension": lambda c: None,
    "if": lambda c: ast.If(c[0]),
    "else": lambda c: ast.Else(_statement(c)),
    "endif": lambda c: ast.EndIf(),
    "select": lambda c: ast.Select(c[0]),
    "case": _case,
    "choice": _one_or_pair,
    "endselect": lambda c: ast.EndSelect(),
    "for": _for,
    "endfor": lambda c: ast.EndFor(),
    "while": lambda c: ast.While(c[0]),
    "endwhile": lambda c: ast.EndWhile(),
    "repeat": lambda c: ast.Repeat(),
    "until": lambda c: ast.Until(c[0]),
    "cycle": lambda c: ast.Cycle(),
    "exit_cycle": lambda c: ast.ExitCycle(),
    "goto": lambda c: ast.Goto(_name(c[0])),
    "return": lambda c: ast.Return(c[0] if c else None),
    "condition": lambda c: ast.Condition(),
    "when": lambda c: ast.When(_statement(c[1:])),
    "endcondition": lambda c: ast.EndCondition(),
    "motion": _motion,
    "arm": lambda c: ArmPart((c[0].subscripts[0],)),
    "absolute": _absolute,
    "destination": _destination,
    "clause": _clause,
    "with": lambda c: c[0],
    "sync": lambda c: SyncPart((_move(False, c),)),
    "item": SettingPart,
    "item_condition": _beside,
    "assign": lambda c: ast.Assign(c[0], str(c[1]), c[2]),
    "call": _call,
    "call_program": lambda c: ast.Call(_name(c[0]), c[1] if len(c) > 1 else (), True),
    "io": _io,
    "format": lambda c: c[0],
    "open": lambda c: ast.Still("OPEN"),
    "open_clause": lambda c: None,
    "still": lambda c: ast.Still(c[0]),
    "still_word": lambda c: "",
    "soup": lambda c: ast.Still("soup"),
    "soup_word": lambda c: None,
    "group": lambda c: None,
    "binary": lambda c: ast.Binary(str(c[1]).upper(), c[0], c[2]),
    "unary": lambda c: ast.Unary(str(c[0]).upper(), c[1]),
    "parenthesised": lambda c: (
        ast.Unary("()", c[0]) if isinstance(c[0], ast.Reference) else c[0]
    ),
    "number": lambda c: c[0],
    "string": lambda c: ast.Text(_unquoted(c[0])),
    "aggregate": lambda c: ast.Aggregate(tuple(c)),
    "invoke": lambda c: ast.Invoke(_name(c[0]), c[1]),
    "arguments": tuple,
    "argument": lambda c: c[0] if c else None,
    "reference": _reference,
    "step": lambda c: c[0],
    "field": lambda c: _name(c[0]),
    "index": lambda c: ast.Index(tuple(c)),
    "subscript": _one_or_pair,
}
