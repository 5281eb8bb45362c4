"""From what a program says to where the TCP goes: visits to targets of the planner."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.eligibility.reasons import Reasons
from postproc.compensation.solver.arc_angles import (
    ArcAngles,
    find_past_start,
    place_ends,
)
from postproc.compensation.solver.arc_turns import ArcTurns, turn_between
from postproc.diagnostics import Code, Reason
from postproc.language.visits import (
    Blend,
    Diagnostic,
    Meaning,
    Visits,
    ZoneRule,
)
from postproc.motion.path import arc_per_start
from postproc.motion.targets import Fly, TargetKind, Targets
from postproc.robot.cell import Cell
from postproc.robot.pose import (
    MM,
    inverse,
    is_unknown,
    products,
    rotation_from_vector,
    times,
)
from postproc.robot.trajectory import Motion

# What a program says of its fly points, and what it leaves to be assumed.

USUAL_DISTANCE = 5.0  # [mm] where no zone is set, as simulation systems take it
USUAL_OVERLAP = 100.0  # [%] where no overlap is set
FAR = 0.1  # [mm] passing a point farther away than this is worth a note


def rounding_of(visits: Visits) -> tuple[Ints, Floats, Floats]:
    """Tell how fly points are rounded: `Fly`, distances [m] and overlaps, (n,) each."""
    cartesian = visits.zone.blend == Blend.ZONE
    passing = cartesian & (visits.zone.rule == ZoneRule.PASS)
    within = visits.zone.rule == ZoneRule.WITHIN
    rounding = np.where(cartesian, np.where(within, Fly.WITHIN, Fly.FROM), Fly.OVERLAP)
    rounding[passing | (visits.zone.size_mm < 0)] = Fly.EXACT
    rounding[find_open_corners(visits)] = Fly.UNKNOWN
    distance = np.nan_to_num(visits.zone.size_mm, nan=USUAL_DISTANCE) * MM
    overlap = np.nan_to_num(visits.zone.overlap_percent, nan=USUAL_OVERLAP) / 100.0
    return rounding, np.maximum(distance, 0.0), np.clip(overlap, 0.0, 1.0)


def find_open_corners(visits: Visits) -> Bools:
    """Return fly points whose corner is not known, (n,).

    Of some the program does not show whether the arm stops there. Of others it does not
    show from where the arm comes or where it goes: they have several ways in or out, or
    one that leads nowhere known.
    """
    n, pred = len(visits), visits.graph.pred.astype(np.int64)
    into = np.diff(visits.graph.pred_start)
    to, known = np.repeat(np.arange(n), into), pred >= 0
    out = np.bincount(pred[known], minlength=n)
    framed = ~np.isin(
        visits.target.meaning, (*JOINTS, Meaning.BY, Meaning.PARTIAL_JOINTS)
    )
    nowhere = framed & ((visits.frame.tool < 0) | (visits.frame.uframe < 0))
    nowhere |= visits.target.meaning == Meaning.UNKNOWN
    leads = np.bincount(pred[known & nowhere[to]], minlength=n) > 0
    rounded = (
        visits.motion.fly & ~visits.motion.via & (visits.zone.rule != ZoneRule.PASS)
    )
    rounded &= ~(visits.zone.size_mm < 0)
    open_ = rounded & ((into > 1) & (out > 0) | (out > 1) | leads)
    return np.asarray(open_ | (visits.zone.rule == ZoneRule.UNKNOWN))


def report_rounded_points(visits: Visits, away: Floats) -> list[Diagnostic]:
    """Say once how far the path passes rounded fly points, and what was assumed.

    Args:
        visits: Every arrival.
        away: How far the path passes each, (n,) [mm].
    """
    rows = np.flatnonzero((away > 0) & ~visits.motion.via)
    if len(rows) == 0:
        return []
    found = [_note(visits, int(rows[0]), Code.FLY_ASSUMED, text)
             for text in [_list_assumptions(visits, rows)] if text]  # fmt: skip
    far = rows[away[rows] > FAR]
    if len(far):
        worst = int(far[np.argmax(away[far])])
        text = (
            f"the path passes {len(far)} fly points at more than {FAR:g} mm, this one "
            f"at {away[worst]:.2f} mm, {visits.dialect.terms.corner}"
        )
        found.append(_note(visits, worst, Code.FLY_CORNER, text))
    return found


def unknown_blends(visits: Visits, corrected: Bools) -> list[Diagnostic]:
    """Report once which corrected points may be stops, or be passed in any zone.

    Args:
        visits: Every arrival.
        corrected: Those that are corrected, (n,).
    """
    found = np.flatnonzero(corrected & find_open_corners(visits))
    if len(found) == 0:
        return []
    text = (
        f"the program does not show whether the arm stops at {len(found)} points, how "
        "early it leaves them, or which of several ways it takes there. They are "
        "corrected for all cases; joints that turn back there are corrected for the "
        "middle of their play"
    )
    return [_note(visits, int(found[0]), Code.FLY_UNKNOWN, text)]


def _list_assumptions(visits: Visits, rows: Ints) -> str:
    """List what fly points take for granted."""
    cartesian = visits.zone.blend[rows] == Blend.ZONE
    overlap = ~cartesian | (visits.motion.kind[rows] == Motion.JOINT)
    type_, percent, size, rule = visits.dialect.terms.blend
    untold = [
        (type_, visits.zone.blend[rows] == Blend.UNSET),
        (percent.format(USUAL_OVERLAP),
         overlap & np.isnan(visits.zone.overlap_percent[rows])),
        (size.format(USUAL_DISTANCE), cartesian & np.isnan(visits.zone.size_mm[rows])),
        (rule, cartesian & (visits.zone.rule[rows] == ZoneRule.UNSET)),
    ]  # fmt: skip
    taken = ", ".join(text for text, where in untold if where.any())
    return taken and f"fly points are rounded as with {taken}: not set in the program"


def _note(visits: Visits, row: int, code: Code, text: str) -> Diagnostic:
    return Diagnostic(visits.file_name(row), int(visits.place.line[row]), code, text)


# From what a program says to where the TCP goes: visits to targets of the planner.
#
# World . BASE . FK(q) . TOOL = UFRAME . P, so that the TCP in the arm's base frame is
# inverse(BASE) . UFRAME . P.

JOINTS = (Meaning.JOINTS, Meaning.HOME, Meaning.CALIBRATION)
PLACED = (
    TargetKind.POSE,
    TargetKind.TOOL_STEP,
    TargetKind.BASE_STEP,
    TargetKind.TOWARDS,
)
IN_JOINTS = {
    Meaning.JOINTS: TargetKind.JOINTS,
    Meaning.HOME: TargetKind.JOINTS,
    Meaning.CALIBRATION: TargetKind.JOINTS,
    Meaning.BY: TargetKind.JOINT_STEP,
    Meaning.PARTIAL_JOINTS: TargetKind.PARTIAL_JOINTS,
}
STEPS_IN = {
    Meaning.RELATIVE_TOOL: "tool",
    Meaning.RELATIVE_BASE: "base",
    Meaning.RELATIVE_UFRAME: "uframe",
}


Rows = Ints | slice
ALL = slice(None)


@dataclass(frozen=True)
class Frames:
    """The frames that hold at some visits, (m, 4, 4) [m], NaN where not known.

    Attributes:
        tool: TCP in the flange frame.
        user: User frame in the arm's base frame.
    """

    tool: Floats
    user: Floats


def targets_from_visits(visits: Visits, cell: Cell) -> tuple[Targets, Reasons]:
    """Express all visits in the arm's base frame.

    Args:
        visits: What the program says.
        cell: Home, calibration pose and the kinds of auxiliary axes.

    Returns:
        The targets, and why visits must not be compensated as far as frames, tools,
        values and auxiliary axes tell.
    """
    frames, reasons = _frames(visits), Reasons(len(visits))
    values = _values(visits, cell)
    kind, tcp, joints = _places(visits, frames.user, values)
    poses = np.isin(visits.target.meaning, (Meaning.POSE, Meaning.NEAR))
    outside = _auxiliary(visits, cell, reasons)
    _explain(visits, values, poses, reasons)
    lost = (outside | visits.frame.tool_remote) & (kind != TargetKind.JOINTS)
    lost |= _find_unplaced(kind, tcp, joints, frames)
    lost |= place_ends(visits, tcp, reasons)
    # Joint moves to poses of arms whose branches no controller's flags name.
    of_poses = np.isin(visits.target.meaning, (Meaning.POSE, Meaning.NEAR))
    rows = of_poses & (visits.motion.kind == Motion.JOINT) & (cell.arm.file.opw is None)
    reasons.mark(rows, UNNAMED)
    lost |= rows
    along = turn_between(visits, tcp)
    slot, turns = visits.dialect.flags(
        visits.target.config, visits.target.configs, values
    )
    branch = np.where(visits.target.config_given & poses, slot, -1), turns
    places = np.where(lost, TargetKind.UNKNOWN, kind), tcp, joints
    found = _targets(visits, places, frames.tool, branch, along)
    return found.slim(), reasons


def _targets(
    visits: Visits,
    places: tuple[Ints, Floats, Floats],
    tool: Floats,
    branch: tuple[Ints, Floats],
    along: Bools,
) -> Targets:
    """Put targets together with how the program moves there.

    Args:
        visits: What the program says.
        places: Kinds, TCP poses and joints, as `_places` returns them.
        tool: TCP in the flange frame, (n, 4, 4) [m].
        branch: Slots of the arm's branches, -1 where not told, and turns.
        along: Points of arcs on which it is not known how the tool turns, (n,).
    """
    kind, tcp, joints = places
    rounding, fly_distance, overlap = rounding_of(visits)
    starts, before = (
        v.astype(np.int64) for v in (visits.graph.pred_start, visits.graph.pred)
    )
    pred_start, pred = arc_per_start(
        visits.motion.kind, visits.motion.via, starts, before
    )
    return Targets(
        move=visits.motion.kind,
        kind=kind,
        via=visits.motion.via,
        tcp=tcp,
        distance=np.where(
            visits.target.meaning == Meaning.FOR, visits.target.distance_mm * MM, np.nan
        ),
        joints=joints,
        tool=tool,
        slot=branch[0],
        turns=branch[1],
        nearest_turn=visits.motion.nearest_turn,
        fly=visits.motion.fly,
        rounding=rounding,
        fly_distance=fly_distance,
        overlap=overlap,
        linear_speed=visits.speed.linear,
        rotary_speed=visits.speed.turning,
        override=visits.speed.override,
        wrist_joint=visits.motion.wrist_joint,
        block=visits.motion.block,
        curved=visits.motion.curved,
        along=along,
        past_start=find_past_start(visits),
        stops=np.zeros(len(visits), dtype=bool),
        pred_start=pred_start,
        pred=pred,
    )


UNNAMED = Reason(
    Code.CONFIGURATION_UNKNOWN,
    "the branch that its flags name is not known for an arm without a closed form of "
    "the inverse kinematics: go there by joint angles, or on a line",
)


def _find_unplaced(kind: Ints, tcp: Floats, joints: Floats, frames: Frames) -> Bools:
    """Tell which targets miss a number or the tool that they need, (n,)."""
    placed = np.isin(kind, PLACED)
    in_joints = np.isin(kind, (TargetKind.JOINTS, TargetKind.JOINT_STEP))
    unknown: Bools = placed & (is_unknown(tcp) | is_unknown(frames.tool))
    partial = kind == TargetKind.PARTIAL_POSE  # of which places may be missing
    unknown |= partial & (np.isnan(tcp[:, 0, 0]) | is_unknown(frames.tool))
    return unknown | (in_joints & np.isnan(joints).any(axis=1))


def move_targets(targets: Targets, visits: Visits, cell: Cell, rows: Ints) -> Targets:
    """Express some visits anew, whose numbers have changed, and nothing else.

    Args:
        targets: All visits as they were.
        visits: All visits as they are now.
        cell: As in `targets_from_visits`.
        rows: Visits with other numbers, and points of arcs that move or turn with
            them, (m,).
    """
    user, values = _user_frames(visits, rows), _values(visits, cell, rows)
    _, tcp, joints = _places(visits, user, values, rows)
    found = targets.move_to(rows, tcp, joints)
    arcs = ArcAngles.of(visits)
    arcs = arcs.among(np.isin(arcs.end, rows))
    if len(arcs):
        ends = arcs.ends(found.tcp)
        found = found.move_to(arcs.end, ends, found.joints[arcs.end])
    return _turn_again(found, visits, rows)


def _turn_again(targets: Targets, visits: Visits, rows: Ints) -> Targets:
    """Turn the points between on arcs that lie elsewhere now, as `turn_between` has."""
    arcs = ArcTurns.of(visits)
    arcs = arcs.among(~targets.along[arcs.via] & np.isin(arcs.via, rows))
    if len(arcs) == 0:
        return targets
    joints = targets.joints[arcs.via]
    return targets.move_to(arcs.via, arcs.turn(targets.tcp), joints)


def _frames(visits: Visits) -> Frames:
    return Frames(few_frames(visits)[visits.frame.tool], _user_frames(visits, ALL))


def _user_frames(visits: Visits, rows: Rows) -> Floats:
    """Place the user frames of visits in the arm's base frame, (m, 4, 4) [m]."""
    poses = few_frames(visits)
    return products(
        inverse(poses), poses, visits.frame.base[rows], visits.frame.uframe[rows]
    )


