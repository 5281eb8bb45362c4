"""Follow a program of one statement a time: every arrival, and where it comes from."""

from __future__ import annotations

from abc import abstractmethod
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, TypeVar

from postproc.diagnostics import Code, Reason
from postproc.language import ir
from postproc.language.analysis.assigned_points import NO_POINTS, Points, Scope
from postproc.language.analysis.call_context import CALLED, At, Context
from postproc.language.analysis.call_graph import reach
from postproc.language.analysis.control_flow import ControlFlow
from postproc.language.analysis.declarations import TaskRoutine
from postproc.language.analysis.interpreter import (
    NOT_UNROLLED,
    calls_around,
)
from postproc.language.analysis.origins import (
    MANY,
    NOWHERE,
    TOLD_TOGETHER,
    Origins,
    join_origins,
)
from postproc.language.analysis.symbols import TaskSymbols
from postproc.language.analysis.task_blocks import BlockMachine
from postproc.language.text.statement_table import StatementText
from postproc.language.visits import Diagnostic

DEEPEST = 60  # calls within calls


@dataclass(frozen=True, eq=False)
class TaskPlace:
    """A call of a routine, or a round of one of its loops.

    Attributes:
        scope: Where its statements stand, and what they know of loops and parameters.
        routine, flow: The routine.
        text: The statements of its file.
        offset: Job-wide index of the first of these.
    """

    scope: Scope
    routine: TaskRoutine
    flow: ControlFlow
    text: StatementText[Any]
    offset: int

    def statement(self, row: int) -> Any:
        """Return what a row of its file says."""
        return self.text.statement(row)


@dataclass(frozen=True)
class Arrived:
    """How the arm may come to a statement.

    Attributes:
        origins: Where it may come from.
        modes: What moves are carried out with.
        points: What points hold that assignments have changed, as far as it is known.
        lost: See `Interpreter`; shared by all ways.
    """

    origins: Origins
    modes: Any
    points: Points = NO_POINTS
    lost: set[int] = field(default_factory=set, compare=False)

    def copy(self) -> Arrived:
        """Return it: it never changes."""
        return self

    def join(self, other: Arrived) -> Arrived:
        """Allow for another way here."""
        if self == other:
            return self
        modes = self.modes
        if modes != other.modes:
            modes = modes.join(other.modes)
        points = self.points.join(other.points)
        origins = join_origins(self.origins, other.origins, self.lost)
        both = Arrived(origins, modes, points, self.lost)
        return self if both == self else both

    def forget(self) -> Arrived:
        """Forget where the arm is, what moves are made with, and all shared data."""
        modes, points = self.modes.forget(), self.points.forget_shared()
        return Arrived(NOWHERE, modes, points, self.lost)

    def elsewhere(self) -> Arrived:
        """Forget where the arm is."""
        return self.arriving(NOWHERE)

    def arriving(self, origins: Origins) -> Arrived:
        """Return it where the arm comes from elsewhere."""
        return Arrived(origins, self.modes, self.points, self.lost)

    def with_points(self, points: Points) -> Arrived:
        """Return it where points hold something else."""
        return self if points is self.points else replace(self, points=points)

    def with_modes(self, modes: Any) -> Arrived:
        """Return it where moves are made otherwise."""
        if modes is self.modes:
            return self
        return Arrived(self.origins, modes, self.points, self.lost)

    def setting(self, **changed: Any) -> Arrived:
        """Return it where some modes have other values."""
        return self.with_modes(self.modes.with_(**changed))

    def blocking(self, why: Reason) -> Arrived:
        """Return it where targets cannot be compensated from here on, and why."""
        return self.setting(blocked=self.modes.blocked | {why})


JUMPS = frozenset("goto return exit exitcycle raise retry trynext".split())
"""Words with which a statement leads to another place."""
MOVES = "moves"
Effects = frozenset[str]
"""What statements may do to moves: `MOVES`, or more that a language names."""
RECURSIVE = "calls itself: it is not followed"
NOT_FOLLOWED = "is not followed, and may move the arm"
_PLAIN = (ir.SourceStatement, ir.LabelMark)
M = TypeVar("M", bound="TaskMachine")


