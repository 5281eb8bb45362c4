"""Variable files: the values that a program's points have on the controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.language.diagnostic import Diagnostic
from postproc.language.source import Source

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Entry:
    """One variable or array element with its value.

    Attributes:
        name: As it is written, array elements as ``tab[3]``.
        kind: POS, JNTP or XTND; other types keep only scalar numbers.
        line: 1-based line of its first number (of its head where it has none).
        numbers: Up to six numbers, None where uninitialised.
        slots: Index of each number in the file, -1 for none.
        aux: (axis, value) of auxiliary axes.
        config: Configuration string or None.
        shared: Other programs see it (Xport).
        arm: Arm number, 0 where it is not said.
    """

    name: str
    kind: str
    line: int
    numbers: tuple[float | None, ...]
    slots: tuple[int, ...]
    aux: tuple[tuple[int, float | None], ...]
    config: str | None
    shared: bool
    arm: int


@dataclass(frozen=True)
class Variables:
    """A variable file.

    Attributes:
        source: The text.
        start, end: Byte offsets of every number, its sign included, (m,).
        entries: Entries by lower-case name.
        diagnostics: What was found while reading.
    """

    source: Source
    start: Ints
    end: Ints
    entries: Mapping[str, Entry]
    diagnostics: tuple[Diagnostic, ...]
