"""The expected true error of every target, against a tolerance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from postproc.arrays import Floats, Signs
from postproc.compensation.solver.expected_error import ExpectedErrors
from postproc.exceptions import PostprocError
from postproc.language.visits import Visits
from postproc.robot.cell import Cell
from postproc.robot.pose import MM


@dataclass(frozen=True)
class JobTolerance:
    """The largest true error that the targets of a job may have.

    Attributes:
        default_mm: Of targets that no pattern names.
        patterns: Tolerances [mm] by patterns of target names and of program files, such
            as ``p_drill*`` and ``weld*.pdl``; the last one that fits counts.
    """

    default_mm: float
    patterns: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse what is no length.

        Raises:
            PostprocError: A tolerance is no positive number.
        """
        for name, size in {"--tolerance": self.default_mm, **self.patterns}.items():
            if not 0.0 < size < np.inf:
                raise PostprocError(f"{name} {size:g}: give a length in mm above 0")

    @classmethod
    def of_cell(cls, cell: Cell, given_mm: float | None = None) -> JobTolerance | None:
        """Return the tolerance of [job], None without one.

        Args:
            cell: The cell.
            given_mm: The tolerance of all targets for this run, instead.
        """
        if given_mm is not None:
            return cls(given_mm)
        job = cell.file.job
        if job.tolerance_mm is None:
            return None
        return cls(job.tolerance_mm, job.tolerances_mm)

    def of_visits(self, visits: Visits) -> Floats:
        """Return the tolerance of every visit, (n,) [m]."""
        found = np.full(len(visits), self.default_mm * MM)
        for pattern, size in self.patterns.items():
            for texts, index in (
                (visits.target.names, visits.target.name),
                (visits.files, visits.place.file),
            ):
                fits = [fnmatchcase(text.lower(), pattern.lower()) for text in texts]
                found[np.array(fits, dtype=bool)[index]] = size * MM
        return found


class Verdict(IntEnum):
    """What the bounds of a target's error say of a tolerance."""

    PASS = 0  # the upper bound is within it
    FAIL = 1  # the lower bound is beyond it
    UNKNOWN = 2  # it lies between them, or the error is not known
    NONE = 3  # the move holds no target of its own, such as $HOME


@dataclass(frozen=True, eq=False)
class ToleranceCheck:
    """Expected true errors of n visits against tolerances; lengths in metres.

    Attributes:
        errors: The expected errors.
        tolerance: What each is held against, (n,).
        verdict: `Verdict` of every visit, (n,).
        low: What 95 % of the lengths of its error are beyond, (n,), NaN where unknown.
        risk: Probability that it is beyond the tolerance, (n,), likewise.
    """

    errors: ExpectedErrors
    tolerance: Floats
    verdict: Signs
    low: Floats
    risk: Floats

    @property
    def passes(self) -> bool:
        """Whether every visit to a target passes."""
        return not (self.count(Verdict.FAIL) or self.count(Verdict.UNKNOWN))

    def count(self, verdict: Verdict) -> int:
        """Count the visits of one verdict."""
        return int((self.verdict == verdict).sum())

    def to_record(self) -> dict[str, Any]:
        """Return what a record says of it."""
        words = {v.name.lower(): self.count(v) for v in Verdict if v != Verdict.NONE}
        return {"tolerance_mm": self.range_mm, **words}

    @property
    def range_mm(self) -> list[float]:
        """Return the least and the largest tolerance, once where they are the same."""
        own = np.round(self.tolerance / MM, 9)
        return sorted({float(own.min()), float(own.max())}) if len(own) else []

    @property
    def outside(self) -> float:
        """How many visits of known error are expected beyond the tolerance.

        The sum of their probabilities: it holds however their errors depend on each
        other.
        """
        return float(np.nansum(self.risk))


def check_tolerance(errors: ExpectedErrors, tolerance: Floats) -> ToleranceCheck:
    """Judge every visit by what it keeps of its error.

    Args:
        errors: The expected errors of n visits.
        tolerance: Largest length of each true error, (n,) [m].
    """
    known, law = errors.known, errors.law
    low = np.where(known, law.least, np.nan)
    risk = np.where(known, law.beyond(tolerance), np.nan)
    # Outside of what was surveyed nothing says how wide the bounds are.
    verdict = np.full(len(known), Verdict.UNKNOWN, dtype=np.int8)
    verdict[(errors.high <= tolerance) & ~errors.outside] = Verdict.PASS
    verdict[low > tolerance] = Verdict.FAIL
    verdict[~errors.judged] = Verdict.NONE
    return ToleranceCheck(errors, tolerance, verdict, low, risk)
