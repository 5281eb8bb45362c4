"""Commands that would land where the program says, in the numbers of the file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from postproc.arrays import Bools, Floats, Ints, take_rows
from postproc.compensation.program import PlannedProgram
from postproc.compensation.solver.arc_angles import ArcAngles, points_to_write
from postproc.compensation.solver.payload import (
    load_error,
    load_reasons,
    with_surveyed_load,
)
from postproc.compensation.solver.targets import few_frames
from postproc.exceptions import ModelError
from postproc.language.visits import Meaning, Visits
from postproc.model.evaluator import PredictedErrors
from postproc.model.kinematics import ArmStates
from postproc.model.model import UNSURE, Model, Prediction
from postproc.motion.path import circles
from postproc.motion.planner import Plan
from postproc.robot.arm import Arm
from postproc.robot.cell import Cell
from postproc.robot.pose import (
    MM,
    cross,
    has_unknown,
    inverse,
    is_unknown,
    lengths,
    products,
    rotation_from_vector,
    rotation_vector,
)
from postproc.robot.state import States

# The tool's rotation, as far as a model knows it.

UNSURE_RAD = 3e-4  # [rad] 0.03 mm at 0.1 m from the TCP
UNSURE_TURN = "the tool's rotation is not known well enough there to correct it"


def turn_std(model: Model, arm: Arm, states: States) -> Floats:
    """Standard error of the predicted rotation per axis, (n, 3) [rad]."""
    effects, values, covariance = model.compensable()
    at = effects.at(ArmStates(arm, states), values)
    X = effects.rotation_columns(at)
    variance = np.einsum("nip,nip->ni", X @ covariance, X)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def refuse_unknown_rotations(model: Model) -> None:
    """Refuse a model that tells where one point of the tool lands, not how it turns.

    Raises:
        ModelError: The survey does not show all rotations, or the method has none.
    """
    cure = "Leave orientation out, or fit a model with --method full from a survey "
    if model.method != "full" or not len(model.covariance):
        problem = f"the method {model.method} says nothing of the tool's rotation"
        raise ModelError("orientation", problem, f"{cure}of three points")
    if not model.ranges.see_all_rotations:
        raise ModelError(
            "orientation",
            "the model was surveyed at one point of the tool: it does not know how "
            "the tool is turned",
            f"{cure}of three points that span a plane ([survey] points_mm in the cell "
            "file), or of a 6D probe of known mounting",
        )


# Which command lands on the wanted pose.


@dataclass(frozen=True)
class Solution:
    """Corrected commands of n targets.

    Attributes:
        q: Joint angles of the command, (n, 6) [rad], NaN where it cannot be reached.
        command: TCP pose to command, base frame, (n, 4, 4).
        residual: Distance of the predicted landing from the wanted place, (n,) [m].
    """

    q: Floats
    command: Floats
    residual: Floats


def solve(
    model: Model,
    arm: Arm,
    wanted: Floats,
    tool: Floats,
    states: States,
    orientation: bool = False,
) -> Solution:
    """Find the command whose predicted landing is the wanted place.

    The branch stays as it is, and so does the commanded orientation unless it is to be
    corrected too.

    Args:
        model: Predicts the error of a command.
        arm: The arm.
        wanted: TCP poses in the arm's base frame, (n, 4, 4).
        tool: Tool in the flange frame, (4, 4) or (n, 4, 4).
        states: The nominal states at the targets: angles, direction, loads.
        orientation: Correct the orientation as well as the position.
    """
    tool = np.broadcast_to(tool, (len(wanted), 4, 4))
    states = states.with_(tool=tool[:, :3, 3])
    found = model.evaluator(arm).commands(wanted, tool, states, orientation)
    return Solution(*found)


# Commands that would land where the program says, visit by visit.


@dataclass(frozen=True)
class Commands:
    """Corrected commands of n visits, NaN where pose or joint angles are not known.

    Attributes:
        known: Visits that can be solved, (n,).
        direction: Arrival direction that they are solved for, (n, 6).
        q: Joint angles, (n, 6) [rad], NaN where the command cannot be reached.
        command: TCP poses to command, base frame, (n, 4, 4) [m].
        turn: Rotation of the commands against the targets, (n, 3) [rad].
        residual: Predicted landing against the wanted position, (n,) [m].
        foreseen: The error predicted there, as far as its standard error was asked for;
            where the load was not surveyed, for the nearest that was.
        std_error: Standard error of the model there, per axis, (n, 3) [m], likewise.
        outside: Reasons why visits lie outside what was surveyed, (n,) each.
    """

    known: Bools
    direction: Floats
    q: Floats
    command: Floats
    turn: Floats
    residual: Floats
    foreseen: PredictedErrors
    std_error: Floats
    outside: dict[str, Bools]

    @cached_property
    def turned(self) -> Ints:
        """Visits whose command is known to turn the tool, ascending."""
        some = (self.turn < 0.0) | (self.turn > 0.0)
        return np.unique(np.nonzero(some)[0])


def solve_visits(
    model: Model,
    cell: Cell,
    planned: PlannedProgram,
    states: States,
    orientation: bool = False,
) -> Commands:
    """Solve every visit whose pose and joint angles are known.

    Args:
        model: The arm's error.
        cell: The arm.
        planned: The program's plan.
        states: Planned states, with the directions to correct for.
        orientation: Correct the orientation as well as the position.

    Raises:
        ModelError: The orientation is asked for, and the model does not know it.
    """
    if orientation:
        refuse_unknown_rotations(model)
    n, plan = len(states), planned.plan
    known = ~(has_unknown(plan.q) | is_unknown(plan.tcp))
    empty = Commands(
        known=known,
        direction=np.array(states.direction),
        q=np.full((n, 6), np.nan),
        command=np.full((n, 4, 4), np.nan),
        turn=np.full((n, 3), np.nan),
        residual=np.full(n, np.nan),
        foreseen=PredictedErrors.unknown(n),
        std_error=np.full((n, 3), np.nan),
        outside=_outside_survey(model, cell, known, states),
    )
    everything = np.ones(n, dtype=bool)
    return solve_again(empty, everything, model, cell, planned, states, orientation)


def solve_again(
    solved: Commands,
    rows: Bools,
    model: Model,
    cell: Cell,
    planned: PlannedProgram,
    states: States,
    orientation: bool = False,
) -> Commands:
    """Solve some visits anew, for the directions of `states`; keep the others.

    Args:
        solved: What is known.
        rows: Visits to solve, (n,).
        model: The arm's error.
        cell: The arm.
        planned: The program's plan.
        states: Planned states, with the directions to correct for.
        orientation: Correct the orientation as well as the position.
    """
    plan, known = planned.plan, np.flatnonzero(rows & solved.known)
    here, wanted = states[known], planned.reference_poses(known)
    tool = take_rows(plan.tool, known)
    part = solve(model, cell.arm, wanted, tool, here, orientation)
    out = replace(
        solved,
        direction=np.where(rows[:, None], states.direction, solved.direction),
        q=np.array(solved.q),
        command=np.array(solved.command),
        turn=np.array(solved.turn),
        residual=np.array(solved.residual),
        foreseen=solved.foreseen.copy(),
        std_error=np.array(solved.std_error),
        outside=dict(solved.outside),
    )
    out.q[known], out.command[known] = part.q, part.command
    out.turn[known] = turns_between(part.command, plan.tcp[known])
    out.residual[known] = part.residual
    near = with_surveyed_load(model, cell, here)
    found = model.predict_on_flanks(cell.arm, near)
    out.foreseen.put(known, found)
    out.std_error[known] = np.hypot(found.std, load_error(model, cell, here))
    _mark(out.outside, UNSURE, known, model.unsure(found.std), len(rows))
    if orientation:
        spread = turn_std(model, cell.arm, here)
        unsure = np.asarray(np.linalg.norm(spread, axis=1) > UNSURE_RAD)
        _mark(out.outside, UNSURE_TURN, known, unsure, len(rows))
    return out


def foresee(
    model: Model, cell: Cell, states: States, solved: Commands, rows: Ints | None = None
) -> Commands:
    """Predict the errors that visits are corrected for, with their standard errors.

    These are many times as costly as the errors: what solving has asked for is kept,
    the others are wanted of the last round alone.

    Args:
        model: The arm's error.
        cell: The arm.
        states: Planned states of n visits.
        solved: Their commands.
        rows: Those to predict, default: all of known pose and joint angles.
    """
    wanted = solved.known & np.isnan(solved.std_error[:, 0])
    rows = np.flatnonzero(wanted) if rows is None else rows[wanted[rows]]
    here = states.with_(direction=solved.direction)[rows]
    near = with_surveyed_load(model, cell, here)
    foreseen, std_error = solved.foreseen.copy(), np.array(solved.std_error)
    found = model.evaluator(cell.arm).predict(near)
    foreseen.put(rows, found)
    std_error[rows] = np.hypot(found.std, load_error(model, cell, here))
    return replace(solved, foreseen=foreseen, std_error=std_error)


def predict_arrivals(
    model: Model, cell: Cell, states: States, solved: Commands
) -> Prediction:
    """Predict the errors that visits are corrected for, with what they carry.

    Args:
        model: The arm's error.
        cell: The arm.
        states: Planned states of n visits.
        solved: Their commands, with all that is foreseen, see `foresee`.

    Returns:
        NaN where pose or joint angles are not known.
    """
    here, found = states.with_(direction=solved.direction), solved.foreseen
    evaluator = model.evaluator(cell.arm)
    near = with_surveyed_load(model, cell, here)
    other = (near.payload != here.payload) & ~np.isnan(here.payload)
    if evaluator.given:  # they may depend on the visit before
        other = np.ones(len(here), dtype=bool)
    rows = np.flatnonzero(solved.known & other)
    if len(rows):
        found = found.copy()
        found.put(rows, evaluator.predict(here[rows]))
    return model.describe(here, found)


def turns_between(new: Floats, old: Floats) -> Floats:
    """Return the rotation from old poses to new ones (n, 4, 4), (n, 3) [rad]."""
    new, old, out = new[:, :3, :3], old[:, :3, :3], np.zeros((len(new), 3))
    rows = np.unique(np.nonzero(new != old)[0])
    lost = np.isnan(new[rows]).any(axis=(1, 2))
    out[rows[lost]] = np.nan
    rows = rows[~lost]
    out[rows] = rotation_vector(new[rows] @ np.swapaxes(old[rows], 1, 2))
    return out


def _outside_survey(
    model: Model, cell: Cell, known: Bools, states: States
) -> dict[str, Bools]:
    """Say which visits lie outside of what was surveyed, whatever their directions."""
    rows, found = np.flatnonzero(known), dict[str, Bools]()
    here, ranges = states[rows], replace(model.ranges, payload=None)
    reasons = ranges.outside(here, model.needs, model.bent)
    reasons |= load_reasons(model, cell, here)
    for text, mask in reasons.items():
        _mark(found, text, rows, mask, len(known))
    return found


def _mark(
    outside: dict[str, Bools], text: str, rows: Ints, mask: Bools, n: int
) -> None:
    """Say anew of some of n visits whether they lie outside for a reason."""
    if text in outside or mask.any():
        marked = np.array(outside.get(text, np.zeros(n, dtype=bool)))
        marked[rows] = mask
        outside[text] = marked


# Commands in the numbers of the file, and how far those change.


def new_numbers(
    visits: Visits, arm: Arm, plan: Plan, solved: Commands, aside: Floats
) -> Floats:
    """Express commands in the numbers of the file, (n, w).

    P = inverse(UFRAME) . BASE . command. A fly point is moved so that the path passes
    it where it should. An orientation that does not change keeps its written numbers.
    Flags that small moves decide are those of the numbers as they are rounded; they
    are of the target, which a blend passes with other joints.
    """
    numbers = np.array(visits.target.values)
    joints = visits.target.meaning == Meaning.JOINTS
    numbers[joints, :6] += np.rad2deg(solved.q[joints] - plan.q[joints])
    poses = np.flatnonzero(visits.target.meaning == Meaning.POSE)
    placed = base_in_uframe(visits, poses)
    command = np.array(solved.command[:, :, 3])
    command[:, :3] -= aside
    arcs, via, end = _end_at_angles(visits, plan, command)
    command[arcs.via, :3], command[arcs.end, :3] = via, end
    point = np.einsum("nij,nj->ni", placed, command[poses])
    numbers[poses, :3] = point[:, :3] / MM
    rows, dialect = solved.turned, visits.dialect
    rows = rows[visits.target.meaning[rows] == Meaning.POSE]
    if len(rows):
        by = rotation_from_vector(turns_in_file(visits, solved)[rows])
        numbers[rows] = dialect.rotate(numbers[rows], by)
    if dialect.flag_joints:
        before = plan.exact.q[poses]
        q = solved.q[poses] + (before - plan.q[poses])
        close = np.flatnonzero(dialect.rounding_decides(q))
        rows = poses[close]
        q[close] = solve_written(visits, arm, rows, numbers[rows], q[close])
        numbers[poses] = dialect.rewrite_flags(numbers[poses], q, before)
    return numbers


def _end_at_angles(
    visits: Visits, plan: Plan, command: Floats
) -> tuple[ArcAngles, Floats, Floats]:
    """Let arcs that end at an angle end where they should.

    Args:
        visits: n visits.
        plan: Their plan.
        command: Where the TCP should go, (n, 4) [m], base frame.

    Returns:
        k arcs, and what to write for the points on their ways and for their third
        points, (k, 3) [m] each, base frame.
    """
    arcs = ArcAngles.of(visits)
    arcs = arcs.among(arcs.start >= 0)
    if len(arcs) == 0:
        return arcs, np.empty((0, 3)), np.empty((0, 3))
    ways = np.stack([arcs.start, arcs.via, arcs.end])
    before = plan.tcp[ways, :3, 3] - plan.aside[ways]
    pose = visits.dialect.poses(visits.target.values[arcs.end])
    third = (inverse(base_in_uframe(visits, arcs.end)) @ pose)[:, :3, 3]
    return arcs, *points_to_write(before, command[ways, :3], third)


def angles_astray(visits: Visits, plan: Plan, solved: Commands, aside: Floats) -> Bools:
    """Tell which points on the ways of arcs are missed by more than without us, (n,).

    Start, end and angle tell an arc but for a turn about the line between both: where
    the corrections there differ much from that of the point between, it is left aside.
    """
    out = np.zeros(len(visits), dtype=bool)
    if not visits.motion.via.any():
        return out
    command = np.array(solved.command[:, :, 3])
    command[:, :3] -= aside
    arcs, via, _ = _end_at_angles(visits, plan, command)
    # How far places lie from their arcs' points on the way, across the arcs.
    off = via - command[arcs.via, :3]
    points = [plan.tcp[rows, :3, 3] for rows in (arcs.start, arcs.via, arcs.end)]
    centre, normal, _ = circles(*points)
    along = cross(normal, points[1] - centre)
    along /= np.maximum(lengths(along), 1e-12)[:, None]
    missed = lengths(off - (off * along).sum(1)[:, None] * along)
    size = lengths(solved.command[arcs.via, :3, 3] - plan.tcp[arcs.via, :3, 3])
    out[arcs.via] = missed > size
    return out


def solve_written(
    visits: Visits, arm: Arm, rows: Ints, numbers: Floats, near: Floats
) -> Floats:
    """Solve the numbers (k, w) of some poses as they will be rounded, (k, 6) [rad].

    Where they cannot be solved the joints `near` stay.
    """
    scale = 10.0 ** np.array(visits.dialect.pose_decimals)
    pose = visits.dialect.poses(np.rint(numbers * scale) / scale)
    from_tcp = inverse(few_frames(visits))[visits.frame.tool[rows]]
    flange = inverse(base_in_uframe(visits, rows)) @ pose @ from_tcp
    found = np.array(near)
    known = np.isfinite(near).all(axis=1) & np.isfinite(flange).all(axis=(1, 2))
    own = arm.branch(near[known])
    q = arm.nearest(flange[known], near[known], own)
    found[known] = np.where(np.isnan(q), near[known], q)
    return found


def base_in_uframe(visits: Visits, rows: Ints) -> Floats:
    """Return the pose of the arm's base in the user frame, (k, 4, 4) [m]."""
    if len(rows) == 0:
        return np.empty((0, 4, 4))
    frames = few_frames(visits)
    return products(
        inverse(frames), frames, visits.frame.uframe[rows], visits.frame.base[rows]
    )


def turns_in_file(visits: Visits, solved: Commands) -> Floats:
    """Give the commands' rotations in the frame of the numbers, (n, 3) [rad]."""
    out = np.array(solved.turn)
    poses = solved.turned[visits.target.meaning[solved.turned] == Meaning.POSE]
    axes = base_in_uframe(visits, poses)[:, :3, :3]
    out[poses] = np.einsum("nij,nj->ni", axes, out[poses])
    return out


def change_mm(visits: Visits, numbers: Floats, correction: Floats) -> Floats:
    """Give the change that arrivals at one literal must agree on, (n, 3) [mm].

    For a pose it is that of its numbers (the same literal may be reached in two user
    frames), for joint angles that of the TCP.
    """
    poses = (visits.target.meaning == Meaning.POSE)[:, None]
    moved = numbers[:, :3] - visits.target.values[:, :3]
    near = np.flatnonzero(visits.target.meaning == Meaning.NEAR)
    axes = base_in_uframe(visits, near)[:, :3, :3]
    change = np.where(poses, moved, correction / MM)
    change[near] = np.einsum("nij,nj->ni", axes, correction[near]) / MM
    return change
