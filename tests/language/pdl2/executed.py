"""What a generated program is, and what a run of it gives."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

PAGE = 100_000  # lines of the k-th page of a job are counted from k * PAGE
EVERYWHERE = ("gp",)  # variables that all files of a job share


class Literal(tuple[float, ...]):
    """Numbers that stand in the text as they are; what is computed from them is none.

    Attributes:
        line: Where they stand.
    """

    line: int

    @classmethod
    def at(cls, line: int, numbers: tuple[float, ...]) -> Literal:
        made = cls(numbers)
        made.line = line
        return made


@dataclass(frozen=True)
class Executed:
    """One move that was run.

    Attributes:
        line: Its line, counted through all pages of the job.
        values: Its numbers; None: a variable that was never set.
        tool, uframe: The frames then.
        how: TO, VIA, NEAR, FOR, AWAY, BY, or RELATIVE or ABOUT and a frame: ABOUT_TOOL.
        short_mm: How far NEAR stays away, or FOR goes.
    """

    line: int
    values: tuple[float, ...] | None
    tool: tuple[float, ...]
    uframe: tuple[float, ...]
    how: str = "TO"
    short_mm: float = 0.0

    @property
    def origin(self) -> int:
        """The line in which its numbers stand, 0 where they are computed."""
        return self.values.line if isinstance(self.values, Literal) else 0


@dataclass
class Generated:
    """A program: its text, its instructions by line, its routines, and its pages.

    Attributes:
        handlers: First line of what each condition handler does.
        extra: Lines that another program of the same moves has not: they take no time.
    """

    text: str
    ops: dict[int, tuple[Any, ...]]
    entry: int
    routines: dict[str, int]
    deterministic: bool
    pages: tuple[str, ...] = ()
    handlers: dict[int, int] = field(default_factory=dict)
    extra: frozenset[int] = frozenset()

    @property
    def whole(self) -> str:
        """All texts of the job."""
        return "\n".join([self.text, *self.pages])

    @property
    def files(self) -> dict[str, bytes]:
        """All files of the job, its program first."""
        names = ["job.pdl", *(f"page{k + 1}.pdl" for k in range(len(self.pages)))]
        texts = (self.text, *self.pages)
        return {n: t.encode("latin-1") for n, t in zip(names, texts, strict=True)}
