"""Follow a program every way that it may take, in any language."""

from __future__ import annotations

import heapq
import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, Self, TypeVar

from postproc.language import ir
from postproc.language.analysis.call_context import CALLED, At, Context, Point
from postproc.language.analysis.control_flow import EXIT, ControlFlow

MOST_ROUNDS = 10_000  # rounds of loops within each other, followed one by one
MOST_ROWS = 400_000  # of loops that are followed so, all in all
MOST_STEPS = 4_000_000  # statements run one by one, all in all
NOT_UNROLLED = (
    "the loop runs {:,} times: too often to be followed round by round; targets that "
    "depend on its counter are not compensated"
)
_CONTROL = ir.Branch | ir.BlockWord | ir.ForLoop | ir.JumpTo | ir.Leave | ir.CompactIf


class RoutinePlace(Protocol):
    """Where statements stand."""

    @property
    def flow(self) -> ControlFlow:
        """The blocks of the routine."""

    @property
    def offset(self) -> int:
        """The job-wide index of the first row of its file."""

    def statement(self, row: int) -> ir.SourceStatement:
        """Return what a row of its file says."""


class AbstractState(Protocol):
    """What is known at a place of a program, on every way there."""

    def copy(self) -> Self:
        """Return a state that can change on its own."""

    def join(self, other: Self) -> Self:
        """Return what holds on either way; itself where that is no less."""


S = TypeVar("S", bound=AbstractState)


@dataclass(frozen=True)
class Counting:
    """The rounds of a loop whose bounds are known.

    Attributes:
        first: What its variable is in the first round.
        step: By what it counts.
        rounds: How many there are.
    """

    first: float
    step: float
    rounds: int

    @classmethod
    def of(cls, first: float, last: float, step: float) -> Counting | None:
        """Count the rounds of a loop, None where its bounds are not known."""
        if not all(map(math.isfinite, (first, last, step))) or not step:
            return None
        steps = (last - first) / step
        if not math.isfinite(steps):
            return None
        return cls(first, step, 0 if steps < 0 else int(steps + 1e-9) + 1)

    def value(self, number: int) -> float:
        """Return what the variable is in a round."""
        return self.first + number * self.step


