"""An interpreter of generated programs.

It runs the instructions that the generator wrote beside the text; it shares nothing
with the parser or the analysis, so that both can be wrong only in the same way by
chance.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any

from tests.language.poses import composed, inverted

PAGE = 100_000  # lines of the k-th page of a job are counted from k * PAGE
EVERYWHERE = ("gp",)  # variables that all files of a job share


@dataclass(frozen=True)
class Executed:
    """One move that was run.

    Attributes:
        line: Its line, counted through all pages of the job.
        values: Its numbers; None: a variable that was never set.
        tool, uframe: The frames then.
        how: TO, VIA, NEAR, AWAY, RELATIVE_TOOL, RELATIVE_BASE or RELATIVE_UFRAME.
        short_mm: How far NEAR stays away.
    """

    line: int
    values: tuple[float, ...] | None
    tool: tuple[float, ...]
    uframe: tuple[float, ...]
    how: str = "TO"
    short_mm: float = 0.0


@dataclass
class Generated:
    """A program: its text, its instructions by line, its routines, and its pages."""

    text: str
    ops: dict[int, tuple[Any, ...]]
    entry: int
    routines: dict[str, int]
    deterministic: bool
    pages: tuple[str, ...] = ()

    @property
    def whole(self) -> str:
        """All texts of the job."""
        return "\n".join([self.text, *self.pages])


class Interpreter:
    """Runs a generated program once, with random inputs."""

    def __init__(self, program: Generated, seed: int, most: int = 400) -> None:
        self.program = program
        self.rng = random.Random(seed)
        self.most = most
        self.values: dict[str, Any] = {}
        self.frames = {"tool": (0.0,) * 6, "uframe": (0.0,) * 6}
        self.stack: list[tuple[int, str]] = []
        self.limits: dict[int, float] = {}
        self.trace: list[Executed] = []
        self.line = program.entry

    def run(self) -> list[Executed]:
        for _ in range(20 * self.most):
            op = self.program.ops.get(self.line, ("nop",))
            following = getattr(self, f"do_{op[0]}")(*op[1:])
            if following == 0 or len(self.trace) >= self.most:
                break
            self.line = following or self.line + 1
        return self.trace

    def name(self, name: str) -> str:
        """Tell variables of pages apart, and follow a parameter to its argument."""
        if name == "a":
            return self.stack[-1][1]
        page = 0 if name in EVERYWHERE else self.line // PAGE
        return f"{page}:{name}"

    def held(self, name: str) -> Any:
        return self.values.get(self.name(name))

    def log(self, values: Any, how: str = "TO", short_mm: float = 0.0) -> None:
        tool, uframe = self.frames["tool"], self.frames["uframe"]
        self.trace.append(Executed(self.line, values, tool, uframe, how, short_mm))

    def test(self, kind: str, name: str = "", value: float = 0.0) -> bool:
        if kind == "random":
            return self.rng.random() < 0.5
        held = self.held(name)
        if held is None:
            return self.rng.random() < 0.5
        return held == value if kind == "equal" else held < value

    def do_nop(self) -> None: ...

    def do_move(self, numbers: Any) -> None:
        self.log(numbers)

    def do_move_to(self, name: str) -> None:
        self.log(self.held(name))

    def do_move_table(self, index: str) -> None:
        self.log(self.held(f"tab[{self.subscript(index)}]"))

    def subscript(self, index: str) -> str:
        held = float(index) if index.isdigit() else self.held(index)
        return str(held)

    def do_set(self, name: str, value: Any) -> None:
        self.values[self.name(name)] = value

    def do_copy(self, a: str, b: str) -> None:
        self.values[self.name(a)] = self.held(b)

    def do_shift(self, a: str, b: str, by: Any) -> None:
        self.values[self.name(a)] = self.shifted(b, by)

    def do_move_shifted(self, name: str, by: Any) -> None:
        self.log(self.shifted(name, by))

    def do_near(self, name: str, short_mm: float) -> None:
        self.log(self.held(name), "NEAR", short_mm)

    def do_arc(self, name: str, via: str) -> None:
        self.log(self.held(via), "VIA")
        self.log(self.held(name))

    def do_without(self, how: str, numbers: Any) -> None:
        self.log(numbers, how)

    def do_compose(self, a: str, b: str, by: Any) -> None:
        held = self.held(b)
        self.values[self.name(a)] = None if held is None else composed(held, by)

    def do_invert(self, a: str, b: str) -> None:
        held = self.held(b)
        self.values[self.name(a)] = None if held is None else inverted(held)

    def shifted(self, name: str, by: Any) -> Any:
        held = self.held(name)
        if held is None:
            return None
        return (*(v + d for v, d in zip(held[:3], by, strict=True)), *held[3:])

    def do_component(self, name: str, at: int, number: float, add: bool) -> None:
        held = self.held(name)
        if held is not None:
            new = held[at] + number if add else number
            self.values[self.name(name)] = (*held[:at], new, *held[at + 1 :])

    def do_input(self, name: str) -> None:
        self.values[self.name(name)] = float(self.rng.randrange(5))

    def do_add(self, name: str) -> None:
        if self.held(name) is not None:
            self.values[self.name(name)] += 1.0

    def do_frame(self, name: str, numbers: Any) -> None:
        self.frames[name] = numbers

    def do_fill(self, index: str, numbers: Any) -> None:
        self.values[self.name(f"tab[{self.subscript(index)}]")] = numbers

    def do_scramble(self, name: str) -> None:
        self.values[self.name(name)] = tuple(self.rng.random() for _ in range(6))

    def do_call(self, name: str, argument: str) -> int:
        self.stack.append((self.line + 1, self.name(argument)))
        return self.program.routines[name]

    def do_return(self) -> int:
        return self.stack.pop()[0] if self.stack else 0

    def do_stop(self) -> int:
        return 0

    def do_cycle(self, start: int) -> int:
        return start

    def do_jump(self, line: int) -> int:
        return line

    def do_unless(self, test: Any, line: int) -> int | None:
        return None if self.test(*test) else line

    def do_select(self, name: str, cases: Any, otherwise: int) -> int:
        held = self.held(name)
        if held is None:
            held = float(self.rng.randrange(5))
        return next((line for value, line in cases if value == held), otherwise)

    def do_for(self, name: str, first: float, last: Any, by: float, end: int) -> Any:
        self.limits[self.line] = float(self.rng.randrange(4)) if last is None else last
        self.values[self.name(name)] = first
        return None if self._inside(self.line, first, by) else end + 1

    def do_next(self, start: int, name: str, by: float) -> Any:
        value = self.held(name) + by
        if self._inside(start, value, by):
            self.values[self.name(name)] = value
            return start + 1
        self.values.pop(self.name(name))
        return None

    def _inside(self, start: int, value: float, by: float) -> bool:
        last = self.limits[start]
        return value <= last if by > 0 else value >= last
