"""How the interpreter runs: line after line, in and out of routines and handlers."""

from __future__ import annotations

import random
from typing import Any

from tests.language.pdl2.executed import EVERYWHERE, PAGE, Executed, Generated

FIRES = 0.04  # chance that an enabled handler runs between two statements


class StoppedError(Exception):
    """The run has been long enough."""


class Running:
    """Runs instructions; a subclass says what each of them does.

    Attributes:
        stack: Where routines and handlers go back to, and what each calls `a`.
        enabled: Handlers that may run.
        depth: Of the stack when the running handler began, -1 where none runs.
        trace: The moves so far.
    """

    def __init__(self, program: Generated, seed: int, most: int = 400) -> None:
        self.program = program
        self.rng = random.Random(seed)
        self.most = most
        self.budget = 20 * most
        self.values: dict[str, Any] = {}
        self.frames = {"tool": (0.0,) * 6, "uframe": (0.0,) * 6}
        self.stack: list[tuple[int, str]] = []
        self.limits: dict[int, float] = {}
        self.enabled: set[int] = set()
        self.depth = -1
        self.returned: Any = None
        self.trace: list[Executed] = []
        self.line = program.entry

    def run(self) -> list[Executed]:
        try:
            while self.line:
                self.step()
        except StoppedError:
            pass
        return self.trace

    def step(self) -> None:
        """Run one line, and perhaps a handler before; after the last, the line is 0."""
        if self.line not in self.program.extra:
            self.fire()
            self.budget -= 1
        if self.budget < 0 or len(self.trace) >= self.most:
            raise StoppedError
        op = self.program.ops.get(self.line, ("nop",))
        following = getattr(self, f"do_{op[0]}")(*op[1:])
        self.line = self.line + 1 if following is None else following

    def fire(self) -> None:
        """Let a handler run now, to its end."""
        if not self.enabled or self.depth >= 0 or self.rng.random() > FIRES:
            return
        self.depth = len(self.stack)
        at = self.program.handlers[self.rng.choice(sorted(self.enabled))]
        self.within(at, "")
        self.depth = -1

    def within(self, line: int, argument: str) -> None:
        """Run from a line until what starts there is over, then go on as before."""
        came, depth = self.line, len(self.stack)
        self.stack.append((came, argument))
        self.line = line
        while len(self.stack) > depth:
            self.step()
        self.line = came

    # ---- names ----------------------------------------------------------------------
    def name(self, name: str) -> str:
        """Tell variables of pages apart, and follow a parameter to its argument."""
        if name == "a":
            return self.stack[-1][1]
        page = 0 if name in EVERYWHERE else self.line // PAGE
        return f"{page}:{name}"

    def hold(self, name: str) -> Any:
        return self.values.get(self.name(name))

    def log(self, values: Any, how: str = "TO", short_mm: float = 0.0) -> None:
        tool, uframe = self.frames["tool"], self.frames["uframe"]
        self.trace.append(Executed(self.line, values, tool, uframe, how, short_mm))

    def test(self, kind: str, name: str = "", value: float = 0.0) -> bool:
        if kind == "random":
            return self.rng.random() < 0.5
        held = self.hold(name)
        if held is None:
            return self.rng.random() < 0.5
        return held == value if kind == "equal" else held < value
