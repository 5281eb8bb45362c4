"""What a user's program can contain is no exception: it is collected and reported."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, order=True)
class Diagnostic:
    """One finding about a program.

    Attributes:
        file: File name the line belongs to.
        line: 1-based line.
        code: Short stable name, for instance ``unknown-statement``.
        message: What was found, what it means and what the user can do.
    """

    file: str
    line: int
    code: str
    message: str
