"""What a KRL program sets on its way: entries of tables, corrections, switches."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

TABLES = ("tool_data", "base_data", "load_data")
"""Arrays that $TOOL, $BASE and $LOAD are read from."""
CORRECTIONS: Mapping[str, tuple[tuple[str, str], tuple[str, str]]] = {
    "$tool": (("tool_corr_w", "tool_corr_w_on"), ("tool_corr", "tool_corr_on")),
    "$base": (("base_corr", "base_corr_on"), ("m_base_corr", "m_bas_cor_on")),
}
"""Frames that BAS links to an entry, in front of it and behind it, and their switches.

``BAS(#TOOL, n)`` sets ``TOOL_CORR_W : TOOL_DATA[n] : TOOL_CORR``, each correction where
its switch is TRUE; likewise the base, ``FRAMES``, ``STOOL2`` and ``SBASE``.
"""
_PAIRS = [pair for both in CORRECTIONS.values() for pair in both]
CORRECTION_FRAMES = frozenset(frame for frame, _ in _PAIRS)
SWITCHES = frozenset(switch for _, switch in _PAIRS)
PERHAPS = "perhaps"
"""Value of a switch that is on or off by the release of the controller."""
HELD = frozenset(TABLES) | CORRECTION_FRAMES | SWITCHES
"""Names of data that hold until the program sets them again."""


@dataclass(frozen=True)
class KrlStore:
    """Values that the program has set so far, and that are the same on every way here.

    Attributes:
        held: Names, with an index where they are entries, and values, by name.
    """

    held: tuple[tuple[str, object], ...] = ()

    def get(self, name: str) -> object | None:
        """Return what a name stands for, None where nothing is known of it."""
        return next((value for key, value in self.held if key == name), None)

    def with_(self, name: str, value: object | None) -> KrlStore:
        """Return it with another value for a name; None forgets it."""
        rest = [pair for pair in self.held if pair[0] != name]
        new = [] if value is None else [(name, value)]
        return KrlStore(tuple(sorted([*rest, *new], key=lambda pair: pair[0])))

    def without(self, table: str) -> KrlStore:
        """Return it without any entry of a table."""
        begin = f"{table}["
        return KrlStore(tuple(p for p in self.held if not p[0].startswith(begin)))

    def join(self, other: KrlStore) -> KrlStore:
        """Keep what is the same on another way here."""
        return KrlStore(tuple(pair for pair in self.held if pair in other.held))


NOTHING_SET = KrlStore()


def entry_name(table: str, number: int) -> str:
    """Name an entry of a table.

    >>> entry_name("base_data", 2)
    'base_data[2]'
    """
    return f"{table}[{number}]"
