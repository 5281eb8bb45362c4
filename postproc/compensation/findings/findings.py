"""What the user should know of a plan beyond what came of each target."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np

from postproc.arrays import Bools, Floats, Ints, any_in_rows, map_chunks
from postproc.compensation.solver.continuity import on_path
from postproc.compensation.solver.taught_frames import find_taught_records
from postproc.diagnostics import Code, Reason
from postproc.language.languages import file_named, language_of
from postproc.language.visits import Diagnostic, Meaning, Visits
from postproc.robot.arm import Arm
from postproc.robot.cell import Cell
from postproc.robot.pose import MM

SURE = 0.9  # part of its play from its middle at which a joint rests on a flank
LISTED = 0.01  # [mm] and [deg], the last decimal of the controller's own listing

SHORTEST = 2.0  # [mm] of a tool that is no flange; a longer one has no 2 m

SINGLY = 20  # findings of one kind that are listed line by line


def report_controller_assumption(name: str, cell: Cell) -> Diagnostic:
    """State that the controller is assumed not to compensate on its own."""
    text = f"the controller's own absolute accuracy is assumed to be off ({cell.path})"
    return Diagnostic(name, 1, Code.ABSOLUTE_ACCURACY, text)


def controller_unknown(name: str, cell: Cell) -> list[Diagnostic]:
    """State that the arm is assumed to have a controller that runs the program."""
    if cell.controllers:
        return []
    language = language_of(name)
    text = (
        f"neither {cell.path} nor the file of the arm {cell.arm.name} names its "
        f"controller, which is assumed to run {language.name}. Write "
        f'controller = "{language.controller}" in the arm file'
    )
    return [Diagnostic(name, 1, Code.CONTROLLER, text)]


def tool_in_metres(visits: Visits) -> list[Diagnostic]:
    """Ask about the first tool that is shorter than any, but not of no length.

    Tools are tens of millimetres long and more; written in metres none reaches two.
    """
    longest = np.abs(visits.frame.poses[:, :3, 3]).max(axis=1, initial=0.0) / MM
    short = (longest > 0.0) & (longest < SHORTEST)
    known = np.flatnonzero(visits.frame.tool >= 0)
    first = known[short[visits.frame.tool[known]]][:1]
    return [
        Diagnostic(
            visits.file_name(i),
            int(visits.place.line[i]),
            Code.TOOL_LENGTH,
            f"the tool here is {longest[visits.frame.tool[i]]:g} mm long, by the "
            "program or by [tool] of the cell: are these metres? Write millimetres",
        )
        for i in first
    ]


def list_followed_pages(visits: Visits, untouched: Collection[str]) -> list[Diagnostic]:
    """List the files that are one job with the program.

    Args:
        visits: The arrivals of the job.
        untouched: Names of files that are never rewritten.
    """
    files = enumerate(map(file_named, visits.files[1:]), start=1)
    pages = [
        (number, file.place)
        for number, file in files
        if not (file.is_variables or file.is_from_elsewhere)
    ]
    uses = [f"{name} {_use(name, k, visits, untouched)}" for k, name in pages]
    return [Diagnostic(visits.files[0], 1, Code.PAGE, use) for use in uses]


def _use(name: str, number: int, visits: Visits, untouched: Collection[str]) -> str:
    """Say what is done with a file of a job."""
    if file_named(name).is_shared:
        return "is read, but not written: all programs share it"
    pinned = [bool(why) for why in visits.literals.pinned]
    own = np.array(pinned, dtype=bool)[visits.literals.file == number]
    if name in untouched or (len(own) and own.all()):
        return "is read, but not written: its numbers must stay"
    return "is a part of this program: it is read, and written with corrected targets"


def missing_file(visits: Visits) -> list[Diagnostic]:
    """Tell that a program came without the variable file that holds its targets."""
    name = file_named(visits.files[0]).variables
    if not name or any(file_named(one).is_variables for one in visits.files):
        return []
    none = np.array([one.code is Code.NO_VALUE for one in visits.reasons])
    lost = none[visits.reason]
    text = (
        f"targets without a value: {lost.sum()}, and there is no {name}. Put it beside "
        "the program, or give it with --variables"
    )
    return [
        Diagnostic(
            visits.file_name(row),
            int(visits.place.line[row]),
            Code.NO_VARIABLE_FILE,
            text,
        )
        for row in np.flatnonzero(lost)[:1].tolist()
    ]


def list_overruled_strings(visits: Visits, rows: Bools) -> list[Diagnostic]:
    """List targets whose configuration string the path does not follow, rows (n,).

    Where the program says whether strings are checked, it is as the program wants it,
    or the target is left alone.
    """
    text = visits.dialect.terms.overruled
    return _each(visits, rows, Code.CONFIGURATION_OVERRULED, text)


def list_untimed_runs(visits: Visits, rows: Bools) -> list[Diagnostic]:
    """List targets in runs that no time law was found for, rows (n,)."""
    text = "no time law was found for this run: times and speeds are estimates"
    return _each(visits, rows, Code.NO_TIME_LAW, text)


def flank_steps(
    visits: Visits, corrected: Bools, place: Floats, side: Floats, gap: Floats, arm: Arm
) -> list[Diagnostic]:
    """Tell where a change of flank asks for more acceleration than an axis has.

    On a path the correction makes up for the gap on the way to one fly point. To turn
    by it and stand still again takes 4 gap / T^2 at least, T being the time for that
    way at the programmed speed.

    Args:
        visits: Every arrival.
        corrected: Visits whose target moves, (n,).
        place: Where the program wants the TCP, (n, 3) [m].
        side: Where every joint lies in its play, (n, 6) from -1 to 1.
        gap: Half the fitted gap between the flanks of every joint, (6,) [rad].
        arm: Its accelerations may be guesses of the arm file.
    """
    before = on_path(visits)
    rows = np.flatnonzero(corrected & (before >= 0) & (visits.speed.linear > 0.0))
    last = before[rows]
    way = np.linalg.norm(place[rows] - place[last], axis=1)
    time = way / (visits.speed.linear[rows] * visits.speed.override[rows])
    found = []
    for j in range(len(gap)):
        with np.errstate(divide="ignore", invalid="ignore"):
            asked = 4.0 * np.abs(side[rows, j] - side[last, j]) * gap[j] / time**2
            over = np.where(time > 0.0, asked / arm.acceleration[j], 0.0)
        count = int((over > 1.0).sum())
        if count == 0:
            continue
        i = int(over.argmax())
        text = (
            f"axis {j + 1} changes its flank on the way to {count} fly points faster "
            f"than its acceleration allows (here {over[i]:.1f} times, as far as the "
            "arm file knows it): the controller may slow down or round the step off"
        )
        line = int(visits.place.line[rows[i]])
        name = visits.file_name(rows[i])
        found.append(Diagnostic(name, line, Code.FLANK_ACCELERATION, text))
    return found


def listing_cost(
    visits: Visits, corrected: Bools, q: Floats, arm: Arm
) -> list[Diagnostic]:
    """Say what is lost when the controller lists corrected values with its 2 decimals.

    Args:
        visits: Every arrival.
        corrected: Visits whose target moves, (n,).
        q: Joint angles there, (n, 6) [rad].
        arm: How far a joint angle moves the TCP.
    """
    if len(visits.literals) == 0:
        return []
    files = np.array([file_named(name).is_variables for name in visits.files])
    rows = corrected & files[visits.literals.file[visits.target.literal]]
    found = []
    poses = rows & (visits.target.meaning != Meaning.JOINTS)
    if poses.any():
        lever = np.linalg.norm(_tool(visits, poses), axis=1).max() / MM
        lost = np.sqrt(3) * LISTED / 2
        found.append(
            f"up to {lost:.4f} mm of position and, in orientation, {LISTED / 2:g} deg "
            f"an angle: {np.deg2rad(LISTED / 2) * lever:.3f} mm over the tool's length"
        )
    joints = rows & (visits.target.meaning == Meaning.JOINTS)
    if joints.any():
        at, tool = q[joints], _tool(visits, joints)
        reach = map_chunks(lambda some: _reach(arm, at[some], tool[some]), len(at))
        lost = max(reach) * np.deg2rad(LISTED / 2)
        found.append(f"up to {lost / MM:.3f} mm at joint targets")
    first = np.flatnonzero(rows)[:1]
    return [
        Diagnostic(
            visits.files[visits.literals.file[visits.target.literal[v]]],
            int(visits.literals.line[visits.target.literal[v]]),
            Code.LSV_PRECISION,
            f"a listing by the controller has 2 decimals (0.01 mm, 0.01 deg): to list "
            f"these values and load them again costs {'; '.join(found)}",
        )
        for v in first
    ]


def _tool(visits: Visits, rows: Bools) -> Floats:
    """Return the TCP in the flange frame at some visits, (k, 3) [m]."""
    return np.asarray(visits.frame.poses[visits.frame.tool[rows], :3, 3])


def _reach(arm: Arm, q: Floats, tool: Floats) -> float:
    """Return how far the TCP moves at most if all joints turn a little [m/rad]."""
    J = arm.jacobian(q, tool)[:, :3]
    return float(np.linalg.norm(J, axis=1).sum(axis=1).max())


def _each(visits: Visits, rows: Bools, code: Code, text: str) -> list[Diagnostic]:
    """Make one diagnostic for each visit, or one for all where they are many."""
    found = np.flatnonzero(rows)
    if len(found) > SINGLY:
        text, found = f"{len(found)} targets from here on: {text}", found[:1]
    return [
        Diagnostic(visits.file_name(i), int(visits.place.line[i]), code, text)
        for i in found.tolist()
    ]


def report_uncertain_frames(
    visits: Visits, corrected: Bools, std_error: Floats, cell: Cell
) -> list[Diagnostic]:
    """Say how unsure targets in taught frames are, and what makes them surer.

    Args:
        visits: Every arrival.
        corrected: Visits whose target moves, (n,).
        std_error: Standard error of the correction, (n, 3) [m].
        cell: Says which frames were taught, and from which sides.
    """
    found, poses = [], np.isin(visits.target.meaning, (Meaning.POSE, Meaning.NEAR))
    for frame, record in find_taught_records(visits, cell).items():
        sides = cell.taught_sides.get(record)
        rows = np.flatnonzero(corrected & poses & (visits.frame.uframe == frame))
        if cell.taught_frames[record] is None or len(rows) == 0:
            continue
        if sides is not None and sides.all():
            continue
        size = float(np.linalg.norm(std_error[rows], axis=1).max()) / MM
        text = (
            f"{len(rows)} targets stand in a user frame that was taught from sides "
            f"that are not known (up to +-{size:.3f} mm): teach its three points far "
            "apart, each reached by a move of all joints in one direction, and write "
            "these directions as taught_direction in the cell file"
        )
        where = (
            visits.file_name(rows[0]),
            int(visits.place.line[rows[0]]),
        )
        found.append(Diagnostic(*where, Code.DIRECTION_UNCERTAIN, text))
    return found


def report_averaged_points(
    visits: Visits, why: Ints, reasons: Sequence[Reason]
) -> list[Diagnostic]:
    """List the points that have one correction for arrivals that need different ones.

    Args:
        visits: Every arrival.
        why: Index of the reason of each, (n,).
        reasons: All reasons.
    """
    found = []
    for code in (Code.ARRIVALS_AVERAGED, Code.ARRIVALS_FAR_APART):
        averaged = np.array([one.code is code for one in reasons])
        rows = np.flatnonzero(averaged[why])
        _, first = np.unique(visits.target.literal[rows], return_index=True)
        for i in rows[np.sort(first)].tolist():
            name, text = (
                visits.target_name(i),
                reasons[why[i]].text,
            )
            place = visits.file_name(i), int(visits.place.line[i])
            text = f"{name}: {text}" if name else text
            found.append(Diagnostic(*place, code, text))
    return found


def no_advice(rows: Ints) -> dict[int, str]:
    """Say nothing on how to approach visits: nobody knows their ways."""
    return {}


def report_uncertain_sides(
    visits: Visits,
    corrected: Bools,
    side: Floats,
    std_error: Floats,
    advice: Callable[[Ints], Mapping[int, str]],
) -> list[Diagnostic]:
    """List the corrected targets of which an approach direction is uncertain.

    They are corrected for where the joint should lie within its play, or for its
    middle where that is not known: up to half of the backlash may remain.

    Args:
        visits: Every arrival.
        corrected: Visits whose target moves, (n,).
        side: Where every joint lies in its play, (n, 6) from -1 to 1.
        std_error: Standard error of the correction, (n, 3) [m].
        advice: Says how to approach some visits.
    """
    rows = np.flatnonzero(corrected & any_in_rows((-SURE < side) & (side < SURE)))
    size = np.linalg.norm(std_error, axis=1) / MM
    cure = "start the approach farther away, or so that the axis does not reverse"
    if len(rows) > SINGLY:
        first, worst = rows[0], rows[np.argsort(-size[rows])[:5]]
        place = visits.place
        worst = worst[np.lexsort((place.line[worst], place.file[worst]))]
        lines = ", ".join(visits.list_lines(worst, place.file[first]))
        text = (
            f"the approach direction of {len(rows)} targets is uncertain, because an "
            f"axis reversed shortly before (up to +-{size[rows].max():.3f} mm, for "
            f"instance lines {lines}): {cure}"
        )
        return [
            Diagnostic(
                visits.file_name(first),
                int(place.line[first]),
                Code.DIRECTION_UNCERTAIN,
                text,
            )
        ]
    told = advice(rows)
    return [
        Diagnostic(
            visits.file_name(i),
            int(visits.place.line[i]),
            Code.DIRECTION_UNCERTAIN,
            f"the approach direction is uncertain (+-{size[i]:.3f} mm), because "
            f"{_how(side[i])}: {told.get(i, cure)}",
        )
        for i in rows.tolist()
    ]


def _how(side: Floats) -> str:
    """Say why the approach direction is uncertain."""
    if not side.any():
        return "the place before is not known"
    return f"{name_axes(np.flatnonzero(np.abs(side) < SURE))} reversed shortly before"


def name_axes(joints: Ints) -> str:
    """Name axes by their numbers from 0.

    >>> name_axes(np.array([1, 2, 4])), name_axes(np.array([0]))
    ('axes 2, 3 and 5', 'axis 1')
    """
    *most, last = [str(j + 1) for j in joints.tolist()]
    return f"axes {', '.join(most)} and {last}" if most else f"axis {last}"
