"""Condition handlers: what they do may happen between any two statements."""

from __future__ import annotations

from tests.language.pdl2.generator.assignments import Assignments
from tests.language.pdl2.generator.motions import Motions


class Handlers(Motions, Assignments):
    """Writes handlers, and statements that enable and disable them.

    Attributes:
        moving: Handlers of this program may move the arm.
        calling: Routines that they may call.
    """

    moving: bool = False
    calling: tuple[str, ...] = ()

    def handler(self) -> None:
        """Write a handler and enable it."""
        number = len(self.handlers) + 1
        start = self.emit(f"CONDITION[{number}] :")
        self.emit(f"  WHEN $DIN[{number}]+ DO")
        self.handlers[number] = self.here
        outside = self.parameter, self.in_loops
        self.parameter, self.in_loops = "", ()
        for _ in range(self.rng.randrange(1, 3)):
            self.action()
        self.parameter, self.in_loops = outside
        self.patch(start, "jump", self.emit("ENDCONDITION", "resume") + 1)
        self.emit(f"ENABLE CONDITION[{number}]", "enable", number)

    def action(self) -> None:
        """Write one thing that a handler does."""
        if self.exact:
            self.emit("$DOUT[7] := ON", "nop")
            return
        usual = [self.assign_any, self.assign_count, self.assign_joints]
        usual += [self.assign_component, self.fill, self.copy]
        usual += [self.frame] if self.rng.random() < 0.3 else []
        if self.moving:
            usual += [self.move_literal, self.move_variable]
            usual += [self.call_one] if self.calling else []
        self.rng.choice(usual)()

    def call_one(self) -> None:
        """Call a routine of this file."""
        raise NotImplementedError

    def disable(self) -> None:
        if self.handlers:
            number = self.rng.choice(sorted(self.handlers))
            self.emit(f"DISABLE CONDITION[{number}]", "disable", number)
