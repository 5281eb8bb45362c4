"""Programs from lines: declarations, routines, blocks, and where each jump leads."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from postproc.arrays import Each
from postproc.language import pdl2 as ast
from postproc.language.blocks import build_blocks
from postproc.language.diagnostic import Diagnostic
from postproc.language.forms import Formed, formed
from postproc.language.lines import Lines, read_lines
from postproc.language.parser import parse_form
from postproc.language.program import Body, Program
from postproc.language.source import Source
from postproc.language.variables import Variable, Variables

_PLAIN = (ast.Move, ast.Assign, ast.Call, ast.Transfer, ast.Still)


@dataclass
class _Scope:
    """What is being read: a program's or a routine's declarations."""

    routine: ast.Routine | None = None
    begin: int = -1
    variables: Variables = field(default_factory=Variables)


@dataclass
class _Reader:
    """Collects the parts of a program, one structural line after the other."""

    lines: Lines
    statements: Formed[ast.Statement]
    taught: frozenset[int]
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

    def report(self, row: int, code: str, message: str) -> None:
        name = self.lines.source.name
        line = int(self.lines.line[row])
        self.diagnostics.append(Diagnostic(name, line, code, message))

    def take(self, row: int, statement: ast.Statement) -> None:
        scope = self.scopes[-1]
        match statement:
            case ast.Section(then) if then is not None:
                self.take(row, then)
            case ast.Program(name, slot):
                self.name = name
                if slot >= 0:
                    self.arm = int(self.lines.value[self.lines.first[row] + slot])
            case ast.Import(file):
                self.imports.append(file)
            case ast.Structure(name):
                self.structure = name
            case ast.NodeFields(names) if self.structure:
                known = self.nodes.get(self.structure, frozenset())
                self.nodes[self.structure] = known.union(names)
            case ast.EndStructure():
                self.structure = ""
            case ast.Declare() | ast.Constant() if scope.begin < 0:
                self._declare(row, statement)
            case ast.Routine(name, _, exported):
                if exported and exported != self.name:
                    self.outside[name] = exported
                else:
                    self._before_next(row)
                    self.scopes.append(_Scope(statement))
            case ast.Begin():
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

    def _declare(self, row: int, statement: ast.Declare | ast.Constant) -> None:
        if self.structure:
            return
        variables = self.scopes[-1].variables
        if isinstance(statement, ast.Constant):
            name, value = statement.name, statement.value
            constant = Variable(name, row, initial=value, constant=True)
            variables.declare([name], constant)
            return
        said = Variable(
            "",
            row,
            statement.type,
            statement.initial,
            statement.exported,
            "const" in statement.attributes,
            int(self.lines.line[row]) in self.taught,
        )
        variables.declare(statement.names, said)

    def _before_next(self, row: int) -> None:
        """End or drop a routine because the next body or routine begins."""
        scope = self.scopes[-1]
        if scope.routine is None:
            return
        if scope.begin < 0:
            self._drop_declared()
        else:
            name = scope.routine.name
            self.report(row, "end-missing", f"END {name} is missing before this line")
            self.close(row)

    def _drop_declared(self) -> None:
        """Take a routine that turns out to have no body of its own as declared."""
        scope = self.scopes.pop()
        self.scopes[-1].begin = scope.begin
        self.scopes[-1].variables.declare_all(scope.variables)

    def close(self, last: int) -> None:
        """End the innermost routine, or the program."""
        scope = self.scopes[-1]
        routine = scope.routine
        blocks, problems = build_blocks(
            self.lines, self.statements, scope.begin + 1, last
        )
        for row, message in problems:
            self.report(row, "block-structure", message)
        name = routine.name if routine else ""
        parameters = routine.parameters if routine else ()
        own = scope.variables if routine else Variables()
        body = Body(name, scope.begin, last, parameters, own, blocks)
        if routine:
            self.routines[name] = body
            self.scopes.pop()
        else:
            self.main = body
            self.scopes[-1] = _Scope(variables=scope.variables)


def parse(source: Source, each: Each = map) -> Program:
    """Parse a PDL2 program: every distinct shape of line once.

    Lines that the grammar does not know are kept and listed.

    Args:
        source: The program.
        each: As in `read_lines`.

    Raises:
        ProgramError: A string does not end on its line.
    """
    lines = read_lines(source, each)
    statements = formed(lines.shapes, parse_form)
    taught = frozenset(line for line, _ in lines.marks("TAUGHT"))
    reader = _Reader(lines, statements, taught)
    structural = statements.which(lambda said: not isinstance(said, _PLAIN))
    for row in np.flatnonzero(structural[lines.shape]).tolist():
        statement = statements[int(lines.shape[row])]
        if isinstance(statement, ast.Unknown):
            _report_unknown(reader, row)
        reader.take(row, statement)
    _close_open(reader)
    return Program(
        reader.name,
        lines,
        statements,
        reader.main,
        reader.routines,
        reader.outside,
        reader.scopes[0].variables,
        tuple(reader.imports),
        reader.arm,
        tuple(reader.diagnostics),
        reader.nodes,
    )


def _report_unknown(reader: _Reader, row: int) -> None:
    line = int(reader.lines.line[row])
    text = reader.lines.source.line_text(line).strip()
    reader.report(
        row,
        "unknown-statement",
        f"this statement is not understood and is kept as it is: {text[:60]!r}; "
        "moves that it may influence are not compensated",
    )


def _close_open(reader: _Reader) -> None:
    """Report what is missing at the end of the file and close what is open."""
    while reader.scopes[-1].begin >= 0 or len(reader.scopes) > 1:
        scope = reader.scopes[-1]
        last = len(reader.lines) - 1
        name = scope.routine.name if scope.routine else reader.name
        reader.report(last, "end-missing", f"END {name} is missing at the end")
        if scope.begin < 0:
            reader.scopes.pop()
        else:
            reader.close(last + 1)
    if reader.main is None and not reader.routines and len(reader.lines):
        reader.report(0, "no-program", "the file holds no BEGIN .. END")
