"""Which variables the lines of a variable file belong to, without reading values."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

_ENTRY = re.compile(r"([A-Za-z_]\w*(?:\[[\d, ]+\])?)\s+[A-Z]{3,4}\b")
_NESTED = re.compile(rb"\s*[A-Za-z_]\w*\s+(?:A?REC|PATH)\b", re.I)
_HEAD = re.compile(
    r"\s*([A-Za-z_$][\w$]*)\s+A?(INT|REA|BOO|STR|VEC|POS|JNTP?|XTND?|SEM|REC|NODE|PATH)"
    r"\b(?!\s*:)(.*)",
    re.I | re.S,
)
_ACCESS = re.compile(r"\b(?:Priv|Xport|Local)\b", re.I)
_PART = re.compile(r"\s*(?:NODE\s*)?\[([\d, ]+)\]", re.I)


def entry_names(lines: Sequence[bytes], wanted: Sequence[int]) -> Iterator[str]:
    """Find the variables that lines of a variable file belong to.

    Args:
        lines: The file.
        wanted: 1-based lines, ascending but for 0: those that it does not have.
    """
    if any(map(_NESTED.match, lines)):
        yield from _with_parts(lines, wanted)
        return
    name, seen = "", 0
    for line in wanted:
        if line == 0:
            yield _entry_name(lines[0]) if lines else ""
            continue
        backwards = (_entry_name(lines[k]) for k in range(line - 1, seen - 1, -1))
        name, seen = next(filter(None, backwards), name), line
        yield name


def _entry_name(line: bytes) -> str:
    """Return the variable that a line begins to describe, "" if it does not."""
    found = _ENTRY.match(line.decode("latin-1"))
    return found.group(1) if found else ""


def _with_parts(lines: Sequence[bytes], wanted: Sequence[int]) -> Iterator[str]:
    """Do it for a file with records or paths: name their parts too."""
    place, seen = _NamedPlace(), 0
    for line in wanted:
        if line == 0:
            yield _entry_name(lines[0]) if lines else ""
            continue
        for text in lines[seen:line]:
            place.take(text.decode("latin-1"))
        seen = line
        yield place.name


@dataclass
class _NamedPlace:
    """Where in a file a line stands.

    Attributes:
        variable, kind: Name and type code of the last variable.
        part, field: The part of it, if it is a record or a path, and the field there.
    """

    variable: str = ""
    kind: str = ""
    part: str = ""
    field: str = ""

    @property
    def name(self) -> str:
        """Return the name as a program writes it."""
        return self.variable + self.part + self.field

    def take(self, line: str) -> None:
        """Go on by a line."""
        nested = self.kind in ("REC", "PATH")
        head, part = _HEAD.match(line), _PART.match(line)
        if head is not None:
            name, kind, rest = head.groups()
            if nested and (name[0] == "$" or not _ACCESS.search(rest)):
                self.field = f".{name}"
            else:
                self.variable, self.kind, self.part, self.field = (
                    name,
                    kind.upper(),
                    "",
                    "",
                )
        elif part is not None and nested:
            index = part[1].replace(" ", "")
            self.part = f".NODE[{index}]" if self.kind == "PATH" else f"[{index}]"
            self.field = ""
