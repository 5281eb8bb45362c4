"""Follow a KRL job from its first routine: every arrival, and where it comes from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from postproc.language.collect import cell_pose
from postproc.language.flow import HeadedRows
from postproc.language.interface import Start
from postproc.language.krl import syntax as said
from postproc.language.krl.frames import KrlFrame
from postproc.language.krl.modes import (
    HALTING,
    HARMLESS,
    PLANNED,
    KrlModes,
    ModeReader,
)
from postproc.language.krl.moves import KrlGoals
from postproc.language.krl.store import HELD
from postproc.language.krl.task import (
    FUNCTIONS,
    STILL,
    KrlTask,
    operands_of,
    parts_of,
)
from postproc.language.machine import Arrived, CallContext, Scope, TaskMachine
from postproc.language.visits import START

_PASSED = (
    said.AccessHeader, said.KrlDeclaration, said.OutsideName, said.InterruptDeclared,
    said.SpeedPart,
)  # fmt: skip
_ACTING = (
    said.Assignment, said.Instruction, said.KrlMove, said.SplineBlock, said.Waiting,
    said.ContinueWord, said.InterruptSwitched, said.PathTrigger,
)  # fmt: skip
_INTERRUPT = "an interrupt or a trigger may move the arm, or change its settings"
_RESUMED = "RESUME or BRAKE may end the way to it anywhere"


@dataclass
class KrlMachine(TaskMachine):
    """The ways through a KRL job.

    Attributes:
        task: Its files.
        goals: Reads destinations.
    """

    task: KrlTask = field(kw_only=True)
    goals: KrlGoals = field(kw_only=True)
    _moving: dict[tuple[int, int], bool] = field(default_factory=dict)

    @classmethod
    def of(cls, task: KrlTask, start: Start) -> KrlMachine:
        """Get ready to follow a job."""
        texts = [file.text for file in task.files]
        goals = KrlGoals(task, frozenset(start.aux))
        return cls(texts, start, task=task, goals=goals)

    def run(self) -> None:
        """Follow every way from the first routine."""
        modes = KrlModes(tool=_frame(self.start.tool), base=_frame(self.start.uframe))
        blocked = {_INTERRUPT} if self._interrupted() else set()
        blocked |= {_RESUMED} if self._resumed() else set()
        modes = replace(modes, blocked=frozenset(blocked))
        first = self.task.files[0]
        here = Arrived(frozenset([START]), modes)
        self.call(0, first.name, first.routines[0], None, -1, here)
        self.follow_all()

    # What a statement is.

    def acts(self, one: said.SourceStatement) -> bool:
        """Tell what moves, calls or sets, see `TaskMachine.acts`."""
        return isinstance(one, _ACTING)

    def goes_on(self, one: said.SourceStatement) -> bool:
        """Tell what does nothing, see `TaskMachine.goes_on`."""
        return isinstance(one, _PASSED)

    def number(self, operand: said.Operand | None, row: int, scope: Scope) -> float:
        """Evaluate a number, see `TaskMachine.number`."""
        return self.task.number(operand, row, scope)

    def scope_of(self, file: int, module: str, routine: HeadedRows) -> Scope:
        """Return where the statements of a routine stand."""
        return self.task.scope_of(file, module, routine)

    @staticmethod
    def usual_step(first: float, last: float) -> float:
        """Count by 1: a loop downwards needs STEP."""
        return 1.0

    # What it does.

    def act(
        self, context: CallContext, row: int, one: said.SourceStatement, here: Arrived
    ) -> Arrived | None:
        """Carry a statement out; None where it goes on in a routine."""
        here = self.after_functions(context, row, one, here)
        match one:
            case said.KrlMove():
                return self._move(context, row, one, here)
            case said.Assignment():
                return self._assign(context, row, one, here)
            case said.Instruction():
                return self._call(context, row, one, here)
            case said.Waiting():
                return _halted(here, True)
            case said.ContinueWord():
                return replace(here, modes=replace(here.modes, goes_on=True))
            case said.InterruptSwitched():
                return _halted(here, None)
            case _:
                return here

    def _move(
        self, context: CallContext, row: int, one: said.KrlMove, here: Arrived
    ) -> Arrived:
        """Record the visits of a move."""
        scope = context.scope
        after = self.arrive(
            context, row, here,
            lambda: [*self.goals.visits(one, row, scope, here.modes)],
        )  # fmt: skip
        return replace(after, modes=replace(after.modes, halted=False, goes_on=False))

    def _modes(self, context: CallContext, row: int) -> ModeReader:
        return ModeReader(self.task, row, context.scope)

    def _assign(
        self, context: CallContext, row: int, one: said.Assignment, here: Arrived
    ) -> Arrived:
        """Give a value to data, or change how moves are made."""
        name = one.target.name
        if name.startswith("$") and name not in PLANNED:
            here = _halted(here, True if name in HALTING else None)
        modes = self._modes(context, row).assigned(here.modes, one)
        if modes is None:
            what = (
                f"sets {name.upper()}: what that does to moves is not known. Take it "
                "out if it is not needed"
            )
            return self.unknown(context, row, here, what)
        return replace(here, modes=modes)

    def _call(
        self, context: CallContext, row: int, one: said.Instruction, here: Arrived
    ) -> Arrived | None:
        """Call a routine."""
        name = one.name
        found = self.task.routine(name, context.scope)
        if found is not None:
            return self.enter_routine(context, row, found, here)
        if name in self.task.routines:
            return self.unknown(context, row, here, "names several routines")
        if name == "bas":
            here = _halted(here, None) if _puts_out(one) else here
            modes = self._modes(context, row).bas(here.modes, one.arguments)
            return replace(here, modes=modes)
        if name == "pulse":
            return _halted(here, True)
        if name in STILL or self.said_still(name):
            return _halted(here, None)
        return self.outside(context, row, name, here)

    def after_functions(
        self, context: CallContext, row: int, one: said.SourceStatement, here: Arrived
    ) -> Arrived:
        """Allow for what a statement reads, and for what its functions do."""
        for part in parts_of(operands_of(one)):
            if isinstance(part, said.FunctionCall):
                here = self._function(context, row, part.name, here)
            elif isinstance(part, said.DataObject) and part.name.startswith("$"):
                given = isinstance(one, said.Assignment) and part is one.target
                known = part.name in PLANNED or isinstance(one, said.KrlMove)
                if given or (known and part.name not in HALTING):
                    continue
                here = _halted(here, True if part.name in HALTING else None)
        return here

    def _function(
        self, context: CallContext, row: int, name: str, here: Arrived
    ) -> Arrived:
        """Allow for what a function does."""
        found = self.task.routine(name, context.scope)
        if found is not None:
            if not self._moves(found[0], found[2]):
                return _halted(here, None)
            what = f"calls the function {name}, which moves: it is not followed"
            return self.unknown(context, row, here, what)
        if name in FUNCTIONS or name in STILL or self.said_still(name):
            return here
        what = f"calls the function {name}, which is not known: it may move"
        return self.unknown(context, row, here, what)

    # What a routine may do, read off its text.

    def _interrupted(self) -> bool:
        """Tell whether an interrupt or a trigger moves, or sets what moves need."""
        for file, text in enumerate(self.texts):
            for row in range(len(text)):
                one = text.statement(row)
                if isinstance(one, said.InterruptDeclared | said.PathTrigger):
                    if self._any_moves(file, [one.action]):
                        return True
        return False

    def _resumed(self) -> bool:
        """Tell whether an interrupt may end moves before their targets."""
        said_of = (one for text in self.texts for one in text.said)
        return any(
            isinstance(one, said.InterruptSwitched) and one.word in ("brake", "resume")
            for one in said_of
        )

    def _moves(self, file: int, routine: HeadedRows) -> bool:
        """Tell whether a routine moves, or changes how moves are carried out."""
        key = file, routine.first
        if key not in self._moving:
            self._moving[key] = False  # of one that calls itself
            text = self.texts[file]
            rows = range(routine.first + 1, routine.last)
            self._moving[key] = self._any_moves(file, map(text.statement, rows))
        return self._moving[key]

    def _any_moves(self, file: int, some: Iterable[said.SourceStatement]) -> bool:
        """Tell whether some statements may move the arm, or set what moves need."""
        here = Scope(file, self.task.files[file].name, "")
        for one in some:
            if isinstance(one, said.KrlMove | said.SplineBlock | said.NotUnderstood):
                return True
            if isinstance(one, said.Assignment) and _is_modal(one.target.name):
                return True
            parts = parts_of(operands_of(one))
            names = [p.name for p in parts if isinstance(p, said.FunctionCall)]
            if isinstance(one, said.Instruction):
                names.append(one.name)
            if any(self._may_move(name, here) for name in names):
                return True
        return False

    def _may_move(self, name: str, here: Scope) -> bool:
        found = self.task.routine(name, here)
        if found is not None:
            return self._moves(found[0], found[2])
        return not (name in STILL or name in FUNCTIONS or self.said_still(name))


def _puts_out(one: said.Instruction) -> bool:
    """Return True if a call of BAS switches outputs, which may stop the arm."""
    command = one.arguments[0].value if one.arguments else None
    return isinstance(command, said.EnumValue) and command.name.startswith("#out_")


def _is_modal(name: str) -> bool:
    """Tell whether setting a variable may change how moves are made."""
    own = name in ("fdat_act", "pdat_act", "ldat_act") or name in HELD
    return own or (name.startswith("$") and name not in HALTING | HARMLESS)


def _frame(record: tuple[float, ...] | None) -> KrlFrame:
    """Take a frame over from the cell."""
    return KrlFrame(() if record is None else cell_pose(record))


def _halted(here: Arrived, halted: bool | None) -> Arrived:
    """Say that the arm stops before it goes on, or that it may (None)."""
    modes = here.modes
    if modes.goes_on:
        return replace(here, modes=replace(modes, goes_on=False))
    if modes.halted or modes.halted == halted:
        return here
    return replace(here, modes=replace(modes, halted=halted))
