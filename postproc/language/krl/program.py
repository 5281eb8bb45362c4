"""A KRL file: its routines, data, moves, and what is not understood."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from postproc.diagnostics import Code
from postproc.files import base_name
from postproc.language import ir
from postproc.language.analysis.control_flow import HeadedRows
from postproc.language.krl import syntax as said
from postproc.language.krl.files import KrlFileName
from postproc.language.krl.statements import KrlText, read_krl_statements
from postproc.language.text.blocks import BlockWords, Outline
from postproc.language.text.source import Source
from postproc.language.visits import Diagnostic

_WORDS = BlockWords(
    ends={
        "end": "def", "endfct": "deffct", "enddat": "defdat", "endif": "if",
        "endfor": "for", "endwhile": "while", "endtest": "test", "endloop": "loop",
        "until": "repeat", "endspline": "spline",
    },
    within={"else": "if", "case": "test", "default": "test"},
    scopes=("def", "deffct", "defdat"),
    outer=(),
)  # fmt: skip
_ROUTINES = ("def", "deffct")
OPENING = ("if", "while", "test", "loop", "repeat")


@dataclass(frozen=True)
class KrlDatum:
    """Data, or an element of an array, with what it is at first.

    Attributes:
        name: In lower case.
        index: Of the element, empty for the whole.
        type: As declared, "" for an element.
        value: What it is at first, None where nothing is said.
        row: Its statement.
        routine: Name of the routine whose own it is, "" where it is the file's.
        shared: Every program knows it.
        dimensions: Of an array.
    """

    name: str
    index: tuple[int, ...]
    type: str
    value: ir.Operand | None
    row: int
    routine: str
    shared: bool
    dimensions: tuple[ir.Operand, ...] = ()


@dataclass(frozen=True)
class KrlFile:
    """What a KRL file holds.

    Attributes:
        text: Its statements.
        name: Its base name in lower case: a source and its data list share it.
        routines: In the order of the file; empty in a data list.
        data: Declared data, and the values of a data list.
        moves: Rows of statements that move.
        splines: Rows of spline blocks.
        diagnostics: What is not understood, by line.
    """

    text: KrlText
    name: str
    routines: tuple[HeadedRows, ...]
    data: tuple[KrlDatum, ...]
    moves: tuple[int, ...]
    splines: tuple[range, ...]
    diagnostics: tuple[Diagnostic, ...]

    @property
    def _named(self) -> KrlFileName:
        return KrlFileName(self.text.source.name)

    @cached_property
    def is_system(self) -> bool:
        """Return True if it is of the controller: ``$config.dat``, or of a package."""
        source = self.text.source
        return self.name.startswith("$") or self._named.is_system_source(source.data)

    @property
    def is_submit(self) -> bool:
        """Return True if it runs beside the program, and moves no arm."""
        return self._named.is_submit


def read_krl(source: Source) -> KrlFile:
    """Read a KRL file.

    Raises:
        ProgramError: A string does not end.
    """
    text = read_krl_statements(source)
    reader = _KrlReader(text, Outline(text, _WORDS))
    for row in text.where(lambda one: not isinstance(one, said.KrlMove)):
        reader.take(row, text.statement(row))
    reader.outline.close()
    found = sorted({*reader.outline.diagnostics, *reader.diagnostics})
    return KrlFile(
        text,
        base_name(source.name),
        tuple(sorted(reader.outline.of(*_ROUTINES), key=lambda one: one.first)),
        tuple(reader.data),
        tuple(text.where(lambda one: isinstance(one, said.KrlMove))),
        tuple(reader.splines),
        tuple(found),
    )


LARGEST = 1 << 31  # whole number that counts or names anything


def whole(value: float) -> int | None:
    """Return a whole number, None where it is none.

    >>> whole(3.0), whole(2.5), whole(float("inf"))
    (3, None, None)
    """
    return int(value) if abs(value) < LARGEST and value == int(value) else None


@dataclass
class _KrlReader:
    """Statements of a file, as they are met."""

    text: KrlText
    outline: Outline
    data: list[KrlDatum] = field(default_factory=list)
    splines: list[range] = field(default_factory=list)
    diagnostics: list[Diagnostic] = field(default_factory=list)
    _spline: int = -1

    def take(self, row: int, one: ir.SourceStatement) -> None:
        """Take the next statement."""
        match one:
            case said.KrlDeclaration():
                self._declare(row, one)
            case ir.Assignment(target=target, value=value):
                if self.outline.name("defdat"):
                    self._initial(row, target, value)
            case ir.NotUnderstood():
                message = f"{self.text.quote(row)} is not understood"
                self.diagnostics.append(
                    self.text.diagnostic(row, Code.UNKNOWN_STATEMENT, message)
                )
            case _:
                self._block(row, one)

    def _block(self, row: int, one: ir.SourceStatement) -> None:
        """Open, divide or end a block."""
        match one:
            case said.KrlRoutine(kind=kind):
                self.outline.begin(kind, row, one)
            case said.DataList():
                self.outline.begin("defdat", row, one)
            case ir.ForLoop():
                self.outline.open("for", row, one)
            case ir.Branch(word=word) if word in OPENING:
                self.outline.open(word, row, one)
            case ir.Branch(word=word) | ir.BlockWord(word=word):
                self.outline.word(word, row)
            case said.SplineBlock(word="endspline"):
                self.outline.word("endspline", row)
                if self._spline >= 0:
                    self.splines.append(range(self._spline, row))
                self._spline = -1
            case said.SplineBlock():
                self.outline.open("spline", row, one)
                self._spline = row

    def _declare(self, row: int, one: said.KrlDeclaration) -> None:
        routine = self.outline.name(*_ROUTINES)
        for item in one.items:
            datum = KrlDatum(
                item.name,
                (),
                one.type,
                item.value,
                row,
                routine,
                one.shared,
                item.dimensions,
            )
            self.data.append(datum)

    def _initial(self, row: int, target: ir.DataObject, value: ir.Operand) -> None:
        """Take the value that a data list gives to data, or to an element."""
        index = self._index(row, target.steps)
        if index is not None:
            self.data.append(KrlDatum(target.name, index, "", value, row, "", False))

    def _index(
        self, row: int, steps: Sequence[str | ir.ElementStep]
    ) -> tuple[int, ...] | None:
        """Return the index of an element, None where it is none that can be told."""
        if not steps:
            return ()
        if len(steps) > 1 or not isinstance(steps[0], ir.ElementStep):
            return None
        slots = [s.slot for s in steps[0].subscripts if isinstance(s, ir.Num)]
        if len(slots) < len(steps[0].subscripts):
            return None
        first = int(self.text.first[row])
        found = [whole(float(self.text.value[first + slot])) for slot in slots]
        known = tuple(k for k in found if k is not None)
        return known if len(known) == len(found) else None
