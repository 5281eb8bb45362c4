"""Points put on the ways of moves: their numbers, their text, and that no more changed.

They lie on the programmed path; what corrects them is what corrects all targets.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.output.equivalence import equivalent
from postproc.compensation.output.rewrite import VerificationError
from postproc.compensation.paths.arcs import Chords, CutArc, is_arc
from postproc.compensation.paths.backlash_preload import BacklashPreload
from postproc.compensation.paths.insertion_report import Points
from postproc.compensation.paths.meant_sides import MeantSides
from postproc.compensation.program import ParsedProgram, read_program
from postproc.compensation.solver.inverse_model import base_in_uframe
from postproc.language.insert_moves import Splitter
from postproc.language.languages import language_of
from postproc.language.text.source import Edit, Source, apply, compose
from postproc.language.visits import Graph, Visits
from postproc.robot.cell import Cell
from postproc.robot.pose import MM, lengths, rotation_from_vector, rotation_vector
from postproc.robot.trajectory import Motion

JointsAlong = Callable[[Ints, Floats], Floats]
"""Joint angles (k, 6) [rad] at shares (k,) of the ways to visits (k,)."""

ROUNDED = 2e-6  # [m] that a point on a way may move where it is written anew
TURNED = 2e-3  # [rad] .. and the tool turn: what drives turn it by is a tenth of that


@dataclass(frozen=True)
class PathPoints:
    """What is put on the ways of a program, by the visits that they lead to.

    Attributes:
        points: Where points lie.
        stops: Moves whose first point is a stop, where the backlash is preloaded.
        chords: Pieces of arcs that are chords.
        approaches: Stops from which targets are approached again, (w,) each.
        meant: From which sides points of lines are meant to be passed.
        joints: Where the joints are, for the flags of points; None: as at their starts.
    """

    points: Points
    stops: Mapping[int, BacklashPreload] = field(default_factory=dict)
    chords: Chords = ()
    approaches: Mapping[int, Floats] = field(default_factory=dict)
    meant: Mapping[int, MeantSides] = field(default_factory=dict)
    joints: JointsAlong | None = None

    @property
    def count(self) -> int:
        """Return the number of points, stops before targets among them."""
        return sum(map(len, self.points.values())) + len(self.approaches)

    def turns(self, visit: int) -> Floats:
        """Return what the tool turns by at the points of a move, (k, 3) [rad]."""
        found = np.zeros((len(self.points.get(visit, ())), 3))
        if visit in self.meant:
            found[:] = self.meant[visit].turn
        if visit in self.stops:
            found[0] = self.stops[visit].turn
        return found


def insert(
    reading: ParsedProgram,
    put: PathPoints,
    splitter: Splitter,
    cell: Cell,
    proves: bool = True,
) -> tuple[ParsedProgram, Ints]:
    """Put points on the ways of a program.

    Args:
        reading: The program, n visits.
        put: The points.
        splitter: Its files.
        cell: What holds at program start.
        proves: Prove that it makes the same moves otherwise; what is predicted alone,
            and not written, needs no proof.

    Returns:
        The program with points, and those of its visits that the source makes, (n,).

    Raises:
        VerificationError: It would make other moves.
        CloneError: A point cannot be written.
    """
    visits = reading.visits
    edits = _edits(reading, lines_in_files(reading, cell), put, splitter)
    sources = [
        Source(source.name, apply(source.data, own))
        for source, own in zip(reading.sources, edits, strict=True)
    ]
    again = read_program({s.name: s.data for s in sources}, cell)
    found = _find_inserted(again.visits, sources, edits)
    new = points_on_ways(again.visits, sources, found)
    if proves:
        _prove(visits, again.visits, found, new, put.count)
    cloned = tuple(
        tuple(compose(one, own))
        for one, own in zip(reading.cloned or [()] * len(edits), edits, strict=True)
    )
    given = reading.given or reading.sources
    with_points = replace(again, cloned=cloned, given=given, missed=reading.missed)
    own = np.flatnonzero(~new)
    aims = _aims(visits, again.visits.motion.via, own, put)
    told = replace(with_points, diagnostics=reading.diagnostics, aims=aims)
    return told, own


def _edits(
    reading: ParsedProgram, lines: Ints, put: PathPoints, splitter: Splitter
) -> list[list[Edit]]:
    """Write the points, and the stops before targets, file by file in their order."""
    visits, found = reading.visits, [list[Edit]() for _ in reading.sources]
    on_lines = _points_of_lines(visits, put)
    for visit in sorted({*put.points, *put.approaches}):
        config = visits.target.configs[visits.target.config[visit]]
        file, line = int(visits.place.file[visit]), int(lines[visit])
        stops = visit in put.stops
        if visit in put.approaches:
            numbers = put.approaches[visit]
            found[file].append(splitter.approach(file, line, numbers, config))
        if visit not in put.points:
            continue
        if visits.motion.via[visit]:
            turns = {v: put.turns(v) for v in (visit, visit + 1)}
            arc = CutArc.of(visits, put.points, visit, put.chords, turns, put.joints)
            pieces, via = arc.pieces()
            found[file] += splitter.arc(file, line, pieces, via, config, stops)
        elif visit in on_lines:
            numbers = on_lines[visit]
            found[file].append(splitter.points(file, line, numbers, config, stops))
    return [sorted(own, key=lambda edit: edit.span) for own in found]


def _points_of_lines(visits: Visits, put: PathPoints) -> dict[int, Floats]:
    """Write the numbers of the points on lines, turned as they are to be, (k, w)."""
    lines = [v for v in put.points if not is_arc(visits, v)]
    if not lines:
        return {}
    shares = [np.array(put.points[v]) for v in lines]
    count = [len(share) for share in shares]
    on, share = np.repeat(lines, count), np.concatenate(shares)
    numbers = between(visits, on, share)
    if put.joints is not None:
        numbers = visits.dialect.count_flags(numbers, put.joints(on, share))
    tool = visits.dialect.poses(numbers)[:, :3, :3]
    turn = np.concatenate([put.turns(v) for v in lines])
    axis = np.einsum("kij,kj->ki", tool, turn)
    numbers = visits.dialect.rotate(numbers, rotation_from_vector(axis))
    parts = np.split(numbers, np.cumsum(count)[:-1])
    return dict(zip(lines, parts, strict=True))


def lines_in_files(reading: ParsedProgram, cell: Cell) -> Ints:
    """Return the lines of visits in the files as they are, clones included, (n,)."""
    if not reading.cloned:
        return reading.visits.place.line
    return read_program(
        {s.name: s.data for s in reading.sources}, cell
    ).visits.place.line


def between(visits: Visits, visit: Ints | int, share: Floats) -> Floats:
    """Write points on the lines that lead to visits.

    The tool turns about one axis that stands still.

    Args:
        visits: The program.
        visit: Where the line ends, or that of each point, (k,).
        share: Of the way, (k,).

    Returns:
        Their numbers, (k, w).
    """
    end = np.broadcast_to(visit, share.shape)
    old, new = (visits.target.values[at] for at in (visits.graph.before[end], end))
    turn, other = (visits.dialect.poses(values)[:, :3, :3] for values in (old, new))
    axis = rotation_vector(other @ np.swapaxes(turn, 1, 2))
    out = np.array(old)
    out[:, :3] += share[:, None] * (new - old)[:, :3]
    return visits.dialect.rotate(out, rotation_from_vector(share[:, None] * axis))


def _aims(visits: Visits, via: Bools, own: Ints, put: PathPoints) -> Floats:
    """Tell from which sides m visits are meant to be reached, (m, 6), NaN: any."""
    out = np.full((len(via), 6), np.nan)
    for visit, sides in put.meant.items():
        rows = np.arange(own[visit - 1] + 1 if visit else 0, own[visit] + 1)
        ends = rows[~via[rows]][: len(put.points[visit])]
        out[ends] = sides.side[: len(ends)]
        piece = np.cumsum(~via[rows])[via[rows]]
        out[rows[via[rows]]] = sides.between[piece]
    for visit, taken in put.stops.items():
        arc = bool(visits.motion.via[visit])
        first = own[visit - 1] + 1 if arc else own[visit] - len(put.points[visit])
        out[first] = taken.side
    return out


def numbers_at(visits: Visits, visit: int, pose: Floats, q: Floats) -> Floats:
    """Write a TCP pose in the arm's base as numbers of a visit, (w,).

    Args:
        visits: The program.
        visit: In whose frames.
        pose: The pose, (4, 4) [m].
        q: Joint angles there, (6,) [rad].
    """
    numbers = np.array(visits.target.values[[visit]])
    pose = base_in_uframe(visits, np.array([visit]))[0] @ pose
    turn = pose[:3, :3] @ visits.dialect.poses(numbers)[0, :3, :3].T
    numbers[0, :3] = pose[:3, 3] / MM
    numbers = visits.dialect.rotate(numbers, turn[None])
    return np.asarray(visits.dialect.count_flags(numbers, q[None])[0])


# The proof that a program with points makes the same moves otherwise.


def _find_inserted(
    visits: Visits, sources: Sequence[Source], edits: Sequence[Sequence[Edit]]
) -> Bools:
    """Tell which visits of a program with points are those points, (m,)."""
    found = np.zeros(len(visits), dtype=bool)
    for file, (source, own) in enumerate(zip(sources, edits, strict=True)):
        size = np.array([len(edit.new) for edit in own], dtype=np.int64)
        old = np.array([e.span.end - e.span.start for e in own], dtype=np.int64)
        begin = np.array([e.span.start for e in own], dtype=np.int64)
        begin += np.cumsum(size - old) - (size - old)
        rows = np.flatnonzero(visits.place.file == file) if own else begin
        lines = source.line_starts[visits.place.line[rows] - 1]
        at = np.searchsorted(begin, lines, side="right") - 1
        found[rows] = (at >= 0) & (lines < (begin + size)[at])
    return found


def points_on_ways(visits: Visits, sources: Sequence[Source], inserted: Bools) -> Bools:
    """Tell which visits the source does not make, (m,).

    Where an arc is cut, the point on its way has become the end of a piece, and what
    stands in its place in the move is new.

    Args:
        visits: The program with points.
        sources: Its files.
        inserted: Visits on lines that are points, (m,).
    """
    new = np.array(inserted)
    language = language_of(sources[0].name)
    for row in np.flatnonzero(inserted & ~visits.motion.via).tolist():
        source = sources[visits.place.file[row]]
        text = source.line_text(int(visits.place.line[row])).encode("latin-1")
        if language.ends_at_via(text):
            later = np.flatnonzero(visits.motion.via[row:] & ~inserted[row:])
            if len(later):
                new[row], new[row + later[0]] = False, True
    return new


def _prove(
    before: Visits, after: Visits, inserted: Bools, new: Bools, count: int
) -> None:
    """Hold a program with points to be the same but for them.

    Args:
        before: The program.
        after: .. with points.
        inserted: Visits on lines that are points, (m,).
        new: Visits that the source does not make, (m,).
        count: How many points were put in.

    Raises:
        VerificationError: It is not.
    """
    found = inserted & ~after.motion.via
    problem = f"{int(found.sum())} of {count} points are found again"
    if int(found.sum()) == count and len(after) - int(new.sum()) == len(before):
        nothing = np.zeros(0, dtype=np.int64)
        ends = inserted & ~new  # of pieces, which were points on ways
        motion = np.where(ends, Motion.CIRCULAR, after.motion.kind)
        old = after.with_columns(via=after.motion.via | ends, kind=motion)
        same = renumber_literals(before, without(old, new))
        cut = np.flatnonzero(ends[~new])  # there the tool may be turned a little
        if are_near(before, same, cut):
            values = np.array(same.target.values)
            values[cut] = before.target.values[cut]
            aux = np.array(same.target.aux)  # what is not written there stays as it is
            aux[cut] = np.where(np.isnan(aux[cut]), before.target.aux[cut], aux[cut])
            passing = _passing(before, same, cut)
            same = same.with_columns(values=values, aux=aux, **passing)
        problem = equivalent(before, same, nothing, before.target.values)
    if problem:
        raise VerificationError(
            f"{before.files[0]}: points on the ways would change what the program "
            f"does ({problem}); nothing is written"
        )


def _passing(before: Visits, after: Visits, cut: Ints) -> dict[str, Any]:
    """Return how points are passed, those on the ways of arcs as in the source.

    As the end of a piece such a point says how it is blended, and the tool turns as on
    lines where the piece is a chord: arcs are cut where that makes no difference.
    """
    found = {name: np.array(column) for name, column in vars(after.zone).items()}
    for name, column in found.items():
        column[cut] = getattr(before.zone, name)[cut]
    law = np.array(after.motion.orientation_law)
    law[cut] = before.motion.orientation_law[cut]
    return {**found, "orientation_law": law}


def are_near(before: Visits, after: Visits, rows: Ints) -> bool:
    """Tell whether some visits are the same but for how the tool is turned there."""
    poses = [v.dialect.poses(v.target.values[rows])[:, :3] for v in (before, after)]
    off = np.swapaxes(poses[0][:, :, :3], 1, 2) @ poses[1][:, :, :3]
    far = lengths(poses[1][:, :, 3] - poses[0][:, :, 3])
    turned = lengths(rotation_vector(off))
    return bool((far < ROUNDED).all() and (turned < TURNED).all())


def without(visits: Visits, rows: Bools) -> Visits:
    """Leave out visits that are reached from one place each, and their numbers.

    Args:
        visits: A program, m visits.
        rows: Which of them, (m,).
    """
    own, number = np.flatnonzero(~rows), np.cumsum(~rows) - 1
    count = np.diff(visits.graph.pred_start)
    pred = visits.graph.pred[np.repeat(~rows, count)]
    while len(at := np.flatnonzero((pred >= 0) & rows[pred])):
        pred[at] = visits.graph.pred[visits.graph.pred_start[pred[at]]]
    gone = np.zeros(len(visits.literals) + 1, dtype=bool)
    gone[visits.target.literal[rows]] = True
    gone[-1] = False  # that is no literal
    start = np.append(0, np.cumsum(count[own]))
    graph = Graph(start, np.where(pred >= 0, number[pred], pred))
    left, fewer = visits.take(own, graph), np.cumsum(gone)
    columns = {"literal": left.target.literal, "follows": left.target.follows}
    literals = visits.literals.take(np.flatnonzero(~gone[:-1]))
    return replace(
        left.with_columns(
            **{k: own - fewer[own] * (own >= 0) for k, own in columns.items()}
        ),
        literals=literals,
    )


def renumber_literals(before: Visits, after: Visits) -> Visits:
    """Number the literals of a program as those of another one, where that is possible.

    They are numbered as they stand in the files, and the point on the way of an arc
    that is cut stands in front of the arc's end, not behind it.
    """
    has = (before.target.literal >= 0) & (after.target.literal >= 0)
    number = np.arange(len(after.literals))
    number[after.target.literal[has]] = before.target.literal[has]
    if not np.array_equal(np.sort(number), np.arange(len(number))):
        return after
    number = np.append(number, -1)  # that is no literal
    own = after.with_columns(
        literal=number[after.target.literal], follows=number[after.target.follows]
    )
    literals = after.literals.take(np.argsort(number[:-1]))
    return replace(own, literals=literals)
