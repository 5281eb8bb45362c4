"""One record or path of a variable file: which of its lines hold a field's value.

No public listing of a path is known. What is read is what the listings of the other
types would be with fields in them; where a line leaves open to which part a value
belongs, nothing of the entry is read.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from postproc.language.entered import Entered
from postproc.language.entry_columns import NESTED, kind_of
from postproc.language.field import HIDDEN, Field, OddLine, fits
from postproc.language.forms import Formed
from postproc.language.lines import Lines


@dataclass
class Nested:
    """A record, an array of records or a path, line by line.

    Attributes:
        lines, said: The file, and what its shapes of lines say.
        row: Row of its head.
        found: Its fields by part (``.NODE[1]``, ``[1]``, "") and lower-case name.
        unread: Rows of what is not read, and why not.
        dropped: Parts of which nothing is read.
    """

    lines: Lines
    said: Formed[Entered | None]
    row: int
    found: dict[str, dict[str, Field]] = field(default_factory=dict)
    unread: list[tuple[int, str]] = field(default_factory=list)
    dropped: set[str] = field(default_factory=set)
    _part: str | None = None
    _words: bool | None = None  # parts begin with NODE[1], not with [1]
    _listed: bool = False  # a field of this part has elements
    _deeper: bool = False  # a field of this part has fields
    _open: tuple[int, Entered] | None = None
    _configs: int = 0

    def fields(self, end: int) -> list[Field]:
        """Return the fields up to a row, that of the next variable.

        Raises:
            OddLine: A line leaves open to which part a value belongs.
        """
        self.head = self._entered(self.row)
        self._begin_entry()
        for row in range(self.row + 1, end):
            self._take(row, self._entered(row))
        self._close(end)
        return [
            one
            for part, own in self.found.items()
            for one in own.values()
            if part not in self.dropped
        ]

    def _entered(self, row: int) -> Entered:
        entered = self.said[int(self.lines.shape[row])]
        if entered is None:
            text = self.lines.source.line_text(int(self.lines.line[row]))
            raise OddLine(row, f"{text.strip()[:60]!r} is not understood")
        return entered

    def _begin_entry(self) -> None:
        self.kind, self.array = kind_of(self.head.type)
        if not self.head.variable:
            why = "its head does not say whose it is (Priv, Xport, Local)"
            raise OddLine(self.row, why)
        if self.kind == "NODE" or (self.kind == "PATH" and self.array):
            raise OddLine(self.row, "values of this type are not read")
        if self.head.element or self.head.says_value:
            raise OddLine(self.row, "a value stands beside its head")
        if self.kind == "REC" and not self.array:
            self._part = ""
        slot = self.head.arm
        self._arm = self._index(self.row, slot) if slot >= 0 else 0

    def _take(self, row: int, line: Entered) -> None:
        if line.name:
            self._close(row)
            self._field(row, line)
        elif line.node >= 0 or line.element:
            if self._open is not None or not self._is_element(line):
                self._close(row)
                self._begin_part(row, line)
        elif self._open is not None:
            self._value(row, line)
        elif not (self._listed or self._deeper):
            raise OddLine(row, "it is not clear whose value this is")

    def _is_element(self, line: Entered) -> bool:
        """Tell whether a line is an element of a field, and cannot be a part."""
        parts = self._words or (self.kind == "REC" and not self.array)
        return bool(line.element and self._listed and parts)

    def _begin_part(self, row: int, line: Entered) -> None:
        words = line.node >= 0
        if self.kind == "REC" and (words or not self.array):
            raise OddLine(row, "a record has no such parts")
        if self._words not in (None, words) or (self._listed and not words):
            raise OddLine(row, "this may be a part of it, or an element of a field")
        if line.says_value:
            raise OddLine(row, "it is not clear whose value this is")
        slots = (line.node,) if words else line.element
        index = ",".join(str(self._index(row, slot)) for slot in slots)
        self._part = f".NODE[{index}]" if self.kind == "PATH" else f"[{index}]"
        if self._part in self.found:
            self._drop(row, f"{self._part.lstrip('.')} is there twice")
        self.found.setdefault(self._part, {})
        self._words, self._listed, self._deeper = words, False, False

    def _index(self, row: int, slot: int) -> int:
        value = float(self.lines.value[self.lines.first[row] + slot])
        if not (value.is_integer() and value >= 1):
            raise OddLine(row, "an index, or an arm, is no whole number")
        return int(value)

    def _field(self, row: int, line: Entered) -> None:
        if self._part is None:
            raise OddLine(row, "a field stands before the first part")
        kind, array = kind_of(line.type)
        nested = kind in NESTED
        self._listed |= array or bool(line.element) or kind == "PATH"
        if self._deeper:
            return
        if nested or array or line.element:
            self._deeper = nested
            if nested or line.name.startswith("$"):
                self._drop(row, f"{line.name} has parts of its own")
            else:
                self.unread.append((row, f"{line.name} has elements"))
        elif line.name.lower() in HIDDEN:
            self.unread.append((row, f"{line.name} may mean a component"))
            self._open = (row, line)
        else:
            self._open = (row, line)
        self._configs = 0
        if self._open is not None and line.says_value:
            self._value(row, line)

    def _value(self, row: int, line: Entered) -> None:
        assert self._open is not None
        self._configs += line.config is not None
        if self._configs > 1 or not fits(kind_of(self._open[1].type)[0], line):
            raise OddLine(row, f"this is no value of {self._open[1].name}")

    def _drop(self, row: int, why: str) -> None:
        """Read nothing of this part: which of its values is meant is not sure."""
        assert self._part is not None
        self.dropped.add(self._part)
        self.unread.append((row, why))

    def _close(self, row: int) -> None:
        """End the field that is open."""
        if self._open is None or self._part is None:
            return
        first, line = self._open
        self._open, name = None, line.name.lower()
        if name in HIDDEN or self._part in self.dropped:
            return
        own = self.found.setdefault(self._part, {})
        if name in own:
            self._drop(first, f"{line.name} is there twice")
        written = f"{self.head.name}{self._part}.{line.name}"
        own[name] = Field(first, row, written, self.head.shared, self._arm)
