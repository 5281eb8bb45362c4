"""The variable that a move names as where it goes, as far as it can be cloned."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from postproc.language import pdl2 as ast
from postproc.language.edits import Span
from postproc.language.layout import CloneError
from postproc.language.program import Body, Program
from postproc.language.variables import Variable

_POINTS = frozenset({"position", "xtndpos", "jointpos"})
_STRING = re.compile(r"'(?:\\.|[^'\\])*'|'[^']*'|\"[^\"]*\"")


@dataclass(frozen=True)
class Named:
    """A variable that a move names as its destination.

    Attributes:
        file: Index of its file.
        scope: Name of the routine that declares it, "" for the program.
        variable: Its declaration.
        span: Where the move names it.
    """

    file: int
    scope: str
    variable: Variable
    span: Span

    @property
    def key(self) -> str:
        """Return a text that tells variables apart."""
        return f"{self.file}:{self.scope}/{self.variable.name.lower()}"


def named_at(
    programs: Sequence[Program], file: int, line: int, via: bool, name: str
) -> Named:
    """Find the variable that a move goes to, as far as it can be cloned.

    Args:
        programs: The program files of a job.
        file: Where the move stands.
        line: Its line there.
        via: Its VIA point is meant, not its end.
        name: Owner of the value that it goes to.

    Raises:
        CloneError: The move names no variable that can be.
    """
    program = programs[file]
    row = int(np.searchsorted(program.lines.line, line))
    move = _unwrapped(program.statement(row))
    where = None
    if isinstance(move, ast.Move) and move.how == "TO":
        where = move.via if via else move.where[0]
    if not isinstance(where, ast.Reference):
        raise CloneError("the numbers stand in the move itself, or are computed")
    if where.steps:
        raise CloneError("elements of arrays, records and paths are not cloned")
    body = body_at(program, row)
    if any(p.name == where.name for p in body.parameters):
        raise CloneError(f"{where.name} is a parameter")
    own = body.variables.get(where.name)
    variable = own or program.variables.get(where.name)
    if variable is None or variable.type is None:
        raise CloneError(f"{where.name} is not declared as a variable in this file")
    if variable.type.name not in _POINTS or variable.type.array or variable.type.path:
        raise CloneError(f"{variable.name} is no single point")
    if variable.exported not in ("", program.name):
        raise CloneError(f"{variable.name} belongs to {variable.exported}")
    if variable.name.lower() != name.lower():
        raise CloneError(f"{variable.name} holds a copy of {name}")
    span = _destination(program, row, "VIA" if via else "TO", variable.name)
    return Named(file, body.name if own else "", variable, span)


def _unwrapped(statement: ast.Statement) -> ast.Statement | None:
    inner = (ast.Label, ast.Case, ast.Else, ast.When)
    return statement.then if isinstance(statement, inner) else statement


def body_at(program: Program, row: int) -> Body:
    """Return the body that a row stands in.

    Raises:
        CloneError: It stands in none.
    """
    for body in (program.main, *program.routines.values()):
        if body is not None and body.first < row < body.last:
            return body
    raise CloneError("the move stands outside of any body")


def _destination(program: Program, row: int, word: str, name: str) -> Span:
    """Find the name after TO or VIA in a statement."""
    lines = program.lines
    first = int(lines.line[row])
    after = len(lines.source.line_starts) + 1
    last = int(lines.line[row + 1]) if row + 1 < len(lines) else after
    pattern = re.compile(rf"\b{word}\s+({re.escape(name)})\b(?!\s*[\[.(:])", re.I)
    found = []
    for line in range(first, last):
        start = int(lines.source.line_starts[line - 1])
        code = code_of(program, line)
        code = _STRING.sub(lambda s: " " * len(s.group()), code)
        found += [
            (start + f.start(1), start + f.end(1)) for f in pattern.finditer(code)
        ]
    if len(found) != 1:
        raise CloneError(f"{word} {name} stands {len(found)} times in the statement")
    return Span(*found[0])


def code_of(program: Program, line: int) -> str:
    """Return a physical line without its comment and line ending."""
    lines = program.lines
    text = lines.source.line_text(line)
    comment = int(lines.comment[line - 1])
    if comment < 0:
        return text
    return text[: comment - int(lines.source.line_starts[line - 1])]
