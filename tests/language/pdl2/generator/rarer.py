"""The whole language of the generator: rarer moves, handlers, functions, recursion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tests.language.pdl2.generator.computed import Computed
from tests.language.pdl2.generator.functions import Functions
from tests.language.pdl2.generator.generator import ROUTINES, Generator
from tests.language.pdl2.generator.handlers import Handlers
from tests.language.pdl2.generator.rarer_moves import RarerMoves


@dataclass(frozen=True)
class Kinds:
    """Which of the rarest statements a program has.

    Attributes:
        handlers: Condition handlers.
        moving: .. that may move the arm.
        recursion: Routines that may call each other and themselves.
        functions: Functions that are called in expressions.
    """

    handlers: bool = False
    moving: bool = False
    recursion: bool = False
    functions: bool = False


@dataclass
class Rarer(Computed, RarerMoves, Functions, Handlers, Generator):
    """Writes all statements; what nothing can follow only in some programs."""

    kinds: Kinds | None = None

    def __post_init__(self) -> None:
        if self.kinds is None:
            drawn = [self.rng.random() < part for part in (0.4, 0.4, 0.25, 0.4)]
            handlers, moving, recursion, functions = drawn
            live = not self.exact
            self.kinds = Kinds(handlers, moving and live, recursion and live,
                               functions and live)  # fmt: skip
        self.moving = self.kinds.moving
        self.calling = ROUTINES

    @property
    def has(self) -> Kinds:
        """What this program has."""
        assert self.kinds is not None
        return self.kinds

    def more(self) -> list[Callable[[], Any]]:
        """Return statements that are written beside the usual ones."""
        found = [*self.rarer_moves(), self.compose, self.invert]
        if self.has.handlers:
            found += [self.handler, self.disable]
        if self.has.functions:
            found += [self.use_function, self.use_function]
        return found

    def more_nested(self) -> list[Callable[[int], None]]:
        """Return blocks that are written beside the usual ones."""
        return [self.goto_forward]

    def more_routines(self) -> None:
        """Write functions."""
        if self.has.functions:
            self.function("f1", posed=True)
            self.function("g1", posed=False)

    def call(self) -> None:
        """Call a routine, from routines only where recursion is wanted."""
        if self.in_main:
            self.call_with_point(self.rng.choice(self.calling))
        elif self.has.recursion and self.rng.random() < 0.5:
            text, op = self.find_calls(self.rng.choice(self.calling))
            self.guarded(text, *op)
        else:
            self.move_literal()

    def call_one(self) -> None:
        """Call a routine of this file."""
        self.call_with_point(self.rng.choice(self.calling))

    def goto_forward(self, depth: int) -> None:
        """Jump over some statements."""
        self.labels += 1
        label, test = f"f{self.labels}", None
        if self.rng.random() < 0.6:
            text, test = self.condition()
            start = self.emit(f"IF {text} THEN")
        line = self.emit(f"GOTO {label}")
        if test is not None:
            self.patch(start, "unless", test, self.here)
            self.emit("ENDIF", "nop")
        self.block(self.rng.randrange(1, 3), depth + 1)
        self.patch(line, "jump", self.emit(f"{label}::", "nop"))
