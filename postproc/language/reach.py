"""What a call or a handler may do, through all files of the job."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from postproc.language import pdl2 as ast
from postproc.language.effects import Effects, invocations, references, rows_effects
from postproc.language.world import Place, World

HANDS_OVER = ("sensor_", "c5gopen", "c4gopen", "open_controller", "opencontrol")
FRAMES = ("tool", "base", "uframe")


@dataclass(frozen=True)
class Reached:
    """Rows that may run: those of one body, or some of them.

    Attributes:
        place: Where they stand.
        effects: What they may do.
    """

    place: Place
    effects: Effects


@dataclass(frozen=True)
class Reach:
    """All that may run because something runs.

    Attributes:
        parts: What runs first, then what it calls, in any file of the job.
        moves: It may move the arm, itself or by a routine that the job does not hold.
        frames: A routine that the job does not hold may set frames.
    """

    parts: tuple[Reached, ...]
    moves: bool
    frames: bool

    @property
    def assigned(self) -> frozenset[str]:
        """Names of variables and settings (with ``$``) that may change."""
        names = frozenset().union(*(part.effects.assigned for part in self.parts))
        return names | {f"${frame}" for frame in FRAMES if self.frames}


def reach_of(world: World, place: Place) -> Reach:
    """Follow a body into all that it calls; remembered for each body."""
    key = id(place.body)
    if key not in world.reached:
        world.reached[key] = reach_rows(world, place, place.body.first, place.body.last)
    found = world.reached[key]
    assert isinstance(found, Reach)
    return found


def reach_rows(world: World, place: Place, first: int, last: int) -> Reach:
    """Follow rows first to last - 1 of a body into all that they call."""
    parts = [Reached(place, rows_effects(place.program, first, last))]
    done, waiting = {id(place.body)}, list(_called(world, place, first, last))
    if (first, last) != (place.body.first, place.body.last):
        done.clear()  # the rest of the body may be called from these rows
    while waiting:
        one = waiting.pop()
        if id(one.body) not in done:
            done.add(id(one.body))
            rows = (one.body.first, one.body.last)
            parts.append(Reached(one, rows_effects(one.program, *rows)))
            waiting += _called(world, one, *rows)
    outside = frozenset().union(*(part.effects.calls for part in parts))
    said = {world.start.routines.get(name) for name in outside}
    return Reach(
        tuple(parts),
        any(part.effects.moves for part in parts)
        or "moves" in said
        or any(name.startswith(HANDS_OVER) for name in outside),
        "sets-frames" in said or not outside.isdisjoint(world.start.frame_tables),
    )


def _called(world: World, place: Place, first: int, last: int) -> Iterator[Place]:
    """Yield the bodies that rows name, as calls or in expressions."""
    lines = place.program.lines
    for shape in np.unique(lines.shape[first:last]).tolist():
        for name, whole in _names(place.program.statements[shape]):
            find = world.find_program if whole else world.find_routine
            found = find(place.program, name)
            if found is not None:
                yield found


def _names(statement: ast.Statement) -> Iterator[tuple[str, bool]]:
    """Yield names that may be called, and whether each is that of a program."""
    match statement:
        case ast.Label(_, then) | ast.Case(_, then) | ast.Else(then) | ast.When(then):
            if then is not None:
                yield from _names(then)
        case ast.Call(name, _, program):
            yield name, program
    for call in invocations(statement):
        yield call.name, False
    for reference in references(statement):
        if not reference.steps:
            yield reference.name, False
