"""A parsed program: declarations, routines, blocks, and where each jump leads."""

from __future__ import annotations

import re
from array import array
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from postproc.arrays import Bools, Indices, Ints
from postproc.diagnostics import Code
from postproc.language import ir
from postproc.language.analysis.control_flow import ControlFlow, FlowReader
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.parser import parse_form
from postproc.language.pdl2.pose_encoding import COMMENTS
from postproc.language.text.source import Source
from postproc.language.text.statement_table import Statements, read_lines
from postproc.language.text.symbol_column import NameColumn
from postproc.language.text.templates import name_index
from postproc.language.visits import Diagnostic

ProgramLines = Statements[ir.SourceStatement]

# Block structure of one body: which line closes which, and where jumps lead.

_UNKNOWN_OPENERS: tuple[tuple[str, ir.SourceStatement], ...] = (
    (r"IF\b(?!.*\bENDIF\b)", ir.Branch("if")),
    (r"SELECT\b(?!.*\bENDSELECT\b)", ir.Branch("test")),
    (r"FOR\b(?!.*\bENDFOR\b)", ir.ForLoop("", None, None)),
    (r"WHILE\b(?!.*\bENDWHILE\b)", ir.Branch("while")),
    (r"UNTIL\b", ir.Branch("until")),
    (r"CASE\b", ir.Branch("case")),
    (r"CONDITION\b(?!.*\bENDCONDITION\b)", ir.Branch("condition")),
)
_STRING = re.compile(r"'[^']*'")
_JUMP = re.compile(r"\b(?:GOTO|RETURN|EXIT)\b", re.I)
_LEADS = (
    "where this line leads is not known: write its statements on lines of their own, "
    "in words that are understood"
)


def _spell(word: str) -> str:
    return word.upper().replace("TEST", "SELECT")


def recover_block(statement: ir.SourceStatement) -> ir.SourceStatement:
    """Return the block that an unknown line opens, or the statement itself."""
    if isinstance(statement, ir.NotUnderstood):
        for pattern, opener in _UNKNOWN_OPENERS:
            if re.match(pattern, statement.text, re.I):
                return opener
    return statement


def read_flow(lines: ProgramLines, rows: Ints, first: int, last: int) -> ControlFlow:
    """Match the blocks of a body.

    Args:
        lines: Those of the program.
        rows: Those of the body that are no plain ones.
        first: The first row of the body.
        last: The row of its end.
    """
    reader = FlowReader(lines.line, _spell, ("if", "test"))
    for row in rows.tolist():
        written = lines.statement(row)
        odd = ast.action(written)
        text = odd.text if isinstance(odd, ir.NotUnderstood) else ""
        if _JUMP.search(_STRING.sub("", text)):  # it may lead to another place
            reader.problems.append((row, _LEADS))
        reader.take(row, recover_block(written))
    return reader.flow(first, last)


@dataclass(frozen=True, slots=True)
class Variable:
    """A declared variable or constant.

    Attributes:
        name: As it is written.
        row: Logical line of its declaration.
        type: Its type, None for a constant.
        initial: Its initial value or None.
        exported: The program it is exported from, or "".
        constant: Declared in a CONST section.
        taught: Marked ``-- TAUGHT``.
        arm: ``FOR ARM[n]``, 0 where it is not said.
    """

    name: str
    row: int
    type: ast.Type | None = None
    initial: ir.Operand | None = None
    exported: str = ""
    constant: bool = False
    taught: bool = False
    arm: int = 0


