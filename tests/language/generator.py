"""Random programs with known flow, and an interpreter that runs them.

The generator writes the text of a program and, beside every line, an instruction of a
tiny machine. The interpreter runs the instructions; it shares nothing with the parser
or the analysis, so that both can be wrong only in the same way by chance.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

POINTS = ("p1", "p2", "P3")
JOINTS = ("j1",)
COUNTS = ("n1", "n2")
TABLE = "tab"


@dataclass(frozen=True)
class Executed:
    """One move that was run."""

    line: int
    values: tuple[float, ...] | None  # None: a variable that was never set
    tool: tuple[float, ...]
    uframe: tuple[float, ...]


@dataclass
class Generated:
    """A program: its text, its instructions by line, and its routines."""

    text: str
    ops: dict[int, tuple[Any, ...]]
    entry: int
    routines: dict[str, int]
    deterministic: bool


@dataclass
class Generator:
    rng: random.Random
    exact: bool = False  # nothing that is known only at run time
    lines: list[str] = field(default_factory=list)
    ops: dict[int, tuple[Any, ...]] = field(default_factory=dict)
    routines: dict[str, int] = field(default_factory=dict)
    labels: int = 0
    in_loops: tuple[str, ...] = ()
    parameter: str = ""
    in_main: bool = False
    cycle: int = 0

    # ---- writing --------------------------------------------------------------------
    def emit(self, text: str, *op: Any) -> int:
        noise = self.rng.choice(["", "", "", "  ", " -- it's -- a 'note", ";"])
        self.lines.append("  " * self.rng.randrange(3) + text + noise)
        if op:
            self.ops[len(self.lines)] = op
        return len(self.lines)

    def patch(self, line: int, *op: Any) -> None:
        self.ops[line] = op

    @property
    def here(self) -> int:
        """The next line."""
        return len(self.lines) + 1

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
        self.lines = ["PROGRAM job EZ", "VAR"]
        self.lines += [f"  {', '.join(POINTS)}, q : POSITION"]
        self.lines += [f"  {', '.join(JOINTS)} : JOINTPOS FOR ARM[1]"]
        self.lines += [f"  {', '.join(COUNTS)}, i1, i2, i3, k1, k2, k3 : INTEGER"]
        self.lines += ["  xt : XTNDPOS FOR ARM[1]"]
        self.lines += [f"  {TABLE} : ARRAY[9] OF POSITION"]
        self.lines += ["ROUTINE ext(a : POSITION) EXPORTED FROM other"]
        for name in ("r1", "r2"):
            self._routine(name)
        self.lines.append("BEGIN")
        self.in_main = True
        entry = self.here
        for name in POINTS:
            self.assign_point(name)
        for name in COUNTS if self.exact else ():
            self.emit(f"{name} := 1", "set", name, 1.0)
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
        text = self.rng.choice(["\r\n", "\n"]).join(self.lines)
        return Generated(text, self.ops, entry, self.routines, self.exact)

    def opening(self) -> None:
        """Write what every program begins with."""

    def _routine(self, name: str) -> None:
        self.parameter = "a" if self.rng.random() < 0.5 else ""
        self.lines.append(f"ROUTINE {name}{'(a : POSITION)' * bool(self.parameter)}")
        self.lines.append("BEGIN")
        self.routines[name] = self.here
        self.ops[-len(self.routines)] = ("parameter", name, self.parameter)
        self.block(self.rng.randrange(1, 5), 1)
        self.emit(f"END {name}", "return")
        self.parameter = ""

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
        ]
        nested = [self.if_, self.for_, self.select, self.if_]
        unsure = [self.while_, self.repeat, self.read, self.goto, self.return_]
        choices = simple + (nested if depth < 3 else [])
        if not self.exact:
            choices += unsure if depth < 3 else []
        chosen = self.rng.choice(choices)
        if chosen in nested or chosen in unsure:
            chosen(depth)  # type: ignore[call-arg]
        else:
            chosen()  # type: ignore[call-arg]

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
        callable_now = list(self.routines)[: 2 if self.in_main else 0]
        if not callable_now:
            self.move_literal()
            return
        name = self.rng.choice(callable_now)
        at = list(self.routines).index(name) + 1
        takes = self.ops[-at][2]
        point = self.rng.choice(POINTS)
        argument = f"({point})" if takes else ""
        self.emit(f"{name}{argument}", "call", name, point.lower() if takes else "")

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
        return self.stack[-1][1] if name == "a" else name

    def log(self, values: Any) -> None:
        self.trace.append(
            Executed(self.line, values, self.frames["tool"], self.frames["uframe"])
        )

    def test(self, kind: str, name: str = "", value: float = 0.0) -> bool:
        if kind == "random":
            return self.rng.random() < 0.5
        held = self.values.get(name)
        if held is None:
            return self.rng.random() < 0.5
        return held == value if kind == "equal" else held < value

    def do_nop(self) -> None: ...

    def do_move(self, numbers: Any) -> None:
        self.log(numbers)

    def do_move_to(self, name: str) -> None:
        self.log(self.values.get(self.name(name)))

    def do_move_table(self, index: str) -> None:
        self.log(self.values.get(f"tab[{self.subscript(index)}]"))

    def subscript(self, index: str) -> str:
        return index if index.isdigit() else str(self.values.get(index))

    def do_set(self, name: str, value: Any) -> None:
        self.values[self.name(name)] = value

    def do_copy(self, a: str, b: str) -> None:
        self.values[self.name(a)] = self.values.get(self.name(b))

    def do_shift(self, a: str, b: str, by: Any) -> None:
        self.values[self.name(a)] = self.shifted(b, by)

    def do_move_shifted(self, name: str, by: Any) -> None:
        self.log(self.shifted(name, by))

    def shifted(self, name: str, by: Any) -> Any:
        held = self.values.get(self.name(name))
        if held is None:
            return None
        return (*(v + d for v, d in zip(held[:3], by, strict=True)), *held[3:])

    def do_component(self, name: str, at: int, number: float, add: bool) -> None:
        name = self.name(name)
        held = self.values.get(name)
        if held is not None:
            new = held[at] + number if add else number
            self.values[name] = (*held[:at], new, *held[at + 1 :])

    def do_input(self, name: str) -> None:
        self.values[name] = float(self.rng.randrange(5))

    def do_add(self, name: str) -> None:
        if self.values.get(name) is not None:
            self.values[name] += 1.0

    def do_frame(self, name: str, numbers: Any) -> None:
        self.frames[name] = numbers

    def do_fill(self, index: str, numbers: Any) -> None:
        index = self.subscript(index)
        self.values[f"tab[{str(float(index)) if index != 'None' else index}]"] = numbers
        self.values[f"tab[{index}]"] = numbers
        if "." in index and index != "None":
            self.values[f"tab[{int(float(index))}]"] = numbers

    def do_scramble(self, name: str) -> None:
        self.values[self.name(name)] = tuple(self.rng.random() for _ in range(6))

    def do_call(self, name: str, argument: str) -> int:
        self.stack.append((self.line + 1, argument))
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
        held = self.values.get(name)
        if held is None:
            held = float(self.rng.randrange(5))
        return next((line for value, line in cases if value == held), otherwise)

    def do_for(self, name: str, first: float, last: Any, by: float, end: int) -> Any:
        self.limits[self.line] = float(self.rng.randrange(4)) if last is None else last
        self.values[name] = first
        return None if self._inside(self.line, first, by) else end + 1

    def do_next(self, start: int, name: str, by: float) -> Any:
        value = self.values[name] + by
        if self._inside(start, value, by):
            self.values[name] = value
            return start + 1
        self.values.pop(name)
        return None

    def _inside(self, start: int, value: float, by: float) -> bool:
        last = self.limits[start]
        return value <= last if by > 0 else value >= last
