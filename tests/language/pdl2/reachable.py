"""Random programs and jobs that the arm of the tests can run."""

from __future__ import annotations

import random
from dataclasses import dataclass

from tests.language.pdl2.executed import EVERYWHERE, Generated
from tests.language.pdl2.generator.assignments import Assignments
from tests.language.pdl2.generator.blocks import Blocks
from tests.language.pdl2.generator.motions import Motions
from tests.language.pdl2.generator.rarer import Kinds, Rarer
from tests.language.pdl2.whole_jobs import Job, Page

# Around the frames of the tests' cell: middle and half width of every number.
BOXES = {
    "pose": ((150, 150), (200, 150), (250, 100), (0, 20), (168, 9), (0, 20)),
    "joints": ((-10, 8), (15, 8), (-100, 8), (20, 10), (60, 8), (0, 10)),
    "tool": ((80, 10), (-40, 10), (150, 10), (0, 0), (0, 0), (0, 0)),
    "uframe": ((1600, 30), (-300, 30), (900, 30), (0, 3), (0, 2), (0, 3)),
    "step": ((0, 30), (0, 30), (0, 30), (0, 10), (2, 2), (0, 10)),
}
OPENING = (
    (-40.0, -10.0, -80.0, -20.0, 30.0, -40.0),
    (-25.0, 0.0, -90.0, 0.0, 45.0, -20.0),
)
PARTS = (0.25, 0.2, 0.1, 0.25)  # of programs with handlers, that move, recursion, ..


class Within(Motions, Assignments, Blocks):
    """Draws poses, joint angles and frames within reach.

    Attributes:
        shares: Part of statements that are moves to the same few points.
    """

    shares: float = 0.0

    def statement(self, depth: int) -> None:
        """Write a move to a point, or any statement."""
        if self.rng.random() < self.shares:
            self.move_variable()
        else:
            super().statement(depth)

    def draw(self, kind: str) -> tuple[float, ...]:
        """Draw six numbers."""
        rng = self.rng
        return tuple(round(rng.uniform(m - w, m + w), 4) for m, w in BOXES[kind])

    def number(self) -> float:
        """Draw a component, or what is added to one."""
        return round(self.rng.uniform(10.0, 40.0), 4)

    def give_values(self) -> None:
        """Give values to what a file has beside its points."""
        self.assign_joints()
        self.extended()
        for index in ("1", "2"):
            numbers, text = self.record()
            line = f"tab[{index}] := POS({text}, '')"
            self.emit(line, "fill", index, numbers)

    def move_away(self) -> None:
        """Move all joints one way, so that every gear's side is known."""
        for numbers in OPENING:
            text = ", ".join(f"{n:.4f}" for n in numbers)
            self.emit(f"MOVE JOINT TO {{{text}}}", "move", numbers)


@dataclass
class ReachablePage(Within, Page):
    """A page within reach."""

    def assignments(self) -> None:
        """Give values to everything."""
        super().assignments()
        self.give_values()


@dataclass
class Reachable(Within, Rarer):
    """A program of one file within reach."""

    def opening(self) -> None:
        """Begin at a known place, with everything known."""
        self.move_away()
        self.give_values()


@dataclass
class ReachableJob(Within, Job):
    """A job of several files within reach."""

    page_type: type[Page] = ReachablePage

    def opening(self) -> None:
        """Begin at a known place, with everything known in all pages."""
        self.move_away()
        self.give_values()
        self.assign_point(EVERYWHERE[0])
        self.run_pages()


def reachable(
    seed: int, exact: bool, pages: bool = False, shares: float = 0.0
) -> Generated:
    """Write a program, or a job of several files, that starts at a known place."""
    rng = random.Random(seed)
    handlers, moving, recursion, functions = (rng.random() < part for part in PARTS)
    live = not exact
    kinds = Kinds(handlers, moving and live, recursion and live, functions and live)
    kind = ReachableJob if pages else Reachable
    writer = kind(rng, exact, kinds=kinds)
    writer.shares = shares
    return writer.program()
