"""Kinds of files in a tree of programs, told by their names and contents."""

from __future__ import annotations

import os
import re

PROGRAM, VARIABLES, COMPILED = ".pdl", ".lsv", (".cod", ".var")
LARGEST = 500_000_000  # bytes of a program or variable file; a longer one is neither

_TARGETS = re.compile(
    rb"^[ \t]*\w+[ \t]+A?(?:POS|XTND|JNTP|PATH)\b", re.IGNORECASE | re.MULTILINE
)


def suffix_of(place: str) -> str:
    """Return a path's suffix in lower case.

    >>> suffix_of("a/JOB.PDL")
    '.pdl'
    """
    return os.path.splitext(place)[1].lower()


def base_of(place: str) -> str:
    """Return a file's name without folder and suffix, in lower case.

    >>> base_of("a/JOB.PDL")
    'job'
    """
    return os.path.splitext(place.rpartition("/")[2])[0].lower()


def holds_targets(data: bytes) -> bool:
    r"""Tell whether a variable file holds positions.

    >>> holds_targets(b"p1 POS Priv\n X: 1 ..")
    True
    """
    return _TARGETS.search(data) is not None
