"""What a KRL program sets on its way: entries of tables, corrections, switches."""

from __future__ import annotations

from collections.abc import Mapping

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


def entry_name(table: str, number: int) -> str:
    """Name an entry of a table.

    >>> entry_name("base_data", 2)
    'base_data[2]'
    """
    return f"{table}[{number}]"
