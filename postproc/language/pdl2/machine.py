"""Run a program over what is known: every way it may take, with a list of work."""

from __future__ import annotations

import heapq
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from postproc.arrays import Ints
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.abstract_state import (
    MANY,
    MOST_ORIGINS,
    GivenValues,
    Settings,
    Store,
)
from postproc.language.pdl2.call_context import CALLED, Context, Point
from postproc.language.pdl2.evaluate import ProgramPoint, invalidate_key, parts_under
from postproc.language.pdl2.job import Place, World
from postproc.language.pdl2.program import Body, Program
from postproc.language.pdl2.side_effects import PURE, circles, invocations, references
from postproc.language.pdl2.values import Nothing, Position
from postproc.language.visits import ELSEWHERE, Meaning
from postproc.robot.trajectory import Motion

# What the analysis records of each arrival, before it becomes arrays.

Numbers = tuple[float | None, ...]
_NO_NUMBERS: Numbers = (None,) * 6


@dataclass(frozen=True, slots=True)
class Goal:
    """What a destination means.

    Attributes:
        target: What the numbers mean.
        numbers: Six numbers, None where not known.
        position: The position value where there is one.
        distance: For NEAR and FOR [mm].
        reason: Why it cannot be compensated.
    """

    target: Meaning
    numbers: Numbers = _NO_NUMBERS
    position: Position | None = None
    distance: float | None = None
    reason: Reason = NO_REASON


@dataclass(frozen=True, slots=True)
class MoveForm:
    """What moves have in common that differ in numbers and points only.

    Attributes:
        motion: Trajectory.
        reason: Why that is not known, or why none can be compensated.
        fly: MOVEFLY.
        via: The VIA point of an arc.
        slots: Number slots of the six numbers that stand in the move, () where it goes
            to something else.
        joints: Those are joint angles.
        config: The configuration string beside them, None where there is none.
        overrides: Settings that WITH sets to numbers, and the slots of these.
    """

    motion: Motion
    reason: Reason = NO_REASON
    fly: bool = False
    via: bool = False
    slots: tuple[int, ...] = ()
    joints: bool = False
    config: str | None = None
    overrides: tuple[tuple[str, int], ...] = ()


WRITTEN, HELD = -1, -2  # instead of a row of the variable file


@dataclass(frozen=True, slots=True)
class MoveRun:
    """Moves that follow each other, each from the one before; often a single one.

    Attributes:
        place: Where they stand.
        rows: Their rows, (k,).
        form: Which form each has, (k,).
        forms: The forms, by number.
        predecessors: Visits the first of them may come from.
        settings: Frames and motion variables that hold, but for overrides.
        point: Row of the variable file that each goes to, (k,); WRITTEN where the
            numbers stand in the move, HELD where its goal was evaluated.
        goals: These, by the index of the move.
        reason: Why none of them can be compensated.
    """

    place: Place
    rows: Ints
    form: Ints
    forms: Mapping[int, MoveForm]
    predecessors: frozenset[int]
    settings: Settings
    point: Ints
    goals: Mapping[int, Goal]
    reason: Reason = NO_REASON

    def __len__(self) -> int:
        """Return the number of visits."""
        return len(self.rows)


_FIRST, _HELD = np.zeros(1, dtype=np.int64), np.full(1, HELD)


@lru_cache(maxsize=64)
def _only(form: MoveForm) -> dict[int, MoveForm]:
    """Return the forms of a run of one move: the same ones for all that are alike."""
    return {0: form}


def single(
    here: Execution,
    form: MoveForm,
    predecessors: frozenset[int],
    settings: Settings,
    goal: Goal,
) -> MoveRun:
    """Return the run of one move, whose goal was evaluated."""
    row, forms = np.array([here.row]), _only(form)
    return MoveRun(
        here.place, row, _FIRST, forms, predecessors, settings, _HELD, {0: goal}
    )


# A *configuration* is a place in the program with the calls and the rounds of constant
# FOR loops that led there. Each has one store, in which all ways that lead there are
# merged; a configuration is run again when its store has changed, until nothing
# changes. Work is done in program order, so that most configurations are run once.

MAX_ROWS = 20_000  # rows of unrolled loops and of calls, each time they are run
DEEP = 64  # calls within calls, from where on it pays to know which call themselves
MAX_STEPS = 8_000_000  # configurations run, calls and unrolled rows, all in all

Key = tuple[Context, int, int]


@dataclass
class Execution(ProgramPoint):
    """A point of the execution with the way that led to it."""

    context: Context = field(default_factory=Context)
    reason: Reason = NO_REASON  # why nothing here may be compensated


