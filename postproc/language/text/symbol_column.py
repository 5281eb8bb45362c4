"""Names by the million, as the core keeps them."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from postproc._native import NameColumn

__all__ = ["NameColumn", "read_kinds", "read_names"]

Sequence.register(NameColumn)  # as the stub of the core says


def read_names(path: Path) -> Mapping[str, str]:
    """Read a list that is shipped: the first word of a line, and those behind it."""
    lines = (line.partition("#")[0] for line in path.read_text("ascii").splitlines())
    words = (line.split() for line in lines if line.strip())
    return {name: " ".join(rest) for name, *rest in words}


def read_kinds(path: Path) -> Mapping[str, frozenset[str]]:
    """Read a table that is shipped: ``kind: names``; return names in lower case."""
    lines = path.read_text("ascii").splitlines()
    found: dict[str, frozenset[str]] = {}
    for kind, _, names in (one.partition(":") for one in lines if one[:1] != "#"):
        found[kind] = found.get(kind, frozenset()).union(names.lower().split())
    return found
