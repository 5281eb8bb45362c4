"""From a parsed program to its visits: what it moves to, and from where."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from postproc.diagnostics import Code, Reason
from postproc.files import base_name
from postproc.language import ir
from postproc.language.analysis.call_context import CALLED, HANDLED, At, Context
from postproc.language.analysis.interpreter import MOST_STEPS, NOT_UNROLLED
from postproc.language.analysis.origins import NOWHERE
from postproc.language.analysis.shared_changes import OutsideCall, describe_call
from postproc.language.language import JobReading, Start
from postproc.language.pdl2 import calls, values
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.abstract_state import FRAMES, Store
from postproc.language.pdl2.evaluate import Execution
from postproc.language.pdl2.initial_values import fill_initial, keep_values
from postproc.language.pdl2.job import Place, World
from postproc.language.pdl2.machine import (
    Machine,
    Pdl2Goal,
    Pdl2Visit,
    invalidate,
    invalidate_names,
    let_others_run,
)
from postproc.language.pdl2.move_blocks import MoveBlocks
from postproc.language.pdl2.moves import move
from postproc.language.pdl2.other_programs import find_calls
from postproc.language.pdl2.program import Program
from postproc.language.pdl2.side_effects import (
    CallGraph,
    has_target,
    is_harmless,
    list_changed_arguments,
    list_live,
    live_rows,
    names_but_ends,
    words_in,
)
from postproc.language.pdl2.to_visits import Pdl2Collector
from postproc.language.pdl2.variable_file import VariableFile
from postproc.language.visits import START, Meaning
from postproc.robot.trajectory import Motion

_MOVES = re.compile(r".*\b(?:MOVE|MOVEFLY|SYNCMOVE|SYNCMOVEFLY)\b", re.I)


@dataclass(kw_only=True)
class Pdl2Machine(Machine):
    """The ways through a PDL2 program: what each statement does to the store.

    Attributes:
        blocks: Moves that are run at once.
    """

    blocks: MoveBlocks = field(init=False)

    def __post_init__(self) -> None:
        """Find blocks with what is known of the job."""
        self.blocks = MoveBlocks(self)

    def point(self, at: At, store: Store) -> Execution:
        """Return the point of the execution at a row."""
        return Execution(self.world, at.place, at.row, store, at.context)

    def run_block(self, at: At, state: Store) -> tuple[int, Store] | None:
        """Run a block of moves, or all moves of a body whose blocks do not close."""
        here = self.point(at, state)
        if here.place.body.broken:
            run_broken(self, here)
            return here.place.body.last, state
        return (here.row, state) if self.blocks.run(here) else None

    def act(self, at: At, one: ir.SourceStatement, state: Store) -> Store | None:
        """Run one statement that leads to the next row, or into a routine."""
        if isinstance(one, ast.When):
            then = one.then
            return state if then is None else self.run_one(at, then, state)
        here = self.point(at, state)
        text = one.text if isinstance(one, ir.NotUnderstood) else ""
        prepare(self, here, one, text)
        return state if step(self, here, one) else None

    def before(self, at: At, one: ir.SourceStatement, state: Store) -> Store:
        """Allow for what a line does besides leading elsewhere."""
        here = self.point(at, state)
        written = here.place.program.lines.statement(at.row)
        text = written.text if isinstance(written, ir.NotUnderstood) else ""
        prepare(self, here, one, text)
        if text:
            _forget_by_text(here, text, _forget_names(here, text))
        return state

    def evaluate(
        self, at: At, operand: ir.Operand | None, state: Store
    ) -> float | str | None:
        """Return a number, a text or a truth, None where only the run tells."""
        found = self.point(at, state).value(operand)
        return found if isinstance(found, float | bool | str) else None

    def selector(self, head: ir.SourceStatement) -> ir.Operand | None:
        """Return what SELECT names."""
        return super().selector(ast.action(head) or head)

    def counts_alone(self, at: At, loop: ir.ForLoop) -> bool:
        """Tell whether nothing but a loop itself changes its variable."""
        place, key = at.place, self.world.root(at.place, loop.name)
        inside = list_live(self.world, place, at.row + 1, place.flow.end[at.row])
        return loop.name not in self.world.volatile and not any(
            loop.name in own.assigned and self.world.root(other, loop.name) == key
            for other, own in inside
        )

    def say_not_unrolled(self, at: At, rounds: int) -> None:
        """Say that a loop runs too often to be followed round by round."""
        text = NOT_UNROLLED.format(rounds)
        code, program = Code.LOOP_NOT_UNROLLED, at.place.program
        self.world.report_once(program, at.row, code, str(at.row), text)

    def begin_round(
        self, at: At, loop: ir.ForLoop, value: float, state: Store
    ) -> tuple[Place, Store]:
        """Give the variable of a loop its value."""
        key = self.point(at, state).locate(ir.DataObject(loop.name)).key
        state.write(key, value)
        return at.place, state

    def forget_counter(
        self, at: At, loop: ir.ForLoop, ended: bool, state: Store
    ) -> Store:
        """Forget the variable of a loop."""
        why = "it counted a loop that has ended" if ended else "it counts a loop"
        invalidate(self.point(at, state), ir.DataObject(loop.name), why)
        return state

    def leave(self, context: Context, state: Store, by_return: bool = False) -> None:
        """Go back to the caller, or into the next cycle."""
        call = context.call
        body = call.place.body
        if not by_return and body.flow.cycle >= 0 and not body.name:
            self.enter(At(call, body.flow.cycle), state)
        elif call.kind == CALLED:
            for name in body.own_names:
                state.drop(self.world.root(call.place, name))
            self.return_to_caller(call, state)

    def leave_otherwise(self, at: At, one: ir.Leave, state: Store) -> Store | None:
        """Begin the next cycle (EXIT CYCLE); without one the program goes on."""
        _cancel(self.point(at, state))
        return None if self.begin_cycle(at.context, state) else state


# What each statement does to the store.


def prepare(
    machine: Machine, here: Execution, statement: ir.SourceStatement, text: str
) -> None:
    """Allow for what may happen at a statement, and for the functions that it calls.

    Args:
        machine: It follows the program.
        here: The statement.
        statement: What it says, without what follows it on its line.
        text: How it is written, where it is not understood.
    """
    if machine.cycle_left:
        left = here.store.copy()
        left.last = NOWHERE
        machine.begin_cycle(here.context, left)
    if _waits(statement):
        machine.paused |= here.store.last
    if _lets_others_run(statement) or text:
        let_others_run(here)
    calls.calls_in_expressions(machine, here, statement)


def _lets_others_run(one: ir.SourceStatement) -> bool:
    """Tell whether a statement takes time, or a program may wait with it."""
    words = ("condition", "while", "until", "cycle")
    if isinstance(one, ir.Branch | ir.BlockWord):
        return one.word in words
    return isinstance(one, ast.Still | ast.Transfer | ir.JumpTo)


def step(machine: Machine, here: Execution, statement: ir.SourceStatement) -> bool:
    """Run one statement; tell whether the next row follows."""
    match statement:
        case ast.Move():
            move(machine, here, statement)
        case ir.Assignment():
            lines = here.place.program.lines
            taught = here.world.taught_lines[lines.source.name]
            calls.assign(here, statement, lines.line(here.row) in taught)
        case ir.Instruction():
            return not calls.call_statement(machine, here, statement)
        case ast.Transfer("WRITE", operands):
            for operand in operands:
                here.world.pin(here.value(operand), "the program writes it out")
        case ast.Transfer(word, operands):
            for operand in list_changed_arguments(operands):
                invalidate(here, operand, f"{word} changes it")
        case ir.NotUnderstood():
            _unknown(machine, here, statement)
        case ast.CancelMove(arms):
            if not arms or any(here.is_ours(arm) is not False for arm in arms):
                _cancel(here)
    return True


def _waits(statement: ir.SourceStatement) -> bool:
    """Tell whether a statement takes time that only the run tells."""
    if isinstance(statement, ast.Transfer):
        return statement.word == "READ"
    return isinstance(statement, ast.Still) and statement.waits


_RUNNING = re.compile(
    rb"^[^\n]*?\b(?:ADVANCE|MOVEFLY|SYNCMOVEFLY|ASYNC)\b", re.I | re.M
)


def _cancel(here: Execution) -> None:
    """End a move on its way, where the program may have gone on before its end."""
    programs = here.world.programs()
    if any(_RUNNING.search(one.lines.source.data) for one in programs):
        here.store.lost |= here.store.last
        here.store.last |= NOWHERE


def _unknown(machine: Machine, here: Execution, statement: ir.NotUnderstood) -> None:
    """Forget all that unknown text could influence."""
    why, arrived = _forget_names(here, statement.text), frozenset[int]()
    if _MOVES.match(statement.text):
        reason = Reason(Code.UNKNOWN_STATEMENT, "the move statement is not understood")
        goal, come = Pdl2Goal(Meaning.UNKNOWN, why=reason), machine.predecessors(here)
        settings, joint = here.store.settings, Motion.JOINT
        arrival = Pdl2Visit(here.place, joint, False, goal, settings, come, at=here.row)
        arrived = frozenset({machine.record(here, 1, arrival)})
    if _forget_by_text(here, statement.text, why):
        here.store.last |= arrived


def _forget_names(here: Execution, text: str) -> str:
    """Forget what text names; return why it is not known."""
    line = here.place.program.lines.line(here.row)
    why = f"line {line}, which is not understood, may change it"
    invalidate_names(here, words_in(text), why)
    return why


def _forget_by_text(here: Execution, text: str, why: str) -> bool:
    """Forget what only text that moves could change; tell whether it may move."""
    called = (here.world.is_function(here.place, name) for name in words_in(text))
    if is_harmless(text) and not any(called):
        return False
    here.store.forget_surroundings(why)
    text = (
        "this statement is not understood: the position of the arm, its frames and "
        "its motion settings are not known after it, and targets are not corrected "
        "until these are set again"
    )
    here.world.report(here.place.program, here.row, Code.MOTION_UNKNOWN, text)
    return True


def run_broken(machine: Machine, here: Execution) -> None:
    """List the moves of a body whose blocks do not close; follow none of them."""
    body = here.place.body
    why = f"the block structure is broken (line {body.broken})"
    here.reason = Reason(Code.BLOCK_STRUCTURE, why)
    for row, one in here.place.list_moves():
        here.row, here.store.last = row, NOWHERE
        move(machine, here, one)
    inside = list_live(here.world, here.place, body.first, body.last)
    calls.take_effects(here, inside, f"{why}: it may be used in a computation", why)
    here.store.forget_frames(why)
    here.store.last = NOWHERE


def resolve(
    program: Program,
    start: Start | None = None,
    variables: VariableFile | None = None,
    others: Mapping[str, Program] | None = None,
    beside: Sequence[Program] = (),
) -> JobReading:
    """Follow a program from its start and list every arrival with its origins.

    Every way that the program may take is followed, with what is known of variables,
    frames and motion settings; whatever cannot be known is said on the visits that
    depend on it and never guessed.

    Args:
        program: The parsed program.
        start: What the cell says, by default identity frames and nothing else.
        variables: The program's variable file.
        others: Programs named by IMPORT, CALL or EXPORTED FROM, by lower-case name.
        beside: Other programs, which change variables that these export.
    """
    world = World(program, dict(others or {}), start or Start(), variables, beside)
    fill_initial(world)
    machine = _follow(world)
    runs = 1
    while not machine.exhausted and keep_values(world, machine.given, runs):
        machine, runs = _follow(world), runs + 1
    if machine.exhausted:
        world.report_once(
            program, 0, Code.TOO_COMPLEX, "", "the program has too many ways, or "
            f"calls, to be followed to the end (more than {MOST_STEPS} steps): nothing "
            "in it is compensated",
        )  # fmt: skip
        machine = _list_moves(world)
    _keep_exported(world, machine)
    world.pin_loose(machine.given)
    world.settle()
    collector = Pdl2Collector(machine)
    visits = collector.collect()
    moves = (np.flatnonzero(one.lines.which(has_target)) for one in world.programs())
    missed = collector.find_unreached(moves)
    machine.root.forget()
    found = tuple(sorted(world.diagnostics))
    return JobReading((), visits, found, missed=missed)


def _keep_exported(world: World, machine: Machine) -> None:
    """Keep the numbers of what routines use that other programs alone may call."""
    run = {id(context.place.body) for context, _ in machine.entries}
    for program in world.programs():
        for body in program.routines.values():
            if body.exported and id(body) not in run:
                place = world.place(program, body)
                why = f"{body.name} uses it, which another program may call"
                for name in names_but_ends(program, body.first, body.last):
                    world.loosen(world.root(place, name), why)


def _follow(world: World) -> Machine:
    """Follow every way from the start."""
    machine = Pdl2Machine(world=world)
    _start(machine)
    machine.follow()
    return machine


def _list_moves(world: World) -> Machine:
    """List every move of a job that is too complex to be followed, once."""
    machine = Pdl2Machine(world=world, exhausted=True)
    for place, _ in world.declarations():
        here = Execution(world, place, place.body.first, Store(lambda key: None))
        name = place.body.name or place.program.name
        calls.list_moves(machine, here, place, name)
    return machine


def _start(machine: Machine) -> None:
    world = machine.world
    program, start = world.main, world.start
    store = Store(world.initial.find, last=frozenset({START}), changing=world.changing)
    why = "the cell file does not say what it is"
    records = {name: getattr(start, name) for name in FRAMES}
    store.set(**{n: calls.frame_value(start, r, why) for n, r in records.items()})
    if start.linear_speed is not None:
        store.set(lin_spd=start.linear_speed)
    if start.override is not None:
        store.set(gen_ovr=start.override)
    machine.given, machine.lost = store.given, store.lost
    _handlers(machine, store)
    outside = find_calls(program, world.beside)
    if program.main is not None:
        machine.root.place = world.place(program, program.main)
        for name in {program.name, base_name(program.lines.source.name)}:
            if call := outside.get(f"{name}/"):
                why = describe_call(call)
                world.report_once(program, 0, Code.CALLED_BY_OTHERS, "", why)
                store.forget_surroundings(why)
        machine.enter(At(machine.root, program.main.first + 1), store)
    _begin_anywhere(machine, outside, store)


def _begin_anywhere(
    machine: Machine, outside: Mapping[str, OutsideCall], store: Store
) -> None:
    """Begin the routines that other programs call, wherever these are then."""
    world = machine.world
    for program in world.programs():
        names = {program.name, base_name(program.lines.source.name)}
        for name, body in program.routines.items():
            found = (outside.get(f"{one}/{name}") for one in names)
            if call := next(filter(None, found), None):
                why, place = describe_call(call), world.place(program, body)
                code = Code.CALLED_BY_OTHERS
                world.report_once(program, body.first, code, name, why)
                unknown = _nothing_known(world, store, why)
                at = place.offset + body.first
                context = machine.root.within(at, HANDLED, place)
                machine.enter(At(context, body.first + 1), unknown)


def _nothing_known(world: World, store: Store, why: str) -> Store:
    """Return what is known where anything may have run before."""
    nothing = values.Nothing(why)
    unknown = Store(lambda key: nothing, last=NOWHERE)
    unknown.changing = world.changing
    unknown.given, unknown.lost = store.given, store.lost
    unknown.forget_frames(why)
    return unknown


def _handlers(machine: Machine, store: Store) -> None:
    """Condition handlers run at any time: nothing they change is ever known."""
    world = machine.world
    unknown = _nothing_known(world, store, "a condition handler runs at any time")
    for place in world.places():
        for first, last in place.flow.conditions:
            reach = live_rows(world, place, first, last)
            world.volatile |= reach.may_change
            for other, own in reach.parts:
                for name in own.read:
                    root = world.root(other, name)
                    world.loosen(root, "a condition handler may use it")
            if reach.moves:
                _moving_handler(machine, place, first, unknown)
            elif reach.cancels:
                _cancelling_handler(machine, place, first, reach)
    for name in world.volatile:
        if name.startswith("$"):
            store.set(**{name[1:]: values.Nothing("a condition handler changes it")})


def _ends_ours(world: World, place: Place, first: int, reach: CallGraph) -> bool:
    """Return True if a handler may end moves of our arm."""
    if any(own.cancels for _, own in reach.parts[1:]):
        return True
    for row in range(first, place.flow.end[first]):
        action = ast.action(place.program.lines.statement(row))
        if isinstance(action, ast.CancelMove):
            at = Execution(world, place, row, Store(lambda key: None))
            ours = [at.is_ours(arm) is not False for arm in action.arms]
            if any(ours) or not ours:
                return True
    return False


def _cancelling_handler(
    machine: Machine, place: Place, row: int, reach: CallGraph
) -> None:
    """Allow for a handler that ends moves on their way."""
    cycles = any(isinstance(one, ir.Leave) for one in reach.cancels)
    if not cycles and not _ends_ours(machine.world, place, row, reach):
        return
    machine.interrupted = True
    machine.cycle_left |= cycles
    text = (
        "this condition handler may end any move early (CANCEL, EXIT CYCLE): the start "
        "of every move is uncertain"
    )
    code, program = Code.HANDLER_CANCELS, place.program
    machine.world.report_once(program, row, code, str(row), text)


def _moving_handler(machine: Machine, place: Place, row: int, store: Store) -> None:
    line = place.program.lines.line(row)
    machine.interrupted = True
    code, moves = Code.HANDLER_MOVES, "may move the arm at any time"
    machine.handler = Reason(code, f"a condition handler (line {line}) {moves}")
    text = f"this condition handler {moves}: the start of every move is uncertain"
    machine.world.report_once(place.program, row, code, str(row), text)
    context = machine.root.within(place.offset + row, HANDLED, place)
    machine.enter(At(context, row + 1), store)
