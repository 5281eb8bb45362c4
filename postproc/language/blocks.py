"""Block structure of one body: which line closes which, and where jumps lead."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from postproc.language import pdl2 as ast
from postproc.language.forms import Formed
from postproc.language.lines import Lines

_CLOSED_BY: dict[type, type] = {
    ast.If: ast.EndIf,
    ast.Select: ast.EndSelect,
    ast.For: ast.EndFor,
    ast.While: ast.EndWhile,
    ast.Repeat: ast.Until,
    ast.Condition: ast.EndCondition,
}
_INNER = (ast.Else, ast.Case)
_PLAIN = (ast.Move, ast.Assign, ast.Call, ast.Transfer, ast.Still)
_UNKNOWN_OPENERS: tuple[tuple[str, ast.Statement], ...] = (
    (r"IF\b(?!.*\bENDIF\b)", ast.If(None)),
    (r"SELECT\b(?!.*\bENDSELECT\b)", ast.Select(None)),
    (r"FOR\b(?!.*\bENDFOR\b)", ast.For("", None, None)),
    (r"WHILE\b(?!.*\bENDWHILE\b)", ast.While(None)),
    (r"UNTIL\b", ast.Until(None)),
    (r"CASE\b", ast.Case(())),
    (r"CONDITION\b(?!.*\bENDCONDITION\b)", ast.Condition()),
)


@dataclass(frozen=True)
class Blocks:
    """Where the jumps of a body lead, by row.

    Attributes:
        end: Row that closes the block which a row opens or divides.
        opener: Row that opens the block which a row closes.
        inner: Rows of ELSE and CASE in a block, by the row that opens it.
        labels: Row of each label.
        cycle: Row of CYCLE, -1 where there is none.
        joins: Rows at which several ways meet.
        loops: (opener, end) rows of the FOR loops.
        handlers: (opener, end) rows of the condition handlers.
        broken: First line whose block structure is wrong, 0 where all is well.
    """

    end: Mapping[int, int]
    opener: Mapping[int, int]
    inner: Mapping[int, tuple[int, ...]]
    labels: Mapping[str, int]
    cycle: int
    joins: frozenset[int]
    loops: tuple[tuple[int, int], ...]
    handlers: tuple[tuple[int, int], ...]
    broken: int


def recovered(statement: ast.Statement) -> ast.Statement:
    """Return the block that an unknown line opens, or the statement itself."""
    if isinstance(statement, ast.Unknown):
        for pattern, opener in _UNKNOWN_OPENERS:
            if re.match(pattern, statement.text, re.I):
                return opener
    return statement


def build_blocks(
    lines: Lines, statements: Formed[ast.Statement], first: int, last: int
) -> tuple[Blocks, list[tuple[int, str]]]:
    """Match the blocks of rows first to last - 1; also return (row, problem)."""
    end: dict[int, int] = {}
    opener: dict[int, int] = {}
    inner: dict[int, list[int]] = {}
    labels: dict[str, int] = {}
    problems: list[tuple[int, str]] = []
    cycle, gotos = -1, []
    stack: list[tuple[int, ast.Statement]] = []
    structural = statements.which(lambda said: not isinstance(said, _PLAIN))
    rows = first + np.flatnonzero(structural[lines.shape[first:last]])
    for row in rows.tolist():
        statement = recovered(statements[int(lines.shape[row])])
        if isinstance(statement, ast.Label):
            labels[statement.name] = row
            statement = statement.then or ast.Statement()
        kind = type(statement)
        behind = _behind(statement)
        if type(behind) in (*_CLOSED_BY, *_CLOSED_BY.values()):
            text = f"this {_word(behind)} stands behind {_word(statement)}"
            problems.append((row, f"{text}: put it on a line of its own"))
        elif isinstance(behind, ast.Goto):
            gotos.append((row, behind.label))
        if kind in _CLOSED_BY:
            stack.append((row, statement))
            inner[row] = []
        elif kind in _CLOSED_BY.values():
            if stack and _CLOSED_BY[type(stack[-1][1])] is kind:
                start, _ = stack.pop()
                for part in (start, *inner[start]):
                    end[part] = row
                opener[row] = start
            else:
                problems.append((row, _unmatched(statement, stack, lines)))
        elif kind in _INNER:
            wanted = (ast.If, ast.Select) if kind is ast.Else else (ast.Select,)
            if stack and isinstance(stack[-1][1], wanted):
                inner[stack[-1][0]].append(row)
            else:
                problems.append((row, _unmatched(statement, stack, lines)))
        elif kind is ast.Cycle:
            cycle = row
        elif isinstance(statement, ast.Goto):
            gotos.append((row, statement.label))
    for row, statement in stack:
        problems.append((row, f"this {_word(statement)} is never closed"))
    problems += [
        (row, f"label {label} does not exist")
        for row, label in gotos
        if label not in labels
    ]
    return (
        _blocks(lines, statements, end, opener, inner, labels, cycle, problems),
        problems,
    )


def _behind(statement: ast.Statement) -> ast.Statement:
    """Return what a division of a block, or an event, has on its line."""
    match statement:
        case ast.Else(then) | ast.Case(_, then) | ast.When(then) if then is not None:
            return then
    return ast.Statement()


def _blocks(
    lines: Lines,
    statements: Formed[ast.Statement],
    end: dict[int, int],
    opener: dict[int, int],
    inner: dict[int, list[int]],
    labels: dict[str, int],
    cycle: int,
    problems: list[tuple[int, str]],
) -> Blocks:
    joins = {*labels.values(), *opener}
    loops, handlers = [], []
    for row, start in opener.items():
        kind = recovered(statements[int(lines.shape[start])])
        if isinstance(kind, ast.Label) and kind.then is not None:
            kind = kind.then
        if isinstance(kind, ast.For):
            loops.append((start, row))
            joins.add(row + 1)
        elif isinstance(kind, ast.While):
            joins |= {start, row + 1}
        elif isinstance(kind, ast.Repeat):
            joins.add(start)
        elif isinstance(kind, ast.Condition):
            handlers.append((start, row))
            joins.add(row + 1)
    if cycle >= 0:
        joins.add(cycle)
    return Blocks(
        end,
        opener,
        {row: tuple(parts) for row, parts in inner.items()},
        labels,
        cycle,
        frozenset(joins),
        tuple(sorted(loops)),
        tuple(sorted(handlers)),
        min((int(lines.line[row]) for row, _ in problems), default=0),
    )


def _word(statement: ast.Statement) -> str:
    return type(statement).__name__.upper()


def _unmatched(
    statement: ast.Statement, stack: list[tuple[int, ast.Statement]], lines: Lines
) -> str:
    text = f"this {_word(statement)} closes or divides no block"
    if stack:
        row, open_one = stack[-1]
        text += f" (line {lines.line[row]} opens {_word(open_one)})"
    return text
