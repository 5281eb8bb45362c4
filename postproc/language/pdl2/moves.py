"""What one move statement means at a point of the execution."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language import ir
from postproc.language.analysis.origins import NOWHERE
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.abstract_state import Settings
from postproc.language.pdl2.evaluate import SINGLE, Execution, parts_under
from postproc.language.pdl2.machine import (
    MOST_AXES,
    NO_AXES,
    NO_SLOTS,
    UNKNOWN,
    Machine,
    Pdl2Goal,
    Pdl2Visit,
    escape_names,
)
from postproc.language.pdl2.side_effects import goes_to_target
from postproc.language.pdl2.values import (
    Nothing,
    Position,
    Value,
    Vector,
    add_unknown,
    may_be,
)
from postproc.language.visits import Meaning
from postproc.robot.trajectory import Motion

# Nodes of paths as destinations: where the one position of a node stands.

MAIN = ("$main_pos", "$main_jntp", "$main_xtnd")


def may_be_node(here: Execution, reference: ir.DataObject) -> bool:
    """Tell whether a reference may mean a node of a path, or what is in one."""
    type_ = here.world.type_of(here.place, reference.name)
    if type_ is None:
        return reference.steps[:1] == ("node",)
    return type_.path or type_.name not in SINGLE


def destination(here: Execution, reference: ir.DataObject) -> Value:
    """Return where a move to what may be a node goes: to the one position in it.

    What other standard fields (``$LIN_SPD``, ``$SEG_TOOL_IDX``) of a node do in a move
    to it no public source tells: such a node is not known, and keeps its numbers.
    """
    whole = here.value(reference)
    target = here.locate(reference)
    if not isinstance(whole, Nothing) or not target.exact or target.component != ():
        return whole
    (key,) = target.keys
    under = len(key) + 1
    names = {part[under:] for part in parts_under(here, key)}
    found = {name for name in names if name[:1] == "$" and "." not in name}
    standard = sorted(found | _list_declared(here, reference))
    fields = [
        here.value(ir.DataObject(reference.name, (*reference.steps, name)))
        for name in standard
        if name in MAIN
    ]
    if not fields:
        return whole
    file, name = here.world.variables, key.rpartition("/")[2]
    unread = file.unread if file is not None else ()
    if any(f"{name}.".startswith((f"{one}.", f"{one}[")) for one in unread):
        return add_unknown(
            Nothing("its values in the variable file are not read"), *fields
        )
    if len(fields) == 1 == len(standard):
        return fields[0]
    several = len(fields) > 1
    why = "it has several positions" if several else "it has settings of its own"
    return add_unknown(Nothing(f"{why} ({', '.join(standard).upper()})"), *fields)


def _list_declared(here: Execution, reference: ir.DataObject) -> frozenset[str]:
    """Return the standard fields that the type of a node declares."""
    type_ = here.world.type_of(here.place, reference.name)
    steps = [step for step in reference.steps if isinstance(step, str)]
    if type_ is None or steps not in ([], ["node"]):
        return frozenset()
    found = [one.nodes.get(type_.name) for one in here.world.programs()]
    return frozenset().union(*filter(None, found))


# What the destination of a move means: where the arm goes, as far as it is told.

_FRAME = {
    "TOOL": Meaning.RELATIVE_TOOL,
    "BASE": Meaning.RELATIVE_BASE,
    "UFRAME": Meaning.RELATIVE_UFRAME,
}
UNSURE = "a move whose target is uncertain may go to it"
_PLACES = {"home": Meaning.HOME, "cal_sys": Meaning.CALIBRATION}


def goal_of(here: Execution, statement: ast.Move, motion: Motion) -> Pdl2Goal:
    """Tell where a move goes."""
    where = statement.where
    match statement.how:
        case "TO":
            goal = absolute(here, where[0])
            unread = goal.why is IN_PART and _is_unread(here, where[0])
            return replace(goal, why=_UNREAD) if unread else goal
        case "RELATIVE":
            vector, frame = here.value(where[0]), _FRAME.get(statement.frame)
            if isinstance(vector, Vector) and frame is not None:
                return _no_target(frame, vector.numbers, "RELATIVE")
        case "AWAY":
            return _no_target(Meaning.AWAY, (here.real(where[0]),), "AWAY")
        case "NEAR":
            return _short_of(here, Meaning.NEAR, where[0], where[1])
        case "FOR":  # a place of its own on a straight line only
            return _short_of(
                here, Meaning.FOR, where[1], where[0], motion is Motion.LINEAR, 0.0
            )
        case "ALONG":
            return _along(here, where[0])
        case "ABOUT":
            axis, angle = here.value(where[0]), here.real(where[1])
            if isinstance(axis, Vector) and statement.frame in _FRAME:
                numbers = (*axis.numbers, angle, float(_FRAME[statement.frame]))
                return _no_target(Meaning.ABOUT, numbers, "ABOUT")
        case "BY":
            by = here.value(where[0])
            here.world.pin(by, "MOVE BY goes on by it")
            if isinstance(by, Position) and by.joints:
                return _no_target(Meaning.BY, by.numbers, "BY")
    return Pdl2Goal(Meaning.UNKNOWN, why=_why(statement.how))


_UNREAD = Reason(Code.UNREADABLE_NUMBER, "a number of the target cannot be read")


def _is_unread(here: Execution, place: ir.Operand) -> bool:
    """Tell whether a number of a written target cannot be read."""
    numbers = (one for one in ir.walk(place) if isinstance(one, ir.Num))
    return not all(math.isfinite(here.number(one).value) for one in numbers)


def _why(word: str) -> Reason:
    return Reason(Code.NO_TARGET, f"the move holds no target of its own ({word})")


def _no_target(target: Meaning, numbers: Sequence[float], word: str) -> Pdl2Goal:
    """Return a goal that can be planned only where all its numbers are known."""
    if any(map(math.isnan, numbers)):
        return Pdl2Goal(Meaning.UNKNOWN, why=_why(word))
    return Pdl2Goal(target, (*numbers, *UNKNOWN[len(numbers) :]), why=_why(word))


def _short_of(
    here: Execution,
    target: Meaning,
    place: ir.Operand,
    by: ir.Operand,
    known: bool = True,
    least: float = -math.inf,
) -> Pdl2Goal:
    """Go near a pose, or a distance of at least so much towards it."""
    goal, distance = absolute(here, place), here.real(by)
    if goal.target is not Meaning.POSE or not known:
        return Pdl2Goal(Meaning.UNKNOWN, why=_why(target.name))
    if not distance >= least:
        return Pdl2Goal(Meaning.UNKNOWN, why=_why(target.name))
    return replace(
        goal, target=target, slots=NO_SLOTS, follows=goal.origin, name="",
        distance_mm=distance, why=_why(target.name),
    )  # fmt: skip


def _along(here: Execution, path: ir.Operand) -> Pdl2Goal:
    """Go along a path: its nodes must stay, for the arm goes to them from elsewhere."""
    name = path.name if isinstance(path, ir.DataObject) else ""
    why = f"MOVE ALONG {name} goes to it too"
    escape_names(here, frozenset({name}), why)
    reason = (
        f"the nodes of a path are not followed (MOVE ALONG {name}): the next move is "
        "assumed to start at an unknown place"
    )
    return Pdl2Goal(Meaning.UNKNOWN, why=Reason(Code.POSITION_UNKNOWN, reason))


def absolute(here: Execution, expression: ir.Operand) -> Pdl2Goal:
    """Tell what a place means that does not depend on where the arm is."""
    if isinstance(expression, ir.DataObject) and expression.name.startswith("$"):
        return _system(here, expression)
    value: Value | None = None
    if isinstance(expression, ir.DataObject):
        name = expression.name
        declared = here.world.find_declaration(here.place, name)
        if declared is None and here.world.type_of(here.place, name) is None:
            text = f"{name} is used and not declared"
            here.report_once(Code.UNDECLARED_VARIABLE, name, text)
        if may_be_node(here, expression):
            value = destination(here, expression)
    if value is None:
        value = here.value(expression)
    if isinstance(value, Nothing):
        here.world.pin(value, UNSURE)
    return from_value(value)


def _system(here: Execution, reference: ir.DataObject) -> Pdl2Goal:
    """Tell where a place of the controller is; it belongs to no target."""
    name, component = here.locate_setting(reference)
    if name is None or component != ():
        last = reference.steps[-1] if reference.steps else reference.name
        said = str(last).lstrip("$").upper() if isinstance(last, str) else "it"
        why = f"${said} belongs to another arm, or only the run tells to which"
        return from_value(Nothing(why))
    held = here.store.settings.get(name)
    if name not in _PLACES:
        unknown = Nothing(f"${name.upper()} is a system variable")
        return from_value(held or unknown, True)
    if held is None:
        return Pdl2Goal(_PLACES[name], why=_why(f"${name.upper()}"))
    return replace(from_value(held), why=_why(f"${name.upper()}"))


def from_value(value: Value, system: bool = False) -> Pdl2Goal:
    """Tell what a move to a value means; `system`: to that of a system variable."""
    if isinstance(value, Nothing):
        reason = Reason(value.code, f"the target is not known: {value.why}")
        return Pdl2Goal(Meaning.UNKNOWN, why=reason)
    if not isinstance(value, Position):
        return Pdl2Goal(Meaning.UNKNOWN, why=NO_POSITION)
    target = Meaning.JOINTS if value.joints else Meaning.POSE
    numbers = value.numbers
    if not value.complete:
        target, numbers, reason = Meaning.UNKNOWN, UNKNOWN, IN_PART
    elif value.derived:
        text = f"the target is computed: {value.derived}"
        reason = Reason(Code.COMPUTED_TARGET, text)
    elif system:
        reason = SYSTEM
    else:
        reason = NO_REASON if value.editable else COMPUTED
    slots, own = value.slots, value.complete and value.editable
    along = not own and target is Meaning.POSE and -1 not in slots
    axes = None if value.aux is None else tuple([axis for axis, _ in value.aux])
    given = {axis: x for axis, x in value.aux or () if not math.isnan(x)}
    aux = NO_AXES
    if given:
        aux = tuple([given.get(axis, math.nan) for axis in range(1, MOST_AXES + 1)])
    return Pdl2Goal(
        target, numbers, slots if own else NO_SLOTS, slots if along else NO_SLOTS,
        value.name, aux, reason,
        shared=value.shared, config=value.config, axes=axes, taught=value.taught,
        holds=frozenset() if own or along else may_be(value),
    )  # fmt: skip


NO_POSITION = Reason(Code.RUNTIME_VALUE, "the target is no position")
IN_PART = Reason(
    Code.RUNTIME_VALUE, "the target is known only in part before the program runs"
)
SYSTEM = Reason(Code.COMPUTED_TARGET, "the target is a system variable")
COMPUTED = Reason(
    Code.COMPUTED_TARGET, "a number of the target is computed, not written"
)


_MOTIONS = {"joint": Motion.JOINT, "linear": Motion.LINEAR, "circular": Motion.CIRCULAR}
_FROM_HERE = frozenset(
    {Meaning.RELATIVE_TOOL, Meaning.RELATIVE_BASE, Meaning.RELATIVE_UFRAME,
     Meaning.AWAY, Meaning.ABOUT, Meaning.BY, Meaning.FOR}
)  # fmt: skip


def read_move(here: Execution, statement: ast.Move) -> Pdl2Visit:
    """Read a move of our arm that nothing but its target tells from others."""
    settings = _with(here, statement)
    motion, reason = motion_of(here, statement, settings)
    goal, why = goal_of(here, statement, motion), here.reason or reason
    return Pdl2Visit(
        here.place, motion, False, goal, settings, why=why, at=here.row,
        fly=statement.fly,
    )  # fmt: skip


def move(machine: Machine, here: Execution, statement: ast.Move) -> None:
    """Record the visits of a move and let the arm stand at its end."""
    _beside(machine, here, statement)
    store, whose = here.store, here.is_ours(statement.arm)
    if whose is False:
        _keep(here, statement)
        return
    found = read_move(here, statement)
    if whose is None:
        named = statement.arm is not None
        unsure = "the arm that moves (ARM[..]) is known only at run time"
        text = unsure if named else here.other_default()
        found.why = here.reason or Reason(Code.OTHER_ARM, text)
    found.origins = predecessors = machine.predecessors(here)
    if statement.via is not None:
        goal = absolute(here, statement.via)
        way = replace(found, goal=goal, via=True, fly=True)
        found.origins = frozenset({machine.record(here, 0, way)})
        if machine.interrupted:  # the arm may have been moved off the way
            found.origins |= NOWHERE
    store.last = frozenset({machine.record(here, 1, found)})
    if len(predecessors) > 1 and found.goal.target in _FROM_HERE:
        store.last |= NOWHERE
    if statement.til is not None or whose is None:
        store.last |= found.origins if statement.til is None else NOWHERE


ALONG_WITH = Reason(
    Code.COORDINATED_ARMS, "it runs along with another arm's move (SYNCMOVE)"
)


def _beside(machine: Machine, here: Execution, statement: ast.Move) -> None:
    """Let the moves of SYNCMOVE clauses happen: ours runs along with another arm's."""
    for along in statement.sync:
        ours = along.arm is not None and here.is_ours(along.arm) is not False
        if ours and here.is_ours(statement.arm) is False:
            reason = here.reason
            here.reason = reason or ALONG_WITH
            move(machine, here, along)
            here.reason = reason
        else:
            _keep(here, along)


