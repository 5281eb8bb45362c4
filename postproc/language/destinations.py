"""What the destination of a move means: where the arm goes, as far as it is told."""

from __future__ import annotations

from dataclasses import dataclass, replace

from postproc.language import pdl2 as ast
from postproc.language.forgetting import pin_names
from postproc.language.machine import Here
from postproc.language.nodes import destination, may_be_node
from postproc.language.values import Nothing, Position, Value, Vector
from postproc.language.visits import NO_TARGET, Motion, Target

_FRAME = {
    "TOOL": Target.RELATIVE_TOOL,
    "BASE": Target.RELATIVE_BASE,
    "UFRAME": Target.RELATIVE_UFRAME,
}
UNSURE = "a move whose target is not sure may go to it"
_PLACES = {"home": Target.HOME, "cal_sys": Target.CALIBRATION}


@dataclass(frozen=True)
class Goal:
    """What a destination means.

    Attributes:
        target: What the numbers mean.
        numbers: Six numbers, None where not known.
        position: The position value where there is one.
        distance: For NEAR and FOR [mm].
        reason: Why it cannot be compensated, "" where it can.
    """

    target: Target
    numbers: tuple[float | None, ...] = (None,) * 6
    position: Position | None = None
    distance: float | None = None
    reason: str = ""


def goal_of(here: Here, statement: ast.Move, motion: Motion) -> Goal:
    """Tell where a move goes."""
    where = statement.where
    match statement.how:
        case "TO":
            return absolute(here, where[0])
        case "RELATIVE":
            return _relative(here, where[0], statement.frame)
        case "AWAY":
            distance = here.real(where[0])
            return _no_target(Target.AWAY, (distance, *(None,) * 5), "AWAY")
        case "NEAR":
            goal = absolute(here, where[0])
            distance = here.real(where[1])
            if goal.target is Target.POSE and distance is not None:
                near = goal.position and replace(goal.position, name="", derived="NEAR")
                return Goal(Target.NEAR, goal.numbers, near, distance, _why("NEAR"))
        case "FOR":
            return _towards(here, where, motion)
        case "ALONG":
            return _along(here, where[0])
        case "ABOUT":
            return _about(here, where, statement.frame)
        case "BY":
            by = here.value(where[0])
            here.world.pin(by, "MOVE BY goes on by it")
            if isinstance(by, Position) and by.joints:
                return _no_target(Target.BY, by.numbers, "BY")
    return Goal(Target.UNKNOWN, reason=_why(statement.how))


def _why(word: str) -> str:
    return f"{NO_TARGET} ({word})"


def _no_target(target: Target, numbers: tuple[float | None, ...], word: str) -> Goal:
    """Return a goal that can be planned only where all its numbers are known."""
    needed = {Target.AWAY: 1, Target.BY: 6, Target.ABOUT: 5}.get(target, 3)
    if None in numbers[:needed]:
        return Goal(Target.UNKNOWN, reason=_why(word))
    return Goal(target, numbers, reason=_why(word))


def _relative(here: Here, vector: ast.Expression, frame: str) -> Goal:
    value = here.value(vector)
    if not isinstance(value, Vector) or frame not in _FRAME:
        return Goal(Target.UNKNOWN, reason=_why("RELATIVE"))
    return _no_target(_FRAME[frame], (*value.numbers, None, None, None), "RELATIVE")


def _about(here: Here, where: tuple[ast.Expression, ...], frame: str) -> Goal:
    axis, angle = here.value(where[0]), here.real(where[1])
    if not isinstance(axis, Vector) or frame not in _FRAME:
        return Goal(Target.UNKNOWN, reason=_why("ABOUT"))
    numbers = (*axis.numbers, angle, float(_FRAME[frame]), None)
    return _no_target(Target.ABOUT, numbers, "ABOUT")


def _towards(here: Here, where: tuple[ast.Expression, ...], motion: Motion) -> Goal:
    """Go a distance towards a pose: a place of its own on a straight line only."""
    goal, distance = absolute(here, where[1]), here.real(where[0])
    known = goal.target is Target.POSE and distance is not None and distance >= 0.0
    if not known or motion is not Motion.LINEAR:
        return Goal(Target.UNKNOWN, reason=_why("FOR"))
    towards = goal.position and replace(goal.position, name="", derived="FOR")
    return Goal(Target.FOR, goal.numbers, towards, distance, _why("FOR"))


def _along(here: Here, path: ast.Expression) -> Goal:
    """Go along a path: its nodes must stay, for the arm goes to them from elsewhere."""
    name = path.name if isinstance(path, ast.Reference) else ""
    why = f"MOVE ALONG {name} goes to it too"
    pin_names(here, frozenset({name}), why)
    reason = (
        f"the nodes of a path are not followed (MOVE ALONG {name}): the next move is "
        "taken to come from an unknown place"
    )
    return Goal(Target.UNKNOWN, reason=reason)


def absolute(here: Here, expression: ast.Expression) -> Goal:
    """Tell what a place means that does not depend on where the arm is."""
    if isinstance(expression, ast.Reference) and expression.name.startswith("$"):
        return _system(here, expression)
    if isinstance(expression, ast.Reference):
        _check_declared(here, expression.name)
    if isinstance(expression, ast.Reference) and may_be_node(here, expression):
        value = destination(here, expression)
    else:
        value = here.value(expression)
    if isinstance(value, Nothing):
        here.world.pin(value, UNSURE)
    return from_value(value)


def _system(here: Here, reference: ast.Reference) -> Goal:
    """Tell where a place of the controller is; it belongs to no target."""
    name = here.setting_name(reference)
    if name is None:
        last = reference.steps[-1] if reference.steps else reference.name
        said = str(last).lstrip("$").upper() if isinstance(last, str) else "it"
        why = f"${said} belongs to another arm, or only the run tells to which"
        return from_value(Nothing(why))
    held = here.store.settings.get(name)
    if name not in _PLACES:
        unknown = Nothing(f"${name.upper()} is a system variable")
        return from_value(held or unknown, True)
    if held is None:
        return Goal(_PLACES[name], reason=_why(f"${name.upper()}"))
    return replace(from_value(held), reason=_why(f"${name.upper()}"))


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


def from_value(value: Value, system: bool = False) -> Goal:
    """Tell what a move to a value means; `system`: to that of a system variable."""
    if isinstance(value, Nothing):
        return Goal(Target.UNKNOWN, reason=f"the target is not known: {value.why}")
    if not isinstance(value, Position):
        return Goal(Target.UNKNOWN, reason="the target is no position")
    if not value.complete:
        reason = "the target is known only in part before the program runs"
        return Goal(Target.UNKNOWN, position=value, reason=reason)
    reason = value.derived
    if reason:
        reason = f"the target is computed: {reason}"
    elif system:
        reason = "the target is a system variable"
    elif not value.editable:
        reason = "a number of the target is computed, not written"
    target = Target.JOINTS if value.joints else Target.POSE
    return Goal(target, value.numbers, value, reason=reason)
