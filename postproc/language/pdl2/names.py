"""Which parts of records and paths the lines of a variable file belong to."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

NESTED = re.compile(rb"\s*[A-Za-z_]\w*\s+(?:A?REC|PATH)\b", re.I)
_HEAD = re.compile(
    r"\s*([A-Za-z_$][\w$]*)\s+A?(INT|REA|BOO|STR|VEC|POS|JNTP?|XTND?|SEM|REC|NODE|PATH)"
    r"\b(?!\s*:)(.*)",
    re.I | re.S,
)
_ACCESS = re.compile(r"\b(?:Priv|Xport|Local)\b", re.I)
_PART = re.compile(r"\s*(?:NODE\s*)?\[([\d, ]+)\]", re.I)


def part_names(lines: Sequence[bytes], wanted: Sequence[int]) -> Iterator[str]:
    """Name what lines of a file with records or paths belong to, see `Language`."""
    place, seen = _NamedPlace(), 0
    for line in wanted:
        for text in lines[seen:line]:
            place.take(text.decode("latin-1"))
        seen = max(seen, line)
        yield place.name if line else ""


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