@dataclass
class Machine:
    """The work in hand and what came out of it.

    Attributes:
        world: The files of the job.
        root: The context of the main part.
        arrivals: Runs of visits, by place; the last analysis of a place holds.
        ids: First visit id of each.
        places: Program and body of each context.
        entries: The store of each configuration.
        ranges: (first, step, rounds) of constant loops, by context and row.
        widened: Loops that are not unrolled.
        recursive: Bodies (by id) that call themselves, directly or not.
        interrupted: A condition handler may move the arm at any time.
        handler: Why no move can be compensated that a handler may interrupt.
        cycle_left: A condition handler may begin the cycle again at any time.
        exhausted: The program is too complex to be followed to the end.
        paused: Visits behind which the arm may stop before the program goes on.
        lost: Visits behind which it may go anywhere.
        given: What variables are given at any time.
    """

    world: World
    root: Context = field(default_factory=Context)
    arrivals: dict[Key, MoveRun] = field(default_factory=dict)
    ids: dict[Key, int] = field(default_factory=dict)
    places: dict[Context, Place] = field(default_factory=dict)
    entries: dict[tuple[Context, int], Store] = field(default_factory=dict)
    ranges: dict[tuple[Context, int], tuple[float, float, int]] = field(
        default_factory=dict
    )
    widened: set[tuple[Context, int]] = field(default_factory=set)
    volatile: frozenset[str] = frozenset()
    recursive: set[int] = field(default_factory=set)
    interrupted: bool = False
    handler: Reason = NO_REASON
    cycle_left: bool = False
    exhausted: bool = False
    paused: set[int] = field(default_factory=set)
    lost: set[int] = field(default_factory=set)
    given: GivenValues = field(default_factory=GivenValues)
    rows: int = 0
    _heap: list[tuple[Point, int]] = field(default_factory=list)
    _queued: set[tuple[Context, int]] = field(default_factory=set)
    _called: dict[int, tuple[ast.Invoke, ...]] = field(default_factory=dict)
    _offsets: dict[int, int] = field(default_factory=dict)
    next_id: int = 0

    def __post_init__(self) -> None:
        offset = 0
        for program in self.world.programs():
            self._offsets[id(program)] = offset
            offset += len(program.lines) + 1

    # ---- places ---------------------------------------------------------------------
    def position(self, program: Program, row: int) -> int:
        """Return the job-wide index of a row."""
        return self._offsets[id(program)] + row

    def enter(self, context: Context, place: Place) -> None:
        """Say where a context is."""
        self.places[context] = place

    def visit_id(self, key: Key, count: int = 1) -> int:
        """Return the first id of the visits of a place."""
        if key not in self.ids:
            self.ids[key] = self.next_id
            self.next_id += count
        return self.ids[key]

    def record(self, here: Execution, sub: int, arrival: MoveRun) -> int:
        """Keep visits; return the id of the first."""
        key = (here.context, self.position(here.place.program, here.row), sub)
        self.arrivals[key] = arrival
        if MANY in arrival.predecessors:
            here.world.report_once(
                here.place.program, here.row, Code.MANY_ORIGINS, str(here.row),
                f"more than {MOST_ORIGINS} moves may come before this one: they are "
                "not followed separately, and the approach direction is not known",
            )  # fmt: skip
        return self.visit_id(key, len(arrival))

    def predecessors(self, here: Execution) -> frozenset[int]:
        """Return where the arm may come from."""
        last = here.store.last
        return last | {ELSEWHERE} if self.interrupted else last

    # ---- work -----------------------------------------------------------------------
    def push(self, context: Context, row: int, store: Store) -> None:
        """A way leads to a row with what is known there."""
        context = self._inside(context, row)
        config = (context, row)
        known = self.entries.get(config)
        if known is None:
            self.entries[config] = store.copy()
        elif not known.merge(store):
            return
        if config not in self._queued:
            self._queued.add(config)
            at = self.position(self.places[context].program, row)
            heapq.heappush(self._heap, (Point(context, at), row))

    def go_on(self, context: Context, row: int, store: Store) -> None:
        """Go on with a row as the one after the last: ELSE and CASE end a branch."""
        place = self.places[context]
        if row < place.body.last:
            statement = place.program.statement(row)
            if isinstance(statement, ast.Case | ast.Else):
                row = place.body.blocks.end.get(row, row)
        self.push(context, row, store)

    def _inside(self, context: Context, row: int) -> Context:
        """Drop the rounds of loops that a jump to a row leaves."""
        place = self.places[context]
        while context.is_round:
            start = context.at - self._offsets[id(place.program)]
            if start < row <= place.body.blocks.end[start]:
                break
            context = context.outer
        return context

    def next(self) -> Execution | None:
        """Take the first piece of work, None when all is done."""
        if not self._heap:
            return None
        point, row = heapq.heappop(self._heap)
        context = point.context
        config = (context, row)
        self._queued.discard(config)
        self.rows += 1
        if self.rows > MAX_STEPS:
            self.exhausted = True
            return None
        store = self.entries[config].copy()
        return Execution(
            self.world, self.places[context], row, store, self.volatile, context
        )

    def find_calls(
        self, place: Place, statement: ast.Statement
    ) -> tuple[ast.Invoke, ...]:
        """Return the calls in a statement's expressions that may have effects.

        A function without arguments is called by its name alone.
        """
        known = self._called.get(id(statement))
        if known is None:
            found = [c for c in invocations(statement) if c.name not in PURE]
            names = {r.name for r in references(statement) if not r.steps}
            alone = [n for n in names if self.world.is_function(place, n)]
            found += [ast.Invoke(name, ()) for name in sorted(alone)]
            known = self._called[id(statement)] = tuple(found)
        return known

    def begin_cycle(self, here: Execution, store: Store) -> bool:
        """Go on with the next cycle of the program that runs; False without one."""
        context = here.context
        while True:
            cycle = self.places[context].body.blocks.cycle
            if cycle >= 0:
                self.push(context, cycle, store)
                return True
            if context is self.root:
                return False
            context = context.outer

    # ---- calls ----------------------------------------------------------------------
    def calls_to(self, body: Body, context: Context) -> list[Body]:
        """Return the bodies that run since one of them was called, none if it was not.

        Below a handler of a file without a main body there is none.
        """
        if context.depth > DEEP and id(body) not in self._circles:
            return []
        found: list[Body] = []
        while True:
            place = None if context.is_round else self.places.get(context)
            if place is not None:
                found.append(place.body)
                if place.body is body:
                    return found
            if context is self.root:
                return []
            context = context.outer

    @cached_property
    def _circles(self) -> frozenset[int]:
        """Bodies (by id) that may call themselves, directly or not."""
        return circles(self.world)

    def leave(self, here: Execution, by_return: bool = False) -> None:
        """The body ends: go back to the caller, or into the next cycle."""
        context = here.context
        while context.is_round:
            context = context.outer
        blocks = here.place.body.blocks
        if not by_return and blocks.cycle >= 0 and not here.place.body.name:
            self.push(context, blocks.cycle, here.store)
        elif context.kind == CALLED:
            for name in here.place.body.own_names:
                here.store.drop(here.world.root(here.place, name))
            caller = self.places[context.outer]
            row = context.at - self._offsets[id(caller.program)]
            self.go_on(context.outer, row + 1, here.store)

    def call(self, here: Execution, place: Place) -> None:
        """Go into a routine; it comes back to the row after this one."""
        at = self.position(here.place.program, here.row)
        context = here.context.within(at, CALLED)
        self.enter(context, place)
        self.rows += 1
        self.push(context, place.body.first + 1, here.store)


