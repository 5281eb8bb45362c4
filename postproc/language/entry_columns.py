"""The entries of a variable file as columns; single ones are made when asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from postproc.arrays import Floats, Ints

POSITIONS = ("POS", "XTND", "JNTP")
NESTED = ("REC", "NODE", "PATH")
_KINDS = {"POS": "POS", "JNT": "JNTP", "JNTP": "JNTP", "XTN": "XTND", "XTND": "XTND"}


def kind_of(code: str) -> tuple[str, bool]:
    """Read the type code of a head: the kind of its values, and whether it is an array.

    >>> kind_of("XTN"), kind_of("APOS"), kind_of("AINT")
    (('XTND', False), ('POS', True), ('INT', True))
    """
    code = code.upper()
    array = code.startswith("A") and code != "ARM"
    code = code[1:] if array else code
    return _KINDS.get(code, code), array


@dataclass(frozen=True)
class Entry:
    """One variable or array element with its value.

    Attributes:
        name: As it is written, array elements as ``tab[3]``.
        kind: POS, JNTP, XTND, or another type's code, of which only a scalar is kept.
        line: 1-based line of its head.
        numbers: Six numbers of a position (or the one number of a scalar), None where
            uninitialised or missing.
        slots: Index of each number in the file, -1 for none.
        aux: (axis, value) of auxiliary axes.
        config: Configuration string or None.
        shared: Other programs see it (Xport).
        arm: Arm number, 0 where it is not said.
    """

    name: str
    kind: str
    line: int
    numbers: tuple[float | None, ...]
    slots: tuple[int, ...]
    aux: tuple[tuple[int, float | None], ...]
    config: str | None
    shared: bool
    arm: int


@dataclass(frozen=True)
class Layout:
    """What entries that are written alike have in common.

    Attributes:
        kind, shared, config: See `Entry`.
        axes: Auxiliary axes, ascending.
        seen: How many values are written, ``****`` counted.
    """

    kind: str
    shared: bool
    config: str | None
    axes: tuple[int, ...]
    seen: int


@dataclass(frozen=True, eq=False)
class Entries(Mapping[str, Entry]):
    """k entries, and those of them that have a name of their own by that.

    Attributes:
        row: Row of each lower-case name; names with two entries are missing.
        name: Names as they are written, k strings.
        line: 1-based line of each head, (k,).
        layout: Index into `layouts`, (k,).
        layouts: How they are written.
        numbers: Six numbers each, (k, 6), NaN where uninitialised or missing.
        slots: Index of each number in the file, (k, 6), -1 for none.
        aux: Values of the auxiliary axes of their layout, (k, a), NaN likewise.
        arm: Arm number, (k,), 0 where it is not said.
    """

    row: Mapping[str, int]
    name: Sequence[str]
    line: Ints
    layout: Ints
    layouts: tuple[Layout, ...]
    numbers: Floats
    slots: Ints
    aux: Floats
    arm: Ints

    @cached_property
    def parts(self) -> list[str]:
        """List the lower-case names of elements and fields."""
        if not any(mark in "\n".join(self.name) for mark in "[."):
            return []
        return [name for name in self.row if "[" in name or "." in name]

    def __len__(self) -> int:
        """Return how many names have one entry."""
        return len(self.row)

    def __iter__(self) -> Iterator[str]:
        """Go through the names in the order of the file."""
        return iter(self.row)

    def __getitem__(self, name: str) -> Entry:
        """Return the entry of a lower-case name."""
        return self.entry(self.row[name])

    def entry(self, row: int) -> Entry:
        """Return the entry of a row."""
        layout = self.layouts[int(self.layout[row])]
        return Entry(
            self.name[row],
            layout.kind,
            int(self.line[row]),
            _known(self.numbers[row]),
            tuple(self.slots[row].tolist()),
            tuple(zip(layout.axes, _known(self.aux[row]), strict=False)),
            layout.config,
            layout.shared,
            int(self.arm[row]),
        )


def _known(values: Floats) -> tuple[float | None, ...]:
    return tuple(None if value != value else value for value in values.tolist())
