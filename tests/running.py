"""Run a simple program line by line, from its text alone.

A reader of its own for the few statements that `shared_points` writes: it shares
nothing with the parser or the analysis, so that a compensated program with clones is
executed as a controller would, and not as the compensation understood it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

NUMBERS = re.compile(r"(?:POS\(|\{)([-\d., ]+?)(?:, '[^']*')?[)}]")
MOVE = re.compile(r"MOVE (JOINT|LINEAR) TO (.+)")
ASSIGN = re.compile(r"(\w+) := (.+)")
DECLARED = re.compile(r"([\w, ]+) : (?:POSITION|XTNDPOS|JOINTPOS)[^(]*(\(.*\))?.*")


@dataclass(frozen=True)
class Executed:
    """One move that was run: its trajectory, its six numbers, and their kind."""

    motion: str
    joints: bool
    numbers: tuple[float, ...]


@dataclass
class Runner:
    """Runs a program once.

    Attributes:
        lines: Its lines without indents and comments.
        held: What every variable holds, as text.
        done: The moves that were run.
    """

    lines: list[str]
    held: dict[str, str] = field(default_factory=dict)
    done: list[Executed] = field(default_factory=list)

    @classmethod
    def of(cls, program: str, values: str = "") -> Runner:
        """Read a program and its variable file."""
        runner = cls([line.partition("--")[0].strip() for line in program.splitlines()])
        for line in runner.lines:
            if found := DECLARED.fullmatch(line.removeprefix("VAR ")):
                for name in found[1].split(","):
                    runner.held[name.strip().lower()] = found[2] or ""
        for entry in re.split(r"\n(?=\w+ XTND)", values.replace("\r", ""))[1:]:
            numbers = re.findall(r"[XYZAER]: *(-?[\d.]+)", entry)
            runner.held[entry.split()[0].lower()] = f"POS({', '.join(numbers)})"
        return runner

    def run(self) -> list[Executed]:
        """Run the main part, which starts with the last BEGIN."""
        starts = [at for at, line in enumerate(self.lines) if line == "BEGIN"]
        self.block(starts[-1] + 1)
        return self.done

    def block(self, at: int) -> int:
        """Run up to the end of a block; return the line of that end."""
        while not re.match(r"END|ELSE", self.lines[at]):
            at = self.line(at) + 1
        return at

    def skip(self, at: int) -> int:
        """Return the line that ends the block which starts at a line."""
        while not re.match(r"END|ELSE", self.lines[at]):
            opens = re.match(r"IF|FOR", self.lines[at])
            at = self.after(at) if opens else at + 1
        return at

    def after(self, at: int) -> int:
        """Return the line behind a block that a line opens."""
        end = self.skip(at + 1)
        return (self.skip(end + 1) if self.lines[end] == "ELSE" else end) + 1

    def line(self, at: int) -> int:
        """Run one statement; return its last line."""
        text = self.lines[at]
        if found := MOVE.fullmatch(text):
            self.move(found[1], found[2])
        elif found := re.fullmatch(r"FOR (\w+) := (\d+) TO (\d+) DO", text):
            for number in range(int(found[2]), int(found[3]) + 1):
                self.held[found[1]] = str(number)
                self.block(at + 1)
            return self.skip(at + 1)
        elif found := re.fullmatch(r"IF (\w+) = (\d+) THEN", text):
            end = self.skip(at + 1)
            if self.held[found[1]] == found[2]:
                self.block(at + 1)
            elif self.lines[end] == "ELSE":
                self.block(end + 1)
            return self.after(at) - 1
        elif found := ASSIGN.fullmatch(text):
            self.held[found[1].lower()] = found[2]
        elif text:
            start = self.lines.index(f"ROUTINE {text}")
            self.block(self.lines.index("BEGIN", start) + 1)
        return at

    def move(self, motion: str, where: str) -> None:
        """Run a move to a literal or to what a variable holds."""
        while not (found := NUMBERS.search(where)):
            where = self.held[where.lower()]
        numbers = tuple(float(number) for number in found[1].split(","))
        self.done.append(Executed(motion, "{" in where, numbers[:6]))
