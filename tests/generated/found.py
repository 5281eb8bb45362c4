"""What came of generated programs, and the figures that are made of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from postproc.compensation.outcome import Decisions
from postproc.diagnostics import Code

KNOWN = "compensated arrivals, sides known"
UNSURE = "compensated arrivals, a side listed as not sure"
CLONED = "of these, at clones"
FIRST = "of these, first moves of programs"
ROUNDED = "compensated fly points, rounded on the way"
LOADED = "compensated arrivals with a load that the program states"
AVERAGED = "arrivals at points with one correction for several"
ALONG = "targets that move along with one (NEAR, FOR, POS_SHIFT)"
PAIRS = (KNOWN, CLONED, UNSURE, FIRST, ROUNDED, LOADED, AVERAGED, ALONG)
ONE_FOR_ALL = (Code.ARRIVALS_AVERAGED, Code.ARRIVALS_FAR_APART)
ALL = "all compensated arrivals"
DONE = "compensated"
MOST = 12  # reasons that are listed


@dataclass
class Found:
    """What came of one program, or of several.

    Attributes:
        error_mm: True errors before and after, by kind of arrival.
        z: True errors after where a side is not sure, in standard errors that the
            report states for them.
        once: What came of targets that are seen at one value from one side.
        visits, corrected: How many visits there are, and how many are corrected.
        reasons: Why the others are not.
        refused: Programs that are refused, by what is said.
        wrong: What must not be: seed, line and what it is.
    """

    error_mm: dict[str, list[tuple[float, float]]] = field(
        default_factory=lambda: {kind: [] for kind in PAIRS}
    )
    z: list[float] = field(default_factory=list)
    once: Counter[str] = field(default_factory=Counter)
    visits: int = 0
    corrected: int = 0
    reasons: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    wrong: list[tuple[int, int, str]] = field(default_factory=list)

    def add(self, other: Found) -> None:
        """Take in what came of another program."""
        for kind in PAIRS:
            self.error_mm[kind] += other.error_mm[kind]
        self.z += other.z
        self.once += other.once
        self.visits += other.visits
        self.corrected += other.corrected
        self.reasons += other.reasons
        self.refused += other.refused
        self.wrong += other.wrong

    def pairs(self, kind: str) -> np.ndarray:
        """Return errors before and after, (n, 2) [mm]; `ALL` for known and unsure."""
        kinds = (KNOWN, UNSURE) if kind == ALL else (kind,)
        found = [pair for one in kinds for pair in self.error_mm[one]]
        return np.array(found).reshape(-1, 2)


def is_averaged(decisions: Decisions, rows: list[int]) -> bool:
    """Tell whether visits have one correction for arrivals that need different ones."""
    return any(decisions.reasons[k].code in ONE_FOR_ALL for k in decisions.why[rows])


def lines(found: Found) -> Iterable[str]:
    """Say what came of it."""
    for kind in (ALL, *PAIRS):
        e = found.pairs(kind)
        if len(e):
            yield (
                f"{kind}: {len(e)}, mean {e[:, 0].mean():.3f} -> {e[:, 1].mean():.4f} "
                f"mm, 95 % {np.percentile(e[:, 1], 95):.4f}, max {e[:, 1].max():.4f}"
            )
    if found.z:
        yield f"  not sure: within 2 stated standard errors {within(found.z):.1%}"
    if found.visits:
        share = found.corrected / found.visits
        yield f"visits: {found.visits}, corrected {share:.1%}; not corrected as:"
        yield from (f"  {n:6d} {text}" for text, n in found.reasons.most_common(MOST))
    yield from (f"  refused {n}: {text}" for text, n in found.refused.most_common())
    if not found.once:
        return
    yield f"targets seen at one value from one side: {found.once.total()}"
    for text, count in found.once.most_common():
        yield f"  {count:6d} {text}"


def within(z: list[float]) -> float:
    """Return the part of errors of up to two standard errors."""
    return float((np.array(z) <= 2.0).mean())