@dataclass(kw_only=True)
class Interpreter(ABC, Generic[S]):
    """The ways through a program.

    A *configuration* is a row with the calls, and the rounds of loops that count, that
    led there. Each has one state, in which all ways there are joined; it is run again
    when that has changed, until nothing changes. Work is done in program order, so that
    most configurations are run once.

    Attributes:
        root: The outermost context.
        entries: The state of each configuration.
        counted: Loops that are followed round by round, by context and row.
        widened: Loops that are not.
        unrolled: Rows of loops that are followed round by round, all rounds together.
        steps: Statements that have been run.
        exhausted: The program has too many ways to be followed to the end.
        visits: Arrivals by number; what follows each other and is alike has one number,
            which as an origin means the last of it.
        keys: Context, row and number within the row of each.
        paused: Visits behind which the arm may stop before the program goes on.
        lost: Visits behind which it may go anywhere.
    """

    root: Context = field(default_factory=Context)
    entries: dict[At, S] = field(default_factory=dict)
    counted: dict[At, Counting] = field(default_factory=dict)
    widened: set[At] = field(default_factory=set)
    unrolled: int = 0
    steps: int = 0
    exhausted: bool = False
    visits: list[Any] = field(default_factory=list)
    keys: list[tuple[Context, int, int]] = field(default_factory=list)
    paused: set[int] = field(default_factory=set)
    lost: set[int] = field(default_factory=set)
    _heap: list[tuple[Point, int]] = field(default_factory=list)
    _queued: set[At] = field(default_factory=set)

    # What a language says.

    @abstractmethod
    def act(self, at: At, one: ir.SourceStatement, state: S) -> S | None:
        """Carry out a statement that leads to the next one.

        None where it goes on in a routine, or where the language goes on by itself.
        """

    def run_block(self, at: At, state: S) -> tuple[int, S | None] | None:
        """Run moves at once that differ only in where they go.

        Returns:
            The row behind them and what holds there, as `act`; None where none begin
            at a row.
        """
        return None

    def before(self, at: At, one: ir.SourceStatement, state: S) -> S:
        """Allow for what a statement does besides leading elsewhere."""
        return state

    @abstractmethod
    def evaluate(
        self, at: At, operand: ir.Operand | None, state: S
    ) -> float | str | None:
        """Return what decides a way, None where only the run tells; truth is 0 or 1."""

    def truth(self, at: At, condition: ir.Operand, state: S) -> bool | None:
        """Tell whether a condition holds, None where only the run tells."""
        found = self.evaluate(at, condition, state)
        return bool(found) if isinstance(found, float | bool) else None

    def fits(self, at: At, case: ir.Branch, head: At, state: S) -> bool | None:
        """Tell whether a case means what its block tests, None where it may."""
        value = self.evaluate(head, self.selector(head.statement), state)
        found: bool | None = not case.values and None
        for choice in case.values:
            low, high = choice, choice
            if isinstance(choice, ir.Interval):
                low, high = choice.low, choice.high
            a, b = (self.evaluate(at, one, state) for one in (low, high))
            known = type(a) is type(b) is type(value) and isinstance(value, float | str)
            if not known:
                found = None
            elif a <= value <= b:  # type: ignore[operator]
                return True
        return found

    def selector(self, head: ir.SourceStatement) -> ir.Operand | None:
        """Return what a block of cases tests."""
        return head.values[0] if isinstance(head, ir.Branch) and head.values else None

    def loop_limit(
        self, at: At, operand: ir.Operand | None, state: S
    ) -> float | str | None:
        """Return a bound of a loop, None where it is not known."""
        return self.evaluate(at, operand, state)

    def count(self, at: At, loop: ir.ForLoop, state: S) -> Counting | None:
        """Return the rounds of a loop, None where they are not known."""
        bounds = loop.first, loop.last, loop.step
        first, last, step = (self.loop_limit(at, one, state) for one in bounds)
        if not (isinstance(first, float) and isinstance(last, float)):
            return None
        if loop.step is None:
            step = self.usual_step(first, last)
        if not isinstance(step, float):
            return None
        return Counting.of(first, last, -step if loop.down and step > 0 else step)

    @staticmethod
    def usual_step(first: float, last: float) -> float:
        """Return what a loop counts by where it does not say so."""
        return 1.0

    def counts_alone(self, at: At, loop: ir.ForLoop) -> bool:
        """Tell whether nothing but a loop itself changes its variable."""
        return True

    def say_not_unrolled(self, at: At, rounds: int) -> None:
        """Say that a loop runs too often to be followed round by round."""

    @abstractmethod
    def begin_round(
        self, at: At, loop: ir.ForLoop, value: float, state: S
    ) -> tuple[Any, S]:
        """Return where the statements of a round stand, and what holds as it begins."""

    def forget_counter(self, at: At, loop: ir.ForLoop, ended: bool, state: S) -> S:
        """Forget what a loop counts, behind it or where it is not known."""
        return state

    @abstractmethod
    def leave(self, context: Context, state: S, by_return: bool = False) -> None:
        """Go on where a routine ends."""

    def leave_otherwise(self, at: At, one: ir.Leave, state: S) -> S | None:
        """Go on behind another word than RETURN that leads elsewhere; often nowhere."""
        return None

    def lose_way(self, at: At, one: ir.SourceStatement, state: S) -> S:
        """Go on behind a statement that leads to no place that is known."""
        return state

    # Configurations.

    def enter(self, at: At, state: S) -> None:
        """Come to a row, once more or for the first time."""
        config = At(_rounds_of(at), at.row)
        known = self.entries.get(config)
        joined = state.copy() if known is None else known.join(state)
        if joined is known:
            return
        self.entries[config] = joined
        if config not in self._queued:
            self._queued.add(config)
            heapq.heappush(self._heap, (Point(config.context, config.job_row), at.row))

    def go_on(self, at: At, state: S) -> None:
        """Go on with a row as the one after the last: ELSE and CASE end a branch."""
        flow = at.place.flow
        if at.row < flow.last and ir.divides(at.statement):
            at = at.to(flow.end.get(at.row, at.row))
        self.enter(at, state)

    def follow(self) -> None:
        """Follow all ways from the rows that have been entered."""
        while self._heap and not self.exhausted:
            point, row = heapq.heappop(self._heap)
            config = At(point.context, row)
            self._queued.discard(config)
            self._run(config, self.entries[config].copy())

    def _run(self, begin: At, state: S) -> None:
        """Run statements one after the other until ways part or meet."""
        at, flow = begin, begin.place.flow
        while at.row < flow.last:
            if at is not begin and at.row in flow.joins:
                self.go_on(at, state)
                return
            self.steps += 1
            self.exhausted |= self.steps > MOST_STEPS
            if (block := self.run_block(at, state)) is not None:
                row, after = block
            else:
                one = at.statement
                if ir.divides(one):
                    if at is not begin:
                        self.go_on(at, state)
                        return
                    one = getattr(one, "then", None) or ir.SourceStatement()
                row, after = at.row + 1, self.run_one(at, one, state)
            if after is None:
                return
            at, state = at.to(row), after
        self.leave(begin.context, state)

    def run_one(self, at: At, one: ir.SourceStatement, state: S) -> S | None:
        """Run a statement; None where the next row does not follow."""
        while isinstance(one, ir.LabelMark) and one.then is not None:
            one = one.then
        if isinstance(one, _CONTROL):
            return self._part(at, one, self.before(at, one, state))
        return self.act(at, one, state)

    # Where ways part.

    def _part(self, at: At, one: ir.SourceStatement, state: S) -> S | None:
        """Go all ways that a statement may lead; return the state where one goes on."""
        row, flow = at.row, at.place.flow
        match one:
            case ir.Branch(word="if" | "while" | "until"):
                self._decide(at, one, state)
            case ir.Branch(word="test"):
                self._otherwise(at, state)
            case ir.CompactIf():
                return self._run_if(at, one, state)
            case ir.BlockWord(word="endwhile" | "endloop") if row in flow.head:
                self.enter(at.to(flow.head[row]), state)
            case ir.Branch(word="condition"):
                self.go_on(at.to(flow.behind(row)), state)
            case ir.BlockWord(word="endcondition"):
                pass
            case ir.ForLoop():
                self._begin_loop(at, one, state)
            case ir.BlockWord(word="endfor") if row in flow.head:
                self._end_round(at, state)
            case ir.JumpTo(name=name):
                return self._jump(at, flow.labels.get(name), one, state)
            case ir.Leave(word=word) if word == EXIT:
                to = flow.behind(flow.exits[row]) if row in flow.exits else None
                return self._jump(at, to, one, state)
            case ir.Leave(word="return"):
                self.leave(at.context, state, by_return=True)
            case ir.Leave():
                return self.leave_otherwise(at, one, state)
            case _:
                return state
        return None

    def _decide(self, at: At, one: ir.Branch, state: S) -> None:
        """Go both ways behind a condition, or the one that is known."""
        flow = at.place.flow
        truth = None
        if one.values:
            truth = self.truth(at, one.values[0], state)
        if truth is not False:
            self.go_on(at.behind, state)
        if truth is not True and one.word == "if":
            self._otherwise(at, state)
        elif truth is not True and one.word == "while":
            self.go_on(at.to(flow.behind(at.row)), state)
        elif truth is not True:
            self.enter(at.to(flow.head.get(at.row, at.row)), state)

    def _run_if(self, at: At, one: ir.CompactIf, state: S) -> S | None:
        """Run a statement, or pass it, or both where its condition is not known."""
        truth = self.truth(at, one.condition, state)
        if truth is False:
            return state
        after = self.run_one(at, one.statement, state.copy())
        if truth or after is None:
            return after if truth else state
        return state.join(after)

    def _otherwise(self, head: At, state: S) -> None:
        """Go to the divisions of a block that may be meant, or to its end."""
        flow = head.place.flow
        for at in map(head.to, flow.divisions_behind(head.row)):
            one = at.statement
            state = self.before(at, one, state)
            fits: bool | None = True
            if isinstance(one, ir.Branch) and one.word == "elseif":
                fits = self.truth(at, one.values[0], state)
            elif isinstance(one, ir.Branch) and one.word != "default":
                fits = self.fits(at, one, head, state)
            if fits is not False:
                self.enter(at, state)
            if fits is True:
                return
        self.enter(head.to(flow.end.get(head.row, flow.last)), state)

    def _jump(
        self, at: At, to: int | None, one: ir.SourceStatement, state: S
    ) -> S | None:
        """Go to a label, or out of a loop."""
        if to is None:
            return self.lose_way(at, one, state)
        self.go_on(at.to(to), state)
        return None

    # Loops that count: round by round where the bounds are known, else over and over.

    def _begin_loop(self, at: At, loop: ir.ForLoop, state: S) -> None:
        """Go into the first round, past the loop, or both where that is not known."""
        behind = at.to(at.place.flow.behind(at.row))
        counting = self.count(at, loop, state)
        if counting is not None and not counting.rounds:
            self.go_on(behind, state)
            return
        if counting is not None and self._unroll(at, loop, counting):
            self._round(at, loop, 0, state)
            return
        self.widened.add(at)
        state = self.forget_counter(at, loop, False, state)
        if counting is None:
            self.go_on(behind, state)
        self.go_on(at.behind, state)

    def _unroll(self, at: At, loop: ir.ForLoop, counting: Counting) -> bool:
        """Tell whether a loop is followed round by round."""
        if at in self.widened or at.row not in at.place.flow.end:
            return False
        if at not in self.counted:
            if not self.counts_alone(at, loop):
                return False
            if not self._afford(at, counting.rounds):
                self.say_not_unrolled(at, counting.rounds)
                return False
            self.counted[at] = counting
        return self.counted[at] == counting

    def _afford(self, at: At, rounds: int) -> bool:
        """Tell whether there are so few rounds that each is followed by itself."""
        rows = rounds * (at.place.flow.behind(at.row) - at.row)
        loops = (one.begun_at for one in at.context.around() if one.is_round)
        around = math.prod(self.counted[loop].rounds for loop in loops)
        if rounds * around > MOST_ROUNDS:
            return False
        if self.unrolled + rows > MOST_ROWS:
            return False
        self.unrolled += rows
        return True

    def _round(self, at: At, loop: ir.ForLoop, number: int, state: S) -> None:
        """Start a round."""
        value = self.counted[at].value(number)
        place, state = self.begin_round(at, loop, value, state)
        inner = at.context.within(at.job_row, number, place)
        self.go_on(At(inner, at.row + 1), state)

    def _end_round(self, at: At, state: S) -> None:
        """Go into the next round, out of the loop, or both where that is not known."""
        head = at.to(at.place.flow.head[at.row])
        loop = head.statement
        loop = loop.then if isinstance(loop, ir.LabelMark) else loop
        assert isinstance(loop, ir.ForLoop)
        if at.context.is_round and at.context.at == head.job_row:
            outer, number = At(at.context.outer, head.row), at.context.kind + 1
            if number < self.counted[outer].rounds:
                self._round(outer, loop, number, state)
                return
            at = At(outer.context, at.row)
        else:
            state = self.forget_counter(at, loop, False, state)
            self.go_on(head.behind, state)
        state = self.forget_counter(at, loop, True, state)
        self.go_on(at.behind, state)

    # Calls.

    def call(self, at: At, place: RoutinePlace, state: S) -> None:
        """Go into a routine; it comes back to the row behind this one."""
        inner = at.context.within(at.job_row, CALLED, place)
        self.enter(At(inner, place.flow.first), state)

    def return_to_caller(self, context: Context, state: S) -> None:
        """Go back to where a routine was called."""
        call = context.call
        if call.kind == CALLED and call.outer.place is not None:
            self.go_on(call.begun_at.behind, state)

    # Arrivals.

    def find_unsure_stops(self) -> set[int]:
        """Return the visits at which it is not known whether the arm stops."""
        leads = set[int]().union(*(visit.origins for visit in self.visits))
        return {k for k in self.lost | (self.paused & leads) if k >= 0}


def calls_around(context: Context) -> Iterator[Context]:
    """Go through the calls in which a context is, the innermost first."""
    return (one for one in context.around() if not one.is_round)


def _rounds_of(at: At) -> Context:
    """Drop the rounds of loops that a jump to a row leaves."""
    context = at.context
    while context.is_round:
        head = context.begun_at.row
        if head < at.row <= context.place.flow.end[head]:
            break
        context = context.outer
    return context
