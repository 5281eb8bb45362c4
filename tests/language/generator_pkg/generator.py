"""Random programs with known flow.

The generator writes the text of a program and, beside every line, an instruction of a
tiny machine, which the interpreter runs.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from tests.language.interpreter import Generated

POINTS = ("p1", "p2", "P3")
JOINTS = ("j1",)
COUNTS = ("n1", "n2")
TABLE = "tab"


@dataclass
class Generator:
    rng: random.Random
    exact: bool = False  # nothing that is known only at run time
    lines: list[str] = field(default_factory=list)
    ops: dict[int, tuple[Any, ...]] = field(default_factory=dict)
    routines: dict[str, int] = field(default_factory=dict)
    takes: dict[str, bool] = field(default_factory=dict)  # a parameter, by routine
    labels: int = 0
    in_loops: tuple[str, ...] = ()
    parameter: str = ""
    in_main: bool = False
    cycle: int = 0
    base: int = 0  # what the lines of its file are counted from

    # ---- writing --------------------------------------------------------------------
    def emit(self, text: str, *op: Any) -> int:
        noise = self.rng.choice(["", "", "", "  ", " -- it's -- a 'note", ";"])
        self.lines.append("  " * self.rng.randrange(3) + text + noise)
        line = self.base + len(self.lines)
        if op:
            self.ops[line] = op
        return line

    def patch(self, line: int, *op: Any) -> None:
        self.ops[line] = op

    @property
    def here(self) -> int:
        """The next line."""
        return self.base + len(self.lines) + 1

    def number(self) -> float:
        return round(self.rng.uniform(-900.0, 900.0), 4)

    def drawn(self, kind: str) -> tuple[float, ...]:
        """Draw six numbers of a pose, joint angles, a tool or a uframe."""
        return tuple(self.number() for _ in range(6))

    def record(self, kind: str = "pose") -> tuple[tuple[float, ...], str]:
        numbers = self.drawn(kind)
        gap = self.rng.choice([", ", ",", " , "])
        return numbers, gap.join(f"{n:.4f}" for n in numbers)

    def program(self) -> Generated:
        self.declare("job")
        self.lines += ["ROUTINE ext(a : POSITION) EXPORTED FROM other"]
        for name in ("r1", "r2"):
            self._routine(name)
        self.lines.append("BEGIN")
        self.in_main = True
        entry = self.here
        self.assignments()
        self.opening()
        self.block(self.rng.randrange(4, 12), 0)
        if not self.exact and self.rng.random() < 0.3:
            start = self.emit("CYCLE", "nop")
            self.cycle = start
            self.block(3, 0)
            self.exit_cycle()
            self.block(1, 0)
            self.emit("END job", "cycle", start)
        else:
            self.emit("END job", "stop")
        return Generated(
            self.text(), self.ops, entry, self.routines, self.exact, self.page_texts()
        )

    def text(self) -> str:
        return self.rng.choice(["\r\n", "\n"]).join(self.lines)

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

    def _routine(self, name: str) -> None:
        self.parameter = "a" if self.rng.random() < 0.5 else ""
        self.lines.append(self.heading(name))
        self.lines.append("BEGIN")
        self.routines[name] = self.here
        self.takes[name] = bool(self.parameter)
        self.block(self.rng.randrange(1, 5), 1)
        self.emit(f"END {name}", "return")
        self.parameter = ""

    def heading(self, name: str) -> str:
        return f"ROUTINE {name}{'(a : POSITION)' * bool(self.parameter)}"

    # ---- statements -----------------------------------------------------------------
    def block(self, count: int, depth: int) -> None:
        for _ in range(count):
            self.statement(depth)

    def statement(self, depth: int) -> None:
        simple = [
            self.move_literal,
            self.move_literal,
            self.move_variable,
            self.move_variable,
            lambda: self.assign_point(self.point()),
            self.assign_component,
            self.assign_joints,
            self.assign_count,
            self.copy,
            self.shift,
            self.move_shifted,
            self.extended,
            self.move_extended,
            self.frame,
            self.fill,
            self.move_table,
            self.call,
            *self.more(),
        ]
        nested = [self.if_, self.for_, self.select, self.if_]
        nested += self.more_nested()
        unsure = [self.while_, self.repeat, self.read, self.goto, self.return_]
        choices = simple + (nested if depth < 3 else [])
        if not self.exact:
            choices += unsure if depth < 3 else []
        chosen = self.rng.choice(choices)
        if chosen in nested or chosen in unsure:
            chosen(depth)  # type: ignore[call-arg]
        else:
            chosen()  # type: ignore[call-arg]

    def more(self) -> list[Callable[[], Any]]:
        """Return statements that some generators write as well."""
        return []

    def more_nested(self) -> list[Callable[[int], None]]:
        """Return the same of blocks."""
        return []

    def point(self) -> str:
        return self.rng.choice([*POINTS, *([self.parameter] if self.parameter else [])])

    def move_literal(self) -> None:
        posed = self.rng.random() < 0.5
        numbers, text = self.record("pose" if posed else "joints")
        word = self.rng.choice(["MOVE", "MOVEFLY"])
        how = self.rng.choice(["JOINT", "LINEAR"])
        end = " ADVANCE" if word == "MOVEFLY" else ""
        if posed:
            self.emit(f"{word} {how} TO POS({text}, ''){end}", "move", numbers)
        else:
            self.emit(f"{word} {how} TO {{{text}}}{end}", "move", numbers)

    def move_variable(self) -> None:
        name = self.rng.choice([self.point(), *JOINTS])
        self.emit(f"MOVE JOINT TO {name}", "move_to", name.lower())

    def assign_point(self, name: str) -> None:
        numbers, text = self.record()
        self.emit(f"{name} := POS({text}, '')", "set", name.lower(), numbers)

    def assign_joints(self) -> None:
        numbers, text = self.record("joints")
        self.emit(f"j1 := {{{text}}}", "set", "j1", numbers)

    def assign_component(self) -> None:
        name, at = self.point(), self.rng.randrange(3)
        number = abs(self.number())
        if self.rng.random() < 0.5:
            op = ("component", name.lower(), at, number, False)
            self.emit(f"{name}.{'XYZ'[at]} := {number:.4f}", *op)
        else:
            op = ("component", name.lower(), at, number, True)
            text = f"{name}.{'XYZ'[at]} := {name}.{'XYZ'[at]} + {number:.4f}"
            self.emit(text, *op)

    def assign_count(self) -> None:
        name = self.rng.choice(COUNTS)
        value = self.rng.randrange(4)
        if not self.exact and self.rng.random() < 0.3:
            self.emit(f"{name} := $FMI[{value + 1}]", "input", name)
        elif self.rng.random() < 0.3:
            self.emit(f"{name} := {name} + 1", "add", name)
        else:
            self.emit(f"{name} := {value}", "set", name, float(value))

    def copy(self) -> None:
        a, b = self.point(), self.point()
        self.emit(f"{a} := {b}", "copy", a.lower(), b.lower())

    def shift(self) -> None:
        a, b = self.point(), self.point()
        by, text = self.vector()
        text = f"{a} := POS_SHIFT({b}, VEC({text}))"
        self.emit(text, "shift", a.lower(), b.lower(), by)

    def move_shifted(self) -> None:
        name = self.point()
        by, text = self.vector()
        how = self.rng.choice(["JOINT", "LINEAR"])
        text = f"MOVE {how} TO POS_SHIFT({name}, VEC({text}))"
        self.emit(text, "move_shifted", name.lower(), by)

    def vector(self) -> tuple[tuple[float, ...], str]:
        by = tuple(round(self.rng.uniform(-40.0, 40.0), 3) for _ in range(3))
        return by, ", ".join(f"{n:.3f}" for n in by)

    def extended(self) -> None:
        numbers, text = self.record()
        self.emit(f"xt.POS := POS({text}, '')", "set", "xt", numbers)
        self.emit(f"xt.AUX[1] := {self.rng.randrange(90)}", "nop")

    def move_extended(self) -> None:
        self.emit("MOVE LINEAR TO xt", "move_to", "xt")

    def exit_cycle(self) -> None:
        line = self.emit("IF $DIN[5] THEN")
        self.emit("EXIT CYCLE", "jump", self.cycle)
        self.patch(line, "unless", ("random",), self.here)
        self.emit("ENDIF", "nop")

    def frame(self) -> None:
        name = self.rng.choice(["TOOL", "UFRAME"])
        numbers, text = self.record(name.lower())
        self.emit(f"${name} := POS({text}, '')", "frame", name.lower(), numbers)

    def fill(self) -> None:
        numbers, text = self.record()
        index = self.index()
        self.emit(f"{TABLE}[{index}] := POS({text}, '')", "fill", index, numbers)

    def index(self) -> str:
        return self.rng.choice([*self.in_loops, "1", "2", "n1"])

    def move_table(self) -> None:
        index = self.index()
        self.emit(f"MOVE LINEAR TO {TABLE}[{index}]", "move_table", index)

    def call(self) -> None:
        if not self.in_main:
            self.move_literal()
            return
        self.call_with_point(self.rng.choice(["r1", "r2"]))

    def call_with_point(self, name: str) -> None:
        """Call a routine, with a point where it takes one."""
        if self.takes[name]:
            point = self.point()
            self.emit(f"{name}({point})", "call", name, point.lower())
        else:
            self.emit(name, "call", name, "")

    def condition(self) -> tuple[str, tuple[Any, ...]]:
        if self.exact or self.rng.random() < 0.4:
            name, value = self.rng.choice(COUNTS), self.rng.randrange(4)
            if not self.exact or self.rng.random() < 0.5:
                return f"{name} = {value}", ("equal", name, float(value))
            return f"({name} < {value})", ("less", name, float(value))
        return f"$DIN[{self.rng.randrange(9)}]", ("random",)

    def if_(self, depth: int) -> None:
        text, test = self.condition()
        start = self.emit(f"IF {text} THEN")
        self.block(self.rng.randrange(3), depth + 1)
        if self.rng.random() < 0.5:
            middle = self.emit("ELSE")
            self.patch(start, "unless", test, self.here)
            self.block(self.rng.randrange(3), depth + 1)
            self.patch(middle, "jump", self.here)
        else:
            self.patch(start, "unless", test, self.here)
        self.emit("ENDIF", "nop")

    def select(self, depth: int) -> None:
        name = self.rng.choice(COUNTS)
        start = self.emit(f"SELECT {name} OF")
        cases, ends = [], []
        for value in range(self.rng.randrange(1, 4)):
            line = self.emit(f"CASE ({value}):")
            ends.append(line)
            cases.append((float(value), line + 1))
            self.block(self.rng.randrange(1, 3), depth + 1)
        otherwise = self.emit("ELSE:")
        ends.append(otherwise)
        self.block(1, depth + 1)
        self.patch(start, "select", name, cases, otherwise + 1)
        for line in ends:
            self.patch(line, "jump", self.here)
        self.emit("ENDSELECT", "nop")

    def for_(self, depth: int) -> None:
        name = f"{'ki'[self.in_main]}{depth + 1}"
        if name in self.in_loops:
            return
        first, last, by = self.rng.choice([(1, 3, 1), (1, 5, 2), (4, 2, -1), (3, 1, 1)])
        word, step = ("DOWNTO", "") if by < 0 else ("TO", f" STEP {by}" * (by > 1))
        unknown = not self.exact and self.rng.random() < 0.3
        stop = "$FMI[7]" if unknown else str(last)
        if unknown:
            word, step, by, first = "TO", "", 1, 1
        start = self.emit(f"FOR {name} := {first} {word} {stop}{step} DO")
        self.in_loops = (*self.in_loops, name)
        self.block(self.rng.randrange(1, 4), depth + 1)
        self.in_loops = self.in_loops[:-1]
        end = self.emit("ENDFOR", "next", start, name, float(by))
        limit = None if unknown else float(last)
        self.patch(start, "for", name, float(first), limit, float(by), end)

    def while_(self, depth: int) -> None:
        text, test = f"$DIN[{self.rng.randrange(9)}]", ("random",)
        start = self.emit(f"WHILE {text} DO")
        self.block(self.rng.randrange(1, 3), depth + 1)
        end = self.emit("ENDWHILE", "jump", start)
        self.patch(start, "unless", test, end + 1)

    def repeat(self, depth: int) -> None:
        start = self.emit("REPEAT", "nop")
        self.block(self.rng.randrange(1, 3), depth + 1)
        text, test = self.condition()
        if test[0] != "random":
            text, test = "$DIN[1]", ("random",)
        self.emit(f"UNTIL {text}", "unless", test, start)

    def read(self, depth: int) -> None:
        name = self.point()
        if self.rng.random() < 0.5:
            self.emit(f"ext({name})", "scramble", name.lower())
        else:
            self.emit(f"READ lun ({name})", "scramble", name.lower())

    def goto(self, depth: int) -> None:
        if self.in_loops:
            return
        self.labels += 1
        label = f"l{self.labels}"
        start = self.emit(f"{label}::", "nop")
        self.block(1, depth + 1)
        line = self.emit("IF $DIN[3] THEN")
        self.emit(f"GOTO {label}", "jump", start)
        self.patch(line, "unless", ("random",), self.here)
        self.emit("ENDIF", "nop")

    def return_(self, depth: int) -> None:
        if depth == 0 or self.rng.random() < 0.7:
            return
        line = self.emit("IF $DIN[4] THEN")
        self.emit("RETURN", "return")
        self.patch(line, "unless", ("random",), self.here)
        self.emit("ENDIF", "nop")
