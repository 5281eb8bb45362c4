"""Inline forms: what their statements set, and which of their data hold the same.

An inline form stores its settings in data of its own (``FP1``, ``LCPDAT1``), and copies
them before its move. Most forms of a program store the same.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterator, Sequence, Set
from typing import Any

import numpy as np

from postproc.arrays import Ints
from postproc.language import ir
from postproc.language.analysis.declarations import TaskFile
from postproc.language.analysis.move_blocks import number_rows
from postproc.language.krl import syntax as said
from postproc.language.text.statement_table import StatementText
from postproc.language.text.symbol_column import NameColumn
from postproc.language.text.templates import name_index, number_in_order, split_by

COPIES = {"fdat_act": "fdat", "pdat_act": "pdat", "ldat_act": "ldat"}
"""What the data of inline forms are copied to, by name, and their types."""
_SET = said.NAMES["planned"] - {"$advance"}  # those that tell where the arm stops
_COMMANDS = frozenset(
    "#frames #tool #base #vel_ptp #vel_cp #ptp_dat #cp_dat #ptp_params #cp_params "
    "#acc_ptp #acc_cp #acc_glue".split()
)
"""Commands of BAS that set what moves behind them are made with, and nothing else."""
_PLAIN = (
    ir.Num, ir.StringLiteral, ir.DataObject, ir.ElementStep, ir.Argument,
    said.EnumValue, said.KrlAggregate, said.NamedField,
)  # fmt: skip


def sets_modes(one: ir.SourceStatement) -> bool:
    """Return True if a statement only sets what the moves behind it are made with.

    That is so where BAS is the controller's, and ``FDAT_ACT`` no point.
    """
    match one:
        case ir.Assignment(target=target, value=value):
            known = target.name in _SET or target.name in COPIES
            return known and all(map(_is_plain, _parts_of(target, value)))
        case ir.Instruction(name="bas", arguments=(first, *_) as arguments):
            word = first.value
            known = isinstance(word, said.EnumValue) and word.name in _COMMANDS
            return known and takes_plain(arguments)
    return False


def sets_alone(one: ir.Assignment, routines: Container[str]) -> bool:
    """Return True if a move sets something for itself alone, by functions of KSS too.

    Args:
        one: What stands behind WITH.
        routines: Names of the routines of the job.
    """
    for part in _parts_of(one.target, one.value):
        if isinstance(part, ir.FunctionCall):
            if part.name not in said.NAMES["function"] or part.name in routines:
                return False
        elif not _is_plain(part):
            return False
    return one.target.name in _SET


def takes_plain(arguments: Sequence[ir.Argument]) -> bool:
    """Return True if what is given hangs on numbers and data of the program alone."""
    return all(map(_is_plain, ir.walk(*arguments)))


def _parts_of(target: ir.DataObject, value: ir.Operand) -> list[ir.Node]:
    """List all nodes in what is given, and in what tells which element gets it."""
    return ir.walk(*target.children(), value)


def _is_plain(part: ir.Node) -> bool:
    """Return True for numbers, words and data, but for variables of the system."""
    system = isinstance(part, ir.DataObject) and part.name.startswith("$")
    return isinstance(part, _PLAIN) and not system


# Data that hold the same.


def find_alike(file: TaskFile, unit: Sequence[TaskFile], written: Set[str]) -> Ints:
    """Find the names in a source of forms' data whose components are the same.

    A name is that of the data list wherever it stands in the source, and something
    else in a routine that has a parameter or data of that name.

    Args:
        file: The source.
        unit: The source and its data list.
        written: Names of data that something may change.

    Returns:
        What stands for each name of its text, (n,), by their index.
    """
    names = file.text.shapes.names
    found, lower = np.arange(len(names)), names.lower()
    apart = NameColumn(sorted(written | _find_double(unit)))
    for text in (one.text for one in unit if not one.routines):
        for declared, kind in _list_kinds(text):
            at = lower.find(declared).astype(np.int64)
            own = np.flatnonzero((at >= 0) & (apart.find(declared) < 0))
            number, example = number_in_order(kind[own])
            found[at[own]] = at[own[example]][number]
    return found


def _find_double(unit: Sequence[TaskFile]) -> set[str]:
    """Find the names of data that routines have of their own, or that stand twice."""
    data = [datum for file in unit for datum in file.data]
    times = Counter([datum.name for datum in data])
    double = {name for name, many in times.items() if many > 1}
    double.update(datum.name for datum in data if datum.routine)
    heads = (rows.head for file in unit for rows in file.routines)
    return double.union(one.name for head in heads for one in head.parameters)


def _list_kinds(text: StatementText[Any]) -> Iterator[tuple[NameColumn, Ints]]:
    """Yield names that are declared alike, m, and which hold the same numbers, (m,)."""
    declares = np.array([*map(_declares_data, text.said.said)], dtype=bool)
    found = np.flatnonzero(declares[text.said.form[text.shape]])
    for _, own in split_by(text.said.form[text.shape[found]]):
        rows = found[own]
        names = text.shapes.names_at(text.shape[rows])
        begin = text.first[rows]
        count = int(text.first[rows[0] + 1] - begin[0])
        columns = [text.value[begin + k].view(np.int64) for k in range(count)]
        kind, _ = number_rows([*names.T[1:], *columns], len(rows))
        yield text.shapes.names.take(names[:, 0].astype(np.int64)).lower(), kind


def _declares_data(one: ir.SourceStatement) -> bool:
    """Return True if a statement declares data of one form, with what they hold."""
    if not isinstance(one, ir.Declaration) or one.type not in COPIES.values():
        return False
    item, value = one.items[0], one.items[0].value
    alone = len(one.items) == 1 and not item.dimensions and name_index(item.name) == 0
    return alone and isinstance(value, said.KrlAggregate) and not ir.calls_in(value)