def _keep(here: Execution, statement: ast.Move) -> None:
    """Keep the numbers of what another arm goes to, and list its target."""
    if goes_to_target(statement):
        arm = here.integer(statement.arm) if statement.arm is not None else None
        whose = f"arm {arm}'s" if arm is not None else "not our arm's"
        number = f" with arm_number = {arm} under [robot]" if arm is not None else ""
        text = (
            f"this move is {whose}, and the cell is of arm {here.world.arm}: it is not "
            f"corrected. Compensate it with a cell of its arm{number}, and its model"
        )
        here.world.report(here.place.program, here.row, Code.OTHER_ARM, text)
    names = frozenset(r.name for r in ir.data_in(*statement.where, statement.via))
    escape_names(here, names, "another arm goes to it too")


def _with(here: Execution, statement: ast.Move) -> Settings:
    """Return the settings that hold during this move."""
    changes: dict[str, Value] = {}
    for one in statement.settings:
        name, component = here.locate_setting(one.target)
        if name is not None and component != ():
            changes[name] = Nothing("a part of it is set for this move alone")
        elif name is not None:
            changes[name] = here.value(one.value)
            here.world.pin(changes[name], f"${name.upper()} is set to it")
    return {**here.store.settings, **changes} if changes else here.store.settings


def motion_of(
    here: Execution, statement: ast.Move, settings: Settings
) -> tuple[Motion, Reason]:
    """Return the trajectory of a move, and why it is not known or not followed."""
    said: Value | None = statement.trajectory.lower() or settings.get("move_type")
    with_ = any(one.target.name == "$move_type" for one in statement.settings)
    if with_:
        said = settings.get("move_type")
    if said is None:
        text = (
            "the move names no trajectory and $MOVE_TYPE is not set: JOINT is assumed"
        )
        here.report_once(Code.ASSUMED_JOINT, "move_type", text)
        return Motion.JOINT, NO_REASON
    motion = _MOTIONS.get(said) if isinstance(said, str) else None
    if motion is None:
        what = said.upper() if isinstance(said, str) else "its trajectory ($MOVE_TYPE)"
        text = f"{what} is not followed or known only at run time"
        return Motion.JOINT, Reason(Code.TRAJECTORY_UNKNOWN, text)
    if motion is Motion.CIRCULAR and statement.via is None:
        return motion, NO_VIA
    return motion, NO_REASON


NO_VIA = Reason(Code.ARC_UNDETERMINED, "the arc has no VIA point in this statement")