def few_frames(visits: Visits) -> Floats:
    """Return the frames that the program uses, and last one that is not known."""
    unknown = np.full((1, 4, 4), np.nan)
    return np.concatenate([visits.frame.poses, unknown])


def _values(visits: Visits, cell: Cell, rows: Rows = ALL) -> Floats:
    """Fill in home and calibration pose where the program does not tell them."""
    values, goal = np.array(visits.target.values[rows]), visits.target.meaning[rows]
    untold = np.isnan(values).any(axis=1)
    for target, joints in (
        (Meaning.HOME, cell.home),
        (Meaning.CALIBRATION, cell.calibration),
    ):
        if joints is not None:
            rows_there = np.flatnonzero(untold & (goal == target))
            values[rows_there, :6] = np.rad2deg(joints)
    return values


def _places(
    visits: Visits, user: Floats, values: Floats, rows: Rows = ALL
) -> tuple[Ints, Floats, Floats]:
    """Turn numbers into kinds, TCP poses (m, 4, 4) [m] and joints (m, 6) [rad]."""
    target = visits.target.meaning[rows]
    n = len(target)
    if (target == Meaning.POSE).all():  # most programs are nothing else
        tcp = times(user, visits.dialect.poses(values))
        return np.full(n, int(TargetKind.POSE)), tcp, np.full((n, 6), np.nan)
    kind = np.full(n, int(TargetKind.UNKNOWN))
    tcp, joints = np.full((n, 4, 4), np.nan), np.full((n, 6), np.nan)
    for meaning, its_kind in IN_JOINTS.items():
        kind[target == meaning] = its_kind
    in_joints = np.isin(target, (*IN_JOINTS,))
    joints[in_joints] = np.deg2rad(values[in_joints, :6])
    poses = np.isin(target, (Meaning.POSE, Meaning.NEAR, Meaning.FOR))
    kind[poses] = np.where(
        target[poses] == Meaning.FOR, TargetKind.TOWARDS, TargetKind.POSE
    )
    tcp[poses] = times(user[poses], visits.dialect.poses(values[poses]))
    near = target == Meaning.NEAR
    tcp[near] = tcp[near] @ _along_approach(-visits.target.distance_mm[rows][near])
    away = target == Meaning.AWAY
    kind[away], tcp[away] = TargetKind.TOOL_STEP, _along_approach(-values[away, 0])
    partial = target == Meaning.PARTIAL_POSE
    kind[partial], axes = TargetKind.PARTIAL_POSE, user[partial]
    origin = np.einsum("nji,nj->ni", axes[:, :3, :3], axes[:, :3, 3])
    tcp[partial] = axes
    tcp[partial, :3, 3] = origin + values[partial, :3] * MM
    steps = np.isin(target, (*STEPS_IN, Meaning.ABOUT))
    for v in np.flatnonzero(steps).tolist():
        kind[v], tcp[v] = _step(target[v], values[v], user[v])
    return kind, tcp, joints


