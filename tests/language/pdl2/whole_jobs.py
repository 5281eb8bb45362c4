"""Random jobs of several pages, with all statements of the generator."""

from __future__ import annotations

from dataclasses import dataclass, field

from tests.language.pdl2.executed import EVERYWHERE, PAGE
from tests.language.pdl2.generator.rarer import Rarer

PAGES = 2


@dataclass
class Sheet(Rarer):
    """Writes one file of a job; some of its variables belong to all files."""

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

    def said(self, name: str, program: str) -> str:
        """Return how another file declares a routine."""
        takes = "(a : POSITION)" * self.takes[name]
        return f"ROUTINE {name}{takes} EXPORTED FROM {program}"


@dataclass
class Page(Sheet):
    """Writes a page: a routine that the job calls, and a program of its own."""

    number_of: int = 1

    def write(self) -> str:
        """Write it, and return its text."""
        name, own = f"page{self.number_of}", f"s{self.number_of}"
        self.base = self.number_of * PAGE
        self.calling = (own,)
        self.declare(name)
        if self.has.recursion:
            self._let_call_back()
        self.lines += ["ROUTINE ext(a : POSITION) EXPORTED FROM other"]
        self.lines += [f"{self.said(own, name)} GLOBAL"]
        self.routine(own)
        self.more_routines()
        self.lines.append("BEGIN")
        self.in_main = True
        self.routines[name] = self.here
        self.assignments()
        self.block(self.rng.randrange(1, 4), 1)
        self.emit(f"END {name}", "return")
        return self.text()

    def _let_call_back(self) -> None:
        """Let this page call routines of the job and of the other page."""
        other = f"page{PAGES + 1 - self.number_of}"
        names = {"r1": "job", f"s{PAGES + 1 - self.number_of}": other}
        self.lines[1:1] = [f"IMPORT '{file}'" for file in names.values()]
        self.lines += [self.said(name, file) for name, file in names.items()]
        self.calling = (*self.calling, *names)

    def more_routines(self) -> None:
        """Write no functions: those of the job would have the same names."""


@dataclass
class Job(Sheet):
    """Writes a job whose main program and routines call its pages."""

    texts: list[str] = field(default_factory=list)
    page_type: type[Page] = Page

    def declare(self, name: str) -> None:
        """Write the pages first, and say what the job uses of them."""
        super().declare(name)
        pages = range(1, PAGES + 1)
        self.takes |= {f"s{k}": self.rng.random() < 0.5 for k in pages}
        for number in pages:
            page = self.page_type(
                self.rng, self.exact, kinds=self.kinds, number_of=number
            )
            page.ops, page.routines, page.takes = self.ops, self.routines, self.takes
            page.handlers = self.handlers
            self.texts.append(page.write())
            self.lines.insert(1, f"IMPORT 'page{number}'")
            self.lines.append(self.said(f"s{number}", f"page{number}"))

    def page_texts(self) -> tuple[str, ...]:
        """Return the texts of the pages."""
        return tuple(self.texts)

    def opening(self) -> None:
        """Run every page once where all must be known."""
        if self.exact:
            self.run_pages()

    def run_pages(self) -> None:
        for number in range(1, PAGES + 1):
            self.emit(f"CALL page{number}", "call", f"page{number}", "")

    def call(self) -> None:
        """Call a routine of the job or of a page, or a page."""
        number, kind = self.rng.randrange(PAGES) + 1, self.rng.randrange(3)
        if kind == 0:
            super().call()
        elif kind == 1:
            self.emit(f"CALL page{number}", "call", f"page{number}", "")
        else:
            self.call_with_point(f"s{number}")
