"""Targets that are seen at one value, from one side: they must be compensated."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from postproc.compensation.findings.findings import SURE
from postproc.compensation.outcome import Outcome, Status
from tests.generated.found import DONE, Found
from tests.language.pdl2.executed import Executed

# Why a target may be left alone that is seen at one value from one side.
ALLOWED = tuple(
    re.compile(text)
    for text in (
        "out of reach", "the path to it", "axis . would be beyond", "singularity",
        "points of the arc", "points of an arc", "would flip the wrist",
        "beyond a joint limit",
        "steps by more than correction_step_mm", "bend the path",
        "all points of its arc are corrected or none",
        "would turn by more than joint_deg", "would move by more than",
        "would swing a joint", "on another branch",
        "other programs may read", "computes? with",
        "composes it", "is set to it", "is given it", "may move to it",
        "a target computed from it", "a target is computed from",
        "a move whose target is uncertain",
        "another arm goes to it", "a number of the target belongs to another",
    )
)  # fmt: skip
LEFT = "is left alone, though it is seen at one value from one side"
SECOND = "another arrival at this point"  # it says that another one has a reason
DIFFER = "its arrivals differ"
BLIND = ", and the plan does not know a side of it"
Flanks = tuple[float, ...]


def count_once(
    found: Found,
    seed: int,
    asked: Sequence[Executed],
    ran: Sequence[Executed],
    done: Outcome,
    rows: Sequence[set[int]],
    sides: Mapping[int, Flanks],
) -> None:
    """Count what came of targets that are seen at one value, from one side.

    A target is the line in which its numbers stand. Every move that goes to it must go
    to nothing else, with the same frames, and with every gear on the same flank; so
    none may lie beyond what the arm could run. In programs without inputs, what is
    left alone must have a reason that is allowed, or a side that the plan does not
    know: before the first move, after a rounded corner, ..
    """
    d = done.decisions
    for line, steps in seen_once(asked, sides).items():
        mine = sorted(set().union(*(rows[k] for k in steps)))
        moved = all(ran[k].values != asked[k].values for k in steps)
        safe = bool(mine) and bool((d.status[mine] == Status.CORRECTED).all())
        assert moved or not safe, f"seed {seed}, line {line}"
        why = {
            d.reasons[d.why[row]].text
            for row in mine
            if d.status[row] != Status.CORRECTED
        }
        text = DONE if safe else " / ".join(sorted(why)) or "no visit"
        text = text if moved == safe else f"{DONE} for some of its moves: {text}"
        lost = bool((np.abs(d.side[mine]) < SURE).any())
        found.once[text + BLIND * lost] += 1
        # The path passes a fly point elsewhere where it goes on elsewhere.
        rounded = len(steps) > 1 and bool(done.visits.motion.fly[mine].any())
        why -= {one for one in why if rounded and one.startswith(DIFFER)}
        if seed % 2 == 0 and not moved and why and not (lost or allowed(why)):
            found.wrong.append((seed, line, f"{LEFT}: {text}"))


def allowed(why: set[str]) -> bool:
    """Tell whether a target may be left alone for some reasons."""
    first = {one for one in why if not one.startswith(SECOND)}
    return bool(first) and all(any(a.search(one) for a in ALLOWED) for one in first)


def seen_once(
    asked: Sequence[Executed], sides: Mapping[int, Flanks]
) -> dict[int, list[int]]:
    """Return the moves to each such target, by the line of its numbers."""
    origins: dict[tuple[int, str], set[int]] = defaultdict(set)
    steps: dict[int, list[int]] = defaultdict(list)
    for k, step in enumerate(asked):
        origins[step.line, step.how].add(step.origin)
        if step.origin and step.how in ("TO", "VIA"):
            steps[step.origin].append(k)
    found = {}
    for line, mine in steps.items():
        single = all(len(origins[asked[k].line, asked[k].how]) == 1 for k in mine)
        frames = {(asked[k].tool, asked[k].uframe) for k in mine}
        flanks = {sides.get(k) for k in mine}
        whole = len(flanks) == 1 and None not in flanks
        if single and whole and len(frames) == 1 and resting(sides[mine[0]]):
            found[line] = mine
    return found


def resting(flanks: Flanks) -> bool:
    """Tell whether every gear lies on a flank, not between."""
    return bool((np.abs(flanks) > 0.99).all())