class Variables(Mapping[str, Variable]):
    """Variables by lower-case name; each is made when it is asked for.

    A name that is declared again means what the last declaration says.
    """

    def __init__(self) -> None:
        """Begin without any."""
        self._names = NameColumn()  # in lower case, each once
        self._at = array("i")  # where each is written last
        self._written = NameColumn()
        self._begins: list[int] = []  # the first name of every declaration
        self._said: list[Variable] = []  # what holds for all names of a declaration
        self._made: dict[str, Variable] = {}

    def declare(self, names: Sequence[str], said: Variable) -> None:
        """Enter the names of one declaration.

        Args:
            names: As they are written.
            said: What holds for all of them, under any name.
        """
        begin = len(self._written)
        own = NameColumn(names).lower()
        if self._made:
            for name in own:
                self._made.pop(name, None)
        for at, number in enumerate(self._names.of(own).tolist(), begin):
            if number == len(self._at):
                self._at.append(at)
            self._at[number] = at
        self._written.extend(names)
        self._begins.append(begin)
        self._said.append(said)

    def some(self, names: Iterable[str]) -> Variables:
        """Return those of some lower-case names that there are."""
        found = Variables()
        for name in names:
            if name in self:
                found.declare([self[name].name], self[name])
        return found

    def settle(self) -> None:
        """Let go of what finds names, until one is looked for again."""
        self._names.settle()
        self._written.settle()

    def __len__(self) -> int:
        """Return the number of names."""
        return len(self._names)

    def __iter__(self) -> Iterator[str]:
        """Go through the lower-case names."""
        return iter(self._names)

    def __contains__(self, name: object) -> bool:
        """Tell whether a lower-case name is declared."""
        return name in self._names

    def __getitem__(self, name: str) -> Variable:
        """Return the variable of a lower-case name."""
        made = self._made.get(name)
        if made is None:
            number = self._names.number(name)
            if number < 0:
                raise KeyError(name)
            at = self._at[number]
            said = self._said[bisect_right(self._begins, at) - 1]
            made = self._made[name] = replace(said, name=self._written[at])
        return made

    def get(self, name: str, default: object = None) -> Variable | None:  # type: ignore[override]
        """Return the variable of a lower-case name, None where there is none."""
        return self[name] if name in self else None

    @property
    def names(self) -> NameColumn:
        """Return the lower-case names."""
        return self._names

    def which(self, test: Callable[[Variable], bool]) -> list[str]:
        """List the lower-case names whose declaration passes a test, in order.

        Args:
            test: What no name decides.
        """
        passed = np.array([test(said) for said in self._said], dtype=bool)
        if not passed.any():
            return []
        found = passed[self._declaration(np.array(self._at, dtype=np.int32))]
        return [self._names[k] for k in np.flatnonzero(found).tolist()]

    def passing(self, names: NameColumn, test: Callable[[Variable], bool]) -> Bools:
        """Tell which lower-case names are declared, and so that it passes a test."""
        number = self._names.find(names)
        found = number >= 0
        own = self._declaration(np.array(self._at, dtype=np.int32)[number[found]])
        passed = np.zeros(len(self._said), bool)
        for k in np.flatnonzero(np.bincount(own)).tolist():
            passed[k] = test(self._said[k])
        found[found] = passed[own]
        return found

    def _declaration(self, index: Indices) -> Ints:
        begins = np.array(self._begins, dtype=np.int32)
        found: Ints = np.searchsorted(begins, index, side="right") - 1
        return found


@dataclass(frozen=True)
class Body:
    """A routine or the main part of a program.

    Attributes:
        name: Routine name in lower case, "" for the main part.
        first, last: Rows of its BEGIN and of its END.
        parameters: Names of its formal parameters, in lower case.
        variables: These and its own variables, by name; the main part has none.
        flow: Where its jumps lead.
        broken: First line whose block structure is wrong, 0 where all is well.
        exported: Other programs may call it.
    """

    name: str
    first: int
    last: int
    parameters: tuple[str, ...]
    variables: Variables
    flow: ControlFlow
    broken: int = 0
    exported: bool = False

    @cached_property
    def own_names(self) -> frozenset[str]:
        """Return the names that mean something else here than around it."""
        return frozenset(self.variables)


