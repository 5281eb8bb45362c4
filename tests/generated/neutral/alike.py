"""One drawn program in all languages: the same visits, states and corrections."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from postproc.compensation.outcome import Outcome, Status
from postproc.language.visits import ELSEWHERE, START, Meaning
from postproc.model.model import Model
from postproc.robot.cell import Cell
from tests.generated.found import Found
from tests.generated.neutral.draw import Draw
from tests.generated.neutral.follow import follow, said, same
from tests.generated.neutral.landing import Case, compensated, given_back
from tests.generated.neutral.languages import LANGUAGES
from tests.generated.neutral.traits import ALL

CLOSE_MM = 0.005  # of corrections, which are rounded differently
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

    def code(self, row: int) -> str:
        """Return the code of what keeps a visit from being corrected."""
        decisions = self.done.decisions
        if decisions.status[row] == Status.CORRECTED:
            return "corrected"
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
        done = compensated(case.text.files, cell, model, seed % 4 < 2)
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
    """Yield in what two languages differ, with the line in the first one."""
    for key in sorted({*a.rows} ^ {*b.rows}):
        where = a if key in a.rows else b
        yield where.case.text.moves[key[0]][1], f"a visit is missing: {key}"
    for key in sorted({*a.rows} & {*b.rows}):
        line = a.case.text.moves[key[0]][1]
        one, two = a.rows[key], b.rows[key]
        states = a.state(one), b.state(two)
        for what in states[0]:
            if states[0][what] != states[1][what]:
                yield line, f"{what} {states[0][what]}, {states[1][what]}"
        frames = a.poses(one), b.poses(two)
        for what in frames[0]:
            if text := unlike(frames[0][what], frames[1][what]):
                yield line, f"{what} {text}"
        if states[0]["code"] == states[1]["code"] == "corrected":
            gap = a.done.decisions.correction[one] - b.done.decisions.correction[two]
            mm = float(np.linalg.norm(gap)) * 1000
            if mm > CLOSE_MM:
                yield line, f"correction {mm:.3f} mm"


def unlike(a: np.ndarray | None, b: np.ndarray | None) -> str:
    """Say in what two poses differ, "" in nothing."""
    if a is None or b is None:
        return "" if a is b else "is known to one alone"
    return "" if same(a, b) else "is another one"
