"""Targets that stand in a RAPID file as numbers: where each of them is written."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeVar

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.language.ir import (
    Argument,
    Assignment,
    Composite,
    Instruction,
    Node,
    Num,
    Operand,
    SourceStatement,
)
from postproc.language.rapid.statements import RapidText
from postproc.language.rapid.syntax import CompactIf, DataDeclaration, LateCall


class RecordKind(IntEnum):
    """What numbers in nested brackets are: they are told apart by their counts."""

    ROBTARGET = 0  # [[x,y,z],[q1,q2,q3,q4],[cf1,cf4,cf6,cfx],[e1..e6]]
    JOINTTARGET = 1  # [[a1..a6],[e1..e6]]
    POSE = 2  # [[x,y,z],[q1,q2,q3,q4]], also in tools and work objects


Layout = Mapping[str, "Layout"]
"""The components of a record in their order, and their own; a value has none."""


def _values(names: str) -> Layout:
    """Lay out components that are values."""
    return {name: {} for name in names.split()}


_AXES = _values("eax_a eax_b eax_c eax_d eax_e eax_f")
_POSE = {"trans": _values("x y z"), "rot": _values("q1 q2 q3 q4")}
_INERTIA = _values("ix iy iz")
_LOAD = {"mass": {}, "cog": _POSE["trans"], "aom": _POSE["rot"], **_INERTIA}
RECORDS: Mapping[str, Layout] = {
    "robtarget": {**_POSE, "robconf": _values("cf1 cf4 cf6 cfx"), "extax": _AXES},
    "jointtarget": {
        "robax": _values("rax_1 rax_2 rax_3 rax_4 rax_5 rax_6"), "extax": _AXES
    },
    "pose": _POSE,
    "loaddata": _LOAD,
    "tooldata": {"robhold": {}, "tframe": _POSE, "tload": _LOAD},
    "wobjdata": {**_values("robhold ufprog ufmec"), "uframe": _POSE, "oframe": _POSE},
    "speeddata": _values("v_tcp v_ori v_leax v_reax"),
    "zonedata": _values(
        "finep pzone_tcp pzone_ori pzone_eax zone_ori zone_leax zone_reax"
    ),
}  # fmt: skip
"""Components of data by type."""


def leaves_of(layout: Layout, prefix: str = "") -> list[str]:
    """Spell the values of a record in their order, with all that they are in."""
    found: list[str] = []
    for name, inside in layout.items():
        found += leaves_of(inside, f"{prefix}{name}.") if inside else [prefix + name]
    return found


def spell_components(type_: str, component: str) -> list[str]:
    """Return the numbers of data, or of a part of them, as they are spelt.

    That of data that are a number is "".

    >>> spell_components("robtarget", "trans"), spell_components("pose", "rot.q1")
    (['trans.x', 'trans.y', 'trans.z'], ['rot.q1'])
    >>> len(spell_components("robtarget", "")), spell_components("pose", "z")
    (17, [])
    """
    every = leaves_of(RECORDS.get(type_, {}))
    if not component:
        return every or [""]
    return [one for one in every if f"{one}.".startswith(f"{component}.")]


COUNTS = {
    (3, 4, 4, 6): RecordKind.ROBTARGET,
    (6, 6): RecordKind.JOINTTARGET,
    (3, 4): RecordKind.POSE,
}
WIDTH = {kind: sum(counts) for counts, kind in COUNTS.items()}
T = TypeVar("T")


@dataclass(frozen=True)
class RecordLiterals:
    """The k records of one kind in a file, each w numbers (structure of arrays).

    Attributes:
        kind: What they are; w is 17, 12 or 7.
        row: The statement that each stands in, ascending, (k,).
        start, stop: Byte offsets of every number, its sign included, (k, w).
        value: [mm], quaternions, counts of quarter turns, [deg], as written, (k, w).
    """

    kind: RecordKind
    row: Ints
    start: Ints
    stop: Ints
    value: Floats

    def __len__(self) -> int:
        """Return the number of records."""
        return len(self.row)


def find_literals(text: RapidText, kind: RecordKind) -> RecordLiterals:
    """Find all records of a kind whose numbers are all written out.

    Statements of one form have them in the same slots.
    """
    rows: list[Ints] = []
    slots: list[Ints] = []
    by_form = text.said.form[text.shape]
    for form, said in enumerate(text.said.said):
        found = [one for one, of in literals_in(said) if of is kind]
        if found:
            here = np.flatnonzero(by_form == form)
            for one in found:
                rows.append(here)
                slots.append(text.first[here][:, None] + np.array(one))
    width = WIDTH[kind]
    row = np.concatenate([np.empty(0, np.int64), *rows])
    at = np.concatenate([np.empty((0, width), np.int64), *slots])
    order = np.lexsort((at[:, 0], row))
    row, at = row[order], at[order]
    return RecordLiterals(kind, row, text.start[at], text.stop[at], text.value[at])


def literals_in(said: SourceStatement) -> Iterator[tuple[list[int], RecordKind]]:
    """Find the records in what a statement says, as slots of its numbers."""
    for operand in operands_of(said):
        yield from _literals(operand)


def _literals(operand: Node) -> Iterator[tuple[list[int], RecordKind]]:
    if isinstance(operand, Composite):
        parts = [_slots(part) for part in operand.items]
        if all(part is not None for part in parts):
            whole = [part for part in parts if part is not None]
            kind = COUNTS.get(tuple(map(len, whole)))
            if kind is not None:
                yield [slot for part in whole for slot in part], kind
                return
    for part in operand.children():
        yield from _literals(part)


def _slots(operand: Operand) -> list[int] | None:
    """Return the slots of ``[1, 2, ..]``, None where it is anything else."""
    if not isinstance(operand, Composite):
        return None
    slots = [item.slot for item in operand.items if isinstance(item, Num)]
    return slots if len(slots) == len(operand.items) else None


def operands_of(said: SourceStatement) -> Sequence[Operand]:
    """Return the values that a statement gives: declared, assigned, as arguments."""
    match said:
        case DataDeclaration(value=value):
            return _drop_none([value])
        case Assignment(value=value):
            return [value]
        case Instruction(arguments=arguments) | LateCall(arguments=arguments):
            return _list_operands(arguments)
        case CompactIf(statement=inside):
            return operands_of(inside)
        case _:
            return []


def _drop_none(values: Sequence[T | None]) -> list[T]:
    return [value for value in values if value is not None]


def _list_operands(arguments: Sequence[Argument]) -> Sequence[Operand]:
    return _drop_none([argument.value for argument in arguments])
