"""Text from outside, made safe to print."""

from __future__ import annotations


def printable(text: str) -> str:
    r"""Escape control characters, so that a name cannot steer the terminal.

    >>> printable("a\x1b[31m")
    'a\\x1b[31m'
    """
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
