"""Instructions of RAPID by name, which move, and data that have a name at first."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from postproc.language.analysis.values import Value, WrittenNumber
from postproc.language.ir import Argument, Operand
from postproc.language.text.symbol_column import read_kinds

NAMES = read_kinds(Path(__file__).with_name("instructions.txt"))
"""Names of instructions and functions by what they do."""


@dataclass(frozen=True)
class Signature:
    """Where the positions stand among an instruction's arguments that go by place.

    Attributes:
        to: The destination.
        via: The point that an arc leads through, -1 where there is none.
        joints: The destination is a jointtarget.
        reaches: The move ends at its destination, not where a signal comes.
        given: Data that the instruction writes where a search ends, -1 for none.
    """

    to: int = 0
    via: int = -1
    joints: bool = False
    reaches: bool = True
    given: int = -1

    def find_written(self, arguments: Sequence[Argument]) -> Operand | None:
        """Return the data that the instruction writes, None where there are none."""
        placed = [one.value for one in arguments if not one.name]
        return placed[self.given] if 0 <= self.given < len(placed) else None

    def operands(self, arguments: Sequence[Argument]) -> tuple[Operand | None, ...]:
        """Return destination and via point, None where one is missing."""
        placed = [one.value for one in arguments if not one.name]
        return tuple(
            placed[at] if 0 <= at < len(placed) else None for at in (self.to, self.via)
        )


_SIGNATURES = {
    "point": Signature(),
    "arc": Signature(to=1, via=0),
    "joints": Signature(joints=True),
    "axes": Signature(joints=True, reaches=False),  # the arm stays
    "search": Signature(to=2, reaches=False, given=1),  # signal, where it came
    "arc-search": Signature(to=3, via=2, reaches=False, given=1),
    "joint-search": Signature(to=2, joints=True, reaches=False, given=1),
}
MOTIONS: Mapping[str, Signature] = {
    name: signature for kind, signature in _SIGNATURES.items() for name in NAMES[kind]
}


@cache
def read_known_instructions() -> Mapping[str, str]:
    """Return the instructions that do not move, and of what kind each is.

    Returns:
        By name in lower case: ``still`` changes nothing of a move, ``modal`` changes
        how the moves after it are carried out, ``left`` is not followed: it may move.

    >>> read_known_instructions()["tpwrite"], read_known_instructions()["pdispon"]
    ('still', 'modal')
    """
    return {name: kind for kind in ("still", "modal", "left") for name in NAMES[kind]}


READING, WAITING = NAMES["reading"], NAMES["waiting"]

ANSWERS = frozenset(
    ["timeflag", "valueattimeout", "taskno", "mectaskno", "errornumber"]
)
"""Options that instructions and functions answer in."""

BUILT_IN_FUNCTIONS = NAMES["function"]

STILL_FUNCTIONS = BUILT_IN_FUNCTIONS | NAMES["answering"]
"""Functions that do not move; those that answer may change what they are given."""

SYNCHRONOUS = ("movejsync", "movelsync", "movecsync")
BY_NAME = "callbyvar"
BY_STRING = frozenset(["setdataval", "setalldataval"])
"""Instructions that change data whose names they are given in strings."""

# Data that the controller gives names to.

_UPRIGHT = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
_NO_LOAD = 0.001, (0.0, 0.0, 0.001), _UPRIGHT[1], 0.0, 0.0, 0.0
_BUILT_IN: Mapping[str, tuple[Any, str]] = {
    "true": (1.0, "bool"), "false": (0.0, "bool"), "pi": (math.pi, "num"),
    "tool0": ((1.0, _UPRIGHT, _NO_LOAD), "tooldata"), "load0": (_NO_LOAD, "loaddata"),
    "wobj0": ((0.0, 1.0, "", _UPRIGHT, _UPRIGHT), "wobjdata"),
    "fine": ((1.0, 0.0), "zonedata"),
}  # fmt: skip
Z0 = 0.3  # [mm]


@cache
def read_controller_data(name: str) -> tuple[Value, str] | None:
    """Return data of the controller, as far as moves take them, and their type.

    >>> read_controller_data("z0")[0][1].value, read_controller_data("zone")
    (0.3, None)
    """
    found, usual = _BUILT_IN.get(name), re.match(r"([vz])(\d+)$", name)
    if usual is not None:
        size = float(usual[2])
        zone = (0.0, size or Z0), "zonedata"
        found = zone if usual[1] == "z" else ((size,), "speeddata")
    return None if found is None else (_as_values(found[0]), found[1])


def _as_values(data: Any) -> Value:
    """Return nested numbers and texts as values."""
    if isinstance(data, tuple):
        return tuple(map(_as_values, data))
    return data if isinstance(data, str) else WrittenNumber(data)
