"""Branches, loops and jumps around other statements."""

from __future__ import annotations

from tests.language.pdl2.generator.writer import COUNTS, UNKNOWN, Writer


class Blocks(Writer):
    """Writes blocks; a subclass says what a block holds."""

    def block(self, count: int, depth: int) -> None:
        """Write some statements."""
        raise NotImplementedError

    def statement(self, depth: int) -> None:
        """Write any statement."""
        raise NotImplementedError

    def guarded(self, text: str, *op: object) -> int:
        """Write a statement that an input decides on; return its line."""
        line = self.emit(f"IF $DIN[{self.rng.randrange(9)}] THEN")
        inside = self.emit(text, *op)
        self.patch(line, "unless", UNKNOWN, self.here)
        self.emit("ENDIF", "nop")
        return inside

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
        for text, values in self._cases():
            line = self.emit(f"CASE ({text}):")
            ends.append(line)
            cases.append((values, line + 1))
            self.block(self.rng.randrange(1, 3), depth + 1)
        otherwise = self.emit("ELSE:")
        ends.append(otherwise)
        self.block(1, depth + 1)
        self.patch(start, "select", name, cases, otherwise + 1)
        for line in ends:
            self.patch(line, "jump", self.here)
        self.emit("ENDSELECT", "nop")

    def _cases(self) -> list[tuple[str, tuple[float, ...]]]:
        """Draw cases of one value, of two, and of a range."""
        ways = [
            [("0", (0.0,)), ("1", (1.0,)), ("2", (2.0,))],
            [("0, 2", (0.0, 2.0)), ("1", (1.0,))],
            [("1..3", (1.0, 2.0, 3.0)), ("0", (0.0,))],
        ]
        found = self.rng.choice(ways)
        return found[: self.rng.randrange(1, len(found) + 1)]

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
        start = self.emit(f"WHILE $DIN[{self.rng.randrange(9)}] DO")
        self.block(self.rng.randrange(1, 3), depth + 1)
        end = self.emit("ENDWHILE", "jump", start)
        self.patch(start, "unless", UNKNOWN, end + 1)

    def repeat(self, depth: int) -> None:
        start = self.emit("REPEAT", "nop")
        self.block(self.rng.randrange(1, 3), depth + 1)
        self.emit(f"UNTIL $DIN[{self.rng.randrange(9)}]", "unless", UNKNOWN, start)

    def goto(self, depth: int) -> None:
        if self.in_loops:
            return
        self.labels += 1
        label = f"l{self.labels}"
        start = self.emit(f"{label}::", "nop")
        self.block(1, depth + 1)
        self.guarded(f"GOTO {label}", "jump", start)

    def return_(self, depth: int) -> None:
        if depth > 0 and self.rng.random() < 0.3:
            self.guarded("RETURN", "return")

    def exit_cycle(self) -> None:
        self.guarded("EXIT CYCLE", "jump", self.cycle)
