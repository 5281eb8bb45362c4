"""A RAPID file: its modules, routines, data, moves, and what is not understood."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

from postproc.diagnostics import Code
from postproc.language.analysis.control_flow import HeadedRows
from postproc.language.ir import (
    Argument,
    BlockWord,
    Branch,
    ForLoop,
    Instruction,
    NotUnderstood,
    Operand,
    SourceStatement,
)
from postproc.language.rapid.files import RapidFileName
from postproc.language.rapid.instructions import (
    MOTIONS,
    Signature,
    read_known_instructions,
)
from postproc.language.rapid.statements import RapidText, read_statements
from postproc.language.rapid.syntax import (
    CompactIf,
    DataDeclaration,
    LateCall,
    ModuleHead,
    RecordHead,
    RoutineHead,
)
from postproc.language.text.blocks import BlockWords, Outline
from postproc.language.text.source import Source
from postproc.language.visits import Diagnostic

_SYSTEM = "sysmodule"


@dataclass(frozen=True)
class Datum:
    """Data that a module or a routine declares.

    Attributes:
        declared: What the declaration says.
        row: Its statement.
        module: Name of the module, "" outside of all.
        routine: Name of the routine whose own it is, "" where it is the module's.
    """

    declared: DataDeclaration
    row: int
    module: str
    routine: str


@dataclass(frozen=True)
class MotionCall:
    """An instruction that moves.

    Attributes:
        row: Its statement.
        name: Of the instruction, in lower case.
        signature: Where its positions stand.
        to, via: Destination and point of an arc, None where one is missing.
        arguments: All of its arguments.
        condition: It runs only ``IF`` something is true.
    """

    row: int
    name: str
    signature: Signature
    to: Operand | None
    via: Operand | None
    arguments: tuple[Argument, ...]
    condition: bool


@dataclass(frozen=True)
class RapidFile:
    """What a RAPID file holds.

    Attributes:
        text: Its statements.
        modules, routines: In the order of the file.
        data: Declared data.
        moves: Statements that move.
        diagnostics: What is not understood or may move unseen, by line.
    """

    text: RapidText
    modules: tuple[HeadedRows, ...]
    routines: tuple[HeadedRows, ...]
    data: tuple[Datum, ...]
    moves: tuple[MotionCall, ...]
    diagnostics: tuple[Diagnostic, ...]

    @cached_property
    def is_system(self) -> bool:
        """Tell whether it is a system module, which is read and never rewritten.

        It is one by its place in a backup, by its suffix, or by what a module says.
        """
        heads = (scope.head for scope in self.modules)
        said = any(isinstance(h, ModuleHead) and _SYSTEM in h.attributes for h in heads)
        return said or RapidFileName(self.text.source.name).is_named_as_system


def read_rapid(source: Source) -> RapidFile:
    """Read a RAPID file.

    Raises:
        ProgramError: A string or the header does not end.
    """
    text = read_statements(source)
    outline, data = _outline(text)
    routines = outline.of(*_ROUTINES)
    # Without its end, calls may stand behind a record.
    ended = (r for r in outline.of("record") if r.ended)
    within = {row for r in ended for row in range(r.first, r.last + 1)}
    calls = _Calls(text, {scope.head.name for scope in routines})
    for row in text.where(_is_call):
        if row not in within:
            calls.take(row, text.statement(row))
    found = sorted({*outline.diagnostics, *calls.diagnostics})
    return RapidFile(
        text,
        tuple(outline.of("module")),
        tuple(routines),
        tuple(data),
        tuple(calls.moves),
        tuple(found),
    )


def _is_call(said: SourceStatement) -> bool:
    return isinstance(said, Instruction | LateCall | CompactIf | NotUnderstood)


def _is_outline(said: SourceStatement) -> bool:
    heads = ModuleHead | RoutineHead | RecordHead | Branch | ForLoop
    return isinstance(said, heads | BlockWord | DataDeclaration)


# Blocks: every head has its end.

_WORDS = BlockWords(
    ends={
        "endmodule": "module", "endproc": "proc", "endfunc": "func", "endtrap": "trap",
        "endrecord": "record", "endif": "if", "endfor": "for", "endwhile": "while",
        "endtest": "test",
    },
    within={"elseif": "if", "else": "if", "case": "test", "default": "test"},
    scopes=("module", "proc", "func", "trap", "record"),
    outer=("module",),
)  # fmt: skip
_ROUTINES = ("proc", "func", "trap")


def _outline(text: RapidText) -> tuple[Outline, list[Datum]]:
    """Find modules, routines, records, blocks and data of a file."""
    outline, data = Outline(text, _WORDS), list[Datum]()
    for row in text.where(_is_outline):
        match said := text.statement(row):
            case DataDeclaration():
                module, routine = outline.name("module"), outline.name(*_ROUTINES)
                data.append(Datum(said, row, module, routine))
            case ModuleHead():
                outline.begin("module", row, said)
            case RoutineHead(kind=kind):
                outline.begin(kind, row, said)
            case RecordHead():
                outline.begin("record", row, said)
            case ForLoop():
                outline.open("for", row, said)
            case Branch(word="if" | "while" | "test" as word):
                outline.open(word, row, said)
            case Branch(word=word) | BlockWord(word=word):
                outline.word(word, row)
    outline.close()
    return outline, data


# Calls: what moves, what does not, and what nobody can tell.


@dataclass
class _Calls:
    """Instructions of a file, as they are met.

    Attributes:
        own: Names of its routines.
    """

    text: RapidText
    own: set[str]
    moves: list[MotionCall] = field(default_factory=list)
    diagnostics: list[Diagnostic] = field(default_factory=list)
    _operands: dict[int, tuple[object, tuple[Operand | None, ...]]] = field(
        default_factory=dict
    )  # by the id of arguments, which are kept so that nothing else gets it

    def take(self, row: int, said: SourceStatement, condition: bool = False) -> None:
        """Take the next statement that may move."""
        match said:
            case CompactIf(statement=inside):
                self.take(row, inside, condition=True)
            case Instruction(name=name, arguments=arguments):
                self._instruction(row, name, arguments, condition)
            case LateCall():
                what = "calls a procedure whose name shows when it runs: it may move"
                self._complain(row, Code.LATE_BINDING, what)
            case NotUnderstood():
                self._complain(row, Code.UNKNOWN_STATEMENT, "is not understood")

    def _instruction(
        self, row: int, name: str, arguments: tuple[Argument, ...], condition: bool
    ) -> None:
        signature = MOTIONS.get(name)
        if signature is not None:
            if id(arguments) not in self._operands:
                self._operands[id(arguments)] = arguments, signature.operands(arguments)
            to, via = self._operands[id(arguments)][1]
            self.moves.append(
                MotionCall(row, name, signature, to, via, arguments, condition)
            )
            if to is None or (signature.via >= 0 and via is None):
                self._complain(row, Code.UNKNOWN_STATEMENT, "has too few positions")
        elif (
            read_known_instructions().get(name, "left") == "left"
            and name not in self.own
        ):
            what = "is neither a known instruction nor a routine here: it may move"
            self._complain(row, Code.UNKNOWN_INSTRUCTION, what)

    def _complain(self, row: int, code: Code, what: str) -> None:
        message = f"{self.text.quote(row)} {what}"
        self.diagnostics.append(self.text.diagnostic(row, code, message))
