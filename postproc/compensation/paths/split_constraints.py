"""Which moves may be split: what forbids points on their ways, and how close they lie.

A point may not change what a program does besides where the tool is: nothing that is
counted, timed or enabled along a move may depend on it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.outcome import Decisions, Status
from postproc.compensation.paths.arcs import (
    FLAT,
    WantedArcs,
    hindrances_of_arcs,
    is_arc,
)
from postproc.compensation.solver.payload import payload_of
from postproc.language.insert_moves import ArcPiece, Splitter
from postproc.language.text.source import CloneError
from postproc.language.visits import Meaning, OrientationLaw, Visits
from postproc.model.model import Model
from postproc.motion.cycle_time import ProgramCycle
from postproc.robot.cell import Cell
from postproc.robot.pose import MM
from postproc.robot.trajectory import Motion

CLOSEST = 1e-3  # [m] length of the shortest piece, however slow the move is
CLEAR = 0.02  # [m] from a rounded end: how large its corner is depends on the moves
LAST_FLATS = 2.0  # of `FLAT`: the sagitta of the last piece of an arc, no chord
SAME_LOAD = 1e-3  # [kg, m] by which a stated load may differ from the cell's
ALIKE = 1e-6  # a tool whose axes turn by less keeps its orientation


def hindrances(
    v: Visits,
    decisions: Decisions,
    cycle: ProgramCycle,
    cell: Cell,
    speed: Floats,
    keeps_aux: bool = False,
) -> dict[int, str]:
    """Say why moves of a program must stay in one piece, by their visit.

    Args:
        v: The program.
        decisions: How its targets are corrected.
        cycle: .. in time.
        cell: Its payload is the one that paths are predicted with.
        speed: Of its moves, see `speeds_of_pieces`, (n,) [m/s].
        keeps_aux: See `Splitter.keeps_aux`.
    """
    status, before = decisions.status, np.maximum(v.graph.before, 0)
    corrected = (status == Status.CORRECTED) | (status == Status.UNCHANGED)
    ends = (v.target.literal >= 0) & (v.target.meaning == Meaning.POSE) & corrected
    has = (v.target.literal >= 0) & (len(v.literals) > 0)
    taught = np.zeros(len(v), dtype=bool)
    taught[has] = v.literals.taught[v.target.literal[has]]
    frames = [v.frame.tool, v.frame.base, v.frame.uframe, v.target.config]
    alike = np.all([column == column[before] for column in frames], axis=0)
    found: dict[int, str] = {}
    for rows, why in (
        (v.motion.kind == Motion.JOINT, "it is neither a line nor an arc"),
        (v.graph.before < 0, "its start is not known, or there are several"),
        (_several(v), "it is reached several times"),
        (
            taught | taught[before],
            "one of its ends is taught and contains the arm's error",
        ),
        *_reasons_of_ends(decisions, corrected, before),
        (~(ends & ends[before]), "its ends are not both corrected poses"),
        (v.target.shift >= 0, "its end is shifted from a point"),
        (
            v.motion.weaves,
            "it weaves, or may: the pattern would restart at every point",
        ),
        (_carries_otherwise(v, cell), "the program states the payload on it"),
        (~alike, "it starts with other frames or configuration flags"),
        (_aux_moves(v, before, keeps_aux), "auxiliary axes move with it"),
        (v.frame.tool_remote, "the arm holds the part"),
        *hindrances_of_arcs(v, alike),
        (_turns_otherwise(v, before), "it is uncertain how the tool turns along it"),
        (np.isnan(speed), "its speed is not known"),
        (v.reason > 0, "it is not corrected"),
    ):
        for row in np.flatnonzero(rows).tolist():
            found.setdefault(row, why)
    for via in np.flatnonzero(v.motion.via).tolist():  # an arc is cut as a whole
        for one, other in ((via, via + 1), (via + 1, via)):
            if one in found:
                found.setdefault(other, found[one])
    return found


def _reasons_of_ends(
    decisions: Decisions, corrected: Bools, before: Ints
) -> Iterator[tuple[Bools, str]]:
    """Yield where an end is not corrected for some reason, (n,), and what that says."""
    for k in np.unique(decisions.why[~corrected]).tolist():
        if reason := decisions.reasons[k]:
            here = ~corrected & (decisions.why == k)
            yield here, f"its end is not corrected: {reason}"
            yield here[before], f"its start is not corrected: {reason}"


def speeds_of_pieces(cycle: ProgramCycle, cell: Cell, model: Model) -> Floats:
    """Return the largest speed that each move may have, (n,) [m/s], NaN: not known.

    That is the programmed one. Where it is not known it is the largest that the
    controller allows, if the cell tells it, and if the error is the same at all speeds.
    How a point is rounded may depend on it: points are judged for all roundings.
    """
    speed = np.array(cycle.targets.linear_speed)
    largest = cell.file.motion.linear_limit_mm_s
    if largest is not None and "speed" not in model.needs:
        speed[np.isnan(speed)] = largest * MM
    return speed


def _carries_otherwise(v: Visits, cell: Cell) -> Bools:
    """Return where the program states another load than the cell, (n,)."""
    mass, centre = payload_of(v, cell)
    off = np.column_stack([mass - cell.payload_mass, centre - cell.payload_com])
    same = np.abs(np.nan_to_num(off, nan=np.inf)).max(axis=1) <= SAME_LOAD
    return np.asarray((v.motion.load > 0) & ~same)


def _aux_moves(v: Visits, before: Ints, kept: bool) -> Bools:
    """Return where external axes move, or points would not keep them still, (n,)."""
    if not kept:
        return np.asarray(~np.isnan(v.target.aux).all(axis=1))
    return np.asarray(
        ~np.isclose(v.target.aux, v.target.aux[before], equal_nan=True).all(axis=1)
    )


def unwritable(splitter: Splitter, visits: Visits, v: int, file: int, line: int) -> str:
    """Say what in the text of a move hinders points on its way, "" for nothing."""
    widest = np.array([visits.dialect.widest])
    config = visits.target.configs[visits.target.config[v]]
    try:
        said = splitter.hinders(file, line)
        if not said and is_arc(visits, v):
            pieces = [ArcPiece(widest[0], widest[0], last) for last in (True, False)]
            splitter.arc(file, line, pieces, widest[0], config, False)
        elif not said:
            splitter.points(file, line, widest, config, False)
    except CloneError as problem:
        return str(problem)
    return said


def _several(visits: Visits) -> Bools:
    """Tell which moves are reached more than once, (n,)."""
    rows = np.stack([visits.place.file, visits.place.line, visits.motion.via])
    _, at, count = np.unique(rows, axis=1, return_inverse=True, return_counts=True)
    return np.asarray(count[at.ravel()] > 1)


def _turns_otherwise(visits: Visits, before: Ints) -> Bools:
    """Tell where the tool may turn otherwise than about one axis, (n,)."""
    law = visits.motion.orientation_law
    known = (law == OrientationLaw.UNSET) | (law == OrientationLaw.ONE_AXIS)
    turn = visits.dialect.poses(visits.target.values)[:, :3, :3]
    same = np.abs(turn - turn[before]).max(axis=(1, 2)) < ALIKE
    return np.asarray((~known | visits.motion.wrist_joint) & ~same)


def shortest_pieces(
    visits: Visits, cycle: ProgramCycle, shortest: float, speed: Floats
) -> list[tuple[float, float, float]]:
    """Return the shortest piece of every move, and what stays clear at its ends [m].

    Beside a rounded end a piece is longer than the corner, which must stay as it is.

    Args:
        visits: The program.
        cycle: .. in time.
        shortest: What a piece lasts at the largest speed, at least [s].
        speed: That of the moves, see `speeds_of_pieces`, (n,) [m/s].
    """
    least: Floats = np.maximum(shortest * np.nan_to_num(speed), CLOSEST)
    size = np.maximum(2 * np.nan_to_num(np.abs(visits.zone.size_mm) * MM), CLEAR)
    flown = (
        visits.motion.fly & ~visits.motion.via
    )  # the point on the way of an arc is no corner
    round_ = np.where(flown, np.maximum(size, least), least)
    clear = np.where(
        visits.graph.before >= 0, round_[np.maximum(visits.graph.before, 0)], least
    )
    round_ = np.maximum(round_, _last_pieces(visits, cycle))
    columns = least, np.maximum(clear, least), np.maximum(round_, least)
    return list(zip(*(column.tolist() for column in columns), strict=True))


def _last_pieces(visits: Visits, cycle: ProgramCycle) -> Floats:
    """Return how long the last piece of an arc has to be to bend enough, (n,) [m].

    No more than `CLEAR`; 0 where a move is no arc.
    """
    via, out = np.flatnonzero(visits.motion.via), np.zeros(len(visits))
    if len(via):
        radius = WantedArcs.of(cycle, visits.graph.before, via.tolist()).radius[::2]
        bends = np.sqrt(8.0 * radius * LAST_FLATS * FLAT)
        out[via + 1] = np.minimum(bends, CLEAR)
    return out
