"""What one move statement means at a point of the execution."""

from __future__ import annotations

from dataclasses import dataclass, replace

from postproc.language import pdl2 as ast
from postproc.language.arrivals import Arrival
from postproc.language.machine import Here, Machine
from postproc.language.store import Settings
from postproc.language.values import Nothing, Position, Value, Vector
from postproc.language.visits import ELSEWHERE, NO_TARGET, Motion, Target

_FRAME = {
    "TOOL": Target.RELATIVE_TOOL,
    "BASE": Target.RELATIVE_BASE,
    "UFRAME": Target.RELATIVE_UFRAME,
}
_MOTIONS = {
    "joint": Motion.JOINT,
    "linear": Motion.LINEAR,
    "circular": Motion.CIRCULAR,
}
_VIA, _END = 0, 1


@dataclass(frozen=True)
class _Goal:
    """What a destination means."""

    target: Target
    numbers: tuple[float | None, ...] = (None,) * 6
    position: Position | None = None
    distance: float | None = None
    reason: str = ""


def move(machine: Machine, here: Here, statement: ast.Move) -> None:
    """Record the visits of a move and let the arm stand at its end."""
    store = here.store
    whose = _arm(here, statement.arm)
    if whose is False:
        return
    settings = _with(here, statement)
    motion, reason = _motion(here, statement, settings)
    if whose is None:
        reason = "the arm that moves (ARM[..]) is known only at run time"
    reason = here.reason or reason
    predecessors = machine.predecessors(here)
    if statement.via is not None:
        goal = _absolute(here, statement.via)
        via = _arrival(here, statement, predecessors, settings, motion, goal, reason)
        predecessors = frozenset({machine.record(here, _VIA, _as_via(via))})
        if machine.interrupted:
            predecessors |= {ELSEWHERE}
    goal = _goal(here, statement)
    end = _arrival(here, statement, predecessors, settings, motion, goal, reason)
    arrived = machine.record(here, _END, end)
    store.last = frozenset({arrived})
    if statement.til or whose is None:
        store.last |= {ELSEWHERE} if statement.til else predecessors


def _as_via(arrival: Arrival) -> Arrival:
    return Arrival(
        arrival.place,
        arrival.row,
        arrival.predecessors,
        arrival.settings,
        arrival.motion,
        arrival.target,
        arrival.numbers,
        arrival.position,
        fly=True,
        via=True,
        distance=None,
        reason=arrival.reason,
    )


def _arrival(
    here: Here,
    statement: ast.Move,
    predecessors: frozenset[int],
    settings: Settings,
    motion: Motion,
    goal: _Goal,
    reason: str,
) -> Arrival:
    return Arrival(
        here.place,
        here.row,
        predecessors,
        settings,
        motion,
        goal.target,
        goal.numbers,
        goal.position,
        fly=statement.fly,
        distance=goal.distance,
        reason=goal.reason or reason,
    )


def _arm(here: Here, arm: ast.Expression | None) -> bool | None:
    """Tell whether our arm moves, None where it is not known."""
    if arm is None:
        return True
    number = here.integer(arm)
    return None if number is None else number == here.world.arm


def _with(here: Here, statement: ast.Move) -> Settings:
    """Return the settings that hold during this move."""
    changes: dict[str, Value] = {}
    for reference, expression in statement.settings:
        name = here.setting_name(reference)
        if name is not None:
            changes[name] = here.value(expression)
            here.world.pin(changes[name], f"${name.upper()} is set to it")
    return {**here.store.settings, **changes} if changes else here.store.settings


def _motion(here: Here, statement: ast.Move, settings: Settings) -> tuple[Motion, str]:
    said: Value | None = statement.trajectory.lower() or settings.get("move_type")
    with_ = any(r.name == "$move_type" for r, _ in statement.settings)
    if with_:
        said = settings.get("move_type")
    if said is None:
        here.world.report_once(
            here.place.program,
            here.row,
            "assumed-joint",
            "move_type",
            "the move names no trajectory and $MOVE_TYPE is not set: taken as JOINT",
        )
        return Motion.JOINT, ""
    motion = _MOTIONS.get(said) if isinstance(said, str) else None
    if motion is None:
        what = said.upper() if isinstance(said, str) else "its trajectory ($MOVE_TYPE)"
        return Motion.JOINT, f"{what} is not followed or known only at run time"
    if motion is Motion.CIRCULAR and statement.via is None:
        return motion, "the arc has no VIA point in this statement"
    return motion, ""


