"""Follow a RAPID task from its main routine: every arrival, and where it comes from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, TypeGuard

from postproc.diagnostics import Code, Reason
from postproc.language import ir
from postproc.language.analysis.assigned_points import Scope
from postproc.language.analysis.call_context import At, Context
from postproc.language.analysis.declarations import TaskRoutine
from postproc.language.analysis.origins import NOWHERE, join_origins
from postproc.language.analysis.task_machine import (
    MOVES,
    Arrived,
    Effects,
    TaskMachine,
    scope_at,
)
from postproc.language.rapid import errors
from postproc.language.rapid import syntax as said
from postproc.language.rapid.instructions import (
    BY_NAME,
    MOTIONS,
    NAMES,
    STILL_FUNCTIONS,
    SYNCHRONOUS,
    WAITING,
    read_known_instructions,
)
from postproc.language.rapid.modal_state import (
    ANYTHING,
    AT_START,
    HARMLESS,
    RapidModeReader,
)
from postproc.language.rapid.moves import (
    RapidGoal,
    pose_of,
)
from postproc.language.rapid.program import is_move
from postproc.language.rapid.symbols import RapidTask, as_assignment
from postproc.language.visits import START

PROCESSES = ("arc", "disp", "paint", "cap")  # moves that an error of theirs ends
STOPPED = ("storepath", "clearpath", "stopmovereset")  # somewhere on its path


@dataclass
class RapidMachine(TaskMachine):
    """The ways through a RAPID task.

    Attributes:
        task: Its modules.
        ends: What holds where the main routine ends.
        restarts: What holds where a cycle ends before that.
    """

    procedures = ("proc",)
    reader = RapidGoal
    still = NAMES["still"] | HARMLESS | STILL_FUNCTIONS
    acting = (ir.Instruction,)
    passed = (ir.Declaration, said.ConnectTrap, ir.Assignment, said.TypeAlias)
    task: RapidTask = field(kw_only=True)
    ends: list[Arrived] = field(default_factory=list)
    restarts: list[Arrived] = field(default_factory=list)
    _handlers: dict[tuple[int, int], errors.ErrorHandlers] = field(default_factory=dict)
    _exits: dict[Context, tuple[errors.ErrorExit, ...]] = field(default_factory=dict)

    def run(self) -> None:
        """Follow every way from the main routine."""
        self.task.frames.clear()  # another machine took fewer data as changing
        self.task.conditions.clear()
        mains = self.task.routines.get("main", [])
        found = mains if len(mains) == 1 else self._of_kind("proc")
        here = self.begin(frozenset([START]), AT_START)
        if len(mains) != 1:
            here = here.forget()
            self.say(Scope(0, "", "", row=0), Code.NO_MAIN, _NO_MAIN)
        if any(map(self.routine_effects, self._of_kind("trap"))):
            here = here.blocking(_TRAP)
        for routine in found:
            self.call_routine(routine, None, here)
        self.follow()
        again = self._next_cycle(here)
        if len(mains) == 1 and again != here:
            self.call_routine(mains[0], None, again)
            self.follow()

    def _next_cycle(self, here: Arrived) -> Arrived:
        """Return how main begins again: from where, and with what, a cycle ends.

        The controller sets modes to what it starts with only where the program is
        started from its beginning. What an unknown call leaves unknown does not count,
        which would leave whole programs, unless the task itself sets that mode.
        """
        modes, own = here.modes, self._own_modes()
        for end in (*self.ends, *self.restarts):
            modes = modes.continue_cycle(end.modes, modes.names(), own)
        origins = here.origins | (NOWHERE if self.restarts else frozenset())
        for end in self.ends:
            origins = join_origins(origins, end.origins, self.lost)
        return self.begin(origins, modes)

    def _own_modes(self) -> set[str]:
        """Return the modes that the task sets to other values than it begins with."""
        known, found = read_known_instructions(), set[tuple[str, Any]]()
        modal = {name for name, kind in known.items() if kind == "modal"}
        modal -= {*self.task.routines, *STOPPED}
        for routine in self.task.every_routine:
            scope, rows = self.task.scope_of(routine), routine.inside
            text = self.texts[routine.file]
            for row in text.where(
                lambda one: getattr(ir.inside(one), "name", "") in modal,
                rows.start, rows.stop,
            ):  # fmt: skip
                one = ir.inside(text.statement(row))
                if isinstance(one, ir.Instruction):
                    given = self._modes(scope.at(row)).list_set(one)
                    found |= set() if given >= ANYTHING else given
        return {name for name, value in found if value != getattr(AT_START, name)}

    def _of_kind(self, kind: str) -> list[TaskRoutine]:
        """Return all routines of a kind."""
        return [one for one in self.task.every_routine if one.rows.head.kind == kind]

    is_move = staticmethod(is_move)

    @staticmethod
    def usual_step(first: float, last: float) -> float:
        """Count up or down."""
        return 1.0 if last >= first else -1.0

    def reads_at_once(self, context: Context) -> bool:
        """Return False where an error may lead to any statement.

        No moves are where procedures are called on the way of some: these may set what
        the moves behind are made with, until the arm stops.
        """
        alone = self._exits_of(context) or self.task.find_calls & {*SYNCHRONOUS}
        return super().reads_at_once(context) and not alone

    def is_setting(self, one: ir.SourceStatement) -> bool:
        """Return True for instructions that move nothing, and that set modes alone.

        The arm does not wait for them; they call nothing, and give no data a value
        that is followed.
        """
        if not isinstance(one, ir.Instruction) or one.name in self.task.routines:
            return False
        known = read_known_instructions().get(one.name) in ("still", "modal")
        waits = one.name in WAITING or one.name in STOPPED
        if not known or waits or self.declares_motionless(one.name):
            return False
        return not (as_assignment(one, ()) or ir.calls_in(one))

    def at_call(self, context: Context, here: Arrived) -> Arrived:
        """Leave a routine whose error handler moves."""
        return here.blocking(_HANDLER) if self._handlers_of(context).moves else here

    def at_return(self, context: Context, here: Arrived) -> Arrived:
        """Note the end of a cycle; forget what a handler may have changed."""
        if context.outer is self.root:
            self.ends.append(self._end_blocking(None, here))
        handlers = self._handlers_of(context)
        if not handlers.moves:
            return here
        return self._end_blocking(context.outer, _after(handlers, here))

    def _end_blocking(self, context: Context | None, here: Arrived) -> Arrived:
        """Return it where the program goes on in a routine, None for the next cycle.

        A handler acts while its routine, or one that this calls, runs; but that of a
        process error may act on a move behind which the routine has ended.
        """
        around = (one for one in context.around() if one.place) if context else ()
        acts = "procerrrecovery" in self.task.find_calls or any(
            self._handlers_of(one).moves for one in around
        )
        blocked = here.modes.blocked - {_HANDLER}
        return here if acts else here.setting(blocked=blocked)

    # Errors.

    def _handlers_of(self, context: Context) -> errors.ErrorHandlers:
        """Read the error handlers of a routine once."""
        place = context.place
        key = place.routine.key
        if key not in self._handlers:
            scope = replace(place.scope, given=(), loops=())
            text = self.texts[scope.file]

            def read(operand: ir.Operand | None, row: int) -> str:
                return errors.key_of(operand, self.task.number(operand, scope.at(row)))

            clauses = errors.HandlerReader(text, read).clauses(place.flow)
            rows = place.flow.handlers
            effects, called = self.read_rows(scope, rows, (errors.EXIT_CYCLE,))
            inner = frozenset().union(*map(self.routine_effects, called))
            if moves := bool(effects | inner):
                self.beside.add((scope.file, rows.start, rows.stop))
            but = errors.EXIT_CYCLE, *(MOTIONS.keys() - {*SYNCHRONOUS})
            sets = bool(self.read_rows(scope, rows, but)[0] | inner)
            self._handlers[key] = errors.ErrorHandlers(clauses, moves, sets)
        return self._handlers[key]

    def _exits_of(self, context: Context) -> tuple[errors.ErrorExit, ...]:
        """Find where the program goes on behind errors raised in a routine."""
        if context not in self._exits:
            self._exits[context] = tuple(errors.exits_of(context, self._handlers_of))
        return self._exits[context]

    def _fail(self, at: At, one: ir.SourceStatement, here: Arrived) -> None:
        """Allow for an error that a statement raises and another routine handles.

        The routine's own handler may skip a statement whose operands are not known
        before it runs. Otherwise it changes nothing of how the arm comes there.
        """
        for way in self._exits_of(at.context):
            beside = way.beside(at)
            if not self._may_raise(one, way.numbers):
                continue
            if not beside:
                self._handle(at, way, here.elsewhere())
            elif beside.row > at.row and errors.may_be_skipped(one):
                self._handle(at, way, here)

    def _may_raise(self, one: ir.SourceStatement, numbers: errors.Numbers) -> bool:
        return errors.may_raise(one, numbers, self.task.routines, self.task.declared)

    def _interrupt(self, at: At, one: ir.Instruction, here: Arrived) -> None:
        """Allow for an error that ends a move on its way."""
        always = (
            one.name.startswith(PROCESSES) or "procerrrecovery" in self.task.find_calls
        )
        for way in self._exits_of(at.context):
            named = way.numbers is not None and bool(way.numbers & errors.PATH_ERRORS)
            if way.own and (named or (always and self._may_raise(one, way.numbers))):
                self._handle(at, way, here.elsewhere())

    def _handle(self, at: At, way: errors.ErrorExit, here: Arrived) -> None:
        """Go on behind an error."""
        here = _after(way, here)
        to = way.beside(at) or way.at
        if not way.own:
            here = self._end_blocking(to and to.context, here)
        if to is not None:
            self.go_on(to, here)
        elif way.restarts:
            self.restarts.append(here)
        else:
            self.ends.append(here)

    def leave_otherwise(self, at: At, one: ir.Leave, here: Arrived) -> None:
        """Go on behind ``RAISE``; behind ``EXIT`` the program stops."""
        if one.word != "raise":
            return
        number = self.task.number(one.value, scope_at(at))
        raised = errors.numbers_of(
            [one.value], lambda value: errors.key_of(value, number)
        )
        for way in self._exits_of(at.context):
            shared = errors.common(way.numbers, raised)
            if shared is None or shared:
                self._handle(at, way, here)

    def part_otherwise(
        self, at: At, one: ir.SourceStatement, here: Arrived
    ) -> Arrived | None:
        """Go on behind a call whose procedure only the run tells."""
        if isinstance(one, said.LateCall):  # of which procedures, a text may say
            if _is_text(one.procedure):
                self.run_named_beside(_name_procedure(one.procedure))
            else:
                self._run_all_beside()
        return super().part_otherwise(at, one, here)

    def may_jump(self, at: At, here: Arrived) -> None:
        """Begin a cycle as well, see `TaskMachine.may_jump`."""
        super().may_jump(at, here)
        if errors.EXIT_CYCLE in at.place.text.words([at.row]):
            self.restarts.append(here)

    def _run_all_beside(self) -> None:
        """Note that every procedure may be called."""
        for routine in self._of_kind("proc"):
            self.run_beside(routine)

    def calls_of(self, one: ir.SourceStatement) -> Iterable[TaskRoutine]:
        """Return all procedures where a text names the one that is called."""
        inner = ir.inside(one)
        if isinstance(inner, said.LateCall) or getattr(inner, "name", "") == BY_NAME:
            return self._of_kind("proc")
        return super().calls_of(one)

    def is_beside(self, one: ir.SourceStatement) -> bool:
        """Return True if a move calls a procedure on its way."""
        return getattr(ir.inside(one), "name", "") in SYNCHRONOUS

    def list_handlers(self, routine: TaskRoutine) -> Iterator[tuple[int, int, int]]:
        """Yield the rows from the first handler on."""
        if rows := routine.rows.flow.handlers:
            yield routine.file, rows.start, rows.stop

    # What instructions do.

    def carry_out(self, at: At, one: ir.Instruction, here: Arrived) -> Arrived | None:
        """Run an instruction; None where it goes on in a routine."""
        here = self.after_functions(at, one, here)
        name = one.name
        if (given := as_assignment(one, self.task.routines)) is not None:
            return self.assign_point(at, given, here)
        if name in MOTIONS and name not in self.task.routines:
            return self._move(at, one, here)
        if name in self.task.routines:
            return self.call_named(at, name, here)
        kind = read_known_instructions().get(name)
        if name in WAITING or self.declares_motionless(name):
            self.pause(here)
        if name == errors.EXIT_CYCLE:
            self.restarts.append(here)
            return None
        if name in STOPPED:
            self.lost |= here.origins
            return here.forget()
        if kind == "modal":
            changed = self._modes(scope_at(at, here)).change(one, here.modes)
            return here.with_modes(changed.allowing())
        if kind in ("still", "modal") or self.declares_motionless(name):
            return here
        if name == BY_NAME:
            self._run_all_beside()
        if kind == "left" and name not in self.task.start.routines:
            return self.unknown(at, here, _LEFT)
        return self.outside(at, name, here)

    def _modes(self, scope: Scope) -> RapidModeReader:
        """Return what carries out instructions that stand somewhere.

        A displacement is not known that was taught, and contains the arm's error.
        """

        def pose(operand: ir.Operand | None) -> tuple[float, ...]:
            value = self.task.value(operand, scope)
            taught = self.task.holds_taught(operand, value, scope)
            return () if taught else pose_of(value)

        load = RapidGoal(self.task, scope).load
        return RapidModeReader(lambda x: self.task.number(x, scope), pose, load)

    def _move(self, at: At, one: ir.Instruction, here: Arrived) -> Arrived:
        """Record the visits of a move."""
        self._interrupt(at, one, here)
        after = self.arrive(at, one, here)
        (last,) = after.origins
        if math.isnan(self.visits[last].zone_mm):
            after = after.with_modes(after.modes.settle())
        if one.name in SYNCHRONOUS:
            return self._synchronous(at, one, after)
        return after

    def _synchronous(self, at: At, one: ir.Instruction, here: Arrived) -> Arrived:
        """Allow for the procedure that a move calls while the program runs ahead."""
        placed = [argument.value for argument in one.arguments if not argument.name]
        called = placed[-1] if placed else None
        name = _name_procedure(called) if _is_text(called) else ""
        if self.declares_motionless(name) and name not in self.task.routines:
            return here
        found = self.task.routine(name, at.place.scope)
        given = None if found is None else self._list_set_modes(found)
        if given is None:
            self.run_named_beside(name)
            what = "calls a procedure on its way that may move the arm"
            what = what if found else f"{what}: it is in no file of the task"
            here = self.unknown(at, here, what)
        return here.with_modes(
            here.modes.allowing(ANYTHING if given is None else given)
        )

    def _list_set_modes(
        self, routine: TaskRoutine
    ) -> frozenset[tuple[str, Any]] | None:
        """Return the modes that a procedure may set; None where it may move the arm."""
        if not self.routine_effects(routine):
            return frozenset()
        scope, found = self.task.scope_of(routine), set[tuple[str, Any]]()
        for row in routine.inside:
            one = self.texts[routine.file].statement(row)
            names = (call.name for call in self.list_asked(one))
            effects, called = self.read_calls(names, scope)
            if effects.union(*map(self.routine_effects, called)):
                return None
            one = ir.inside(one)
            own = isinstance(one, ir.Instruction) and one.name in self.task.routines
            if isinstance(one, ir.Instruction) and not own:
                kind = read_known_instructions().get(one.name)
                if kind == "modal" and one.name not in STOPPED:
                    found |= self._modes(scope.at(row)).list_set(one)
                    continue
                if kind == "still" or self.declares_motionless(one.name):
                    continue
            if own or isinstance(one, ir.Instruction) or self.own_effects(one):
                return None
        return frozenset(found)

    def after_functions(
        self, at: At, one: ir.SourceStatement, here: Arrived
    ) -> Arrived:
        """Allow for what the functions of a statement do, and for its errors."""
        for name in (call.name for call in self.list_asked(one)):
            if name in WAITING and name not in self.task.routines:
                self.pause(here)
            here = self.call_function(at, name, here)
        self._fail(at, one, here)
        return here

    # What a routine may do, read off its text.

    def own_effects(self, one: ir.SourceStatement) -> Effects:
        """Return that what is not understood, or called late, may move."""
        odd = isinstance(ir.inside(one), said.LateCall | ir.NotUnderstood)
        return frozenset([MOVES] if odd else [])

    def names_called(self, one: ir.SourceStatement) -> Iterable[str]:
        """Add what a move calls on its way, by a text."""
        yield from super().names_called(one)
        one = ir.inside(one)
        if isinstance(one, ir.Instruction) and one.name in SYNCHRONOUS:
            yield from map(_name_procedure, filter(_is_text, one.values))


_NO_MAIN = (
    "no single PROC main: from where these routines are called, and with what "
    "settings, is not known. Give the module that holds main, with the others of its "
    "task in the same folder"
)
_LEFT = "may move the arm, or change how it moves, in a way that is not followed"
_TRAP = Reason(
    Code.BESIDE_PROGRAM,
    "a TRAP of the task may move the arm, or change its settings, at any time",
)
_HANDLER = Reason(
    Code.BESIDE_PROGRAM,
    "the error handler of its routine may move the arm, or change its settings",
)


def _after(one: errors.ErrorHandlers | errors.ErrorExit, here: Arrived) -> Arrived:
    """Forget what handlers may have changed."""
    if one.sets:
        return here.forget()
    return here.elsewhere() if one.moves else here


def _is_text(operand: ir.Operand | None) -> TypeGuard[ir.StringLiteral]:
    return isinstance(operand, ir.StringLiteral)


def _name_procedure(text: ir.StringLiteral) -> str:
    """Return the procedure that a text names, without its module."""
    return text.text.strip('"').lower().rpartition(":")[2]
