"""What a generated program is, and what a run of it gives."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

PAGE = 100_000  # lines of the k-th page of a job are counted from k * PAGE
EVERYWHERE = ("gp",)  # variables that all files of a job share


@dataclass(frozen=True)
class Executed:
    """One move that was run.

    Attributes:
        line: Its line, counted through all pages of the job.
        values: Its numbers; None: a variable that was never set.
        tool, uframe: The frames then.
        how: TO, VIA, NEAR, AWAY, BY, or RELATIVE or ABOUT with a frame: RELATIVE_TOOL.
        short_mm: How far NEAR stays away.
    """

    line: int
    values: tuple[float, ...] | None
    tool: tuple[float, ...]
    uframe: tuple[float, ...]
    how: str = "TO"
    short_mm: float = 0.0


@dataclass
class Generated:
    """A program: its text, its instructions by line, its routines, and its pages.

    Attributes:
        handlers: First line of what each condition handler does.
        unfollowed: First and last lines of functions, which are called in expressions.
    """

    text: str
    ops: dict[int, tuple[Any, ...]]
    entry: int
    routines: dict[str, int]
    deterministic: bool
    pages: tuple[str, ...] = ()
    handlers: dict[int, int] = field(default_factory=dict)
    functions: tuple[tuple[int, int], ...] = ()

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

    def within_function(self, line: int) -> bool:
        """Tell whether a line belongs to a function."""
        return any(first <= line <= last for first, last in self.functions)