def _goal(here: Here, statement: ast.Move) -> _Goal:
    where = statement.where
    match statement.how:
        case "TO":
            return _absolute(here, where[0])
        case "RELATIVE":
            return _relative(here, where[0], statement.frame)
        case "AWAY":
            distance = here.real(where[0])
            return _no_target(Target.AWAY, (distance, *(None,) * 5), "AWAY")
        case "NEAR":
            goal = _absolute(here, where[0])
            distance = here.real(where[1])
            if goal.target is Target.POSE and distance is not None:
                near = goal.position and replace(goal.position, name="", derived="NEAR")
                return _Goal(Target.NEAR, goal.numbers, near, distance, _why("NEAR"))
        case "ABOUT":
            return _about(here, where, statement.frame)
        case "BY":
            by = here.value(where[0])
            here.world.pin(by, "MOVE BY goes on by it")
            if isinstance(by, Position) and by.joints:
                return _no_target(Target.BY, by.numbers, "BY")
    return _Goal(Target.UNKNOWN, reason=_why(statement.how))


def _why(word: str) -> str:
    return f"{NO_TARGET} ({word})"


def _no_target(target: Target, numbers: tuple[float | None, ...], word: str) -> _Goal:
    """Return a goal that can be planned only where all its numbers are known."""
    needed = {Target.AWAY: 1, Target.BY: 6, Target.ABOUT: 5}.get(target, 3)
    if None in numbers[:needed]:
        return _Goal(Target.UNKNOWN, reason=_why(word))
    return _Goal(target, numbers, reason=_why(word))


def _relative(here: Here, vector: ast.Expression, frame: str) -> _Goal:
    value = here.value(vector)
    if not isinstance(value, Vector) or frame not in _FRAME:
        return _Goal(Target.UNKNOWN, reason=_why("RELATIVE"))
    return _no_target(_FRAME[frame], (*value.numbers, None, None, None), "RELATIVE")


def _about(here: Here, where: tuple[ast.Expression, ...], frame: str) -> _Goal:
    axis, angle = here.value(where[0]), here.real(where[1])
    if not isinstance(axis, Vector) or frame not in _FRAME:
        return _Goal(Target.UNKNOWN, reason=_why("ABOUT"))
    numbers = (*axis.numbers, angle, float(_FRAME[frame]), None)
    return _no_target(Target.ABOUT, numbers, "ABOUT")


def _absolute(here: Here, expression: ast.Expression) -> _Goal:
    if isinstance(expression, ast.Reference) and expression.name.startswith("$"):
        name = here.setting_name(expression)
        held = here.store.settings.get(name or "")
        if held is None and name in ("home", "cal_sys"):
            target = Target.HOME if name == "home" else Target.CALIBRATION
            return _Goal(target, reason=_why(f"${name.upper()}"))
        return _from_value(held or Nothing(f"${name} is a system variable"), True)
    if isinstance(expression, ast.Reference):
        _check_declared(here, expression.name)
    return _from_value(here.value(expression), False)


def _check_declared(here: Here, name: str) -> None:
    if here.world.type_of(here.place, name) is None:
        if here.world.declared(here.place, name) is not None:
            return
        here.world.report_once(
            here.place.program,
            here.row,
            "undeclared-variable",
            name,
            f"{name} is used and not declared",
        )


def _from_value(value: Value, system: bool) -> _Goal:
    if isinstance(value, Nothing):
        return _Goal(Target.UNKNOWN, reason=f"the target is not known: {value.why}")
    if not isinstance(value, Position):
        return _Goal(Target.UNKNOWN, reason="the target is no position")
    if not value.complete:
        reason = "the target is known only in part before the program runs"
        return _Goal(Target.UNKNOWN, position=value, reason=reason)
    reason = value.derived
    if reason:
        reason = f"the target is computed: {reason}"
    elif system:
        reason = "the target is a system variable"
    elif not value.editable:
        reason = "a number of the target is computed, not written"
    target = Target.JOINTS if value.joints else Target.POSE
    return _Goal(target, value.numbers, value, reason=reason)
