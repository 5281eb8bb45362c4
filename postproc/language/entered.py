"""What one line of a variable file says; rule by rule like `build`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from postproc.language.build import Rule
from postproc.language.expressions import Number

_ACCESS = frozenset({"priv", "xport", "local"})


@dataclass(frozen=True)
class Entered:
    """The parts of a line; slots are numbers of the line, -1 for ``****``.

    Attributes:
        name, type: Of the head, "" where the line has none.
        arm: Slot of the arm number, -1 where there is none.
        shared: The head says Xport.
        variable: The head says whose variable it is (Priv, Xport, Local): fields of
            records and of path nodes do not.
        element: Slots of an element's index.
        node: Slot of the number of a path's node, -1 where the line names none.
        components: (letter, slot) pairs.
        axes: (axis slot, value slot) pairs.
        plain: Slots of numbers by themselves.
        config: Configuration string.
    """

    name: str = ""
    type: str = ""
    arm: int = -1
    shared: bool = False
    variable: bool = False
    element: tuple[int, ...] = ()
    node: int = -1
    components: tuple[tuple[str, int], ...] = ()
    axes: tuple[tuple[int, int], ...] = ()
    plain: tuple[int, ...] = ()
    config: str | None = None

    @property
    def says_value(self) -> bool:
        """Tell whether a number or a configuration stands in the line."""
        numbers = self.components or self.axes or self.plain
        return bool(numbers) or self.config is not None


class _Value(int):
    """Slot of a value."""


class _Arm(int):
    """Slot of the arm number."""


class _Element(tuple[int, ...]):
    """Slots of an index."""


class _Node(int):
    """Slot of the number of a node."""


class _Word(str):
    """A word of a head."""


def _line(c: Sequence[Any]) -> Entered:
    line = Entered()
    for part in c:
        match part:
            case Entered():
                line = part
            case _Element():
                line = replace(line, element=tuple(part))
            case _Node():
                line = replace(line, node=int(part))
            case ("component", letter, slot):
                line = replace(line, components=(*line.components, (letter, slot)))
            case ("axis", axis, slot):
                line = replace(line, axes=(*line.axes, (axis, slot)))
            case ("config", text):
                line = replace(line, config=text)
            case ("plain", slot):
                line = replace(line, plain=(*line.plain, slot))
    return line


def _head(c: Sequence[Any]) -> Entered:
    arms = [int(x) for x in c if isinstance(x, _Arm)]
    words = {str(x).lower() for x in c if isinstance(x, _Word)}
    return Entered(
        str(c[0]), str(c[1]), max([-1, *arms]), "xport" in words, bool(words & _ACCESS)
    )


def _plain(c: Sequence[Any]) -> tuple[str, int] | None:
    return ("plain", int(c[0])) if c and isinstance(c[0], _Value) else None


VALUE_RULES: Mapping[str, Rule] = {
    "line": _line,
    "head": _head,
    "dimensions": lambda c: None,
    "arm": lambda c: _Arm(c[1].slot),
    "counted": lambda c: None,
    "word": lambda c: _Word(c[0]),
    "element": lambda c: _Element(n.slot for n in c if isinstance(n, Number)),
    "node": lambda c: _Node(c[1].slot),
    "component": lambda c: ("component", str(c[0]), int(c[1])),
    "axis": lambda c: ("axis", c[0].slot, int(c[1])),
    "config": lambda c: ("config", str(c[1])[1:-1] if len(c) > 1 else ""),
    "plain": _plain,
    "number": lambda c: _Value(c[0].slot),
    "uninitialised": lambda c: _Value(-1),
}
