"""One drawn program in all languages: the same visits, states and corrections."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from postproc.compensation.outcome import Outcome, Status
from postproc.language.visits import ELSEWHERE, START, Meaning
from postproc.model.model import Model
from postproc.robot.cell import Cell
from tests.generated.found import Found, is_averaged
from tests.generated.neutral.draw import Draw
from tests.generated.neutral.follow import follow, said
from tests.generated.neutral.landing import Case, compensated, given_back
from tests.generated.neutral.languages import LANGUAGES
from tests.generated.neutral.traits import ALL
from tests.generated.neutral.tree import (
    Call,
    Element,
    Expr,
    Lift,
    Move,
    Named,
    Point,
    Program,
    SetElement,
    SetPart,
    SetPoint,
    Shifted,
    statements,
)

CLOSE_MM = 0.005  # of corrections, which are rounded differently
ROUNDED = 1e-5  # of poses [m], whose numbers are rounded differently
CORRECTED = "corrected"
TOGETHER = {CORRECTED, "arrivals-differ", "arc-distorted", "dependant-worse"}
"""Codes that what other arrivals need decides."""
PINNED = "numbers-used-elsewhere"
UNFLAGGED = ("configuration-unknown", "unknown-position-before")
"""Codes of KRL behind a place that is not known: its lines have no S and T."""
Key = tuple[int, bool, int]  # mark of a move, whether it is a VIA point, which arrival
PLACES = {START: (START, False, 0), ELSEWHERE: (ELSEWHERE, False, 0)}


@dataclass(frozen=True)
class Arrivals:
    """The visits of one program in a language, each with a name that all languages use.

    Attributes:
        rows: Visits by key.
        keys: Keys by visit.
    """

    case: Case
    done: Outcome
    rows: dict[Key, int]
    keys: list[Key]

    @classmethod
    def of(cls, case: Case, done: Outcome) -> Arrivals:
        """Name the visits of a compensated program."""
        marks = {place: mark for mark, place in case.text.moves.items()}
        visits, counts, keys = done.visits, Counter[tuple[int, bool]](), []
        for row in range(len(visits)):
            place = visits.file_name(row), int(visits.place.line[row])
            own = marks[place], bool(visits.motion.via[row])
            keys.append((*own, counts[own]))
            counts[own] += 1
        return cls(case, done, {key: row for row, key in enumerate(keys)}, keys)

    def state(self, row: int) -> dict[str, object]:
        """Return what is said of a visit in words that all languages share."""
        visits = self.done.visits
        before = visits.graph.predecessors(row).tolist()
        return {
            "kind": int(visits.motion.kind[row]),
            "meaning": Meaning(visits.target.meaning[row]).name,
            "fly": bool(visits.motion.fly[row]),
            "origin": sorted(PLACES.get(k) or self.keys[k] for k in before),
            "code": self.code(row),
        }

    def groups(self) -> list[set[Key]]:
        """Group arrivals at one point, and those on one arc with where it begins."""
        visits, found = self.done.visits, defaultdict[int, set[Key]](set)
        arcs = []
        for row, key in enumerate(self.keys):
            found[int(visits.target.literal[row])].add(key)
            if visits.motion.via[row]:
                starts = (k for k in visits.graph.predecessors(row).tolist() if k >= 0)
                arcs.append({self.keys[k] for k in (*starts, row, row + 1)})
        found.pop(-1, None)
        return [*found.values(), *arcs]

    def code(self, row: int) -> str:
        """Return the code of what keeps a visit from being corrected."""
        decisions = self.done.decisions
        if decisions.status[row] == Status.CORRECTED:
            return CORRECTED
        return decisions.reasons[decisions.why[row]].code.value

    def poses(self, row: int) -> dict[str, np.ndarray | None]:
        """Return frames and target of a visit, None where they are not known."""
        visits = self.done.visits
        frame, target = visits.frame, visits.target
        tool, uframe = int(frame.tool[row]), int(frame.uframe[row])
        meaning = target.meaning[row]
        joints = meaning == Meaning.JOINTS
        own = None
        if joints or meaning == Meaning.POSE:
            own = said(target.values[row].tolist(), joints, self.case.language)
        return {
            "tool": frame.poses[tool] if tool >= 0 else None,
            "frame": frame.poses[uframe] if uframe >= 0 and not joints else None,
            "target": own,
        }


def alike(seed: int, cell: Cell, model: Model) -> Found:
    """Write one program in all languages, compensate each, and compare.

    Raises:
        AssertionError: A program runs otherwise than its visits say.
    """
    made, found = Draw(seed, ALL).program(), Found()
    every: dict[str, Arrivals] = {}
    for name, language in LANGUAGES.items():
        case = Case(made, language.write(made, cell), language)
        done = compensated(case.text.files, cell, model, True)
        given_back(case.text.files, done)
        for run in range(2 if seed % 2 else 1):
            follow(done.visits, case.steps(case.text.files, run), case.text, language)
        every[name] = Arrivals.of(case, done)
        found.visits += len(done.visits)
        found.corrected += done.decisions.count(Status.CORRECTED)
    first, *others = every
    for name in others:
        pair = every[first], every[name]
        for line, what in differences(*pair):
            found.wrong.append((seed, line, f"{first}, {name}: {what}"))
    return found


def differences(a: Arrivals, b: Arrivals) -> Iterator[tuple[int, str]]:
    """Yield in what two languages differ, with the line in the first one.

    These may differ: whether KRL stops at a fly point, where a statement behind it
    waits for the arm; codes at fly points, whose corners are blended otherwise, and at
    points that more than moves read, or that the program sets in several ways (each
    language has rules of its own for them); numbers that variables hold and that serve
    something else (what is never gone to counts in RAPID and KRL, a data list of KRL
    outlives the run); codes of lines of KRL behind a place that is not known; what
    follows from that for other arrivals there and on arcs; corrections at fly points,
    where sides differ, and where one is for several arrivals.
    """
    unlike = codes_unlike(a, b)
    for key in sorted({*a.rows} ^ {*b.rows}):
        where = a if key in a.rows else b
        yield where.case.text.moves[key[0]][1], f"a visit is missing: {key}"
    for key in sorted({*a.rows} & {*b.rows}):
        one, two = a.rows[key], b.rows[key]
        states = a.state(one), b.state(two)
        exempt = {"fly"} if b.case.language.traits.name == "krl" else set()
        exempt |= {"code"} if key in unlike else set()
        found = [*states_differ(*states, exempt)]
        found += poses_differ(a.poses(one), b.poses(two))
        found += corrections_differ(a, b, one, two)
        for what in found:
            yield a.case.text.moves[key[0]][1], what


def codes_unlike(a: Arrivals, b: Arrivals) -> set[Key]:
    """Return arrivals whose codes languages may tell otherwise, by their rules.

    Others at one of their points, or on one of their arcs, may have other codes that
    say so.
    """
    both, krl = {*a.rows} & {*b.rows}, b.case.language.traits.name == "krl"
    moves, read = moves_of(a.case.made), read_elsewhere(a.case.made)
    kept = {name for name in a.case.made.variables if not name.startswith("w")}
    found = set[Key]()
    for key in both:
        named = names_in(moves[key[0]].via) | names_in(moves[key[0]].to)
        said = {one.code(one.rows[key]) for one in (a, b)}
        flies = any(one.done.visits.motion.fly[one.rows[key]] for one in (a, b))
        lost = krl and not said.isdisjoint(UNFLAGGED)
        if flies or lost or named & read or (named & kept and PINNED in said):
            found.add(key)
    told = {k for k in both if {one.code(one.rows[k]) for one in (a, b)} <= TOGETHER}
    before = -1
    while before != len(found):
        before = len(found)
        for group in (group for one in (a, b) for group in one.groups()):
            found |= told.intersection(group) if group & found else set()
    return found


def states_differ(
    a: dict[str, object], b: dict[str, object], exempt: set[str]
) -> Iterator[str]:
    """Yield what is said otherwise."""
    for what in a.keys() - exempt:
        if a[what] != b[what]:
            yield f"{what} {a[what]}, {b[what]}"


def poses_differ(
    a: dict[str, np.ndarray | None], b: dict[str, np.ndarray | None]
) -> Iterator[str]:
    """Yield what stands elsewhere, or is known to one alone."""
    for what, pose in a.items():
        other = b[what]
        if (pose is None) != (other is None):
            yield f"{what} is known to one alone"
        elif pose is not None and other is not None:
            if pose.shape != other.shape or not np.allclose(
                pose, other, rtol=0.0, atol=ROUNDED
            ):
                yield f"{what} is another one"


def corrections_differ(a: Arrivals, b: Arrivals, one: int, two: int) -> Iterator[str]:
    """Yield how far corrections of one arrival are apart."""
    pairs = (a, one), (b, two)
    if any(own.code(row) != CORRECTED for own, row in pairs):
        return
    if any(own.done.visits.motion.fly[row] for own, row in pairs):
        return
    if any(is_averaged(own.done.decisions, [row]) for own, row in pairs):
        return
    first, second = a.done.decisions, b.done.decisions
    if not np.allclose(first.side[one], second.side[two], atol=0.01):
        return
    gap = first.correction[one] - second.correction[two]
    mm = float(np.linalg.norm(gap)) * 1000
    if mm > CLOSE_MM:
        yield f"correction {mm:.3f} mm"


def moves_of(made: Program) -> dict[int, Move]:
    """Return the moves of a program by their marks."""
    every = (one for r in made.routines for one in statements(r.body))
    return {one.mark: one for one in every if isinstance(one, Move)}


def names_in(point: Point | Expr | None) -> set[str]:
    """Return the names of points in what names a place."""
    match point:
        case Named(name) | Element(name):
            return {name}
        case Shifted(inner):
            return names_in(inner)
    return set()


def read_elsewhere(made: Program) -> set[str]:
    """Return the names of points that more than moves read, or that are set twice."""
    found, once = {*made.rows}, set[str]()
    for one in (one for r in made.routines for one in statements(r.body)):
        match one:
            case Move(to=Shifted() as to):
                found |= names_in(to)
            case SetPoint(name, value):
                found |= names_in(value) | ({name} & once)
                once.add(name)
            case SetElement(_, _, value):
                found |= names_in(value)
            case SetPart(point, _, of):
                found |= names_in(point) | names_in(of)
            case Lift(name):
                found.add(name)
            case Call(_, arguments):
                for argument in arguments:
                    found |= names_in(argument)
    given = {n for r in made.routines for n, kind in r.parameters if kind == "point"}
    return found | given | {own.point for own in made.functions}