def _along_approach(distance_mm: Floats) -> Floats:
    """Shifts (m, 4, 4) [m] along the tool's z axis."""
    T = np.tile(np.eye(4), (len(distance_mm), 1, 1))
    T[:, 2, 3] = distance_mm * MM
    return T


def _step(target: int, value: Floats, user: Floats) -> tuple[TargetKind, Floats]:
    """Turn one RELATIVE or ABOUT into a step of the tool or along the base axes."""
    about = target == Meaning.ABOUT
    frame = STEPS_IN.get(Meaning(int(value[4])) if about else Meaning(int(target)), "")
    axes = np.eye(3)
    if frame == "uframe":
        axes = user[:3, :3]
    step = np.eye(4)
    vector = axes @ value[:3]
    if np.isnan(vector).any() or (about and not np.linalg.norm(vector) > 0):
        return TargetKind.UNKNOWN, np.full((4, 4), np.nan)
    if about:
        turn = np.deg2rad(value[3]) * vector / np.linalg.norm(vector)
        step[:3, :3] = rotation_from_vector(turn)
    else:
        step[:3, 3] = vector * MM
    return (TargetKind.TOOL_STEP if frame == "tool" else TargetKind.BASE_STEP), step


_STAYS = (
    "it says nothing of auxiliary axis {}, a track that other targets move away from 0"
)
STAYS = np.inf  # of a track: where earlier moves have left it