@dataclass(frozen=True)
class Program:
    """A parsed program file.

    Attributes:
        name: Program name in lower case.
        lines: Its logical lines.
        main: Its main part, None where it has none.
        routines: Routines with a body, by lower-case name.
        outside: Routines exported from other programs: name to program.
        variables: Declared variables, by lower-case name.
        imports: Files named by IMPORT.
        arm: ``PROG_ARM``, 0 where it is not said.
        diagnostics: What was found while reading.
        nodes: Standard fields that types of nodes declare, all in lower case.
    """

    name: str
    lines: ProgramLines
    main: Body | None
    routines: Mapping[str, Body]
    outside: Mapping[str, str]
    variables: Variables
    imports: tuple[str, ...]
    arm: int
    diagnostics: tuple[Diagnostic, ...]
    nodes: Mapping[str, frozenset[str]]

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """Its main part, if it has one, and its routines."""
        return tuple(one for one in (self.main, *self.routines.values()) if one)

    @cached_property
    def calling(self) -> Bools:
        """Which shapes of its lines may call a function in an expression, (k,)."""
        own = {*self.routines, *self.outside}
        numbered = any(not name.isalpha() for name in own)

        def may_call(part: ir.Node) -> bool:
            if isinstance(part, ir.FunctionCall):
                return part.name not in ast.NAMES["pure"]
            if not isinstance(part, ir.DataObject) or part.steps:
                return False
            return part.name in own or (numbered and name_index(part.name) >= 0)

        return self.lines.said.which(lambda one: any(map(may_call, ir.walk(one))))

    @property
    def handlers(self) -> list[tuple[int, int]]:
        """Rows at which its condition handlers begin and end."""
        return [rows for body in self.bodies for rows in body.flow.conditions]

    @property
    def head(self) -> int:
        """Return the line that names the program, 1 where there is none."""
        heads = self.lines.which(lambda said: isinstance(said, ast.ProgramHead))
        rows = np.flatnonzero(heads)
        return int(self.lines.begin_line[rows[0]]) if len(rows) else 1


_PLAIN = (
    ast.Move, ir.Assignment, ir.Instruction, ast.Transfer, ast.Still, ast.CancelMove
)  # fmt: skip


@dataclass
class _Scope:
    """What is being read: a program's or a routine's declarations."""

    routine: ast.Routine | None = None
    row: int = -1  # of ROUTINE
    begin: int = -1
    variables: Variables = field(default_factory=Variables)


