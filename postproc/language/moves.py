"""What one move statement means at a point of the execution."""

from __future__ import annotations

from postproc.language import pdl2 as ast
from postproc.language.arrivals import Arrival
from postproc.language.destinations import Goal, absolute, goal_of
from postproc.language.effects import references
from postproc.language.forgetting import pin_names
from postproc.language.machine import Here, Machine
from postproc.language.store import Settings
from postproc.language.values import Nothing, Value
from postproc.language.visits import ELSEWHERE, Motion, Target

_MOTIONS = {
    "joint": Motion.JOINT,
    "linear": Motion.LINEAR,
    "circular": Motion.CIRCULAR,
}
_FROM_HERE = frozenset(
    {Target.RELATIVE_TOOL, Target.RELATIVE_BASE, Target.RELATIVE_UFRAME, Target.AWAY,
     Target.ABOUT, Target.BY, Target.FOR}
)  # fmt: skip
_VIA, _END = 0, 1


def move(machine: Machine, here: Here, statement: ast.Move) -> None:
    """Record the visits of a move and let the arm stand at its end."""
    _beside(machine, here, statement)
    store = here.store
    whose = _arm(here, statement.arm)
    if whose is False:
        _keep(here, statement)
        return
    settings = _with(here, statement)
    motion, reason = motion_of(here, statement, settings)
    if whose is None:
        reason = "the arm that moves (ARM[..]) is known only at run time"
    reason = here.reason or reason
    predecessors = machine.predecessors(here)
    several = len(predecessors) > 1
    if statement.via is not None:
        goal = absolute(here, statement.via)
        via = _arrival(here, statement, predecessors, settings, motion, goal, reason)
        predecessors = frozenset({machine.record(here, _VIA, _as_via(via))})
        if several or machine.interrupted:  # the arc depends on where it starts
            predecessors |= {ELSEWHERE}
    goal = goal_of(here, statement, motion)
    end = _arrival(here, statement, predecessors, settings, motion, goal, reason)
    arrived = machine.record(here, _END, end)
    store.last = frozenset({arrived})
    if several and goal.target in _FROM_HERE:
        store.last |= {ELSEWHERE}
    if statement.til or whose is None:
        store.last |= {ELSEWHERE} if statement.til else predecessors


def _beside(machine: Machine, here: Here, statement: ast.Move) -> None:
    """Let the moves of SYNCMOVE clauses happen: ours runs along with another arm's."""
    for along in statement.sync:
        ours = along.arm is not None and _arm(here, along.arm) is not False
        if ours and _arm(here, statement.arm) is False:
            reason = here.reason
            here.reason = reason or "it runs along with another arm's move (SYNCMOVE)"
            move(machine, here, along)
            here.reason = reason
        else:
            _keep(here, along)


def _keep(here: Here, statement: ast.Move) -> None:
    """Keep the numbers of what another arm goes to."""
    names = frozenset(r.name for r in references((statement.where, statement.via)))
    pin_names(here, names, "another arm goes to it too")


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
    goal: Goal,
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
        part = here.frame_part(reference)
        if part is not None:
            changes[part[0]] = Nothing("a part of it is set for this move alone")
        name = here.setting_name(reference)
        if name is not None:
            changes[name] = here.value(expression)
            here.world.pin(changes[name], f"${name.upper()} is set to it")
    return {**here.store.settings, **changes} if changes else here.store.settings


def motion_of(
    here: Here, statement: ast.Move, settings: Settings
) -> tuple[Motion, str]:
    """Return the trajectory of a move, and why it is not known or not followed."""
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
