"""Run a program over what is known: every way it may take, with a list of work."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language import ir
from postproc.language.analysis.call_context import At, Context
from postproc.language.analysis.found_goals import FoundGoal, FoundVisit
from postproc.language.analysis.interpreter import Interpreter
from postproc.language.analysis.origins import MANY, NOWHERE, TOLD_TOGETHER, Origins
from postproc.language.pdl2.abstract_state import GivenValues, Store
from postproc.language.pdl2.evaluate import Execution, invalidate_key, parts_under
from postproc.language.pdl2.job import Place, World
from postproc.language.pdl2.program import Body
from postproc.language.pdl2.side_effects import list_invoked
from postproc.language.pdl2.values import Nothing

MOST_AXES = 12  # auxiliary axes at the most
UNKNOWN = (math.nan,) * 6
NO_AXES = (math.nan,) * MOST_AXES
NO_SLOTS = (-1,) * 6


@dataclass(frozen=True)
class Pdl2Goal(FoundGoal):
    """Where a move goes; what is computed from a part of a position holds its numbers.

    Attributes:
        distance_mm: For NEAR and FOR.
        config: Configuration string, None where there is none.
        axes: Auxiliary axes that it names, None where they are not known.
        taught: Marked as taught with the robot.
    """

    values: tuple[float, ...] = UNKNOWN
    slots: tuple[int, ...] = NO_SLOTS
    follows: tuple[int, ...] = NO_SLOTS
    aux: tuple[float, ...] = NO_AXES
    distance_mm: float = math.nan
    config: str | None = None
    axes: tuple[int, ...] | None = ()
    taught: bool = False


@dataclass
class Pdl2Visit(FoundVisit):
    """One arrival, as it is found; `scope` is the place of its move.

    Attributes:
        at: The row of its move.
        fly: MOVEFLY.
    """

    scope: Place
    goal: Pdl2Goal
    at: int = field(kw_only=True)
    fly: bool = field(kw_only=True, default=False)

    @property
    def row(self) -> int:
        """The row of the move in its file."""
        return self.at


Key = tuple[Context, int, int]


@dataclass(kw_only=True)
class Machine(Interpreter[Store]):
    """The work in hand and what came out of it.

    Attributes:
        world: The files of the job.
        recursive: Bodies (by id) that call themselves, directly or not.
        interrupted: A condition handler may move the arm at any time.
        handler: Why no move can be compensated that a handler may interrupt.
        cycle_left: A condition handler may begin the cycle again at any time.
        given: What variables are given at any time.
    """

    world: World
    recursive: set[int] = field(default_factory=set)
    interrupted: bool = False
    handler: Reason = NO_REASON
    cycle_left: bool = False
    given: GivenValues = field(default_factory=GivenValues)
    _called: dict[int, tuple[ir.FunctionCall, ...]] = field(default_factory=dict)
    _numbers: dict[Key, int] = field(default_factory=dict)

    def record(self, here: Execution, sub: int, visit: FoundVisit) -> int:
        """Keep visits, and return their number; the last analysis of a place holds."""
        key = (here.context, here.place.offset + here.row, sub)
        number = self._numbers.setdefault(key, len(self.visits))
        if number == len(self.visits):
            self.keys.append(key)
            self.visits.append(visit)
        self.visits[number] = visit
        if MANY in visit.origins:
            here.report_once(Code.MANY_ORIGINS, str(here.row), TOLD_TOGETHER)
        return number

    def predecessors(self, here: Execution) -> Origins:
        """Return where the arm may come from."""
        last = here.store.last
        return last | NOWHERE if self.interrupted else last

    def find_calls(
        self, place: Place, statement: ir.SourceStatement
    ) -> tuple[ir.FunctionCall, ...]:
        """Return the calls in a statement's expressions that may have effects.

        A function without arguments is called by its name alone. What follows ELSE or
        CASE on its line is a statement of its own.

        Args:
            place: Where it stands.
            statement: A statement of its program: it outlives the machine.
        """
        known = self._called.get(id(statement))
        if known is None:
            own: tuple[ir.Node, ...] = (statement,)
            if ir.divides(statement):
                own = statement.values if isinstance(statement, ir.Branch) else ()
            found = list_invoked(self.world, place, *own)
            known = self._called[id(statement)] = tuple(found)
        return known

    def begin_cycle(self, context: Context, store: Store) -> bool:
        """Go on with the next cycle of the program that runs; False without one."""
        for one in context.around():
            if one.place is not None and one.place.flow.cycle >= 0:
                self.enter(At(one, one.place.flow.cycle), store)
                return True
        return False

    def calls_to(self, body: Body, context: Context) -> list[Body]:
        """Return the bodies that run since one of them was called, none if it was not.

        Below a handler of a file without a main body there is none.
        """
        found: list[Body] = []
        inner: Context | None = None
        while context is not inner and context.place is not None:
            if not context.is_round:
                found.append(context.place.body)
                if context.place.body is body:
                    return found
            inner, context = context, context.outer
        return []


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
            invalidate(here, ir.DataObject(name), why)


def escape_names(here: Execution, names: frozenset[str], why: str) -> None:
    """Keep the numbers of variables that something not followed may depend on."""
    for name in sorted(names):
        if not name.startswith("$"):
            for key in here.locate(ir.DataObject(name)).keys:
                for part in (key, *parts_under(here, key)):
                    here.world.pin(here.store.read(part), why)


def let_others_run(here: Execution) -> None:
    """Forget variables that another program may have written by now."""
    for key in here.store.exposed:
        invalidate_key(here, key, OTHERS_WRITE)
    here.store.exposed = frozenset()


def invalidate(here: Execution, reference: ir.DataObject, why: str) -> None:
    """Forget what a variable holds, unless it is a constant."""
    declared = here.world.find_declaration(here.place, reference.name)
    if declared is not None and declared.constant:
        return
    if reference.name.startswith("$"):
        name, _ = here.locate_setting(reference)
        if name in here.store.settings:
            here.store.set(**{str(name): Nothing(why)})
        return
    for key in here.locate(reference).keys:
        invalidate_key(here, key, why)
