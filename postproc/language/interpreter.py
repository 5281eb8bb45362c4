"""Follow a program of one statement a time: every arrival, and where it comes from."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np

from postproc.arrays import Bools, Floats, Ints, all_in_rows
from postproc.diagnostics import Code
from postproc.language import ir as said
from postproc.language.assigned_points import NO_POINTS, Points, Scope, TaskSymbols
from postproc.language.comment_directives import Comments
from postproc.language.control_flow import EXIT, HeadedRows, RoutineFlow, flow_of
from postproc.language.language import Start
from postproc.language.move_runs import Runs, find_runs, rows_of_lines
from postproc.language.statement_table import StatementText
from postproc.language.visits import ELSEWHERE, Diagnostic

MOST_STEPS = 4_000_000  # statements run, all in all
MOST_ROUNDS = 10_000  # rounds of loops within each other, followed one by one
DEEPEST = 60  # calls within calls


class VisitLike(Protocol):
    """An arrival as it is found."""

    modes: Any
    origins: frozenset[int]
    count: int
    goal: Any
    agreed: bool


@dataclass(frozen=True, eq=False)
class CallContext:
    """A call of a routine, or a round of one of its loops.

    Attributes:
        scope: Where its statements stand.
        routine, flow: The routine.
        depth: Of calls.
        caller, back: Where it was called from, and the row to go back to.
        outer: For a round of a loop: what holds around it.
        loop, rounds, round: .. the loop's head, all values of its variable, which one.
    """

    scope: Scope
    routine: HeadedRows
    flow: RoutineFlow
    depth: int = 0
    caller: CallContext | None = None
    back: int = -1
    outer: CallContext | None = None
    loop: int = -1
    rounds: tuple[float, ...] = ()
    round: int = 0

    def way(self) -> tuple[int, ...]:
        """Return the rows that lead here, those of calls and loops."""
        if self.outer is not None:
            return (*self.outer.way(), self.loop, self.round)
        if self.caller is not None:
            return (*self.caller.way(), self.back - 1)
        return (self.scope.file, self.routine.first)

    def rounds_around(self) -> int:
        """Return how often it is run by the loops around it, also those of callers."""
        times, at = 1, self
        while at.outer is not None or at.caller is not None:
            times *= len(at.rounds) if at.outer is not None else 1
            around = at.caller if at.outer is None else at.outer
            assert around is not None
            at = around
        return times

    def running(self, file: int, routine: HeadedRows) -> CallContext | None:
        """Return the call of a routine that is being run here, None without one."""
        at: CallContext | None = self
        while at is not None:
            if at.scope.file == file and at.routine is routine and at.outer is None:
                return at
            at = at.caller if at.outer is None else at.outer
        return None


@dataclass(frozen=True)
class Arrived:
    """How the arm may come to a statement.

    Attributes:
        origins: Visits, START or ELSEWHERE.
        modes: What moves are carried out with.
        points: What points hold that assignments have changed, as far as it is known.
    """

    origins: frozenset[int]
    modes: Any
    points: Points = NO_POINTS

    def join(self, other: Arrived) -> Arrived:
        """Allow for another way here."""
        if self == other:
            return self
        modes = self.modes
        if modes != other.modes:
            modes = modes.join(other.modes)
        points = self.points.join(other.points)
        return Arrived(self.origins | other.origins, modes, points)

    def forget(self) -> Arrived:
        """Forget where the arm is, what moves are carried out with, and points."""
        return Arrived(NOWHERE, self.modes.forget())

    def with_points(self, points: Points) -> Arrived:
        """Return it where points hold something else."""
        return self if points is self.points else replace(self, points=points)


NOWHERE = frozenset([ELSEWHERE])
JUMPS = frozenset("goto return exit exitcycle raise retry trynext".split())
"""Words with which a statement leads to another place."""
NOT_FOLLOWED = "is not followed, and may move the arm"
Place = tuple[CallContext, int]
_PLAIN = (said.SourceStatement, said.LabelMark)
M = TypeVar("M", bound="TaskMachine")


@dataclass
class TaskMachine(ABC):
    """The ways through a task.

    Attributes:
        task: What its names mean.
        texts: The statements of its files, the main one first.
        start: What the cell says.
        visits: Arrivals by number.
        order: What sorts them as the program runs.
        diagnostics: What else was found.
        reached: Moves that some way leads to: file and row.
        exhausted: It has too many ways to be followed.
        beside: Statements that run in ways that are not followed: file, first row, and
            the row behind the last.
        at_once: Moves that differ only in where they go are read at once.
        paused: Visits behind which the arm may stop before the program goes on.
        lost: Visits behind which it may go anywhere.
    """

    comments: ClassVar[Comments]
    task: TaskSymbols = field(kw_only=True)
    texts: Sequence[StatementText[Any]]
    start: Start
    visits: list[Any] = field(default_factory=list)
    order: list[tuple[int, ...]] = field(default_factory=list)
    diagnostics: set[Diagnostic] = field(default_factory=set)
    reached: set[tuple[int, int]] = field(default_factory=set)
    exhausted: bool = False
    beside: set[tuple[int, int, int]] = field(default_factory=set)
    at_once: bool = True
    paused: set[int] = field(default_factory=set)
    lost: set[int] = field(default_factory=set)
    _runs: dict[tuple[int, int], Runs] = field(default_factory=dict)
    _numbers: dict[tuple[CallContext, int], list[int]] = field(default_factory=dict)
    _entered: dict[Place, Arrived] = field(default_factory=dict)
    _left: dict[Place, Arrived] = field(default_factory=dict)
    _contexts: dict[tuple[object, ...], CallContext] = field(default_factory=dict)
    _flows: dict[tuple[int, int], RoutineFlow] = field(default_factory=dict)
    _waiting: list[Place] = field(default_factory=list)
    _steps: int = 0

    # What a language says.

    @abstractmethod
    def run(self) -> None:
        """Follow every way from where the task begins."""

    @abstractmethod
    def acts(self, one: said.SourceStatement) -> bool:
        """Tell whether a statement moves, calls, or changes what moves are made with.

        It leads to the next statement or into a routine.
        """

    @abstractmethod
    def act(
        self, context: CallContext, row: int, one: Any, here: Arrived
    ) -> Arrived | None:
        """Carry such a statement out; None where it goes on in a routine."""

    @abstractmethod
    def goes_on(self, one: said.SourceStatement) -> bool:
        """Tell whether a statement leads to the next one and does nothing."""

    @abstractmethod
    def after_functions(
        self, context: CallContext, row: int, one: said.SourceStatement, here: Arrived
    ) -> Arrived:
        """Allow for what the functions of a statement do."""

    @abstractmethod
    def number(self, operand: said.Operand | None, row: int, scope: Scope) -> float:
        """Evaluate a number, NaN where it is not known before the program runs."""

    @abstractmethod
    def scope_of(self, file: int, module: str, routine: HeadedRows) -> Scope:
        """Return where the statements of a routine stand."""

    @abstractmethod
    def calls_of(
        self, file: int, one: said.SourceStatement
    ) -> Iterable[tuple[int, HeadedRows]]:
        """Yield the routines that a statement calls: their files and places."""

    @abstractmethod
    def goals_of(self, file: int, row: int) -> Iterable[Any]:
        """Yield where a move goes that is not followed."""

    @abstractmethod
    def places_of(self, one: Any) -> Sequence[int] | None:
        """Return the numbers of a line to a written point that say only where it is.

        None for all other statements, and for moves that do more than move.
        """

    @staticmethod
    def is_plain(numbers: Floats) -> Bools:
        """Tell which of such numbers, (m, k), need no word of their own, (m,)."""
        return all_in_rows(np.isfinite(numbers))

    def apart(self, context: CallContext) -> set[int] | None:
        """Return rows that are read by themselves, None where all are."""
        return set()

    def bind_arguments(
        self, scope: Scope, routine: HeadedRows, caller: CallContext, row: int
    ) -> Scope:
        """Add what a routine is called with, as far as that is known.

        Args:
            scope: Where its statements stand.
            routine: The routine.
            caller: Where the call stands.
            row: .. and its row.
        """
        return scope

    def part_otherwise(
        self, context: CallContext, row: int, one: said.SourceStatement, here: Arrived
    ) -> None:
        """Go on behind a statement that only this language has."""
        after = self.unknown(context, row, here)
        self.enter(context, row + 1, after)
        if said.is_odd(one):
            self.may_jump(context, row, after)

    def may_jump(self, context: CallContext, row: int, here: Arrived) -> None:
        """Go wherever a statement that is not understood may lead, by its words."""
        if JUMPS.isdisjoint(self.texts[context.scope.file].words([row])):
            return
        flow = context.flow
        for to in sorted(flow.joins | {end + 1 for end in flow.head}):
            self._leap(context, to, here)
        self._return(context, here)

    def counts_alone(self, context: CallContext, row: int, one: said.ForLoop) -> bool:
        """Return True if nothing but the loop itself changes its variable."""
        return True

    def raise_error(  # noqa: B027 - most languages have no such statement
        self, context: CallContext, row: int, one: said.Leave, here: Arrived
    ) -> None:
        """Go on where an error leads that a statement raises; nowhere: it stops."""

    def handles(self, one: said.SourceStatement) -> bool:
        """Tell whether the handlers of a routine begin with a statement."""
        return False

    def changes_of(self, one: said.SourceStatement) -> Iterable[str]:
        """Yield the names of data that a statement changes."""
        return [one.target.name] if isinstance(one, said.Assignment) else []

    def routines_beside(self) -> Iterable[tuple[int, int, int]]:
        """Yield statements that run otherwise than they are followed, as `beside`."""
        return []

    def at_call(self, context: CallContext, here: Arrived) -> Arrived:
        """Allow for what may happen in a routine as long as it runs."""
        return here

    def at_return(self, context: CallContext, here: Arrived) -> Arrived:
        """Allow for other ends of a routine."""
        return here

    # From statement to statement.

    def follow_all(self) -> None:
        """Follow all ways from where statements have been entered."""
        while self._waiting and not self.exhausted:
            place = self._waiting.pop()
            self._follow(place, self._entered[place])

    def enter(self, context: CallContext, row: int, here: Arrived) -> None:
        """Come to a statement, once more or for the first time."""
        known = self._entered.get((context, row))
        joined = here if known is None else known.join(here)
        if joined != known:
            self._entered[context, row] = joined
            self._waiting.append((context, row))

    def _follow(self, place: Place, here: Arrived) -> None:
        """Go on from a statement until ways part or meet."""
        context, row = place
        text, joins = self.texts[context.scope.file], context.flow.joins
        runs = self._runs_of(context)
        while row < context.flow.last:
            behind = runs.get(row, row + 1)
            self._steps += behind - row
            self.exhausted |= self._steps > MOST_STEPS
            one = text.statement(row)
            if self.acts(one):
                known = self._left.get((context, row))
                after = self.act(context, row, one, here)
                if after is None or after == known:
                    return
                self._left[context, row] = here = after
                if behind > row + 1:  # its visit stands for all of a run
                    (number,) = self._numbers[context, row]
                    self.visits[number].count = behind - row
                    file = context.scope.file
                    self.reached |= {(file, k) for k in range(row, behind)}
            elif type(one) in _PLAIN or self.goes_on(one) or _ends(one):
                here = self.after_functions(context, row, one, here)
                here = self.assign_point(context, row, one, here)
            else:
                self.part(context, row, one, here)
                return
            row = behind
            if row in joins:
                self.enter(context, row, here)
                return
        self._return(context, here)

    def _runs_of(self, context: CallContext) -> Runs:
        """Find once which moves of a routine are read at once."""
        key = context.scope.file, context.flow.first
        apart = self.apart(context) if self.at_once else None
        if apart is None:
            return {}
        if key not in self._runs:
            text = self.texts[context.scope.file]
            apart |= rows_of_lines(text, self.comments.list_taught(text.source))
            self._runs[key] = find_runs(
                text, context.flow, apart, self.places_of, self.is_plain
            )
        return self._runs[key]

    def part(
        self, context: CallContext, row: int, one: said.SourceStatement, here: Arrived
    ) -> None:
        """Go all ways that a statement may lead."""
        flow = context.flow
        here = self.after_functions(context, row, one, here)
        match one:
            case said.Branch(word="if"):
                self.enter(context, row + 1, here)
                self._otherwise(context, row, here)
            case said.Branch(word="test"):
                self._otherwise(context, row, here)
            case said.Branch(word="while"):
                self.enter(context, row + 1, here)
                self.enter(context, _after_block(flow, row), here)
            case said.Branch(word="loop" | "repeat"):
                self.enter(context, row + 1, here)
            case said.Branch(word="until"):
                self.enter(context, row + 1, here)
                self.enter(context, flow.head.get(row, row), here)
            case said.Branch() | said.BlockWord(word="else"):  # one before it is done
                self.enter(context, flow.end.get(row, flow.last), here)
            case said.BlockWord(word="endwhile" | "endloop"):
                self.enter(context, flow.head.get(row, row + 1), here)
            case said.ForLoop():
                self._loop(context, row, one, here)
            case said.BlockWord(word="endfor"):
                self._next_round(context, row, here)
            case said.JumpTo(name=name):
                self._jump(context, row, name, here)
            case said.Leave(word="raise"):
                self.raise_error(context, row, one, here)
            case said.Leave(word="return"):
                self._return(context, here)
            case said.Leave(word=word):
                if word == EXIT:
                    self._exit(context, row, here)
            case _:
                self.part_otherwise(context, row, one, here)

    def _otherwise(self, context: CallContext, row: int, here: Arrived) -> None:
        """Go to the branches behind one that need not be taken, or to the end."""
        flow = context.flow
        text = self.texts[context.scope.file]
        while True:
            if row not in flow.next_branch:
                self.enter(context, flow.end.get(row, flow.last), here)
                return
            row = flow.next_branch[row]
            one = text.statement(row)
            here = self.after_functions(context, row, one, here)
            self.enter(context, row + 1, here)
            if isinstance(one, said.BlockWord) or (
                isinstance(one, said.Branch) and one.word == "default"
            ):
                return

    def _loop(
        self, context: CallContext, row: int, one: said.ForLoop, here: Arrived
    ) -> None:
        """Begin a loop: round by round where its bounds are known."""
        behind = _after_block(context.flow, row)
        rounds = self._rounds(context, row, one)
        if rounds is None:  # the body is followed first, once for all behind it
            self.enter(context, behind, here)
            self.enter(context, row + 1, here)
        elif rounds:
            first = self._round(context, row, one.name, rounds, 0)
            self.enter(first, row + 1, here)
        else:
            self.enter(context, behind, here)

    def _rounds(
        self, context: CallContext, row: int, one: said.ForLoop
    ) -> tuple[float, ...] | None:
        """Return the values of a loop's variable, None where they are not known."""
        scope = context.scope
        if not self.counts_alone(context, row, one):
            return None
        first, last = (self.number(x, row, scope) for x in (one.first, one.last))
        step = self.usual_step(first, last)
        if one.step is not None:
            step = self.number(one.step, row, scope)
        if not all(map(math.isfinite, (first, last, step))) or step == 0.0:
            return None
        count = (last - first) / step + 1 + 1e-9
        if not count * context.rounds_around() < MOST_ROUNDS + 1:  # also if infinite
            return None
        return tuple(first + k * step for k in range(int(max(count, 0.0))))

    def _round(
        self,
        outer: CallContext,
        row: int,
        name: str,
        rounds: tuple[float, ...],
        at: int,
    ) -> CallContext:
        key = outer, row, at
        if key not in self._contexts:
            own = tuple(pair for pair in outer.scope.loops if pair[0] != name)
            scope = replace(outer.scope, loops=(*own, (name, rounds[at])))
            self._contexts[key] = replace(
                outer, scope=scope, outer=outer, loop=row, rounds=rounds, round=at
            )
        return self._contexts[key]

    def _next_round(self, context: CallContext, row: int, here: Arrived) -> None:
        """Go on at the end of a round."""
        head = context.flow.head.get(row, row)
        if context.loop != head or context.outer is None:  # rounds are not told apart
            self.enter(context, row + 1, here)
            self.enter(context, head + 1, here)
        elif context.round + 1 < len(context.rounds):
            name = context.scope.loops[-1][0]
            after = context.round + 1
            next_ = self._round(context.outer, head, name, context.rounds, after)
            self.enter(next_, head + 1, here)
        else:
            self.enter(context.outer, row + 1, here)

    def _jump(self, context: CallContext, row: int, name: str, here: Arrived) -> None:
        """Go to a label."""
        to = context.flow.labels.get(name)
        if to is None:
            self.enter(context, row + 1, self.unknown(context, row, here))
            return
        self._leap(context, to, here)

    def _exit(self, context: CallContext, row: int, here: Arrived) -> None:
        """Leave the innermost loop."""
        head = context.flow.exits.get(row)
        if head is None:
            self.enter(context, row + 1, self.unknown(context, row, here))
            return
        self._leap(context, _after_block(context.flow, head), here)

    def _leap(self, context: CallContext, to: int, here: Arrived) -> None:
        """Go to a statement, out of the rounds that it is not in."""
        while context.outer is not None and not (
            context.loop < to < context.flow.loops.get(context.loop, context.loop)
        ):
            context = context.outer
        self.enter(context, to, here)

    def _return(self, context: CallContext, here: Arrived) -> None:
        """Go back to where the routine was called."""
        while context.outer is not None:
            context = context.outer
        here = self.at_return(context, here)
        if context.caller is not None:
            self.enter(context.caller, context.back, here)

    @staticmethod
    def usual_step(first: float, last: float) -> float:
        """Return what a loop counts by where it does not say so."""
        return 1.0 if last >= first else -1.0

    # Calls and moves.

    def declares_motionless(self, name: str) -> bool:
        """Tell whether the cell says that a routine neither moves nor sets frames."""
        start = self.start
        if start.routines.get(name) == "motionless":
            return True
        return any(fnmatchcase(name, pattern) for pattern in start.motionless)

    def outside(
        self, context: CallContext, row: int, name: str, here: Arrived
    ) -> Arrived:
        """Call a routine that is not at hand: the cell may say what it does."""
        said_of_it = self.start.routines.get(name)
        if said_of_it in ("moves", "sets-frames"):
            self.lost |= here.origins
        if said_of_it == "moves":
            return replace(here, origins=NOWHERE)
        if said_of_it == "sets-frames":
            return here.forget()
        what = (
            "is neither a known instruction nor a routine of the given files: it may "
            f"move the arm. Declare it under [routines] of the cell: {name} = "
            f'"motionless", or {name} = "moves"'
        )
        return self.unknown(context, row, here, what)

    def enter_routine(
        self, context: CallContext, row: int, found: tuple[int, str, HeadedRows],
        here: Arrived,
    ) -> Arrived | None:  # fmt: skip
        """Go on in a routine; one that is being run begins again as well.

        What holds behind such a call is not known.
        """
        file, module, routine = found
        running = context.running(file, routine)
        if running is not None:
            self.enter(running, running.flow.first, self.at_call(running, here))
        elif context.depth > DEEPEST:
            self.run_beside(file, routine)
        if running is not None or context.depth > DEEPEST:
            return self.unknown(context, row, here, "calls itself: it is not followed")
        self.call(file, module, routine, context, row + 1, here)
        return None

    def call(
        self, file: int, module: str, routine: HeadedRows, caller: CallContext | None,
        back: int, here: Arrived,
    ) -> None:  # fmt: skip
        """Begin a routine."""
        key = caller, back, file, routine.first
        if key not in self._contexts:
            place = file, routine.first
            if place not in self._flows:
                self._flows[place] = flow_of(self.texts[file], routine, self.handles)
            scope = self.scope_of(file, module, routine)
            if caller is not None:
                scope = self.bind_arguments(scope, routine, caller, back - 1)
            depth = 0 if caller is None else caller.depth + 1
            flow = self._flows[place]
            self._contexts[key] = CallContext(scope, routine, flow, depth, caller, back)
        context = self._contexts[key]
        own = file, module, context.scope.routine
        here = here.with_points(here.points.leave(own))  # declared anew
        here = self.at_call(context, here)
        self.enter(context, context.flow.first, here)

    def arrive(
        self,
        context: CallContext,
        row: int,
        here: Arrived,
        read: Callable[[], Sequence[VisitLike]],
    ) -> Arrived:
        """Record the visits of a move; the arm then stands at the last.

        Args:
            context: Where the move stands.
            row: Its statement.
            here: How the arm comes to it.
            read: Reads its visits, where it is met first.
        """
        self.reached.add((context.scope.file, row))
        known = self._numbers.get((context, row))
        if known is None:
            found = read()
            known = [*range(len(self.visits), len(self.visits) + len(found))]
            self._numbers[context, row] = known
            self.visits += found
            self.order += [(*context.way(), row, k) for k in range(len(found))]
            for before, after in zip(known, found[1:], strict=False):
                after.origins = frozenset([before])
        for number in known:
            visit = self.visits[number]
            if visit.modes != here.modes:
                visit.modes = visit.modes.join(here.modes)
            visit.agreed = visit.agreed and here.points.agree(visit.goal.given)
        self.visits[known[0]].origins |= here.origins
        return replace(here, origins=frozenset([known[-1]]))

    def assign_point(
        self, context: CallContext, row: int, one: said.SourceStatement, here: Arrived
    ) -> Arrived:
        """Note what an assignment gives to a point, or to a component of it."""
        if not isinstance(one, said.Assignment):
            return here
        points = self.task.assign(here.points, one, row, context.scope)
        return here.with_points(points)

    def settle_points(self) -> None:
        """Forget where moves go whose points hold other values on other ways."""
        given = [visit for visit in self.visits if visit.goal.given]
        if not given:
            return
        rows = self._rows_of({*self.beside, *self.routines_beside()})
        lost = {
            name for at, row in rows
            for name in self.changes_of(self.texts[at].statement(row))
        }  # fmt: skip
        for visit in given:
            if not visit.agreed or any(lost & one.names for one in visit.goal.given):
                visit.goal = visit.goal.lost

    def pause(self, here: Arrived) -> None:
        """Note that the arm may stop where it stands, although a zone is written."""
        self.paused |= here.origins

    def find_unsure_stops(self) -> set[int]:
        """Return the visits at which it is not known whether the arm stops."""
        leads = set[int]().union(*(visit.origins for visit in self.visits))
        return self.lost | (self.paused & leads)

    def unknown(
        self, context: CallContext, row: int, here: Arrived, what: str = NOT_FOLLOWED
    ) -> Arrived:
        """Say that a statement may move, and forget what was known."""
        self.lost |= here.origins
        self.say(context.scope.file, row, Code.MOTION_UNKNOWN, what, quote=True)
        return here.forget()

    def say(
        self, file: int, row: int, code: Code, what: str, quote: bool = False
    ) -> None:
        """Say something of a statement, with its beginning or without."""
        text = self.texts[file]
        message = f"{text.quote(row)} {what}" if quote else what
        self.diagnostics.add(text.diagnostic(row, code, message))

    # What runs, and is not followed.

    def run_beside(self, file: int, routine: HeadedRows) -> None:
        """Note a routine that runs at a time, or in a way, that is not followed."""
        self.beside.add((file, routine.first, routine.last))

    def rows_beside(self) -> Iterator[tuple[int, int]]:
        """Yield statements that run in ways that are not followed: file and row."""
        return self._rows_of(self.beside)

    def _rows_of(self, parts: set[tuple[int, int, int]]) -> Iterator[tuple[int, int]]:
        """Yield statements, and those of the routines that they call."""
        waiting, seen = sorted(parts), set(parts)
        while waiting:
            file, first, behind = waiting.pop()
            for row in range(first, behind):
                yield file, row
                for at, one in self.calls_of(file, self.texts[file].statement(row)):
                    key = at, one.first, one.last
                    if key not in seen:
                        seen.add(key)
                        waiting.append(key)

    def find_unreached(self, moves: Mapping[int, Iterable[int]]) -> dict[str, Ints]:
        """Return the lines of moves that no way leads to, by file.

        Args:
            moves: Rows of moves, by file.
        """
        found = {}
        for file, rows in moves.items():
            text = self.texts[file]
            lines = {text.line(row) for row in rows if (file, row) not in self.reached}
            if lines:
                found[text.source.name] = np.array(sorted(lines), dtype=np.int64)
        return found


def follow(make: Callable[[], M]) -> M:
    """Make a machine and run it.

    Where anything runs beside the program another one reads each move by itself: what
    runs beside may be one of several that were read at once.
    """
    machine = make()
    machine.run()
    if machine.beside and any(v.count > 1 for v in machine.visits):
        machine = make()
        machine.at_once = False
        machine.run()
    machine.settle_points()
    return machine


def _ends(one: said.SourceStatement) -> bool:
    """Tell whether a statement only ends a block, or opens none."""
    return isinstance(one, said.BlockWord) and one.word in ("endif", "endtest")


def _after_block(flow: RoutineFlow, row: int) -> int:
    """Return the row behind the block that begins at one."""
    return flow.end.get(row, flow.last - 1) + 1
