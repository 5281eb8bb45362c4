"""Random jobs of several pages, with the rarer statements of the language."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from tests.language.generator import Generator
from tests.language.interpreter import EVERYWHERE, PAGE

PAGES = 2


@dataclass
class Rarer(Generator):
    """Writes moves without targets, composed points, and jumps forward."""

    def point(self) -> str:
        """Draw a variable, now and then one that all pages share."""
        if self.rng.random() < 0.1:
            return self.rng.choice(EVERYWHERE)
        return super().point()

    def declare(self, name: str) -> None:
        """Declare the shared variable too."""
        super().declare(name)
        end = " GLOBAL" if name == "page1" else ""
        self.lines += [f"  {v} : POSITION EXPORTED FROM page1{end}" for v in EVERYWHERE]

    def more(self) -> list[Callable[[], Any]]:
        """Return statements that are written beside the usual ones."""
        return [
            self.near,
            self.away,
            self.relative,
            self.arc,
            self.compose,
            self.invert,
        ]

    def more_nested(self) -> list[Callable[[int], None]]:
        """Return blocks that are written beside the usual ones."""
        return [self.goto_forward]

    def near(self) -> None:
        name, short = self.point(), abs(self.number())
        self.emit(
            f"MOVE LINEAR NEAR {name} BY {short:.4f}", "near", name.lower(), short
        )

    def away(self) -> None:
        by = abs(self.number())
        self.emit(f"MOVE LINEAR AWAY {by:.4f}", "without", "AWAY", (by,))

    def relative(self) -> None:
        frame = self.rng.choice(["TOOL", "BASE", "UFRAME"])
        by, text = self.vector()
        text = f"MOVE LINEAR RELATIVE VEC({text}) IN {frame}"
        self.emit(text, "without", f"RELATIVE_{frame}", by)

    def arc(self) -> None:
        name, via = self.point(), self.point()
        text = f"MOVE CIRCULAR TO {name} VIA {via}"
        self.emit(text, "arc", name.lower(), via.lower())

    def compose(self) -> None:
        a, b = self.point(), self.point()
        by, text = self.record()
        self.emit(f"{a} := {b} : POS({text}, '')", "compose", a.lower(), b.lower(), by)

    def invert(self) -> None:
        a, b = self.point(), self.point()
        self.emit(f"{a} := POS_INV({b})", "invert", a.lower(), b.lower())

    def goto_forward(self, depth: int) -> None:
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


@dataclass
class Page(Rarer):
    """Writes a page: a routine that the job calls, and a program of its own."""

    number_of: int = 1
    said: str = ""  # how the job declares its routine

    def write(self) -> str:
        """Write it, and return its text."""
        name, routine = f"page{self.number_of}", f"s{self.number_of}"
        self.base = self.number_of * PAGE
        self.declare(name)
        self.lines += ["ROUTINE ext(a : POSITION) EXPORTED FROM other", ""]
        exported = len(self.lines) - 1
        self._routine(routine)
        said = f"{self.lines[exported + 1]} EXPORTED FROM {name}"
        self.lines[exported] = f"{said} GLOBAL"
        self.lines.append("BEGIN")
        self.in_main = True
        self.routines[name] = self.here
        self.assignments()
        self.block(self.rng.randrange(1, 4), 1)
        self.emit(f"END {name}", "return")
        self.said = said
        return self.text()

    def call(self) -> None:
        """Call the page's own routine, but not from itself."""
        if self.in_main:
            self.call_with_point(f"s{self.number_of}")
        else:
            self.move_literal()


@dataclass
class Job(Rarer):
    """Writes a job whose main program and routines call its pages."""

    texts: list[str] = field(default_factory=list)

    def declare(self, name: str) -> None:
        """Write the pages first, and say what the job uses of them."""
        super().declare(name)
        for number in range(1, PAGES + 1):
            page = Page(self.rng, self.exact, number_of=number)
            page.ops, page.routines, page.takes = self.ops, self.routines, self.takes
            self.texts.append(page.write())
            self.lines.insert(1, f"IMPORT 'page{number}'")
            self.lines.append(page.said)

    def page_texts(self) -> tuple[str, ...]:
        """Return the texts of the pages."""
        return tuple(self.texts)

    def opening(self) -> None:
        """Run every page once where all must be known."""
        for number in range(1, PAGES + 1) if self.exact else ():
            self.emit(f"CALL page{number}", "call", f"page{number}", "")

    def call(self) -> None:
        """Call a routine of the job or of a page, or a page."""
        number, kind = self.rng.randrange(PAGES) + 1, self.rng.randrange(3)
        if kind == 0 and self.in_main:
            self.call_with_point(self.rng.choice(["r1", "r2"]))
        elif kind == 1:
            self.emit(f"CALL page{number}", "call", f"page{number}", "")
        else:
            self.call_with_point(f"s{number}")
