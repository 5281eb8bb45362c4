"""A whole program: declarations, routines, the main part, now and then a CYCLE."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tests.language.pdl2.executed import Generated
from tests.language.pdl2.generator.assignments import Assignments
from tests.language.pdl2.generator.blocks import Blocks
from tests.language.pdl2.generator.motions import Motions
from tests.language.pdl2.generator.writer import COUNTS, JOINTS, POINTS, TABLE

ROUTINES = ("r1", "r2")


class Generator(Motions, Assignments, Blocks):
    """Writes a program of the usual statements."""

    def program(self) -> Generated:
        self.takes |= {name: self.rng.random() < 0.5 for name in ROUTINES}
        self.declare("job")
        self.lines += ["ROUTINE ext(a : POSITION) EXPORTED FROM other"]
        for name in ROUTINES:
            self.routine(name)
        self.more_routines()
        self.lines.append("BEGIN")
        self.in_main = True
        entry = self.here
        self.assignments()
        self.opening()
        self.block(self.rng.randrange(4, 12), 0)
        if not self.exact and self.rng.random() < 0.3:
            self._cycle()
        else:
            self.emit("END job", "stop")
        return Generated(
            self.text(), self.ops, entry, self.routines, self.exact,
            self.page_texts(), self.handlers,
        )  # fmt: skip

    def _cycle(self) -> None:
        """Write a CYCLE with a way out of it."""
        start = self.emit("CYCLE", "nop")
        self.cycle = start
        self.block(3, 0)
        self.exit_cycle()
        self.block(1, 0)
        self.emit("END job", "cycle", start)

    def page_texts(self) -> tuple[str, ...]:
        """Return the texts of other files of the job."""
        return ()

    def declare(self, name: str) -> None:
        """Write what stands before the routines."""
        self.lines = [f"PROGRAM {name} EZ", "VAR"]
        self.lines += [f"  {', '.join(POINTS)}, q : POSITION"]
        self.lines += [f"  {', '.join(JOINTS)} : JOINTPOS FOR ARM[1]"]
        self.lines += [f"  {', '.join(COUNTS)}, i1, i2, i3, k1, k2, k3 : INTEGER"]
        self.lines += ["  xt : XTNDPOS FOR ARM[1]"]
        self.lines += [f"  {TABLE} : ARRAY[9] OF POSITION"]

    def assignments(self) -> None:
        """Write what every program knows at its start."""
        for name in POINTS:
            self.assign_point(name)
        for name in COUNTS if self.exact else ():
            self.emit(f"{name} := 1", "set", name, 1.0)

    def opening(self) -> None:
        """Write what every program begins with."""

    def more_routines(self) -> None:
        """Write routines beside the usual two."""

    def routine(self, name: str) -> None:
        self.parameter = "a" if self.takes[name] else ""
        self.lines.append(f"ROUTINE {name}{'(a : POSITION)' * self.takes[name]}")
        self.lines.append("BEGIN")
        self.routines[name] = self.here
        self.block(self.rng.randrange(1, 5), 1)
        self.emit(f"END {name}", "return")
        self.parameter = ""

    # ---- statements -----------------------------------------------------------------
    def block(self, count: int, depth: int) -> None:
        for _ in range(count):
            self.statement(depth)

    def statement(self, depth: int) -> None:
        """Write any statement; blocks only where few are open."""
        usual = [self.move_literal, self.move_variable] * 2
        usual += [self.assign_any, self.assign_component, self.assign_joints]
        usual += [self.assign_count, self.copy, self.shift, self.move_shifted]
        usual += [self.extended, self.move_extended, self.frame, self.fill]
        usual += [self.move_table, self.call, *self.more()]
        nested = [self.if_, self.if_, self.for_, self.select, *self.more_nested()]
        if not self.exact:
            nested += [self.while_, self.repeat, self.read, self.goto, self.return_]
        pick = self.rng.randrange(len(usual) + (len(nested) if depth < 3 else 0))
        if pick < len(usual):
            usual[pick]()
        else:
            nested[pick - len(usual)](depth)

    def more(self) -> list[Callable[[], Any]]:
        """Return statements that some generators write as well."""
        return []

    def more_nested(self) -> list[Callable[[int], None]]:
        """Return the same of blocks."""
        return []

    def call(self) -> None:
        if self.in_main:
            self.call_with_point(self.rng.choice(ROUTINES))
        else:
            self.move_literal()

    def find_calls(self, name: str) -> tuple[str, tuple[str, str, str]]:
        """Return a call and its instruction, with a point if the routine takes one."""
        point = self.point() if self.takes[name] else ""
        return f"{name}({point})" if point else name, ("call", name, point.lower())

    def call_with_point(self, name: str) -> None:
        text, op = self.find_calls(name)
        self.emit(text, *op)
