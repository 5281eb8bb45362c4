"""Follow a RAPID task from its main routine: every arrival, and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase

from postproc.language.interface import Start
from postproc.language.rapid import syntax as said
from postproc.language.rapid.flow import RoutineFlow, flow_of
from postproc.language.rapid.modes import (
    AT_START,
    HARMLESS,
    LOST,
    Modes,
    changed_modes,
)
from postproc.language.rapid.moves import Goals, RapidVisit, pose_of
from postproc.language.rapid.program import RapidScope, shown
from postproc.language.rapid.signatures import (
    MOTIONS,
    STILL_FUNCTIONS,
    known_instructions,
)
from postproc.language.rapid.task import RapidTask, Scope, functions_in, inside
from postproc.language.visits import ELSEWHERE, MOTION_UNKNOWN, START, Diagnostic

MOST_STEPS = 4_000_000  # statements run, all in all
MOST_ROUNDS = 10_000  # rounds of a loop that are followed one by one
DEEPEST = 60  # calls within calls


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
    routine: RapidScope
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

    def is_within(self, file: int, routine: RapidScope) -> bool:
        """Tell whether a routine is being run here."""
        at: CallContext | None = self
        while at is not None:
            if at.scope.file == file and at.routine is routine:
                return True
            at = at.caller if at.outer is None else at.outer
        return False


@dataclass(frozen=True)
class Arrived:
    """How the arm may come to a statement.

    Attributes:
        origins: Visits, START or ELSEWHERE.
        modes: What moves are carried out with.
    """

    origins: frozenset[int]
    modes: Modes

    def joined(self, other: Arrived) -> Arrived:
        """Allow for another way here."""
        if self == other:
            return self
        modes = self.modes
        if modes != other.modes:
            modes = modes.joined(other.modes)
        return Arrived(self.origins | other.origins, modes)

    def lost(self) -> Arrived:
        """Forget where the arm is, and what moves are carried out with."""
        blocked = self.modes.blocked
        return Arrived(NOWHERE, replace(LOST, blocked=blocked))


STOPPED = ("storepath", "clearpath", "stopmovereset")  # somewhere on its path
NOWHERE = frozenset([ELSEWHERE])
_NOT_FOLLOWED = "may move the arm: it is not followed"
Place = tuple[CallContext, int]
_PLAIN = (
    said.RapidStatement, said.FileHeader, said.DataDeclaration, said.LabelMark,
    said.ConnectTrap, said.Assignment, said.TypeAlias,
)  # fmt: skip
_BRANCHES = ("elseif", "else", "case", "default")


@dataclass
class RapidMachine:
    """The ways through a task.

    Attributes:
        task: Its modules.
        start: What the cell says.
        goals: Reads destinations, tools, work objects and zones.
        visits: Arrivals by number.
        order: What sorts them as the program runs.
        diagnostics: What else was found.
        reached: Moves that some way leads to: file and row.
        exhausted: It has too many ways to be followed.
    """

    task: RapidTask
    start: Start
    goals: Goals
    visits: list[RapidVisit] = field(default_factory=list)
    order: list[tuple[int, ...]] = field(default_factory=list)
    diagnostics: set[Diagnostic] = field(default_factory=set)
    reached: set[tuple[int, int]] = field(default_factory=set)
    exhausted: bool = False
    _numbers: dict[tuple[CallContext, int], list[int]] = field(default_factory=dict)
    _entered: dict[Place, Arrived] = field(default_factory=dict)
    _left: dict[Place, Arrived] = field(default_factory=dict)
    _contexts: dict[tuple[object, ...], CallContext] = field(default_factory=dict)
    _flows: dict[tuple[int, int], RoutineFlow] = field(default_factory=dict)
    _moving: dict[tuple[int, int], bool] = field(default_factory=dict)
    _waiting: list[Place] = field(default_factory=list)
    _steps: int = 0

    def run(self) -> None:
        """Follow every way from the main routine."""
        mains = self.task.routines.get("main", [])
        found = mains if len(mains) == 1 else self._procedures()
        here = Arrived(frozenset([START]), AT_START)
        if len(mains) != 1:
            here = here.lost()
            self._say(
                0, 0, "no-main", "no single PROC main: from where these routines are "
                "called, and with what settings, is not known. Give the module that "
                "holds main, with the others of its task in the same folder",
            )  # fmt: skip
        if self._trapped():
            here = replace(here, modes=replace(here.modes, blocked=frozenset([_TRAP])))
        for file, module, routine in found:
            self._call(file, module, routine, None, -1, here)
        while self._waiting and not self.exhausted:
            place = self._waiting.pop()
            self._follow(place, self._entered[place])

    def _procedures(self) -> list[tuple[int, str, RapidScope]]:
        routines = (one for found in self.task.routines.values() for one in found)
        return [one for one in routines if _kind(one[2]) == "proc"]

    def _trapped(self) -> bool:
        """Tell whether a trap moves, or changes how moves are carried out."""
        routines = (one for found in self.task.routines.values() for one in found)
        return any(
            _kind(one[2]) == "trap" and self._moves(one[0], one[1], one[2])
            for one in routines
        )

    # From statement to statement.

    def _enter(self, context: CallContext, row: int, here: Arrived) -> None:
        """Come to a statement, once more or for the first time."""
        known = self._entered.get((context, row))
        joined = here if known is None else known.joined(here)
        if joined != known:
            self._entered[context, row] = joined
            self._waiting.append((context, row))

    def _follow(self, place: Place, here: Arrived) -> None:
        """Go on from a statement until ways part or meet."""
        context, row = place
        text, joins = self.task.files[context.scope.file].text, context.flow.joins
        while row < context.flow.last:
            self._steps += 1
            self.exhausted |= self._steps > MOST_STEPS
            one = text.statement(row)
            if isinstance(one, said.Instruction):
                known = self._left.get((context, row))
                after = self._instruction(context, row, one, here)
                if after is None or after == known:
                    return
                self._left[context, row] = here = after
            elif type(one) in _PLAIN or _ends(one):
                here = self._after_functions(context, row, one, here)
            else:
                self._part(context, row, one, here)
                return
            row += 1
            if row in joins:
                self._enter(context, row, here)
                return
        self._return(context, here)

    def _part(
        self, context: CallContext, row: int, one: said.RapidStatement, here: Arrived
    ) -> None:
        """Go all ways that a statement may lead."""
        flow = context.flow
        here = self._after_functions(context, row, one, here)
        match one:
            case said.Branch(word="if"):
                self._enter(context, row + 1, here)
                self._otherwise(context, row, here)
            case said.Branch(word="test"):
                self._otherwise(context, row, here)
            case said.Branch(word="while"):
                self._enter(context, row + 1, here)
                self._enter(context, _after_block(flow, row), here)
            case said.Branch() | said.BlockWord(word="else"):  # one before it is done
                self._enter(context, flow.end.get(row, flow.last), here)
            case said.BlockWord(word="endwhile"):
                self._enter(context, flow.head.get(row, row + 1), here)
            case said.ForLoop():
                self._loop(context, row, one, here)
            case said.BlockWord(word="endfor"):
                self._next_round(context, row, here)
            case said.JumpTo(name=name):
                self._jump(context, row, name, here)
            case said.Leave(word=word):
                if word == "raise" and context.flow.handlers:  # TRYNEXT goes on here
                    self._enter(context, row + 1, here)
                if word in ("return", "raise"):  # a caller's handler may go on there
                    self._return(context, here)
            case said.CompactIf(statement=inside):
                self._enter(context, row + 1, here)
                self._compact(context, row, inside, here)
            case _:
                self._enter(context, row + 1, self._unknown(context, row, here))

    def _otherwise(self, context: CallContext, row: int, here: Arrived) -> None:
        """Go to the branches behind one that need not be taken, or to the end."""
        flow = context.flow
        text = self.task.files[context.scope.file].text
        while True:
            if row not in flow.next_branch:
                self._enter(context, flow.end.get(row, flow.last), here)
                return
            row = flow.next_branch[row]
            one = text.statement(row)
            here = self._after_functions(context, row, one, here)
            self._enter(context, row + 1, here)
            if isinstance(one, said.BlockWord) or (
                isinstance(one, said.Branch) and one.word == "default"
            ):
                return

    def _compact(
        self, context: CallContext, row: int, inside: said.RapidStatement, here: Arrived
    ) -> None:
        """Run the statement behind a condition."""
        if isinstance(inside, said.Instruction):
            after = self._instruction(context, row, inside, here)
            if after is not None:
                self._enter(context, row + 1, after)
        elif isinstance(inside, said.JumpTo | said.Leave | said.CompactIf):
            self._part(context, row, inside, here)
        elif type(inside) not in _PLAIN:
            self._enter(context, row + 1, self._unknown(context, row, here))

    def _loop(
        self, context: CallContext, row: int, one: said.ForLoop, here: Arrived
    ) -> None:
        """Begin a loop: round by round where its bounds are known."""
        behind = _after_block(context.flow, row)
        rounds = self._rounds(context, row, one)
        if rounds is None:
            self._enter(context, row + 1, here)
            self._enter(context, behind, here)
        elif rounds:
            first = self._round(context, row, one.name, rounds, 0)
            self._enter(first, row + 1, here)
        else:
            self._enter(context, behind, here)

    def _rounds(
        self, context: CallContext, row: int, one: said.ForLoop
    ) -> tuple[float, ...] | None:
        """Return the values of a loop's variable, None where they are not known."""
        task, scope = self.task, context.scope
        first, last = (task.number(x, row, scope) for x in (one.first, one.last))
        step = 1.0 if last >= first else -1.0
        if one.step is not None:
            step = task.number(one.step, row, scope)
        if first != first or last != last or step != step or step == 0.0:
            return None
        count = max(int((last - first) / step + 1 + 1e-9), 0)
        if count > MOST_ROUNDS:
            return None
        return tuple(first + k * step for k in range(count))

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
            self._enter(context, head + 1, here)
            self._enter(context, row + 1, here)
        elif context.round + 1 < len(context.rounds):
            name = context.scope.loops[-1][0]
            after = context.round + 1
            next_ = self._round(context.outer, head, name, context.rounds, after)
            self._enter(next_, head + 1, here)
        else:
            self._enter(context.outer, row + 1, here)

    def _jump(self, context: CallContext, row: int, name: str, here: Arrived) -> None:
        """Go to a label, out of the rounds that it is not in."""
        to = context.flow.labels.get(name)
        if to is None:
            self._enter(context, row + 1, self._unknown(context, row, here))
            return
        while context.outer is not None and not (
            context.loop < to < context.flow.loops.get(context.loop, context.loop)
        ):
            context = context.outer
        self._enter(context, to, here)

    def _return(self, context: CallContext, here: Arrived) -> None:
        """Go back to where the routine was called."""
        while context.outer is not None:
            context = context.outer
        file, flow = context.scope.file, context.flow
        if len(flow.handlers):
            if self._any_moves(context.scope, flow.handlers):
                here = here.lost()
            elif self._handler_returns(file, flow):
                here = replace(here, origins=here.origins | NOWHERE)
        if context.caller is not None:
            self._enter(context.caller, context.back, here)

    def _handler_returns(self, file: int, flow: RoutineFlow) -> bool:
        """Tell whether an error may end the routine early."""
        text = self.task.files[file].text
        words = {
            one.word
            for row in flow.handlers
            if isinstance(one := inside(text.statement(row)), said.Leave)
        }
        return "return" in words or not words

    # What instructions do.

    def _instruction(
        self, context: CallContext, row: int, one: said.Instruction, here: Arrived
    ) -> Arrived | None:
        """Run an instruction; None where it goes on in a routine."""
        here = self._after_functions(context, row, one, here)
        name, scope = one.name, context.scope
        found = self.task.routine(name, scope)
        if name in MOTIONS and name not in self.task.routines:
            return self._move(context, row, one, here)
        if found is not None:
            self.reached.add((scope.file, row))
            return self._enter_routine(context, row, found, here)
        if name in self.task.routines:
            return self._unknown(context, row, here, "names several routines")
        kind = known_instructions().get(name)
        if name in STOPPED:
            return here.lost()
        if kind == "modal":
            modes = changed_modes(
                name, one.arguments, here.modes,
                lambda operand: self.task.number(operand, row, scope),
                lambda operand: pose_of(self.task.record(operand, row, scope)),
            )  # fmt: skip
            return replace(here, modes=modes)
        if kind is not None or self._said_still(name):
            return here
        return self._outside(context, row, name, here)

    def _said_still(self, name: str) -> bool:
        start = self.start
        if start.routines.get(name) == "still":
            return True
        return any(fnmatchcase(name, pattern) for pattern in start.still)

    def _outside(
        self, context: CallContext, row: int, name: str, here: Arrived
    ) -> Arrived:
        """Call a routine that is not at hand: the cell may say what it does."""
        said_of_it = self.start.routines.get(name)
        if said_of_it == "moves":
            return replace(here, origins=NOWHERE)
        if said_of_it == "sets-frames":
            return here.lost()
        what = (
            "is neither a known instruction nor a routine of the files at hand: it may "
            f"move the arm. Say what it does under [routines] in the cell: {name} = "
            '"still" or "moves"'
        )
        return self._unknown(context, row, here, what)

    def _enter_routine(
        self, context: CallContext, row: int, found: tuple[int, str, RapidScope],
        here: Arrived,
    ) -> Arrived | None:  # fmt: skip
        """Go on in a routine, but for one that is being run."""
        file, module, routine = found
        if context.is_within(file, routine) or context.depth > DEEPEST:
            return self._unknown(context, row, here, "calls itself: it is not followed")
        self._call(file, module, routine, context, row + 1, here)
        return None

    def _call(
        self, file: int, module: str, routine: RapidScope, caller: CallContext | None,
        back: int, here: Arrived,
    ) -> None:  # fmt: skip
        """Begin a routine."""
        key = caller, back, file, routine.first
        if key not in self._contexts:
            place = file, routine.first
            if place not in self._flows:
                self._flows[place] = flow_of(self.task.files[file].text, routine)
            scope = self.task.scope_of(file, module, routine)
            depth = 0 if caller is None else caller.depth + 1
            flow = self._flows[place]
            self._contexts[key] = CallContext(scope, routine, flow, depth, caller, back)
        context = self._contexts[key]
        if self._any_moves(context.scope, context.flow.handlers):
            here = replace(
                here,
                modes=replace(here.modes, blocked=here.modes.blocked | {_HANDLER}),
            )
        self._enter(context, context.flow.first, here)

    def _move(
        self, context: CallContext, row: int, one: said.Instruction, here: Arrived
    ) -> Arrived:
        """Record the visits of a move; the arm then stands at the last."""
        self.reached.add((context.scope.file, row))
        known = self._numbers.get((context, row))
        if known is None:
            signature, scope = MOTIONS[one.name], context.scope
            found = [*self.goals.visits(one, signature, row, scope, here.modes)]
            known = [*range(len(self.visits), len(self.visits) + len(found))]
            self._numbers[context, row] = known
            self.visits += found
            self.order += [(*context.way(), row, k) for k in range(len(found))]
            for before, after in zip(known, found[1:], strict=False):
                after.origins = frozenset([before])
        for number in known:
            visit = self.visits[number]
            if visit.modes != here.modes:
                visit.modes = visit.modes.joined(here.modes)
        self.visits[known[0]].origins |= here.origins
        return Arrived(frozenset([known[-1]]), here.modes)

    def _after_functions(
        self, context: CallContext, row: int, one: said.RapidStatement, here: Arrived
    ) -> Arrived:
        """Allow for what the functions of a statement do."""
        for name in functions_in(one):
            found = self.task.routine(name, context.scope)
            own = name in self.task.routines
            if not own and (name in STILL_FUNCTIONS or self._said_still(name)):
                continue
            if found is None:
                what = f"calls the function {name}, which is not known: it may move"
                here = self._unknown(context, row, here, what)
            elif self._moves(*found):
                what = f"calls the function {name}, which moves: it is not followed"
                here = self._unknown(context, row, here, what)
        return here

    def _unknown(
        self, context: CallContext, row: int, here: Arrived, what: str = _NOT_FOLLOWED
    ) -> Arrived:
        """Say that a statement may move, and forget what was known."""
        self._say(context.scope.file, row, MOTION_UNKNOWN, what, quote=True)
        return here.lost()

    def _say(
        self, file: int, row: int, code: str, what: str, quote: bool = False
    ) -> None:
        text = self.task.files[file].text
        message = f"{shown(text, row)} {what}" if quote else what
        found = Diagnostic(text.source.name, text.line(row), code, message)
        self.diagnostics.add(found)

    # What a routine may do, read off its text.

    def _moves(self, file: int, module: str, routine: RapidScope) -> bool:
        """Tell whether a routine moves, or changes how moves are carried out."""
        key = file, routine.first
        if key not in self._moving:
            self._moving[key] = False  # of one that calls itself
            scope = self.task.scope_of(file, module, routine)
            rows = range(routine.first + 1, routine.last)
            self._moving[key] = self._any_moves(scope, rows)
        return self._moving[key]

    def _any_moves(self, scope: Scope, rows: range) -> bool:
        """Tell whether some statements may move the arm."""
        text = self.task.files[scope.file].text
        for row in rows:
            one = inside(text.statement(row))
            if isinstance(one, said.LateCall | said.NotUnderstood):
                return True
            if isinstance(one, said.Instruction):
                found = self.task.routine(one.name, scope)
                if found is not None:
                    if self._moves(*found):
                        return True
                elif not self._is_still(one.name):
                    return True
        return False

    def _is_still(self, name: str) -> bool:
        still = known_instructions().get(name) == "still" or name in HARMLESS
        return still or self._said_still(name)


_TRAP = "a TRAP of the task may move the arm, or change its settings, at any time"
_HANDLER = "the error handler of its routine may move the arm, or change its settings"


def _kind(routine: RapidScope) -> str:
    return getattr(routine.head, "kind", "")


def _ends(one: said.RapidStatement) -> bool:
    """Tell whether a statement only ends a block, or opens none."""
    return isinstance(one, said.BlockWord) and one.word in ("endif", "endtest")


def _after_block(flow: RoutineFlow, row: int) -> int:
    """Return the row behind the block that begins at one."""
    return flow.end.get(row, flow.last - 1) + 1
