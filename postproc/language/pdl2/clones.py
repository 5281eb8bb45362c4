"""Clone a variable: another name with its own value, laid out as the file is."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from postproc.language import ir
from postproc.language.language import Cloner, NamedPoint
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.entries import EntryLines, is_nested, last_head
from postproc.language.pdl2.parser import parse_value_form
from postproc.language.pdl2.program import Body, Program
from postproc.language.text.lexer import scan_lines
from postproc.language.text.source import (
    CloneError,
    Edit,
    Source,
    Span,
    find_free_name,
    insert_after,
)
from postproc.language.text.statement_table import read_lines
from postproc.language.visits import Literals

LONGEST_NAME = 32  # characters of an identifier (likely)
_EXPORTED = re.compile(r"\s+EXPORTED\s+FROM\s+\w+", re.I)
_STRING = re.compile(r"'(?:\\.|[^'\\])*'|'[^']*'|\"[^\"]*\"")


@dataclass
class Pdl2Cloner(Cloner):
    """The files of a job, to clone variables in them.

    The new variable is declared behind the old one; wherever the old one is given one
    of the values, the new one is given it next. Until a move that the old one reaches
    with that value, the new one therefore holds the same.

    Attributes:
        programs: Its program files, parsed.
        values: Its variable file, or None; its index follows those of the programs.
        taken: All words of its files, in lower case.
    """

    programs: list[Program]
    values: Source | None
    taken: set[str]

    def target(self, file: int, line: int, via: bool, name: str) -> NamedPoint:
        """Find the variable that a move goes to, as far as it can be cloned."""
        program = self.programs[file]
        row = int(np.searchsorted(program.lines.begin_line, line))
        move = ast.action(program.lines.statement(row))
        where = None
        if isinstance(move, ast.Move) and move.how == "TO":
            where = move.via if via else move.where[0]
        if not isinstance(where, ir.DataObject):
            raise CloneError("the numbers stand in the move itself, or are computed")
        if where.steps:
            raise CloneError("elements of arrays, records and paths are not cloned")
        body = body_at(program, row)
        if where.name in body.parameters:
            raise CloneError(f"{where.name} is a parameter")
        own = body.variables.get(where.name)
        variable = own or program.variables.get(where.name)
        if variable is None or variable.type is None:
            raise CloneError(f"{where.name} is not declared as a variable in this file")
        type_ = variable.type
        if type_.name not in ast.POINTS or type_.array or type_.path:
            raise CloneError(f"{variable.name} is no single point")
        if variable.exported not in ("", program.name):
            raise CloneError(f"{variable.name} belongs to {variable.exported}")
        if variable.name.lower() != name.lower():
            raise CloneError(f"{variable.name} holds a copy of {name}")
        span = _destination(program, row, "VIA" if via else "TO", variable.name)
        place = file, "", body.name if own else "", where.name
        return NamedPoint(place, variable.name, file, span)

    def find_declaration(self, named: NamedPoint) -> int:
        """Return the 1-based line that declares a variable."""
        (*_, routine, name), program = named.place, self.programs[named.file]
        own = program.routines[routine] if routine else program
        return program.lines.line(own.variables[name].row)

    def clone(
        self, literals: Literals, named: Sequence[NamedPoint], rows: Sequence[int]
    ) -> tuple[str, list[tuple[int, Edit]]]:
        """Give some moves a variable of their own, see `Cloner.clone`."""
        first, old = named[0], named[0].name
        program, at = self.programs[first.file], self.find_declaration(first)
        name = find_free_name(old, self.taken, LONGEST_NAME)
        found = [(first.file, _declare_clone(program, at, old, name))]
        for row in rows:
            file, line = int(literals.file[row]), int(literals.line[row])
            starts = literals.places[row : row + 1].start[0].tolist()
            if file == len(self.programs) and self.values and first.file == 0:
                entry = copy_entry(self.values, line, old, name, starts)
                found.append((file, entry))
            elif file != first.file:
                raise CloneError("its value stands in another file")
            elif line != at:
                found.append((file, _assign_clone(program, first, line, name, starts)))
        source = program.lines.source
        return name, [*found, *(one.rename(source, name) for one in named)]


def body_at(program: Program, row: int) -> Body:
    """Return the body that a row stands in.

    Raises:
        CloneError: It stands in none.
    """
    for body in program.bodies:
        if body.first < row < body.last:
            return body
    raise CloneError("the move stands outside of any body")


def _destination(program: Program, row: int, word: str, name: str) -> Span:
    """Find the name after TO or VIA in a statement."""
    lines = program.lines
    first = lines.line(row)
    after = len(lines.source.line_starts) + 1
    last = lines.line(row + 1) if row + 1 < len(lines) else after
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
    text = program.lines.source.line_text(line)
    if "--" not in text:
        return text
    scanned = scan_lines(text.encode("latin-1"), np.zeros(1, dtype=np.int32))
    comment = int(scanned.comment[0])
    return text if comment < 0 else text[:comment]


def _declare_clone(program: Program, line: int, old: str, name: str) -> Edit:
    """Declare the new name in a line behind the old one's."""
    code = code_of(program, line).rstrip()
    head = re.match(r"(\s*)(VAR\b\s*)?([\w\s,]*?)(\s*:.*)\Z", code, re.I)
    if head is None or old.lower() not in re.split(r"[\s,]+", head[3].lower()):
        raise CloneError("its declaration is not understood")
    indent = head[1] + ("  " if head[2] else "")
    return insert_after(
        program.lines.source, line, indent + name + _EXPORTED.sub("", head[4])
    )


