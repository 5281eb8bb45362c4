"""Variable files: the values that a program's points have on the controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from postproc.language.diagnostic import Diagnostic
from postproc.language.entered import Entered
from postproc.language.lines import Lines, read_lines
from postproc.language.parser import parse_value_line
from postproc.language.source import Source

Ints = NDArray[np.int64]

_KINDS = {"POS": "POS", "JNT": "JNTP", "JNTP": "JNTP", "XTN": "XTND", "XTND": "XTND"}
_NESTED = ("REC", "NODE", "PATH")
_LETTERS = "XYZAER"


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
class Variables:
    """A variable file.

    Attributes:
        source: The text.
        start, end: Byte offsets of every number, its sign included, (m,).
        entries: Entries by lower-case name; a name with two entries has none.
        diagnostics: What was found while reading.
    """

    source: Source
    start: Ints
    end: Ints
    entries: Mapping[str, Entry]
    diagnostics: tuple[Diagnostic, ...]


@dataclass
class _Open:
    """The entry that is being read."""

    name: str
    kind: str
    line: int
    shared: bool
    arm: int
    numbers: list[float | None] = field(default_factory=lambda: [None] * 6)
    slots: list[int] = field(default_factory=lambda: [-1] * 6)
    aux: dict[int, float | None] = field(default_factory=dict)
    config: str | None = None
    seen: int = 0

    def put(self, at: int, value: float | None, slot: int) -> None:
        self.seen += 1
        if at < 6:
            self.numbers[at], self.slots[at] = value, slot

    def closed(self) -> Entry:
        return Entry(
            self.name,
            self.kind,
            self.line,
            tuple(self.numbers),
            tuple(self.slots),
            tuple(sorted(self.aux.items())),
            self.config,
            self.shared,
            self.arm,
        )


@dataclass
class _Reader:
    """Collects entries line by line."""

    lines: Lines
    entries: dict[str, Entry] = field(default_factory=dict)
    twice: set[str] = field(default_factory=set)
    diagnostics: list[Diagnostic] = field(default_factory=list)
    head: _Open | None = None
    open: _Open | None = None
    row: int = 0

    def report(self, line: int, code: str, message: str) -> None:
        self.diagnostics.append(Diagnostic(self.lines.source.name, line, code, message))

    def take(self, row: int, entered: Entered) -> None:
        self.row = row
        line = int(self.lines.line[row])
        if entered.name and self._is_field(entered):
            self.close()
            return
        if entered.name:
            self.close()
            arm = self._number(entered.arm) if entered.arm >= 0 else 0.0
            kind = entered.type.upper()
            array = kind.startswith("A") and kind != "ARM"
            kind = kind[1:] if array else kind
            kind = _KINDS.get(kind, kind)
            self.head = _Open(entered.name, kind, line, entered.shared, int(arm or 0))
            self.open = None if array else self.head
        if entered.element and self.head is not None:
            self.close()
            index = ",".join(str(int(self._number(s) or 0)) for s in entered.element)
            head = self.head
            name = f"{head.name}[{index}]"
            self.open = _Open(name, head.kind, line, head.shared, head.arm)
        self._values(entered)

    def _is_field(self, entered: Entered) -> bool:
        """Tell a field of a record or path node from a variable of its own."""
        nested = self.head is not None and self.head.kind in _NESTED
        return nested and (entered.name.startswith("$") or not entered.variable)

    def _values(self, entered: Entered) -> None:
        now = self.open
        if now is None:
            return
        first = int(self.lines.first[self.row])
        for letter, slot in entered.components:
            at = _LETTERS.index(letter.upper())
            now.put(at, self._value(slot), first + slot if slot >= 0 else -1)
        for axis_slot, slot in entered.axes:
            axis = int(self._number(axis_slot) or 0)
            joint = now.kind == "JNTP"
            if joint and 1 <= axis <= 6:
                now.put(axis - 1, self._value(slot), first + slot if slot >= 0 else -1)
            elif axis >= 1:
                now.aux[axis - 6 if joint else axis] = self._value(slot)
        for slot in entered.plain:
            now.put(now.seen, self._value(slot), first + slot if slot >= 0 else -1)
        if entered.config is not None:
            now.config = entered.config

    def _number(self, slot: int) -> float | None:
        value = float(self.lines.value[int(self.lines.first[self.row]) + slot])
        return value if np.isfinite(value) else None

    def _value(self, slot: int) -> float | None:
        return None if slot < 0 else self._number(slot)

    def close(self) -> None:
        now, self.open = self.open, None
        if now is None or now.kind in _NESTED:
            return
        name = now.name.lower()
        if name in self.entries or name in self.twice:
            self.entries.pop(name, None)
            self.twice.add(name)
            self.report(
                now.line,
                "lsv-twice",
                f"{now.name} has two entries: it is not compensated; delete one",
            )
            return
        if now.kind in _KINDS.values() and now.seen < 6:
            self.report(
                now.line,
                "lsv-incomplete",
                f"{now.name} has {now.seen} of 6 values: is the file cut?",
            )
        if now.kind in _KINDS.values() and now.seen >= 6 and None in now.numbers:
            self.report(
                now.line, "lsv-uninitialised", f"{now.name} is not initialised (*)"
            )
        self.entries[name] = now.closed()


def read_variables(source: Source) -> Variables:
    """Read a variable file; what is wrong in it is reported, not fatal.

    Raises:
        ProgramError: A string does not end on its line.
    """
    lines = read_lines(source)
    reader = _Reader(lines)
    for row in range(len(lines)):
        entered = parse_value_line(lines.text(row))
        if entered is not None:
            reader.take(row, entered)
            continue
        reader.close()  # what follows may belong to what was not understood
        if reader.head is None or reader.head.kind not in _NESTED:
            line = int(lines.line[row])
            text = source.line_text(line).strip()[:60]
            reader.report(line, "lsv-line", f"not understood, kept: {text!r}")
    reader.close()
    return Variables(
        source, lines.start, lines.end, reader.entries, tuple(reader.diagnostics)
    )
