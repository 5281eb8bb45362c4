"""The verdict of a program against a tolerance, for a terminal and as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from postproc.compensation.findings.headline import (
    TargetException,
    headline,
    list_exceptions,
)
from postproc.compensation.findings.tolerance import ToleranceCheck, Verdict
from postproc.compensation.outcome import Outcome
from postproc.robot.pose import MM

WORST = 10  # visits that are listed
MOST = 1000  # .. in JSON
WORDS = {Verdict.PASS: "pass", Verdict.FAIL: "fail", Verdict.UNKNOWN: "not known"}
ALL_WORDS = {**WORDS, Verdict.NONE: "no target"}
NOTE = "errors of the part and of its frame are not in these figures"


def tell_tolerance(outcome: Outcome, check: ToleranceCheck) -> str:
    """Write the verdict, and the visits that do not pass, the worst first."""
    lines = [describe_verdict(check), *_list_worst(outcome, check), NOTE]
    return "\n".join(lines)


def describe_verdict(check: ToleranceCheck) -> str:
    """Write how many visits pass."""
    counts = ", ".join(f"{check.count(one)} {word}" for one, word in WORDS.items())
    sizes = " to ".join(f"{size:g}" for size in check.range_mm)
    return f"tolerance {sizes} mm: {counts}; {check.outside:.1f} expected outside"


def _list_worst(outcome: Outcome, check: ToleranceCheck) -> Iterator[str]:
    errors = outcome.errors
    if errors is None:
        return
    for one in list_exceptions(errors, WORST):
        word = WORDS[Verdict(check.verdict[one.row])]
        yield f"  {one.place}: {word}, {one.size()}{one.why()}"
    if (more := int(errors.exceptional().sum()) - WORST) > 0:
        yield f"  and {more} more"


def tolerance_json(check: ToleranceCheck) -> dict[str, Any]:
    """Describe the verdict, one entry a visit in every list; lengths in mm."""
    errors, sizes = check.errors, check.range_mm
    return {
        "tolerance_mm": sizes[-1] if sizes else None,
        "tolerances_mm": np.round(check.tolerance / MM, 9).tolist(),
        "passes": check.passes,
        **{word.replace(" ", "_"): check.count(one) for one, word in WORDS.items()},
        "expected_outside": check.outside,
        "verdict": [ALL_WORDS[Verdict(k)] for k in check.verdict.tolist()],
        "before_mm": np.round(errors.before / MM, 5).tolist(),
        "expected_mm": np.round(errors.after / MM, 5).tolist(),
        "bound_5_mm": np.round(check.low / MM, 5).tolist(),
        "bound_95_mm": np.round(errors.high / MM, 5).tolist(),
    }


def describe_errors(outcome: Outcome) -> dict[str, Any]:
    """Describe the expected true errors and the exceptions; lengths in mm.

    The key is left out where they are not known.
    """
    errors = outcome.errors
    if errors is None:
        return {}
    found = headline(errors)
    exceptions = [describe_exception(one) for one in list_exceptions(errors, MOST)]
    figures = {
        "before_mm": found.before_mm,
        "after_mm": found.after_mm,
        "below_95_before_mm": found.below_before_mm,
        "below_95_mm": found.below_mm,
        "largest_mm": found.largest_mm,
        "largest_bound_95_mm": found.bound_mm,
    }
    return {
        "expected": {
            "verdict": found.verdict(outcome.tolerance),
            "targets": found.targets,
            "corrected": found.corrected,
            "unknown": found.unknown,
            **{name: round(size, 5) for name, size in figures.items()},
            "exceptions_count": int(errors.exceptional().sum()),
            "exceptions": exceptions,
        }
    }


def describe_exception(one: TargetException) -> dict[str, Any]:
    """Describe a visit that somebody has to look at."""
    return {
        "visit": one.row + 1,
        "place": one.place,
        "corrected": one.corrected,
        "code": one.reason.name,
        "reason": one.reason.text,
        "expected_mm": round(one.expected_mm, 5),
        "bound_95_mm": round(one.bound_mm, 5),
    }