@dataclass
class _Reader:
    """Collects the parts of a program, one structural line after the other."""

    lines: ProgramLines
    taught: frozenset[int]
    structural: Ints  # rows of other statements than plain ones, ascending
    name: str = ""
    arm: int = 0
    main: Body | None = None
    routines: dict[str, Body] = field(default_factory=dict)
    outside: dict[str, str] = field(default_factory=dict)
    imports: list[str] = field(default_factory=list)
    diagnostics: list[Diagnostic] = field(default_factory=list)
    scopes: list[_Scope] = field(default_factory=lambda: [_Scope()])
    structure: str = ""  # its name, between RECORD and ENDRECORD
    nodes: dict[str, frozenset[str]] = field(default_factory=dict)

    def report(self, row: int, code: Code, message: str) -> None:
        self.diagnostics.append(self.lines.diagnostic(row, code, message))

    def take(self, row: int, statement: ir.SourceStatement) -> None:
        scope = self.scopes[-1]
        match statement:
            case ir.BlockWord("section", then) if then is not None:
                self.take(row, then)
            case ast.ProgramHead(name, slot):
                self.name = name
                self.arm = self._arm(row, slot)
            case ir.ScopeHead("import", file):
                self.imports.append(file)
            case ir.ScopeHead("record", name):
                self.structure = name
            case ast.NodeFields(names) if self.structure:
                known = self.nodes.get(self.structure, frozenset())
                self.nodes[self.structure] = known.union(names)
            case ir.BlockWord("endrecord"):
                self.structure = ""
            case ast.Declare() if scope.begin < 0 and not self.structure:
                self._declare(row, statement)
            case ast.Routine(name, _, exported):
                if exported and exported != self.name:
                    self.outside[name] = exported
                else:
                    self._before_next(row)
                    self.scopes.append(_Scope(statement, row))
            case ir.BlockWord("begin"):
                if scope.begin >= 0:
                    self._before_next(row)
                if self.scopes[-1].begin < 0:
                    self.scopes[-1].begin = row
            case ast.End(name) if scope.begin >= 0:
                if scope.routine and name == self.name != scope.routine.name:
                    self._drop_declared()
                self.close(row)
            case _:
                pass

    def _arm(self, row: int, slot: int) -> int:
        """Return the number of an arm in a line, 0 where none is said."""
        if slot < 0:
            return 0
        number = float(self.lines.value[self.lines.first[row] + slot])
        return int(number) if number.is_integer() else 0

    def _declare(self, row: int, one: ast.Declare) -> None:
        arm = -1 if one.type is None else one.type.arm
        said = Variable(
            "", row, one.type, one.initial, one.exported, "const" in one.attributes,
            self.lines.line(row) in self.taught, self._arm(row, arm),
        )  # fmt: skip
        self.scopes[-1].variables.declare(one.names, said)

    def _before_next(self, row: int) -> None:
        """End or drop a routine because the next body or routine begins."""
        scope = self.scopes[-1]
        if scope.routine is None:
            return
        if scope.begin < 0:
            self._drop_declared()
        else:
            name = scope.routine.name
            self.report(
                row, Code.END_MISSING, f"END {name} is missing before this line"
            )
            self.close(row)

    def _drop_declared(self) -> None:
        """Take a routine that turns out to have no body of its own as declared."""
        scope = self.scopes.pop()
        self.scopes[-1].begin = scope.begin
        for one in scope.variables.values():
            self.scopes[-1].variables.declare([one.name], one)

    def close(self, last: int) -> None:
        """End the innermost routine, or the program."""
        scope = self.scopes[-1]
        routine = scope.routine
        within = np.searchsorted(self.structural, (scope.begin + 1, last))
        rows = self.structural[slice(*within)]
        flow = read_flow(self.lines, rows, scope.begin + 1, last)
        problems = (*flow.problems, *flow.nowhere)
        for row, message in problems:
            self.report(row, Code.BLOCK_STRUCTURE, message)
        wrong = (self.lines.line(row) for row, _ in problems)
        broken = min(wrong, default=0)
        name = routine.name if routine else ""
        parameters = routine.parameters if routine else ()
        own = scope.variables if routine else Variables()
        for one in parameters:
            arm = self._arm(scope.row, one.type.arm if one.type else -1)
            own.declare(one.names, Variable("", scope.row, one.type, arm=arm))
        names = tuple(name for one in parameters for name in one.names)
        exported = bool(routine and routine.exported)
        body = Body(name, scope.begin, last, names, own, flow, broken, exported)
        if routine:
            self.routines[name] = body
            self.scopes.pop()
        else:
            self.main = body
            self.scopes[-1] = _Scope(variables=scope.variables)


def parse(source: Source) -> Program:
    """Parse a PDL2 program: every distinct shape of line once.

    Lines that the grammar does not know are kept and listed.

    Args:
        source: The program.

    Raises:
        ProgramError: A string does not end on its line.
    """
    lines: ProgramLines = read_lines(source, parse_form)
    rows = np.flatnonzero(lines.which(lambda said: not isinstance(said, _PLAIN)))
    reader = _Reader(lines, COMMENTS.list_taught(source), rows)
    for row in rows.tolist():
        statement = lines.said.once(int(lines.shape[row]))
        if isinstance(statement, ir.NotUnderstood):
            line = reader.lines.line(row)
            text = reader.lines.source.line_text(line).strip()
            reader.report(
                row,
                Code.UNKNOWN_STATEMENT,
                f"this statement is not understood and is kept as it is: {text[:60]!r}",
            )
        reader.take(row, statement)
    _close_open(reader)
    return Program(
        reader.name, lines, reader.main, reader.routines, reader.outside,
        reader.scopes[0].variables, tuple(reader.imports), reader.arm,
        tuple(reader.diagnostics), reader.nodes,
    )  # fmt: skip


def _close_open(reader: _Reader) -> None:
    """Report what is missing at the end of the file and close what is open."""
    while reader.scopes[-1].begin >= 0 or len(reader.scopes) > 1:
        scope = reader.scopes[-1]
        last = len(reader.lines) - 1
        name = scope.routine.name if scope.routine else reader.name
        reader.report(last, Code.END_MISSING, f"END {name} is missing at the end")
        if scope.begin < 0:
            reader.scopes.pop()
        else:
            reader.close(last + 1)
    if reader.main is None and not reader.routines and len(reader.lines):
        reader.report(0, Code.NO_PROGRAM, "the file holds no BEGIN .. END")
