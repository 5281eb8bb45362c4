"""Findings as lines of text: what is the same at many places is one line."""

from __future__ import annotations

from collections.abc import Iterable

from postproc.diagnostics import Code
from postproc.language.visits import Diagnostic, line_ranges

FEW = 3  # places that a line names


def list_findings(found: Iterable[Diagnostic], every: bool = False) -> list[str]:
    """Write findings as lines, those that say the same as one with its first places.

    Args:
        found: In the order in which they are to be read.
        every: Write a line for each.
    """
    if every:
        return [str(one) for one in found]
    same: dict[tuple[str, Code, str], list[Diagnostic]] = {}
    for one in found:
        same.setdefault((one.file, one.code, one.message), []).append(one)
    return [_line(places) for places in same.values()]


def _line(places: list[Diagnostic]) -> str:
    """Write findings that say the same."""
    if len(places) == 1:
        return str(places[0])
    others = [one.line for one in places[1:]]
    if len(others) == 1:
        return f"{places[0]} (also line {others[0]})"
    more = ", .." if len(others) > FEW else ""
    return f"{places[0]} (also {len(others)} lines: {line_ranges(others[:FEW])}{more})"
