"""The grammars of PDL2: forms of lines in, what they say out."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import count, zip_longest
from typing import Any

from postproc.language import ir
from postproc.language.ir import Num
from postproc.language.pdl2 import syntax as ast
from postproc.language.text.common_rules import COMMON, branch, low
from postproc.language.text.lexer import NAME_MARK, UNREADABLE
from postproc.language.text.template_parser import FAILED, Children, FormParser, Word
from postproc.language.text.templates import open_name

# Parts of a line on their way from tree to statement, told apart by type.


class NamesPart(tuple[str, ...]):
    """Declared names."""


class ExportedPart(str):
    """The program after EXPORTED FROM."""


class ArmPart(tuple[Any, ...]):
    """The index of ARM[n]."""


class SettingPart(tuple[Any, ...]):
    """One WITH item that sets a variable."""


class BesidePart(tuple[Any, ...]):
    """One WITH item that names a condition handler."""


class TilPart(tuple[Any, ...]):
    """A TIL clause: what its condition calls."""


class GroupPart(tuple[Any, ...]):
    """What stands between brackets of text that is not understood."""


class RoundPart(GroupPart):
    """What stands between round brackets of it: arguments, if a name is before."""


class SyncPart(tuple[Any, ...]):
    """The move of a SYNCMOVE clause."""


class DestinationPart(tuple[Any, ...]):
    """(how, operands, via, frame)."""


# Turn the grammar's trees into the statements of `syntax`, rule by rule.
#
# Every function here is named after a rule of ``grammars/pdl2.lark`` and takes the
# rule's children: tokens (strings that know their type) and what other rules gave.

Rule = Callable[[Children], Any]


def _of(children: Children, kind: type) -> tuple[Any, ...]:
    return tuple(c for c in children if isinstance(c, kind) and type(c) is not Word)


def _statement(children: Children) -> ir.SourceStatement | None:
    found = _of(children, ir.SourceStatement)
    return found[0] if found else None


def _unquote(mark: str) -> str:
    """Return what stands between the quotes of a string; two are one inside of it."""
    return str(mark)[1:-1].replace(mark[0] * 2, mark[0])


def _read_attributes(children: Children, first: int) -> tuple[str, tuple[str, ...]]:
    """Return the exporting program and the other attributes."""
    rest = children[first:]
    exported = [str(c) for c in rest if isinstance(c, ExportedPart)]
    words = tuple(low(c) for c in rest if type(c) is Word)
    return (exported[0] if exported else ""), words


def _program_attribute(c: Children) -> int:
    """Return the slot of ``PROG_ARM=n``, -1 for any other attribute."""
    arm = len(c) == 2 and low(c[0]) == "prog_arm" and isinstance(c[1], ir.Num)
    return c[1].slot if arm else -1


def _arm_slot(c: Children) -> int:
    """Return the slot of the number in ``FOR ARM[n]``, -1 where there is none."""
    found = [part[0].slot for part in _of(c, ArmPart) if isinstance(part[0], Num)]
    return found[0] if found else -1


def _routine(c: Children) -> ast.Routine:
    parameters = _of(c, list)
    exported, _ = _read_attributes(c, 1)
    return ast.Routine(low(c[0]), tuple(parameters[0]) if parameters else (), exported)


def _variables(c: Children) -> ast.Declare:
    initial = c[2] if len(c) > 2 and isinstance(c[2], ir.Operand) else None
    exported, words = _read_attributes(c, 2)
    return ast.Declare(tuple(c[0]), c[1], initial, exported, words)


def _node_fields(c: Children) -> ast.NodeFields:
    names = (str(part).lower() for part in c if isinstance(part, str))
    return ast.NodeFields(tuple(name for name in names if name.startswith("$")))


def _parameters(c: Children) -> list[ast.FormalParameter]:
    return [p for group in c for p in group]


def _motion(c: Children) -> ast.Move:
    return _move(c[0].kind == "MOVEFLY", c[1:])


def _move(fly: bool, c: Children) -> ast.Move:
    arm = _of(c, ArmPart)
    how, where, via, frame = _of(c, DestinationPart)[0]
    trajectory = [str(m).upper() for m in c if type(m) is Word]
    return ast.Move(
        fly=fly,
        arm=arm[0][0] if arm else None,
        trajectory=trajectory[0] if trajectory else "",
        how=how,
        where=where,
        via=via,
        frame=frame,
        settings=tuple(ir.Assignment(s[0], s[1]) for s in _of(c, SettingPart)),
        conditions=tuple(b[0] for b in _of(c, BesidePart)),
        til=(_of(c, TilPart) or (None,))[0],
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
    frame = str(c[-1]).upper() if type(c[-1]) is Word else ""
    where = tuple(x for x in c[1:] if type(x) is not Word)
    return DestinationPart((c[0].kind, where, None, frame))


_CONDITION_WORDS = frozenset(
    "and at before by condition div error event for in mod not of or percent segment "
    "signal time to until via when with xor after distance end start".split()
)
"""Words of the language that brackets may follow without being called."""


def _terms(c: Children) -> tuple[ir.DataObject | ir.FunctionCall, ...]:
    """Return the names in text that is not understood; those with arguments call."""
    found: list[ir.DataObject | ir.FunctionCall] = []
    for part, after in zip_longest(c, c[1:]):
        if isinstance(part, ir.DataObject):
            calls = type(after) is RoundPart and part.name not in _CONDITION_WORDS
            found.append(ir.FunctionCall(part.name, ()) if calls else part)
        elif isinstance(part, GroupPart):
            found += _terms(part)
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


def _beside(c: Children) -> BesidePart:
    inside = c[0] if len(c) == 1 else ir.FunctionCall(low(c[0]), c[1])
    return BesidePart((inside,))


def _case(c: Children) -> ir.Branch:
    choices = tuple(x for x in c if not isinstance(x, ir.SourceStatement))
    return ir.Branch("case", choices, _statement(c))


def _call(make: type[ir.Instruction]) -> Rule:
    return lambda c: make(low(c[0]), c[1] if len(c) > 1 else ())


def _word(word: str) -> Rule:
    return lambda c: ir.BlockWord(word, _statement(c))


def _assign(c: Children) -> ir.Assignment:
    """Return what ``:=`` does, and ``+=`` and ``-=``, which compute with the target."""
    target, operator, value = c[0], str(c[1]), c[2]
    if operator != ":=":
        value = ir.Operation(operator[0], (target, value))
    return ir.Assignment(target, value)


RULES: Mapping[str, Rule] = {
    **COMMON,
    "line": _statement,
    "labelled": lambda c: ir.LabelMark(low(c[0]).rstrip(": "), _statement(c)),
    "program": lambda c: ast.ProgramHead(low(c[0]), max([-1, *_of(c, int)])),
    "program_attribute": _program_attribute,
    "import": lambda c: ast.Import(_unquote(c[0])),
    "section": lambda c: ast.DeclarationSection(_statement(c)),
    "begin": lambda c: ast.Begin(),
    "end": lambda c: ast.End(low(c[0]) if c else ""),
    "routine": _routine,
    "parameters": _parameters,
    "parameter": lambda c: [ast.FormalParameter(n.lower(), c[1]) for n in c[0]],
    "variables": _variables,
    "constant": lambda c: ast.Constant(low(c[0]), c[1]),
    "structure": lambda c: ast.Structure(low(c[0])),
    "node_fields": _node_fields,
    "end_structure": lambda c: ast.EndStructure(),
    "names": lambda c: NamesPart(str(n) for n in c),
    "exported": lambda c: ExportedPart(low(c[0])),
    "attribute": lambda c: c[0],
    "simple_type": lambda c: ast.Type(low(c[0]), arm=_arm_slot(c)),
    "array_type": lambda c: ast.Type(c[-1].name, array=True, arm=c[-1].arm),
    "path_type": lambda c: ast.Type(low(c[0]), path=True),
    "dimensions": lambda c: None,
    "dimension": lambda c: None,
    "if": branch("if"),
    "else": _word("else"),
    "endif": _word("endif"),
    "select": branch("test"),
    "case": _case,
    "choice": _one_or_pair,
    "endselect": _word("endtest"),
    "for": _for,
    "endfor": _word("endfor"),
    "while": branch("while"),
    "endwhile": _word("endwhile"),
    "cycle": _word("cycle"),
    "exit_cycle": lambda c: ir.Leave("exitcycle"),
    "return": lambda c: ir.Leave("return", *c),
    "condition": lambda c: ir.Branch("condition"),
    "when": lambda c: ast.When(_statement(c[1:]), c[0].terms),
    "endcondition": _word("endcondition"),
    "motion": _motion,
    "arm": lambda c: ArmPart((c[0].subscripts[0],)),
    "absolute": _absolute,
    "destination": _destination,
    "clause": lambda c: (
        TilPart(c[0].terms) if c and isinstance(c[0], ast.Still) else None
    ),
    "with": lambda c: c[0],
    "sync": lambda c: SyncPart((_move(False, c),)),
    "item": SettingPart,
    "item_condition": _beside,
    "assign": _assign,
    "call": _call(ir.Instruction),
    "call_program": _call(ast.ProgramCall),
    "io": lambda c: ast.Transfer(str(c[0]).upper(), tuple(c[1:])),
    "format": lambda c: c[0],
    "open": lambda c: ast.Still(False),
    "open_clause": lambda c: None,
    "cancel": lambda c: ast.CancelMove(tuple(part[0] for part in _of(c, ArmPart))),
    "still": lambda c: ast.Still(c[0], _terms(c[1:])),
    "waiting_word": lambda c: True,
    "still_word": lambda c: False,
    "soup": lambda c: ast.Still(False, _terms(c)),
    "soup_word": _soup_word,
    "group": GroupPart,
    "round_group": RoundPart,
    "binary": lambda c: ir.Operation(str(c[1]).upper(), (c[0], c[2])),
    "unary": lambda c: ir.Operation(str(c[0]).upper(), (c[1],)),
    "parenthesised": lambda c: (
        ir.Operation("()", (c[0],)) if isinstance(c[0], ir.DataObject) else c[0]
    ),
    "string": lambda c: ir.StringLiteral(_unquote(c[0])),
    "aggregate": lambda c: ir.Composite(tuple(c)),
    "invoke": lambda c: ir.FunctionCall(low(c[0]), c[1]),
    "arguments": tuple,
    "argument": lambda c: ir.Argument(c[0] if c else None),
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


class _Value(int):
    """Slot of a value."""


class _Arm(int):
    """Slot of the arm number."""


class _Element(tuple[int, ...]):
    """Slots of an index."""


class _Node(int):
    """Slot of the number of a node."""


class _Word(str):
    """A word of a head."""


def _line(c: Sequence[Any]) -> EntryPart | None:
    """Put a line together; None where a number behind a value has no name.

    Such a number may be the rest of one that is torn, by a blank or by a control
    character, which counts as one: ``X: 10 93.44`` is no X of 10.
    """
    line = EntryPart()
    for part in c:
        match part:
            case EntryPart():
                line = part
            case _Element():
                line = replace(line, element=tuple(part))
            case _Node():
                line = replace(line, node=int(part))
            case ("component", letter, slot):
                line = replace(line, components=(*line.components, (letter, slot)))
            case ("axis", axis, slot):
                line = replace(line, axes=(*line.axes, (axis, slot)))
            case ("config", text):
                line = replace(line, config=text)
            case ("plain", slot):
                line = replace(line, plain=(*line.plain, slot))
    torn = bool(line.plain) and bool(line.components or line.axes)
    return None if torn else line


def _head(c: Sequence[Any]) -> EntryPart:
    arms = [int(x) for x in c if isinstance(x, _Arm)]
    words = {str(x).lower() for x in c if isinstance(x, _Word)}
    return EntryPart(
        str(c[0]), str(c[1]), max([-1, *arms]), "xport" in words, bool(words & _ACCESS)
    )


def _plain(c: Sequence[Any]) -> tuple[str, int] | None:
    return ("plain", int(c[0])) if c and isinstance(c[0], _Value) else None


VALUE_RULES: Mapping[str, Rule] = {
    "line": _line,
    "head": _head,
    "dimensions": lambda c: None,
    "arm": lambda c: _Arm(c[1].slot),
    "counted": lambda c: None,
    "word": lambda c: _Word(c[0]),
    "element": lambda c: _Element(n.slot for n in c if isinstance(n, Num)),
    "node": lambda c: _Node(c[1].slot),
    "component": lambda c: ("component", str(c[0]), int(c[1])),
    "axis": lambda c: ("axis", c[0].slot, int(c[1])),
    "config": lambda c: ("config", str(c[1])[1:-1] if len(c) > 1 else ""),
    "plain": _plain,
    "number": lambda c: _Value(c[0].slot),
    "uninitialised": lambda c: _Value(-1),
}

# Forms of lines in, what they say out.

LONGEST = 1 << 18  # characters of a form; lines of real programs have some hundreds
DEEPEST = 200  # operators or parentheses within each other; followed by recursion

_PARSER = FormParser("pdl2", RULES, (), LONGEST, DEEPEST, "line")
_VALUE_PARSER = FormParser("lsv", VALUE_RULES, (), LONGEST, DEEPEST, "line")


@lru_cache(maxsize=8192)
def parse_form(form: str) -> ir.SourceStatement:
    """Parse the form of a logical line of PDL2, `Unknown` where the grammar cannot."""
    found = _PARSER.parse(form)
    if found is FAILED:
        numbered = count()
        text = re.sub(NAME_MARK, lambda _: open_name(next(numbered)), form)
        return ir.NotUnderstood(text if form[:2] != UNREADABLE else form[2:])
    return found if isinstance(found, ir.SourceStatement) else ir.SourceStatement()


@lru_cache(maxsize=8192)
def parse_value_form(form: str) -> EntryPart | None:
    """Parse the form of a line of a variable file, None where the grammar cannot."""
    found = _VALUE_PARSER.parse(form)
    return found if isinstance(found, EntryPart) else None
