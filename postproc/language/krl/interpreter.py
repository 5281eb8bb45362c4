"""Follow a KRL job from its first routine: every arrival, and where it comes from."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

from postproc.diagnostics import Code, Reason
from postproc.language import ir
from postproc.language.analysis.assigned_points import Scope
from postproc.language.analysis.call_context import At, Context
from postproc.language.analysis.conditions import TaskFrame, cell_pose
from postproc.language.analysis.declarations import TaskRoutine
from postproc.language.analysis.shared_changes import describe_call
from postproc.language.analysis.symbols import whole
from postproc.language.analysis.task_machine import (
    MOVES,
    Arrived,
    Effects,
    TaskMachine,
    scope_at,
)
from postproc.language.krl import syntax as said
from postproc.language.krl.inline_forms import sets_modes, takes_plain
from postproc.language.krl.modal_state import (
    HALTING,
    HARMLESS,
    PLANNED,
    KrlModes,
    ModeReader,
)
from postproc.language.krl.moves import KrlGoal
from postproc.language.krl.symbols import (
    AHEAD,
    ASSUMED,
    FUNCTIONS,
    HELD,
    STILL,
    KrlTask,
    package_routines,
)
from postproc.language.language import Record, Start
from postproc.language.visits import START

_INTERRUPT = Reason(
    Code.BESIDE_PROGRAM,
    "an interrupt or a trigger may move the arm, or change its settings",
)
_RESUMED = Reason(Code.ENDS_ELSEWHERE, "RESUME or BRAKE may end the way to it anywhere")
_ENDED = Reason(
    Code.ENDS_ELSEWHERE,
    "RESUME may end the way to it anywhere, while its interrupt is on",
)
BRAKES, RESUMES = "brake", "resume"
"""What statements may do to moves that are under way, beside `MOVES`."""
EVERY = -1  # interrupt whose number is not known
FURTHEST_AHEAD = 5  # moves, by $ADVANCE


class _InterruptStatement(NamedTuple):
    """What a statement says of an interrupt.

    Attributes:
        file, row: The statement.
        routine: The key of its routine.
        word: decl, on, off, enable, disable, brake or resume.
        number: Of the interrupt, EVERY where it is not known.
        one: The statement.
    """

    file: int
    row: int
    routine: tuple[int, int]
    word: str
    number: int
    one: Any


@dataclass
class KrlMachine(TaskMachine):
    """The ways through a KRL job.

    Attributes:
        task: Its files.
    """

    procedures = ("def",)
    reader = KrlGoal
    still = STILL | FUNCTIONS
    ends_apart = True
    passed = (ir.Declaration,)
    acting = (
        ir.Assignment, ir.Instruction, said.KrlMove, said.SplineBlock, said.Waiting,
        said.ContinueWord, said.InterruptSwitched, said.PathTrigger,
        said.InterruptDeclared,
    )  # fmt: skip
    task: KrlTask = field(kw_only=True)
    _met: set[tuple[int, int]] = field(default_factory=set)
    _assumed: dict[str, tuple[int, int]] = field(default_factory=dict)
    _changed: dict[tuple[int, int, int], frozenset[str]] = field(default_factory=dict)
    _before: dict[Reason, set[int]] = field(default_factory=lambda: defaultdict(set))

    def run(self) -> None:
        """Follow every way from the first routine."""
        modes = KrlModes(
            tool=_frame(self.task.start, self.task.start.tool),
            base=_frame(self.task.start, self.task.start.uframe),
        )
        modes = modes.beside(self.task)
        first = self.task.files[0]
        here = self.begin(frozenset([START]), modes)
        main = TaskRoutine(0, first.name, first.routines[0])
        if main.rows.head.name not in self.task.outside_calls:
            self.call_routine(main, None, here)
        if self.task.outside_calls:
            self._begin_anywhere(here)
        self.follow()
        for name, (file, row) in self._assumed.items():
            place, text = Scope(file, "", "", row=row), f"{name.upper()} {ASSUMED}"
            self.say(place, Code.ROUTINE_ASSUMED_MOTIONLESS, text)

    def _begin_anywhere(self, here: Arrived) -> None:
        """Begin the routines that other programs call, wherever these are then.

        Modes are those of any program as long as none sets others.
        """
        kept = {"orientation", "interpolation"} - self.task.outside_modes
        own = {name: getattr(here.modes, name) for name in kept}
        lost = here.forget()
        lost = replace(lost, modes=lost.modes.with_(**own))
        for name, call in self.task.outside_calls.items():
            for one in self.task.routines[name]:
                if not one.rows.head.local:
                    place = Scope(one.file, "", "", row=one.rows.first)
                    self.say(place, Code.CALLED_BY_OTHERS, describe_call(call))
                    self.call_routine(one, None, lost)

    # What a statement is.

    def is_move(self, one: ir.SourceStatement) -> bool:
        """Return True for moves."""
        return isinstance(one, said.KrlMove)

    def planner_of(self, one: ir.SourceStatement) -> str:
        """Return the planner of a move: they do not blend into each other."""
        spline = isinstance(one, said.KrlMove) and one.word.startswith("s")
        return "spline" if spline else "path"

    def reads_at_once(self, context: Context) -> bool:
        """Return False where an interrupt may end any move, or in a system file."""
        file = self.task.files[context.place.scope.file]
        alone = self._has_interrupts or file.is_system
        return super().reads_at_once(context) and not alone

    def is_setting(self, one: ir.SourceStatement) -> bool:
        """Return True for what inline forms set; some routines do nothing at all."""
        if isinstance(one, ir.Instruction) and one.name not in self.task.routines:
            known = package_routines().get(one.name) == AHEAD
            if known and not self._is_overruled(one.name):
                return takes_plain(one.arguments)
        own = "bas" in self.task.routines or self.task.copies_are_points
        return sets_modes(one) and not own

    def list_apart(self, file: int) -> set[int]:
        """Return the points of splines."""
        return {row for rows in self.task.files[file].splines for row in rows}

    def counts_alone(self, at: At, one: ir.ForLoop) -> bool:
        """Return True if only the loop changes its variable, see `TaskMachine`.

        One that is not the routine's own may be changed by routines that the loop
        calls, and by what runs beside it.
        """
        scope, behind = at.place.scope, at.place.flow.loops.get(at.row, at.row)
        key = scope.file, at.row + 1, behind
        if key not in self._changed:
            text, changes = self.texts[scope.file], self.task.list_changes
            own = (changes(text.statement(row)) for row in range(at.row + 1, behind))
            changed = frozenset(data.name for some in own for data in some)
            place = self.task.place(one.name, scope)
            if place is None or place[2] != scope.routine:
                changed |= self._list_changes({key}) | self.task.volatile
                changed |= self.task.beside
            self._changed[key] = changed | self.task.odd_words
        return one.name not in self._changed[key]

    @cached_property
    def _has_interrupts(self) -> bool:
        """Return True if interrupts or triggers may move the arm, or end its moves."""
        kinds = said.InterruptDeclared | said.PathTrigger
        for number, file in enumerate(self.task.files):
            here = Scope(number, file.name, "")
            for row in file.text.of_kind(lambda one: isinstance(one, kinds)):
                one = file.text.statement(row)
                assert isinstance(one, kinds)
                if self.effects_of(one.action, here):
                    return True
        return False

    # What it does.

    def carry_out(
        self, at: At, one: ir.SourceStatement, here: Arrived
    ) -> Arrived | None:
        """Carry a statement out; None where it goes on in a routine.

        Behind ON_ERROR_PROCEED an error skips it: both ways go on then.
        """
        if not here.modes.perhaps:
            return self._run_once(at, one, here)
        here = here.setting(perhaps=False)
        after = self._run_once(at, one, here)
        if after is None:
            self.go_on(at.behind, here)
            return None
        return after.join(here)

    def _run_once(
        self, at: At, one: ir.SourceStatement, here: Arrived
    ) -> Arrived | None:
        """Carry a statement out without an error."""
        here = self.after_functions(at, one, here)
        here = self._forget(at, one, here)
        match one:
            case said.KrlMove():
                after = self.arrive(at, one, here)
                return after.setting(halted=False, goes_on=False)
            case ir.Assignment():
                return self._assign(at, one, here)
            case ir.Instruction():
                return self._call(at, one, here)
            case said.Waiting():
                return _halt(here, True)
            case said.ContinueWord():
                return here.setting(goes_on=True)
            case said.InterruptDeclared():
                return self._declare(at, one, here)
            case said.InterruptSwitched():
                return self._switch(at, one, _halt(here, None))
            case said.PathTrigger():
                return self._trigger(at, one, here)
            case _:
                return here

    def _forget(self, at: At, one: ir.SourceStatement, here: Arrived) -> Arrived:
        """Forget what a routine may change of what is handed over to it."""
        if isinstance(one, said.InterruptDeclared | said.PathTrigger):
            return here
        if isinstance(one, said.KrlMove) and not self.list_asked(one):
            return here
        own = one.target if isinstance(one, ir.Assignment) else None
        modes = here.modes
        for target in self.task.list_changes(one):
            name = target.name
            if target is own or not _is_modal(name):
                continue
            if name not in HELD:
                what = f"hands {name.upper()} over, which may be changed"
                return self.unknown(at, here, what)
            modes = modes.drop(name)
        return here.with_modes(modes)

    def _modes(self, at: At, here: Arrived) -> ModeReader:
        return ModeReader(self.task, scope_at(at, here))

    def _assign(self, at: At, one: ir.Assignment, here: Arrived) -> Arrived:
        """Give a value to data, or change how moves are made."""
        name = one.target.name
        if name.startswith("$") and name not in PLANNED:
            here = _halt(here, True if name in HALTING else None)
        modes = self._modes(at, here).assign(here.modes, one)
        if modes is None:
            what = (
                f"sets {name.upper()}: what that does to moves is not known. Take it "
                "out if it is not needed"
            )
            return self.unknown(at, here, what)
        value = one.value
        if isinstance(value, ir.FunctionCall) and value.name in ("eb", "eb_abs"):
            # The base follows a conveyor, which takes the arm along.
            here = here.elsewhere()
        return self.assign_point(at, one, here).with_modes(modes)

    def _call(self, at: At, one: ir.Instruction, here: Arrived) -> Arrived | None:
        name = one.name
        if name in self.task.routines:
            return self.call_named(at, name, here)
        if name == "bas":
            command = one.arguments[0].value if one.arguments else None
            if isinstance(command, said.EnumValue) and command.name.startswith("#out_"):
                here = _halt(here, None)  # outputs are switched, which may stop the arm
            return here.with_modes(self._modes(at, here).bas(here.modes, one.arguments))
        if name == "pulse":
            return _halt(here, True)
        if name == "on_error_proceed":
            return here.setting(perhaps=True)
        if name in STILL or self.declares_motionless(name):
            return _halt(here, None)
        if name in package_routines() and not self._is_overruled(name):
            if package_routines()[name] == AHEAD:
                return here
            place = at.place.scope.file, at.row
            self._assumed[name] = min(self._assumed.get(name, place), place)
            return _halt(here, None)
        return self.outside(at, name, here)

    def _is_overruled(self, name: str) -> bool:
        """Return True if the cell says what a routine of a package does."""
        return self.task.start.assume_motion or name in self.task.start.routines

    def after_functions(
        self, at: At, one: ir.SourceStatement, here: Arrived
    ) -> Arrived:
        """Allow for what a statement reads, and for what its functions do."""
        for part in self.list_asked(one):
            if isinstance(part, ir.FunctionCall):
                after = self.call_function(at, part.name, here)
                own = part.name in self.task.routines
                here = _halt(here, None) if own and after is here else after
            else:
                given = isinstance(one, ir.Assignment) and part is one.target
                known = part.name in PLANNED or isinstance(one, said.KrlMove)
                if given or (known and part.name not in HALTING):
                    continue
                here = _halt(here, True if part.name in HALTING else None)
        return here

    def is_asked(self, part: ir.Node) -> bool:
        """Return True for functions and system variables."""
        system = isinstance(part, ir.DataObject) and part.name.startswith("$")
        return system or super().is_asked(part)

    # Interrupts and triggers.

    def _declare(self, at: At, one: said.InterruptDeclared, here: Arrived) -> Arrived:
        """Declare an interrupt; one that nothing switches on may be on already."""
        self._met.add((at.place.scope.file, at.row))
        effects = self.effects_of(one.action, at.place.scope)
        self._call_beside(one.action)
        number = self._number_of(scope_at(at), one.number)
        others = frozenset(d for d in here.modes.declared if d[0] != number)
        here, ends = here.setting(declared=others), RESUMES in effects
        if ends and (MOVES in effects or not self._ends_routines(number)):
            self._begin_early(_RESUMED, here)
            return here.blocking(_RESUMED)
        if effects:
            moves = self._moving(at, one.action) if MOVES in effects else _RESUMED
            own = number, _ENDED if ends else moves
            here = here.setting(declared=others | {own})
            if not self._find_routines(("on",), {number, EVERY}):  # nothing does
                self._begin_early(own[1], here)
                here = here.setting(active=here.modes.active | {own})
        return here

    # RESUME ends all routines that have been called where its interrupt is declared,
    # and the program goes on behind the call, wherever the arm is.

    def _ends_routines(self, number: int) -> bool:
        """Return True if an interrupt is switched on in routines alone that are called.

        They do not declare it, and nothing switches it on where it is declared.
        """
        switching = self._find_routines(("on",), {number, EVERY})
        declaring = self._find_routines(("decl",), {number, EVERY})
        known = number != EVERY and bool(switching)
        return known and declaring.isdisjoint(switching)

    @cached_property
    def _interrupts(self) -> list[_InterruptStatement]:
        """List all that programs say of interrupts, but for submit programs."""
        found, kinds = [], said.InterruptDeclared | said.InterruptSwitched
        for file, own in enumerate(self.task.files):
            if own.is_submit:
                continue
            text, here = own.text, Scope(file, own.name, "")
            for row in text.of_kind(lambda one: isinstance(one, kinds)):
                one, around = text.statement(row), self.task.routine_around(file, row)
                word = "decl" if isinstance(one, said.InterruptDeclared) else one.word
                number = self._number_of(here.at(row), one.number)
                routine = around.key if around else (file, -1)
                found.append(_InterruptStatement(file, row, routine, word, number, one))
        return found

    def _find_routines(
        self, words: Sequence[str], numbers: set[int]
    ) -> set[tuple[int, int]]:
        """Return the routines that say something of some interrupts, by their keys."""
        return {
            one.routine for one in self._interrupts
            if one.word in words and one.number in numbers
        }  # fmt: skip

    def at_return(self, context: Context, here: Arrived) -> Arrived:
        """Allow for a RESUME in the routine, see `TaskMachine.at_return`."""
        ending = {own for own in here.modes.declared if own[1] == _ENDED}
        if not ending:
            return here
        numbers = {number for number, _ in ending} | {EVERY}
        switching = self._find_routines(("on", "off"), numbers)
        called = self.reach_from([context.place.routine])
        switches = any(one.key in switching for one in called)
        if not (ending & here.modes.active or switches):
            return here
        ended = here.forget()
        on = {own for own in ending if own[0] in self._still_enabled}
        left = (ended.modes.active - ending) | on
        return here.join(ended.setting(active=left))

    @cached_property
    def _still_enabled(self) -> set[int]:
        """Numbers of interrupts whose routines may leave them on, EVERY for unknown."""
        declared = (one for one in self._interrupts if one.word == "decl")
        return {one.number for one in declared if not self._switches_itself_off(one)}

    def _switches_itself_off(self, declared: _InterruptStatement) -> bool:
        """Return True if the routine of an interrupt first of all switches it off."""
        name = getattr(declared.one.action, "name", "")
        here = Scope(declared.file, self.task.files[declared.file].name, "")
        found = self.task.routine(name, here)
        if found is None:
            return False
        for row in found.inside:
            one = self.texts[found.file].statement(row)
            if isinstance(one, said.InterruptSwitched) and one.word == "off":
                there = Scope(found.file, found.module, "")
                own = self._number_of(there.at(row), one.number)
                return one.number is None or own == declared.number
            if not isinstance(one, ir.Declaration):
                return False
        return False

    def _switch(self, at: At, one: said.InterruptSwitched, here: Arrived) -> Arrived:
        self._met.add((at.place.scope.file, at.row))
        modes, number = here.modes, self._number_of(scope_at(at), one.number)
        if one.word == "on":
            meant = {
                d for d in modes.declared if EVERY in (number, d[0]) or d[0] == number
            }
            for _, why in meant:
                self._begin_early(why, here)
            return here.setting(active=modes.active | meant)
        if one.word != "off" or (one.number is not None and number == EVERY):
            return here
        left = {d for d in modes.active if one.number is not None and d[0] != number}
        if left == modes.active:
            return here
        return here.setting(active=frozenset(left)).forget()

    def _begin_early(self, why: Reason, here: Arrived) -> None:
        """Note that an interrupt may come in moves before it is switched on.

        The program is ahead of the arm, unless it has waited for it.
        """
        if not here.modes.halted:
            self._before[why] |= here.origins

    @cached_property
    def early(self) -> Mapping[int, frozenset[Reason]]:
        """Return visits on whose way an interrupt may come that is switched on later.

        The program is ahead by `FURTHEST_AHEAD` moves at most.
        """
        found: dict[int, frozenset[Reason]] = {}
        for why, origins in self._before.items():
            reached = self.list_visits(frozenset(origins))
            for _ in range(FURTHEST_AHEAD):
                behind = [self.visits[k] for k in reached]
                before = [v.origins for v in behind if not v.modes.halted]
                reached |= self.list_visits(frozenset().union(*before))
            for k in reached:
                found[k] = found.get(k, frozenset()) | {why}
        return found

    def _number_of(self, here: Scope, operand: ir.Operand | None) -> int:
        """Return the number of an interrupt, EVERY where it is not known."""
        number = whole(self.task.number(operand, here))
        return EVERY if number is None else number

    def _trigger(self, at: At, one: said.PathTrigger, here: Arrived) -> Arrived:
        """Leave what comes behind a trigger that may set what moves need.

        What it does comes at some time in the next move, when the program is ahead.
        """
        if not self.effects_of(one.action, at.place.scope):
            return here
        self._call_beside(one.action)
        return here.blocking(self._moving(at, one.action))

    def _moving(self, at: At, action: ir.SourceStatement) -> Reason:
        """Say which interrupt or trigger may move the arm, and what it calls."""
        file = self.texts[at.place.scope.file]
        names = sorted({name.upper() for name in self.names_called(action)})
        calls = f" calls {' and '.join(names)}" if names else ""
        where = f"line {file.line(at.row)} of {file.source.name}"
        return replace(_INTERRUPT, text=f"{_INTERRUPT.text}: {where}{calls}")

    def _call_beside(self, action: ir.SourceStatement) -> None:
        """Note the routines that an interrupt or a trigger calls."""
        for called in self.calls_of(action):
            self.run_beside(called)

    def calls_of(self, one: ir.SourceStatement) -> Iterable[TaskRoutine]:
        """Return what an interrupt calls later, too."""
        if isinstance(one, said.InterruptDeclared):
            one = one.action
        return super().calls_of(one)

    def is_beside(self, one: ir.SourceStatement) -> bool:
        """Return True if a statement says what is done at another time."""
        return isinstance(one, said.InterruptDeclared | said.PathTrigger)

    @cached_property
    def everywhere(self) -> frozenset[Reason]:
        """Return why no target can be compensated, once all ways are followed.

        An interrupt that no way declares, or that no way switches on, may be on at any
        time: by a routine that is not followed, or by another program.
        """
        odd = {"interrupt", "trigger"} & self.task.odd_words
        found, unseen_on = {_INTERRUPT} if odd else set(), False
        unseen = (d for d in self._interrupts if (d.file, d.row) not in self._met)
        for file, _, _, word, _, one in unseen:
            if word == "decl":
                here = Scope(file, self.task.files[file].name, "")
                effects = self.effects_of(one.action, here)
                found |= {_INTERRUPT} if MOVES in effects else set()
                found |= {_RESUMED} if effects - {MOVES} else set()
            unseen_on |= word == "on"
        if unseen_on:
            found |= {why for v in self.visits for _, why in v.modes.declared}
        return frozenset(found)

    # What a routine may do, read off its text.

    def own_effects(self, one: ir.SourceStatement) -> Effects:
        """Return that a statement moves, sets what moves need, or ends moves."""
        match one:
            case said.KrlMove() | said.SplineBlock() | ir.NotUnderstood():
                return frozenset([MOVES])
            case said.InterruptSwitched(word=word) if word in (BRAKES, RESUMES):
                return frozenset([word])
            case said.PathTrigger(action=action):
                return self.own_effects(action)
        modal = any(_is_modal(data.name) for data in self.task.list_changes(one))
        return frozenset([MOVES] if modal else [])

    def names_called(self, one: ir.SourceStatement) -> Iterable[str]:
        """Return functions and the instruction; of a trigger what it does."""
        if isinstance(one, said.PathTrigger):
            one = one.action
        return super().names_called(one)

    def is_still(self, name: str) -> bool:
        """Add the shipped list of routines of packages."""
        listed = name in package_routines() and not self._is_overruled(name)
        return listed or super().is_still(name)


def _is_modal(name: str) -> bool:
    """Tell whether setting a variable may change how moves are made."""
    own = name in ("fdat_act", "pdat_act", "ldat_act") or name in HELD
    return own or (name.startswith("$") and name not in HALTING | HARMLESS)


def _frame(start: Start, record: Record) -> TaskFrame:
    """Take a frame over from the cell."""
    return TaskFrame(cell_pose(record), taught=record in start.taught_records)


def _halt(here: Arrived, halted: bool | None) -> Arrived:
    """Say that the arm stops before it goes on, or that it may (None)."""
    if here.modes.goes_on:
        return here.setting(goes_on=False)
    return here if here.modes.halted else here.setting(halted=halted)