def _assign_clone(
    program: Program, named: NamedPoint, line: int, name: str, starts: list[int]
) -> Edit:
    """Assign a value to the new name behind the line that gives it to the old one."""
    row = int(np.searchsorted(program.lines.begin_line, line))
    statement = program.lines.statement(row)
    old, routine = named.name, named.place[2]
    own = (
        isinstance(statement, ir.Assignment)
        and statement.target == ir.DataObject(old.lower())
        and isinstance(statement.value, ir.Composite | ir.FunctionCall)
    )
    body = body_at(program, row)  # a name there may mean another variable
    meant = body.name == routine
    if not routine:
        meant = old.lower() not in body.own_names
    if not (own and meant):
        raise CloneError(f"line {line} is no plain assignment of its value")
    code = code_of(program, line).rstrip()
    begin = int(program.lines.source.line_starts[line - 1])
    if not all(begin <= start < begin + len(code) for start in starts):
        raise CloneError("its numbers are assigned one by one")
    head = re.match(rf"(\s*){re.escape(old)}\b", code, re.I)
    if head is None:
        raise CloneError(f"line {line} is not understood")
    return insert_after(program.lines.source, line, head[1] + name + code[head.end() :])


# Copy an entry of a variable file under another name.

_XPORT = re.compile(r"\bXport\b(?P<other>\s+from\b)?", re.I)


def copy_entry(
    values: Source, line: int, old: str, name: str, starts: list[int]
) -> Edit:
    """Enter the value of a variable once more, behind its entry.

    Args:
        values: The variable file.
        line: A line of the entry.
        old: The name that it has.
        name: That of the copy.
        starts: Offsets of its numbers.

    Raises:
        CloneError: The entry is not one of this variable alone.
    """
    lines: EntryLines = read_lines(values, parse_value_form)
    heads = last_head(lines)
    row = int(np.searchsorted(lines.begin_line, line, side="right")) - 1
    at = int(heads[row]) if row >= 0 else -1
    head = lines.statement(at) if at >= 0 else None
    if head is None or head.name.lower() != old.lower() or head.element:
        raise CloneError(f"line {line} of {values.name} is no entry of {old}")
    if is_nested(head):
        raise CloneError(f"{old} is a record or a path: its parts are not cloned")
    after = int(np.searchsorted(heads, at, side="right"))
    first, last = lines.line(at), lines.line(after - 1)
    end = [*values.line_starts.tolist(), len(values.data)][last]
    begin = int(values.line_starts[first - 1])
    if not all(begin <= start < end for start in starts):
        raise CloneError(f"the entry of {old} in {values.name} is cut")
    text = values.text[begin:end].rstrip("\r\n")
    renamed = re.sub(
        rf"\A(\s*){re.escape(old)}\b", rf"\g<1>{name}", text, count=1, flags=re.I
    )
    title, rest = re.split(r"(?=[\r\n]|\Z)", renamed, maxsplit=1)
    if renamed == text:
        raise CloneError(f"the entry of {old} in {values.name} is not understood")
    return insert_after(values, last, _own(title, old) + rest)


def _own(title: str, old: str) -> str:
    """Let a copy be the program's own, where the original is exported."""
    found = _XPORT.search(title)
    if found is None:
        return title
    if found["other"]:
        raise CloneError(f"{old} belongs to another program")
    return title[: found.start()] + "Priv" + title[found.end() :]