OTHERS_WRITE = (
    "another program may write it (it is exported); if none does, name it under "
    "[variables] constant in the cell file"
)

# What is no longer known, and what must stay because something may depend on it.


def invalidate_names(here: Execution, names: frozenset[str], why: str) -> None:
    """Forget variables and settings (with ``$``) by name."""
    for name in names:
        if name.startswith("$"):
            here.store.set(**{name[1:]: Nothing(why)})
        elif name:
            invalidate(here, ast.Reference(name), why)


def escape_names(here: Execution, names: frozenset[str], why: str) -> None:
    """Keep the numbers of variables that something not followed may depend on."""
    for name in sorted(names):
        if not name.startswith("$"):
            for key in here.locate(ast.Reference(name)).keys:
                for part in (key, *parts_under(here, key)):
                    here.world.pin(here.store.read(part), why)


def let_others_run(here: Execution) -> None:
    """Forget variables that another program may have written by now."""
    for key in here.store.exposed:
        invalidate_key(here, key, OTHERS_WRITE)
    here.store.exposed = frozenset()


def invalidate(here: Execution, reference: ast.Reference, why: str) -> None:
    """Forget what a variable holds, unless it is a constant."""
    declared = here.world.find_declaration(here.place, reference.name)
    if declared is not None and declared.constant:
        return
    if reference.name.startswith("$"):
        part = here.frame_part(reference)
        name = here.setting_name(reference) if part is None else part[0]
        if name in here.store.settings:
            here.store.set(**{str(name): Nothing(why)})
        return
    for key in here.locate(reference).keys:
        invalidate_key(here, key, why)
