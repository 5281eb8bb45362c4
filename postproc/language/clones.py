"""Clone a variable: another name with its own value, laid out as the file is."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from postproc.language import pdl2 as ast
from postproc.language.edits import Edit
from postproc.language.entries import copied_entry
from postproc.language.layout import CloneError, check_length, inserted_after
from postproc.language.named import Named, body_at, code_of
from postproc.language.program import Program
from postproc.language.source import Source
from postproc.language.visits import Literals

LONGEST_NAME = 32  # characters of an identifier (likely)
_EXPORTED = re.compile(r"\s+EXPORTED\s+FROM\s+\w+", re.I)


def free_name(old: str, taken: set[str]) -> str:
    """Find a name for a clone that nothing in the files has.

    Args:
        old: The original's name.
        taken: All words of the files in lower case; the new one is added.

    Raises:
        CloneError: It would be too long.

    >>> free_name("Weld", {"weld", "WELD__2".lower()})
    'Weld__3'
    """
    number = 2
    while f"{old}__{number}".lower() in taken:
        number += 1
    name = f"{old}__{number}"
    if len(name) > LONGEST_NAME:
        raise CloneError(f"{name} would be longer than {LONGEST_NAME} characters")
    taken.add(name.lower())
    return name


def clone(
    programs: Sequence[Program],
    values: Source | None,
    literals: Literals,
    named: Sequence[Named],
    rows: Sequence[int],
    name: str,
) -> list[tuple[int, Edit]]:
    """Give some moves a variable of their own with the value of the one they share.

    The new variable is declared behind the old one; wherever the old one is given one
    of the values, the new one is given it next. Until a move that the old one reaches
    with that value, the new one therefore holds the same.

    Args:
        programs: The program files of a job.
        values: Its variable file, whose index follows those of the programs.
        literals: Where the values stand.
        named: Where the moves name the old variable; all mean the same one.
        rows: Literals that it may hold there.
        name: The new name.

    Returns:
        Edits with the index of their file.

    Raises:
        CloneError: A value stands where it cannot be given twice.
    """
    first = named[0]
    program, variable = programs[first.file], first.variable
    at = int(program.lines.line[variable.row])
    found = [(first.file, _declared(program, at, variable.name, name))]
    for row in rows:
        file, line = int(literals.file[row]), int(literals.line[row])
        starts = literals.start[row].tolist()
        if file == len(programs) and values is not None and first.file == 0:
            entry = copied_entry(values, line, variable.name, name, starts)
            found.append((file, entry))
        elif file != first.file:
            raise CloneError("its value stands in another file")
        elif line != at:
            found.append((file, _assigned(program, first, line, name, starts)))
    for one in named:
        source = program.lines.source
        length = len(source.line_text(source.line_of(one.span.start)))
        check_length(source, length + len(name) - len(variable.name))
        found.append((one.file, Edit(one.span, name.encode("latin-1"))))
    return found


def _means(program: Program, row: int, named: Named) -> bool:
    """Tell whether a name in a row means the variable, and no other of its name."""
    body, name = body_at(program, row), named.variable.name.lower()
    if named.scope:
        return body.name == named.scope
    hidden = name in body.variables or any(p.name == name for p in body.parameters)
    return not hidden


def _declared(program: Program, line: int, old: str, name: str) -> Edit:
    """Declare the new name in a line behind the old one's."""
    code = code_of(program, line).rstrip()
    head = re.match(r"(\s*)(VAR\b\s*)?([\w\s,]*?)(\s*:.*)\Z", code, re.I)
    if head is None or old.lower() not in re.split(r"[\s,]+", head[3].lower()):
        raise CloneError("its declaration is not understood")
    indent = head[1] + ("  " if head[2] else "")
    return inserted_after(
        program.lines.source, line, indent + name + _EXPORTED.sub("", head[4])
    )


def _assigned(
    program: Program, named: Named, line: int, name: str, starts: list[int]
) -> Edit:
    """Assign a value to the new name behind the line that gives it to the old one."""
    row = int(np.searchsorted(program.lines.line, line))
    statement = program.statement(row)
    old = named.variable.name
    own = (
        isinstance(statement, ast.Assign)
        and statement.operator == ":="
        and statement.target == ast.Reference(old.lower())
        and isinstance(statement.value, ast.Aggregate | ast.Invoke)
    )
    if not own or not _means(program, row, named):
        raise CloneError(f"line {line} is no plain assignment of its value")
    code = code_of(program, line).rstrip()
    begin = int(program.lines.source.line_starts[line - 1])
    if not all(begin <= start < begin + len(code) for start in starts):
        raise CloneError("its numbers are assigned one by one")
    head = re.match(rf"(\s*){re.escape(old)}\b", code, re.I)
    if head is None:
        raise CloneError(f"line {line} is not understood")
    return inserted_after(
        program.lines.source, line, head[1] + name + code[head.end() :]
    )
