"""The grammars of PDL2: forms of lines in, what they say out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import zip_longest
from typing import Any

from postproc.language import ir
from postproc.language.ir import Num
from postproc.language.pdl2 import syntax as ast
from postproc.language.text.common_rules import (
    COMMON,
    RulePart,
    build_call,
    low,
    part,
    parts,
)
from postproc.language.text.template_parser import KEPT, Children, FormParser, Word

# Turn the grammar's trees into the statements of `syntax`, rule by rule.
#
# Every function here is named after a rule of ``grammars/pdl2.lark`` and takes the
# rule's children: tokens (strings that know their type) and what other rules gave.

Rule = Callable[[Children], Any]


def _statement(c: Children) -> ir.SourceStatement | None:
    return next((one for one in c if isinstance(one, ir.SourceStatement)), None)


def _unquote(mark: str) -> str:
    """Return what stands between the quotes of a string; two are one inside of it."""
    return str(mark)[1:-1].replace(mark[0] * 2, mark[0])


def _read_attributes(children: Children, first: int) -> tuple[str, tuple[str, ...]]:
    """Return the exporting program and the other attributes."""
    exported = [low(name) for (name,) in parts(children, "exported")]
    words = tuple(low(c) for c in children[first:] if type(c) is Word)
    return (exported[0] if exported else ""), words


def _program_attribute(c: Children) -> int:
    """Return the slot of ``PROG_ARM=n``, -1 for any other attribute."""
    arm = len(c) == 2 and low(c[0]) == "prog_arm" and isinstance(c[1], ir.Num)
    return c[1].slot if arm else -1


def _arm_slot(c: Children) -> int:
    """Return the slot of the number in ``FOR ARM[n]``, -1 where there is none."""
    found = [arm.slot for arm in parts(c, "arm") if isinstance(arm, Num)]
    return found[0] if found else -1


def _routine(c: Children) -> ast.Routine:
    parameters = next((one for one in c if isinstance(one, tuple)), ())
    exported, _ = _read_attributes(c, 1)
    return ast.Routine(low(c[0]), parameters, exported)


def _variables(c: Children) -> ast.Declare:
    initial = c[2] if len(c) > 2 and isinstance(c[2], ir.Operand) else None
    exported, words = _read_attributes(c, 2)
    return ast.Declare(c[0], c[1], initial, exported, words)


def _node_fields(c: Children) -> ast.NodeFields:
    names = (str(part).lower() for part in c if isinstance(part, str))
    return ast.NodeFields(tuple(name for name in names if name.startswith("$")))


def _move(fly: bool, c: Children) -> ast.Move:
    ((how, where, via, frame),) = parts(c, "destination")
    return ast.Move(
        fly=fly,
        arm=next(iter(parts(c, "arm")), None),
        trajectory=next((str(m).upper() for m in c if type(m) is Word), ""),
        how=how,
        where=where,
        via=via,
        frame=frame,
        settings=tuple(ir.Assignment(*both) for both in parts(c, "item")),
        conditions=tuple(parts(c, "item_condition")),
        til=next(iter(parts(c, "til")), None),
        sync=tuple(replace(move, fly=fly) for move in parts(c, "sync")),
    )


def _absolute(c: Children) -> RulePart:
    to: list[Any] = []
    via = None
    for word, place in zip(c[0::2], c[1::2], strict=True):
        if word.kind == "VIA":
            via = place
        else:
            to.append(place)
    return RulePart("destination", ("TO", tuple(to), via, ""))


def _destination(c: Children) -> RulePart:
    frame = str(c[-1]).upper() if type(c[-1]) is Word else ""
    where = tuple(x for x in c[1:] if type(x) is not Word)
    return RulePart("destination", (c[0].kind, where, None, frame))


def _terms(c: Children) -> tuple[ir.DataObject | ir.FunctionCall, ...]:
    """Return the names in text that is not understood; those with arguments call."""
    found: list[ir.DataObject | ir.FunctionCall] = []
    for one, after in zip_longest(c, c[1:]):
        if isinstance(one, ir.DataObject):
            calls = isinstance(after, RulePart) and after.name == "round_group"
            calls = calls and one.name not in ast.NAMES["condition"]
            found.append(ir.FunctionCall(one.name, ()) if calls else one)
        elif isinstance(one, RulePart):
            found += _terms(one.value)
    return tuple(found)


def _soup_word(c: Children) -> ir.DataObject | None:
    name = type(c[0]) is Word and c[0].kind == "NAME" if c else False
    return ir.DataObject(low(c[0])) if name else None


def _reference(c: Children) -> ir.DataObject:
    steps = tuple(low(s) if isinstance(s, str) else s for s in c[1:])
    return ir.DataObject(low(c[0]), steps)


def _one_or_pair(c: Children) -> ir.Operand:
    return c[0] if len(c) == 1 else ir.Interval(c[0], c[1])


def _for(c: Children) -> ir.ForLoop:
    step = c[4] if len(c) > 4 else None
    return ir.ForLoop(low(c[0]), c[1], c[3], step, c[2].kind == "DOWNTO")


def _beside(c: Children) -> RulePart:
    inside = c[0] if len(c) == 1 else ir.FunctionCall(low(c[0]), c[1])
    return RulePart("item_condition", inside)


def _case(c: Children) -> ir.Branch:
    choices = tuple(x for x in c if not isinstance(x, ir.SourceStatement))
    return ir.Branch("case", choices, _statement(c))


def _assign(c: Children) -> ir.Assignment:
    """Return what ``:=`` does, and ``+=`` and ``-=``, which compute with the target."""
    target, operator, value = c[0], str(c[1]), c[2]
    if operator != ":=":
        value = ir.Operation(operator[0], (target, value))
    return ir.Assignment(target, value)


RULES: Mapping[str, Rule] = {
    **COMMON,
    "line": lambda c: _statement(c) or ir.SourceStatement(),
    "labelled": lambda c: ir.LabelMark(low(c[0]).rstrip(": "), _statement(c)),
    "program": lambda c: ast.ProgramHead(
        low(c[0]), max(one if isinstance(one, int) else -1 for one in c)
    ),
    "program_attribute": _program_attribute,
    "import": lambda c: ir.ScopeHead("import", _unquote(c[0])),
    "section": lambda c: ir.BlockWord("section", _statement(c)),
    "begin": lambda c: ir.BlockWord("begin"),
    "end": lambda c: ast.End(low(c[0]) if c else ""),
    "routine": _routine,
    "parameter": lambda c: ast.Declare(tuple(map(low, c[0])), c[1], None),
    "variables": _variables,
    "constant": lambda c: ast.Declare((low(c[0]),), None, c[1], attributes=("const",)),
    "structure": lambda c: ir.ScopeHead("record", low(c[0])),
    "node_fields": _node_fields,
    "end_structure": lambda c: ir.BlockWord("endrecord"),
    "names": lambda c: tuple(map(str, c)),
    "exported": part("exported"),
    "attribute": lambda c: c[0],
    "simple_type": lambda c: ast.Type(low(c[0]), arm=_arm_slot(c)),
    "array_type": lambda c: ast.Type(c[-1].name, array=True, arm=c[-1].arm),
    "path_type": lambda c: ast.Type(low(c[0]), path=True),
    "dimensions": lambda c: None,
    "dimension": lambda c: None,
    "else": lambda c: ir.BlockWord("else", _statement(c)),
    "case": _case,
    "choice": _one_or_pair,
    "for": _for,
    "exit_cycle": lambda c: ir.Leave("exitcycle"),
    "condition": lambda c: ir.Branch("condition"),
    "when": lambda c: ast.When(_statement(c[1:]), c[0].terms),
    "motion": lambda c: _move(c[0].kind == "MOVEFLY", c[1:]),
    "arm": lambda c: RulePart("arm", c[0].subscripts[0]),
    "absolute": _absolute,
    "destination": _destination,
    "clause": lambda c: None,
    "til": lambda c: RulePart("til", c[0].terms),
    "with": lambda c: c[0],
    "sync": lambda c: RulePart("sync", _move(False, c)),
    "item": part("item"),
    "item_condition": _beside,
    "assign": _assign,
    "call_program": build_call(ast.ProgramCall),
    "io": lambda c: ast.Transfer(str(c[0]).upper(), tuple(c[1:])),
    "format": lambda c: c[0],
    "open": lambda c: ast.Still(False),
    "open_clause": lambda c: None,
    "cancel": lambda c: ast.CancelMove(tuple(parts(c, "arm"))),
    "still": lambda c: ast.Still(c[0], _terms(c[1:])),
    "waiting_word": lambda c: True,
    "still_word": lambda c: False,
    "soup": lambda c: ast.Still(False, _terms(c)),
    "soup_word": _soup_word,
    "group": part("group"),
    "round_group": part("round_group"),
    "parenthesised": lambda c: (
        ir.Operation("()", (c[0],)) if isinstance(c[0], ir.DataObject) else c[0]
    ),
    "string": lambda c: ir.StringLiteral(_unquote(c[0])),
    "reference": _reference,
    "step": lambda c: c[0],
    "field": lambda c: low(c[0]),
    "index": lambda c: ir.ElementStep(tuple(c)),
    "subscript": _one_or_pair,
}

# What one line of a variable file says; rule by rule like statements.

_ACCESS = frozenset({"priv", "xport", "local"})


@dataclass(frozen=True)
class EntryPart:
    """The parts of a line; slots are numbers of the line, -1 for ``****``.

    Attributes:
        name, type: Of the head, "" where the line has none.
        arm: Slot of the arm number, -1 where there is none.
        shared: The head says Xport.
        variable: The head says whose variable it is (Priv, Xport, Local): fields of
            records and of path nodes do not.
        element: Slots of an element's index.
        node: Slot of the number of a path's node, -1 where the line names none.
        components: (letter, slot) pairs.
        axes: (axis slot, value slot) pairs.
        plain: Slots of numbers by themselves.
        config: Configuration string.
    """

    name: str = ""
    type: str = ""
    arm: int = -1
    shared: bool = False
    variable: bool = False
    element: tuple[int, ...] = ()
    node: int = -1
    components: tuple[tuple[str, int], ...] = ()
    axes: tuple[tuple[int, int], ...] = ()
    plain: tuple[int, ...] = ()
    config: str | None = None

    @property
    def says_value(self) -> bool:
        """Tell whether a number or a configuration stands in the line."""
        numbers = self.components or self.axes or self.plain
        return bool(numbers) or self.config is not None


def _line(c: Children) -> EntryPart | None:
    """Put a line together; None where a number behind a value has no name.

    Such a number may be the rest of one that is torn, by a blank or by a control
    character, which counts as one: ``X: 10 93.44`` is no X of 10.
    """
    head = next((one for one in c if isinstance(one, EntryPart)), EntryPart())
    line = replace(
        head,
        element=next(iter(parts(c, "element")), ()),
        node=next(iter(parts(c, "node")), -1),
        components=tuple(parts(c, "component")),
        axes=tuple(parts(c, "axis")),
        plain=tuple(parts(c, "plain")),
        config=next(reversed(parts(c, "config")), None),
    )
    return None if line.plain and (line.components or line.axes) else line


def _head(c: Children) -> EntryPart:
    arm, words = max([-1, *parts(c, "arm")]), {*parts(c, "word")}
    shared, own = "xport" in words, bool(words & _ACCESS)
    return EntryPart(str(c[0]), str(c[1]), arm, shared, own)


VALUE_RULES: Mapping[str, Rule] = {
    "line": _line,
    "head": _head,
    "dimensions": lambda c: None,
    "arm": lambda c: RulePart("arm", c[1].slot),
    "counted": lambda c: None,
    "word": lambda c: RulePart("word", low(c[0])),
    "element": lambda c: RulePart("element", tuple(n.slot for n in c)),
    "node": lambda c: RulePart("node", c[1].slot),
    "component": lambda c: RulePart("component", (str(c[0]), c[1])),
    "axis": lambda c: RulePart("axis", (c[0].slot, c[1])),
    "config": lambda c: RulePart("config", str(c[1])[1:-1] if len(c) > 1 else ""),
    "plain": lambda c: RulePart("plain", c[0]) if c and isinstance(c[0], int) else None,
    "number": lambda c: c[0].slot,
    "uninitialised": lambda c: -1,
}


parse_form = FormParser("pdl2", RULES, start="line").statements
_VALUE_PARSER = FormParser("lsv", VALUE_RULES, start="line")


@lru_cache(maxsize=KEPT)
def parse_value_form(form: str) -> EntryPart | None:
    """Parse the form of a line of a variable file, None where the grammar cannot."""
    found = _VALUE_PARSER.parse(form)
    return found if isinstance(found, EntryPart) else None
