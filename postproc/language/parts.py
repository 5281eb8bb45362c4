"""Parts of a line on their way from tree to statement, told apart by type."""

from __future__ import annotations

from typing import Any


class Mark(str):
    """A token: text with the name of its terminal."""

    kind: str

    def __new__(cls, text: str, kind: str) -> Mark:
        """Remember the terminal beside the text."""
        mark = super().__new__(cls, text)
        mark.kind = kind
        return mark


class NamesPart(tuple[str, ...]):
    """Declared names."""


class ExportedPart(str):
    """The program after EXPORTED FROM."""


class ArmPart(tuple[Any, ...]):
    """The index of ARM[n]."""


class SettingPart(tuple[Any, ...]):
    """One WITH item that sets a variable."""


class BesidePart(tuple[Any, ...]):
    """One WITH item that names a condition handler."""


class TilPart:
    """A TIL clause."""


class SyncPart(tuple[Any, ...]):
    """The move of a SYNCMOVE clause."""


class DestinationPart(tuple[Any, ...]):
    """(how, operands, via, frame)."""
