"""Names by the million, as the core keeps them."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from postproc._native import NameColumn

__all__ = ["NameColumn", "read_names"]

Sequence.register(NameColumn)  # as the stub of the core says


def read_names(path: Path) -> Mapping[str, str]:
    """Read a list that is shipped: the first word of a line, and those behind it."""
    lines = (line.partition("#")[0] for line in path.read_text("ascii").splitlines())
    words = (line.split() for line in lines if line.strip())
    return {name: " ".join(rest) for name, *rest in words}
