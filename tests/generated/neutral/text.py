"""The text of a program: where its moves and literals stand, and reading them back."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

NUMBER = re.compile(r"(?<![\w.$])-?\d+(?:\.\d+)?(?:E[+-]?\d+)?")
_OPEN = re.compile("\x01(\\d+)\x02")
_MARKS = re.compile("\x01\\d+\x02|\x03")
SHIFTS = 1_000_000  # marks of the numbers of shifts begin behind this one
Place = tuple[str, int, int]  # a file, the first number and how many


@dataclass
class Page:
    """Lines of one file as they are written.

    Attributes:
        moves: Line of every move, by its mark.
    """

    name: str
    end: str = "\n"
    lines: list[str] = field(default_factory=list)
    moves: dict[int, int] = field(default_factory=dict)

    def emit(self, text: str, move: int = 0) -> None:
        """Write a line, maybe that of a move."""
        self.lines.append(text)
        if move:
            self.moves[move] = len(self.lines)


def literal(number: int, text: str) -> str:
    """Mark the numbers of a literal."""
    return f"\x01{number}\x02{text}\x03"


def bare_numbers(text: str) -> list[str]:
    """Return the numbers of a literal without its marks."""
    return NUMBER.findall(_MARKS.sub("", text))


@dataclass(frozen=True)
class Printed:
    """A program in a language.

    Attributes:
        files: Its files, the one that runs first.
        moves: File and line of every move, by its mark.
        literals: Where their numbers stand, by number.
    """

    files: dict[str, bytes]
    moves: dict[int, tuple[str, int]]
    literals: dict[int, Place]

    def numbers(self, outputs: Mapping[str, bytes]) -> dict[int, list[float]]:
        """Read the numbers of all literals in a rewritten program.

        Raises:
            AssertionError: Something else than literals changed.
        """
        found: dict[str, Sequence[str]] = {}
        for name, data in self.files.items():
            old, new = (text.decode("latin-1") for text in (data, outputs[name]))
            assert NUMBER.sub("#", old) == NUMBER.sub("#", new), name
            found[name] = NUMBER.findall(new)
            own = [place for place in self.literals.values() if place[0] == name]
            free = {k for _, first, count in own for k in range(first, first + count)}
            for k, (a, b) in enumerate(
                zip(NUMBER.findall(old), found[name], strict=True)
            ):
                assert a == b or k in free, f"{name}: number {k}"
        return {
            number: [float(one) for one in found[name][first : first + count]]
            for number, (name, first, count) in self.literals.items()
        }


def printed(pages: Sequence[Page]) -> Printed:
    """Put pages together, and find their literals."""
    files, moves, literals = {}, {}, {}
    for page in pages:
        marked = page.end.join([*page.lines, ""])
        text = _MARKS.sub("", marked)
        files[page.name] = text.encode("latin-1")
        moves |= {mark: (page.name, line) for mark, line in page.moves.items()}
        starts = [one.start() for one in NUMBER.finditer(text)]
        for one in _OPEN.finditer(marked):
            end = marked.index("\x03", one.end())
            begin = len(_MARKS.sub("", marked[: one.start()]))
            stop = begin + end - one.end()
            first, behind = np.searchsorted(starts, [begin, stop]).tolist()
            literals[int(one[1])] = (page.name, first, behind - first)
    return Printed(files, moves, literals)