def with_tracks(visits: Visits, cell: Cell) -> Visits:
    """Say of all visits of a program where they leave the arm on its tracks.

    A target that says nothing of a track leaves it where it is, which is not known
    where other targets move it away from 0.
    """
    aux = np.array(visits.target.aux)
    poses = ~np.isin(visits.target.meaning, JOINTS)
    for column in range(aux.shape[1] if aux.ndim == 2 else 0):
        place = aux[:, column]
        away = (place != 0.0) & ~np.isnan(place)
        if cell.aux.get(column + 1) == "track" and away.any():
            place[np.isnan(place) & poses] = STAYS
    return visits.with_columns(aux=aux)


def _auxiliary(visits: Visits, cell: Cell, reasons: Reasons) -> Bools:
    """Tell which visits depend on axes that may move the arm or the part, (n,).

    With its track at 0 the arm stands at the base of the cell.
    """
    outside = np.zeros(len(visits), dtype=bool)
    for column in range(
        visits.target.aux.shape[1] if visits.target.aux.ndim == 2 else 0
    ):
        axis = column + 1
        given, use = ~np.isnan(visits.target.aux[:, column]), cell.aux.get(axis)
        if use == "track":
            given &= visits.target.aux[:, column] != 0.0
        if use == "gun" or not given.any():
            continue
        outside |= given
        if use is None:
            text = (
                f"auxiliary axis {axis} is not declared in the cell: add [aux] "
                f'{axis} = "gun", "track" or "positioner"'
            )
        else:
            stays = Reason(Code.EXTERNAL_AXES, _STAYS.format(axis))
            reasons.mark(given & (visits.target.aux[:, column] == STAYS), stays)
            text = f"auxiliary axis {axis} is a {use}: not modelled"
        reasons.mark(given, Reason(Code.EXTERNAL_AXES, text))
    return outside


def _explain(visits: Visits, values: Floats, poses: Bools, reasons: Reasons) -> None:
    """Say why visits are not compensated."""
    terms = visits.dialect.terms
    reasons.mark(visits.frame.tool_remote, Reason(Code.REMOTE_TOOL, terms.tool_remote))
    reasons.mark(
        np.isnan(values).any(axis=1) & (poses | np.isin(visits.target.meaning, JOINTS)),
        Reason(Code.RUNTIME_VALUE, "a value is not known"),
    )
    unknown = is_unknown(few_frames(visits))
    for name, which, who in (
        (terms.tool, visits.frame.tool, np.ones(len(visits), dtype=bool)),
        (terms.base, visits.frame.base, poses),
        (terms.uframe, visits.frame.uframe, poses),
    ):
        text = f"{name} is not known at this move: add it to the cell file"
        reasons.mark(unknown[which] & who, Reason(Code.FRAME_UNKNOWN, text))