@dataclass
class TaskMachine(BlockMachine[Arrived]):
    """The ways through a task.

    Attributes:
        procedures: Kinds of routines that are followed where they are called.
        acting: Statements that move, call, or change what moves are made with; they
            lead to the next statement or into a routine.
        passed: Statements that lead to the next one and do nothing.
        still: Names of what is known not to move, nor to change how moves are made.
        diagnostics: What else was found.
        beside: Statements that run in ways that are not followed: file, first row, and
            the row behind the last.
    """

    procedures: ClassVar[Collection[str]]
    acting: ClassVar[tuple[type[ir.SourceStatement], ...]]
    passed: ClassVar[tuple[type[ir.SourceStatement], ...]]
    still: ClassVar[Collection[str]]
    diagnostics: set[Diagnostic] = field(default_factory=set)
    beside: set[tuple[int, int, int]] = field(default_factory=set)
    _numbers: dict[At, list[int]] = field(default_factory=dict)
    _read: dict[tuple[int, int], tuple[Effects, list[TaskRoutine]]] = field(
        default_factory=dict
    )
    _effects: dict[tuple[int, int], Effects] = field(default_factory=dict)
    _recursive: dict[tuple[int, int], bool] = field(default_factory=dict)
    _changes: dict[tuple[int, int], frozenset[str]] = field(default_factory=dict)
    _asked: dict[int, tuple[ir.SourceStatement, Sequence[ir.Node]]] = field(
        default_factory=dict
    )

    def __post_init__(self) -> None:
        """Let assignments read where moves to points lead."""
        self.task.reader = self.reader

    # What a language says.

    @abstractmethod
    def run(self) -> None:
        """Follow every way from where the task begins."""

    @abstractmethod
    def carry_out(self, at: At, one: Any, here: Arrived) -> Arrived | None:
        """Carry an acting statement out; None where it goes on in a routine."""

    @abstractmethod
    def after_functions(
        self, at: At, one: ir.SourceStatement, here: Arrived
    ) -> Arrived:
        """Allow for what the functions of a statement do."""

    @abstractmethod
    def own_effects(self, one: ir.SourceStatement) -> Effects:
        """Return what a statement may do to moves, but for what it calls."""

    def is_still(self, name: str) -> bool:
        """Return True if what is no routine of the task is known not to move."""
        return name in self.still or self.declares_motionless(name)

    @abstractmethod
    def is_move(self, one: ir.SourceStatement) -> bool:
        """Return True if a statement moves."""

    def planner_of(self, one: Any) -> str:
        """Return what plans a move, where there are several that tell moves apart."""
        return ""

    def is_asked(self, part: ir.Node) -> bool:
        """Return True if it counts that a statement asks for something as it runs."""
        return isinstance(part, ir.FunctionCall)

    def names_called(self, one: ir.SourceStatement) -> Iterable[str]:
        """Return the names of what a statement calls where it runs."""
        return [part.name for part in self.task.values_of(one)
                if isinstance(part, ir.Instruction | ir.FunctionCall)]  # fmt: skip

    def list_asked(self, one: ir.SourceStatement) -> Sequence[Any]:
        """List what a statement asks for as it runs, of what counts."""
        if id(one) not in self._asked:
            found = tuple(filter(self.is_asked, self.task.values_of(one)))
            self._asked[id(one)] = one, found
        return self._asked[id(one)][1]

    def part_otherwise(
        self, at: At, one: ir.SourceStatement, here: Arrived
    ) -> Arrived | None:
        """Go on behind a statement that only this language has."""
        after = self.unknown(at, here)
        if isinstance(one, ir.NotUnderstood):
            self.may_jump(at, after)
        return after

    def may_jump(self, at: At, here: Arrived) -> None:
        """Go wherever a statement that is not understood may lead, by its words."""
        if JUMPS.isdisjoint(at.place.text.words([at.row])):
            return
        flow = at.place.flow
        for to in sorted(flow.joins | {end + 1 for end in flow.head}):
            self.go_on(at.to(to), here)
        self.leave(at.context, here)

    def scopes_of(
        self, routine: TaskRoutine, seen: frozenset[tuple[int, int]] = frozenset()
    ) -> Iterator[Scope]:
        """Yield where the statements of a routine stand, by all calls of it.

        Args:
            routine: The routine.
            seen: Keys of routines that are being looked at.
        """
        yield self.task.scope_of(routine)
        head = routine.rows.head
        if not head.parameters or routine.key in seen:
            return
        seen = seen | {routine.key}
        for caller, row, call in self._calls_by_name[head.name]:
            for there in self.scopes_of(caller, seen):
                bound = self._bind(routine, call, there.at(row))
                if bound is not None:
                    yield bound

    @cached_property
    def _calls_by_name(
        self,
    ) -> Mapping[str, list[tuple[TaskRoutine, int, ir.Instruction]]]:
        """Return all calls of routines of the task, and where they stand."""
        found = defaultdict[str, list[tuple[TaskRoutine, int, ir.Instruction]]](list)
        for routine in self.task.every_routine:
            for row in routine.inside:
                one = ir.inside(self.texts[routine.file].statement(row))
                if isinstance(one, ir.Instruction):
                    found[one.name].append((routine, row, one))
        return found

    def is_beside(self, one: Any) -> bool:
        """Return True if a statement runs otherwise than it is followed.

        No name with a digit decides that.
        """
        return False

    def list_handlers(self, routine: TaskRoutine) -> Iterable[tuple[int, int, int]]:
        """Yield the handlers of a routine, as `beside`."""
        return ()

    def at_call(self, context: Context, here: Arrived) -> Arrived:
        """Allow for what may happen in a routine as long as it runs."""
        return here

    def at_return(self, context: Context, here: Arrived) -> Arrived:
        """Allow for other ends of a routine."""
        return here

    def read_visits(
        self, one: ir.SourceStatement, scope: Scope, here: Arrived | None
    ) -> Iterable[Any]:
        """Read the visits of a move, nothing for all else.

        Args:
            one: The statement.
            scope: Where it stands.
            here: How the arm comes to it, None where that does not count.
        """
        one = ir.inside(one)
        if not self.is_move(one):
            return ()
        modes, points = (here.modes, here.points) if here else (None, NO_POINTS)
        there = replace(scope, points=points) if points.routines else scope
        return self.reader(self.task, there).visits(one, scope, modes)

    # From statement to statement, see `Interpreter`.

    def act(self, at: At, one: ir.SourceStatement, state: Arrived) -> Arrived | None:
        """Carry out a statement that leads to the next one."""
        if isinstance(one, self.acting):
            after = self.carry_out(at, one, state)
            return None if after is None or self._went_on(at, after) else after
        state = self.after_functions(at, one, state)
        if type(one) in _PLAIN or isinstance(one, self.passed):
            return self.assign_point(at, one, state)
        return self.part_otherwise(at, one, state)

    def _went_on(self, at: At, here: Arrived) -> bool:
        """Tell whether the program has gone on like this behind a move before."""
        numbers = self._numbers.get(at, ())
        if not numbers:
            return False
        visit, before = self.visits[numbers[-1]], self.visits[numbers[-1]].left
        visit.left = here.modes, here.points, here.origins.difference(numbers)
        return bool(visit.left == before)

    def run_block(self, at: At, state: Arrived) -> tuple[int, Arrived | None] | None:
        """Run moves that follow each other; the visit of the first stands for all."""
        behind = self.runs_of(at.context).get(at.row)
        if behind is None:
            return None
        known = self._numbers.get(at)
        if known is None:
            known = self._numbers[at] = [len(self.visits)]
            self.keys.append((at.context, at.job_row, 0))
            self.visits.append(self.read_block(at, behind, state))
        else:
            self._read_block_again(at, behind, state, known[0])
        end = self.visits[known[0]].stages.end
        after = self._come_from(known, at, state).with_modes(end)
        return behind, None if self._went_on(at, after) else after

    def set_modes(self, at: At, here: Arrived) -> Arrived:
        """Carry a statement out that does nothing but set modes."""
        after = self.carry_out(at, at.statement, here)
        assert after is not None
        assert after.origins == here.origins
        return here.with_modes(after.modes)

    def _read_block_again(
        self, at: At, behind: int, here: Arrived, number: int
    ) -> None:
        """Read a block with what is known by now, see `_read_again`."""
        old = self.visits[number]
        if (here.modes, here.points) != (old.stages.begin, old.points):
            new = self.read_block(at, behind, here, old)
            new.origins, new.left = old.origins, old.left
            self.visits[number] = new

    def before(self, at: At, one: ir.SourceStatement, state: Arrived) -> Arrived:
        """Allow for what the functions of a statement do."""
        return self.after_functions(at, one, state)

    def lose_way(self, at: At, one: ir.SourceStatement, state: Arrived) -> Arrived:
        """Go on behind a statement that leads to no place that is known."""
        return self.unknown(at, state)

    def say_not_unrolled(self, at: At, rounds: int) -> None:
        """Say that a loop runs too often to be followed round by round."""
        self.say(scope_at(at), Code.LOOP_NOT_UNROLLED, NOT_UNROLLED.format(rounds))

    def evaluate(
        self, at: At, operand: ir.Operand | None, state: Arrived
    ) -> float | str | None:
        """Return what the program itself has decided before, and ``WHILE TRUE``.

        What is switched off by data that somebody may set, or by FALSE, stays in the
        program as if it ran.
        """
        one = at.statement
        endless = isinstance(one, ir.Branch) and one.word == "while"
        if endless and operand == ir.DataObject("true"):
            return True
        return self.task.decide(operand, scope_at(at, state))

    def loop_limit(self, at: At, operand: ir.Operand | None, state: Arrived) -> float:
        """Return a bound of a loop, NaN where it is not known."""
        return self.task.number(operand, scope_at(at, state))

    def begin_round(
        self, at: At, loop: ir.ForLoop, value: float, state: Arrived
    ) -> tuple[TaskPlace, Arrived]:
        """Return where the statements of a round stand, with the loop's variable."""
        place = at.place
        others = tuple(pair for pair in place.scope.loops if pair[0] != loop.name)
        scope = replace(place.scope, loops=(*others, (loop.name, value)))
        return replace(place, scope=scope), state

    def leave(self, context: Context, state: Arrived, by_return: bool = False) -> None:
        """Go back to where the routine was called."""
        context = context.call
        self.return_to_caller(context, self.at_return(context, state))

    # Calls and moves.

    def declares_motionless(self, name: str) -> bool:
        """Tell whether the cell says that a routine neither moves nor sets frames."""
        return self.task.start.effect_of(name) == "motionless"

    def outside(self, at: At, name: str, here: Arrived) -> Arrived:
        """Call a routine that is not at hand: the cell may say what it does."""
        said_of_it = self.task.start.effect_of(name)
        if said_of_it in ("moves", "sets-frames"):
            self.lost |= here.origins
        if said_of_it == "moves":
            return here.elsewhere()
        if said_of_it == "sets-frames":
            return here.forget()
        what = (
            "is neither a known instruction nor a routine of the given files: it may "
            f"move the arm. Declare it under [routines] of the cell: {name} = "
            f'"motionless", or {name} = "moves"'
        )
        return self.unknown(at, here, what)

    def call_named(self, at: At, name: str, here: Arrived) -> Arrived | None:
        """Call a routine of the task by its name; None where it goes on there."""
        found = self.task.routine(name, at.place.scope)
        if found is not None:
            return self.enter_routine(at, found, here)
        self.run_named_beside(name)
        return self.unknown(at, here, "names several routines")

    def call_function(self, at: At, name: str, here: Arrived) -> Arrived:
        """Allow for what a function does."""
        found = self.task.routine(name, at.place.scope)
        what, still = "", TaskMachine.is_still(self, name)
        if found is None and (name in self.task.routines or not still):
            what = f"calls the function {name}, which is not known: it may move"
        elif found is not None and self.routine_effects(found):
            self.run_beside(found)
            what = f"calls the function {name}, which moves: it is not followed"
        return self.unknown(at, here, what) if what else here

    def enter_routine(
        self, at: At, found: TaskRoutine, here: Arrived
    ) -> Arrived | None:
        """Go on in a routine; one that is being run begins again as well.

        What holds behind such a call is not known.
        """
        if self._is_recursive(found):
            self.run_beside(found)
        calls = [one for one in calls_around(at.context) if one.place is not None]
        running = next((one for one in calls if one.place.routine == found), None)
        if running is not None:
            begin = At(running, running.place.flow.first)
            self.enter(begin, self.at_call(running, here))
            return self.unknown(at, here, RECURSIVE)
        if len(calls) >= DEEPEST:
            self.run_beside(found)
            return self.unknown(at, here, RECURSIVE)
        self.call_routine(found, at, here)
        return None

    def call_routine(
        self, found: TaskRoutine, caller: At | None, here: Arrived
    ) -> None:
        """Begin a routine.

        Args:
            found: Its file, module and rows.
            caller: Where the call stands, None where nothing calls it.
            here: How the arm comes to it.
        """
        (file, module, routine), task = found, self.task
        at, around = task.numbering.rows[file] + routine.first, self.root
        call, points = None, here.points
        if caller is not None:
            at, around = caller.job_row, caller.context
            call = self._call_of(found, caller)
        context = around.find(at, CALLED)
        if context is None:
            bound = call and caller and self._bind(found, call, scope_at(caller))
            text, first = self.texts[file], task.numbering.rows[file]
            scope = bound or task.scope_of(found)
            place = TaskPlace(scope, found, routine.flow, text, first)
            context = around.within(at, CALLED, place)
        own = task.unit(file), module, context.place.scope.routine
        points = points.leave(own)  # declared anew
        if call and caller:
            points = task.hand_over(points, found, call, scope_at(caller, here))
        here = here.with_points(points)
        self.enter(At(context, context.place.flow.first), self.at_call(context, here))

    def _bind(
        self, routine: TaskRoutine, call: ir.Instruction, there: Scope
    ) -> Scope | None:
        """Return where statements of a routine stand, as `TaskSymbols.bind`.

        The call decides which element of an array a parameter stands for. Where the
        routine may change the index, it is an unknown one.
        """
        bound = self.task.bind(routine, call, there)
        if bound is None:
            return None
        given = []
        for name, one, at in bound.given:
            names = _list_indices(one).difference(dict(at.loops))
            if names and not names.isdisjoint(self._list_changes_in(routine)):
                assert isinstance(one, ir.DataObject)
                one = ir.DataObject(one.name, (ir.ElementStep((ir.Operand(),)),))
            given.append((name, one, at))
        return replace(bound, given=tuple(given))

    def _list_changes_in(self, routine: TaskRoutine) -> frozenset[str]:
        """List names of data that a routine changes, and all that it calls."""
        if routine.key not in self._changes:
            part = routine.file, routine.inside.start, routine.inside.stop
            self._changes[routine.key] = self._list_changes({part})
        return self._changes[routine.key]

    def _call_of(self, found: TaskRoutine, caller: At) -> ir.Instruction | None:
        """Return a call whose arguments are followed; None where it has none.

        A routine that calls itself has other values the next time.
        """
        if not found.rows.head.parameters:
            return None
        call = ir.inside(caller.statement)
        if not isinstance(call, ir.Instruction) or call.name != found.rows.head.name:
            return None
        return None if self._is_recursive(found) else call

    def _is_recursive(self, routine: TaskRoutine) -> bool:
        """Return True if a routine has parameters and may come to call itself."""
        if routine.key not in self._recursive:
            own = routine.file, routine.rows.first, routine.rows.last
            called = reach(self._list_calls(own), self._list_calls, tuple)
            found = bool(routine.rows.head.parameters) and own in called
            self._recursive[routine.key] = found
        return self._recursive[routine.key]

    def arrive(self, at: At, one: ir.SourceStatement, here: Arrived) -> Arrived:
        """Record the visits of a move; the arm then stands at the last.

        Args:
            at: Where the move stands.
            one: What it says.
            here: How the arm comes to it.
        """
        known = self._numbers.get(at)
        if known is None:
            found = [*self.read_visits(one, scope_at(at), here)]
            known = [*range(len(self.visits), len(self.visits) + len(found))]
            self._numbers[at] = known
            self.visits += found
            self.keys += [(at.context, at.job_row, k) for k in range(len(found))]
            for before, after in zip(known, found[1:], strict=False):
                after.origins = frozenset([before])
            found[0].points = here.points
        else:
            self._read_again(at, one, here, known)
        return self._come_from(known, at, here)

    def _come_from(self, known: Sequence[int], at: At, here: Arrived) -> Arrived:
        """Note how the arm comes to visits; it then stands at the last of them."""
        first = self.visits[known[0]]
        first.origins = join_origins(first.origins, here.origins, self.lost)
        if MANY in first.origins:
            self.say(scope_at(at), Code.MANY_ORIGINS, TOLD_TOGETHER)
        return here.arriving(frozenset([known[-1]]))

    def _read_again(
        self, at: At, one: ir.SourceStatement, here: Arrived, known: Sequence[int]
    ) -> None:
        """Read visits with what is known by now: the last time holds."""
        found = before = [self.visits[number] for number in known]
        if before[0].points != here.points:
            found = [*self.read_visits(one, scope_at(at), here)]
        for number, old, new in zip(known, before, found, strict=True):
            new.modes = old.modes.join(here.modes)
            new.origins, new.left = old.origins, old.left
            new.points, self.visits[number] = here.points, new

    def assign_point(self, at: At, one: ir.SourceStatement, here: Arrived) -> Arrived:
        """Note what an assignment gives to a point, or to a component of it."""
        if not isinstance(one, ir.Assignment):
            return here
        return here.with_points(self.task.assign(here.points, one, scope_at(at)))

    def begin(self, origins: Origins, modes: Any) -> Arrived:
        """Return how the arm comes to where the task begins: no point is assigned."""
        return Arrived(origins, modes, Points(alike=self.task.are_alike), self.lost)

    def list_changed_beside(self) -> frozenset[str]:
        """List names of data that change in ways that are not followed."""
        return self._list_changes({*self.beside, *self._list_beside()})

    def list_lines_beside(self) -> dict[str, set[int]]:
        """Return the lines that run in ways that are not followed, by file."""
        found: dict[str, set[int]] = {}
        for file, row in self.rows_of({*self.beside, *self._list_beside()}):
            text = self.texts[file]
            found.setdefault(text.source.name, set()).add(int(text.begin_line[row]))
        return found

    def _list_changes(self, parts: set[tuple[int, int, int]]) -> frozenset[str]:
        """List names of data that statements change, as `beside`, and what they call.

        What a routine declares changes for nothing else.
        """
        rows = self.rows_of(parts)
        changed = {
            data.name for at, row in rows
            for data in self.task.list_changes(self.texts[at].statement(row))
            if not self._is_own(data.name, at, row)
        }  # fmt: skip
        return self.task.uses.add_passed(changed)

    def _is_own(self, name: str, file: int, row: int) -> bool:
        """Return True for data that the routine around a statement declares anew."""
        routine = self.task.routine_around(file, row)
        found = routine and self.task.datum(name, self.task.scope_of(routine))
        return bool(found and found[1].routine and found[1].kind != "pers")

    def pause(self, here: Arrived) -> None:
        """Note that the arm may stop where it stands, although a zone is written."""
        self.paused |= here.origins

    def list_visits(self, origins: Origins) -> set[int]:
        """Return visits; of those not distinguished, all that there may be."""
        every = origins | self.lost if MANY in origins else origins
        return {k for k in every if k >= 0}

    def unknown(self, at: At, here: Arrived, what: str = NOT_FOLLOWED) -> Arrived:
        """Say that a statement may move, and forget what was known."""
        self.lost |= here.origins
        self.say(scope_at(at), Code.MOTION_UNKNOWN, what, quote=True)
        return here.forget()

    def say(self, place: Scope, code: Code, what: str, quote: bool = False) -> None:
        """Say something of a statement, with its beginning or without."""
        text = self.texts[place.file]
        message = f"{text.quote(place.row)} {what}" if quote else what
        self.diagnostics.add(text.diagnostic(place.row, code, message))

    # What routines may do, read off their texts.

    def routine_effects(self, routine: TaskRoutine) -> Effects:
        """Collect what a routine may do to moves, and all that it calls."""
        if routine.key not in self._effects:
            found = (self._read_routine(one)[0] for one in self.reach_from([routine]))
            self._effects[routine.key] = frozenset().union(*found)
        return self._effects[routine.key]

    def effects_of(self, one: ir.SourceStatement, here: Scope) -> Effects:
        """Collect what a statement may do to moves, and all that it calls."""
        own, called = self.read_calls(self.names_called(one), here)
        own |= self.own_effects(one)
        return own.union(*map(self.routine_effects, called))

    def reach_from(self, routines: Iterable[TaskRoutine]) -> Iterator[TaskRoutine]:
        """Yield routines, and all that they may come to call."""
        return reach(
            routines, lambda one: self._read_routine(one)[1], lambda one: one.key
        )

    def _read_routine(self, routine: TaskRoutine) -> tuple[Effects, list[TaskRoutine]]:
        """Read once what the statements of a routine do, and what they call."""
        if routine.key not in self._read:
            here = self.task.scope_of(routine)
            self._read[routine.key] = self.read_rows(here, routine.inside)
        return self._read[routine.key]

    def read_rows(
        self, here: Scope, rows: range, but: Collection[str] = ()
    ) -> tuple[Effects, list[TaskRoutine]]:
        """Collect what statements may do to moves, and which routines they call.

        Args:
            here: Where they stand.
            rows: .. and their rows.
            but: Names whose calls do not count.
        """
        effects, called = frozenset[str](), list[TaskRoutine]()
        for row in rows:
            one = self.texts[here.file].statement(row)
            names = (name for name in self.names_called(one) if name not in but)
            own, found = self.read_calls(names, here)
            effects |= own | self.own_effects(one)
            called += found
        return effects, called

    def read_calls(
        self, names: Iterable[str], here: Scope
    ) -> tuple[Effects, list[TaskRoutine]]:
        """Return what calls of no routine may do, and the routines of the others."""
        called, moves = list[TaskRoutine](), False
        for name in names:
            found = self.task.routine(name, here)
            called += [] if found is None else [found]
            unknown = name in self.task.routines or not self.is_still(name)
            moves |= found is None and unknown
        return frozenset([MOVES] if moves else []), called

    # What runs, and is not followed.

    def run_beside(self, routine: TaskRoutine) -> None:
        """Note a routine that runs at a time, or in a way, that is not followed."""
        self.beside.add((routine.file, routine.rows.first, routine.rows.last))

    def run_named_beside(self, name: str) -> None:
        """Note all routines of a name."""
        for routine in self.task.routines.get(name, ()):
            self.run_beside(routine)

    def calls_of(self, one: ir.SourceStatement) -> Iterable[TaskRoutine]:
        """Return the routines that a statement may call."""
        names = {*self.names_called(one)}
        return [found for name in names for found in self.task.routines.get(name, ())]

    def _list_beside(self) -> Iterator[tuple[int, int, int]]:
        """Yield what runs otherwise than it is followed, as `beside`.

        Those are all routines but procedures, handlers, and what the language says.
        """
        for file, text in enumerate(one.text for one in self.task.files):
            for routine in self.task.routines_by_file.get(file, ()):
                if routine.key in self.task.dead:
                    continue
                if routine.rows.head.kind not in self.procedures:
                    yield file, routine.inside.start, routine.inside.stop
                yield from self.list_handlers(routine)
            for row in text.of_kind(self.is_beside):
                yield file, row, row + 1

    def goals_of(self, file: int, row: int) -> Iterator[Any]:
        """Yield where a move goes that is not followed."""
        routine = self.task.routine_around(file, row)
        for scope in () if routine is None else self.scopes_of(routine):
            one = self.texts[file].statement(row)
            for visit in self.read_visits(one, scope.at(row), None):
                yield visit.goal

    def rows_of(self, parts: set[tuple[int, int, int]]) -> Iterator[tuple[int, int]]:
        """Yield statements, by file and row, and those of routines that they call."""
        for file, first, behind in reach(sorted(parts), self._list_calls, tuple):
            yield from ((file, row) for row in range(first, behind))

    def _list_calls(self, part: tuple[int, int, int]) -> Iterator[tuple[int, int, int]]:
        """Yield the routines that some statements call."""
        file, first, behind = part
        for row in range(first, behind):
            for at, _, one in self.calls_of(self.texts[file].statement(row)):
                yield at, one.first, one.last


def _list_indices(value: ir.Operand) -> set[str]:
    """List the names of data that tell which element of an array is meant."""
    steps = value.steps if isinstance(value, ir.DataObject) else ()
    inside = (one for one in steps if isinstance(one, ir.ElementStep))
    return {data.name for data in ir.data_in(*inside)}


def scope_at(at: At, here: Arrived | None = None) -> Scope:
    """Return where a statement stands, with what points hold there if that counts."""
    points = NO_POINTS if here is None else here.points
    scope: Scope = replace(at.place.scope, row=at.row, points=points)
    return scope


def follow(kind: type[M], task: TaskSymbols[Any]) -> M:
    """Make a machine and run it.

    It runs again where data turn out to change in ways that are not followed.
    Where anything runs beside the program another one reads each move by itself: what
    runs beside may be one of several that were read at once.
    """
    machine = kind(task=task)
    task.volatile = machine.list_changed_beside()
    machine.run()
    while True:
        changed = machine.list_changed_beside()
        runs = bool(machine.beside) and any(v.count > 1 for v in machine.visits)
        if changed <= task.volatile and not runs:
            break
        task.volatile |= changed
        at_once = machine.at_once and not machine.beside
        machine = kind(task=task, at_once=at_once)
        machine.run()
    return machine
