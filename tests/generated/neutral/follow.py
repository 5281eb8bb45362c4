"""What a program ran, among the visits that the tool predicted."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from postproc.language.visits import ELSEWHERE, START, Meaning, Visits
from tests.generated.neutral.languages import Language
from tests.generated.neutral.run import Step
from tests.generated.neutral.text import Printed
from tests.generated.neutral.tree import Place, Program, Shifted

CLOSE = 1e-6  # of poses [m], whose numbers are both read from the text
HEAVY = 1e-6  # [kg], [m]
# Reasons of visits that may go anywhere at any time.
ANYTHING = re.compile(r"(interrupt|TRAP|handler) .*may (move|be called)|at any time")


def follow(
    visits: Visits, steps: Sequence[Step], where: Printed, language: Language
) -> list[set[int]]:
    """Return the visits that each step of a run may be, along predecessors.

    Raises:
        AssertionError: A step is no visit, or none that may come then.
    """
    by_line: dict[tuple[str, int], list[int]] = {}
    files, lines = visits.place.file.tolist(), visits.place.line.tolist()
    for visit, (file, line) in enumerate(zip(files, lines, strict=True)):
        by_line.setdefault((visits.files[file], line), []).append(visit)
    before, found = {START}, []
    for step in steps:
        if step.beside:
            found.append(set())
            before = set()
            continue
        place = where.moves[step.move.mark]
        here = by_line.get(place, [])
        alike = [v for v in here if not misfit(visits, v, step, language)]
        now = {
            v for v in alike
            if {ELSEWHERE, *before} & {*visits.graph.predecessors(v).tolist()}
        }  # fmt: skip
        if not now:
            why = {
                misfit(visits, v, step, language) or "its predecessors" for v in here
            }
            text = " / ".join(sorted(why)) or "no visit"
            raise AssertionError(
                f"{place[0]}, line {place[1]} is run otherwise: {text}"
            )
        found.append(now)
        before = now
    return found


def misfit(visits: Visits, visit: int, step: Step, language: Language) -> str:
    """Say in what a visit differs from a step of a run, "" in nothing."""
    if bool(visits.motion.via[visit]) != step.via:
        return "another point of an arc"
    if ANYTHING.search(visits.reasons[visits.reason[visit]].text):
        return ""
    tool, uframe = int(visits.frame.tool[visit]), int(visits.frame.uframe[visit])
    if tool >= 0 and not same(visits.frame.poses[tool], step.tool):
        return "the tool"
    if visits.target.meaning[visit] == Meaning.UNKNOWN:
        return ""
    if not step.in_joints and uframe >= 0:
        if not same(visits.frame.poses[uframe], step.base):
            return "the base"
    known = visits.reason[visit] == 0 and tool >= 0
    if known and not same_load(visits, visit, step):
        return "the load"
    return "" if same_goal(visits, visit, step, language) else "the target"


def same_load(visits: Visits, visit: int, step: Step) -> bool:
    """Compare what the arm carries: NaN is what the cell says."""
    stated = visits.motion.loads[visits.motion.load[visit]]
    mass, centre = step.load
    if np.isnan(stated[0]) or np.isnan(mass):
        return bool(np.isnan(stated[0]) and np.isnan(mass))
    wanted = np.array([mass, *(x / 1000.0 for x in centre)])
    return np.allclose(stated, wanted, rtol=0.0, atol=HEAVY)


def same_goal(visits: Visits, visit: int, step: Step, language: Language) -> bool:
    """Compare the kind of a target, and its numbers."""
    numbers, meaning = (
        visits.target.values[visit].tolist(),
        Meaning(visits.target.meaning[visit]),
    )
    if meaning == Meaning.RELATIVE_UFRAME:
        by = step.move.to.by if isinstance(step.move.to, Shifted) else ()
        return step.move.kind == "step" and np.allclose(numbers[:3], by)
    if step.in_joints != (meaning == Meaning.JOINTS):
        return False
    return same(said(numbers, step.in_joints, language), step.target.value)


def said(numbers: Sequence[float], in_joints: bool, language: Language) -> np.ndarray:
    """Return what the numbers of a visit say."""
    made = Program(places=[Place(np.zeros(6), in_joints, 1, 1)])
    return language.poses({0: list(numbers)}, made)[0]


def same(a: np.ndarray, b: np.ndarray) -> bool:
    """Compare poses or joint angles."""
    return np.allclose(a, b, rtol=0.0, atol=CLOSE)
