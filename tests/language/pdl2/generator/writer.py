"""What every part of the generator writes with: lines, instructions, drawn numbers."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

POINTS = ("p1", "p2", "P3")
JOINTS = ("j1",)
COUNTS = ("n1", "n2")
TABLE = "tab"
UNKNOWN = ("random",)  # a test that only the interpreter decides


@dataclass
class Writer:
    """A text that grows, and the instructions of its lines.

    Attributes:
        exact: Write nothing that is known only at run time.
        takes: Whether a routine takes a point, by its name.
        parameter: The parameter of the routine that is being written, or "".
        base: What the lines of this file are counted from.
    """

    rng: random.Random
    exact: bool = False
    lines: list[str] = field(default_factory=list)
    ops: dict[int, tuple[Any, ...]] = field(default_factory=dict)
    routines: dict[str, int] = field(default_factory=dict)
    takes: dict[str, bool] = field(default_factory=dict)
    handlers: dict[int, int] = field(default_factory=dict)
    labels: int = 0
    in_loops: tuple[str, ...] = ()
    parameter: str = ""
    in_main: bool = False
    cycle: int = 0
    base: int = 0

    def emit(self, text: str, *op: Any) -> int:
        noise = self.rng.choice(["", "", "", "  ", " -- it's -- a 'note", ";"])
        self.lines.append("  " * self.rng.randrange(3) + text + noise)
        line = self.base + len(self.lines)
        if op:
            self.ops[line] = op
        return line

    def patch(self, line: int, *op: Any) -> None:
        self.ops[line] = op

    def text(self) -> str:
        return self.rng.choice(["\r\n", "\n"]).join(self.lines)

    @property
    def here(self) -> int:
        """The next line."""
        return self.base + len(self.lines) + 1

    def number(self) -> float:
        return round(self.rng.uniform(-900.0, 900.0), 4)

    def draw(self, kind: str) -> tuple[float, ...]:
        """Draw six numbers: of a pose, joints, a tool, a uframe, or a small step."""
        return tuple(self.number() for _ in range(6))

    def record(self, kind: str = "pose") -> tuple[tuple[float, ...], str]:
        numbers = self.draw(kind)
        gap = self.rng.choice([", ", ",", " , "])
        return numbers, gap.join(f"{n:.4f}" for n in numbers)

    def vector(self) -> tuple[tuple[float, ...], str]:
        by = tuple(round(self.rng.uniform(-40.0, 40.0), 3) for _ in range(3))
        return by, ", ".join(f"{n:.3f}" for n in by)

    def point(self) -> str:
        return self.rng.choice([*POINTS, *([self.parameter] if self.parameter else [])])

    def index(self) -> str:
        return self.rng.choice([*self.in_loops, "1", "2", "n1"])

    def condition(self) -> tuple[str, tuple[Any, ...]]:
        if self.exact or self.rng.random() < 0.4:
            name, value = self.rng.choice(COUNTS), self.rng.randrange(4)
            if not self.exact or self.rng.random() < 0.5:
                return f"{name} = {value}", ("equal", name, float(value))
            return f"({name} < {value})", ("less", name, float(value))
        return f"$DIN[{self.rng.randrange(9)}]", UNKNOWN
