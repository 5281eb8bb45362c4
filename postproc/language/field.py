"""A field of a record or of a node, as a variable file lists it."""

from __future__ import annotations

from dataclasses import dataclass

from postproc.language.entered import Entered
from postproc.language.values import COMPONENTS

HIDDEN = frozenset({*COMPONENTS, "pos", "aux"})
"""Names of fields that may mean a component too, as in ``rec[1].x``: not read."""


@dataclass(frozen=True)
class Field:
    """A value in a record, or in a node of a path.

    Attributes:
        first: Row of its head.
        closed: Row at which what follows it begins.
        name: How a program writes it: ``pth.NODE[2].$MAIN_POS``.
        shared: Other programs see the record or path (Xport).
        arm: Arm number of the record or path, 0 where it is not said.
    """

    first: int
    closed: int
    name: str
    shared: bool
    arm: int


class OddLine(Exception):  # noqa: N818 - no error of the file, but the end of a reading
    """A line that leaves open to which part a value belongs.

    Attributes:
        row: Its row.
    """

    def __init__(self, row: int, why: str) -> None:
        """Say which line it is, and what is odd about it."""
        super().__init__(why)
        self.row = row


def fits(kind: str, line: Entered) -> bool:
    """Tell whether a line may be a part of a value of a type."""
    place = bool(line.components) or line.config is not None
    match kind:
        case "POS":
            return place and not (line.axes or line.plain)
        case "XTND":
            return (place or bool(line.axes)) and not line.plain
        case "JNTP":
            return bool(line.axes) and not (place or line.plain)
        case "INT" | "REA":
            return bool(line.plain) and not (place or line.axes)
    return not line.axes and line.config is None
