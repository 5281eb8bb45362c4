"""The verdict of a program against a tolerance, for a terminal and as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from postproc.compensation.outcome import Outcome, Status
from postproc.compensation.tolerance import ToleranceCheck, Verdict
from postproc.robot.pose import MM

WORST = 10  # visits that are listed
WORDS = {Verdict.PASS: "pass", Verdict.FAIL: "fail", Verdict.UNKNOWN: "not known"}
ALL_WORDS = {**WORDS, Verdict.NONE: "no target"}


def tell_tolerance(outcome: Outcome, check: ToleranceCheck) -> str:
    """Write the verdict, and the visits that do not pass, the worst first."""
    counts = ", ".join(f"{check.count(one)} {word}" for one, word in WORDS.items())
    lines = [
        f"tolerance {check.tolerance / MM:g} mm: {counts}; "
        f"{check.outside:.1f} expected outside",
        _headline(outcome, check),
        *_list_worst(outcome, check),
        "errors of the part and of its frame are not in these figures",
    ]
    return "\n".join(lines)


def _headline(outcome: Outcome, check: ToleranceCheck) -> str:
    """State the expected true error before and after."""
    known = ~np.isnan(check.expected)
    if not known.any():
        return "expected true error not known at any visit"
    before, after = (x[known].mean() / MM for x in (check.before, check.expected))
    bound = np.percentile(check.high[known], 95) / MM
    text = (
        f"expected true error mean {before:.3f} -> {after:.3f} mm, "
        f"95 % bounds of 95 % of the visits below {bound:.3f} mm"
    )
    if not outcome.decisions.count(Status.CORRECTED):
        text = f"nothing was corrected; {text}"
    return text


def worst_rows(check: ToleranceCheck) -> list[int]:
    """List the visits that do not pass, the largest upper bound first."""
    missed = (Verdict.FAIL, Verdict.UNKNOWN)
    rows = np.flatnonzero(np.isin(check.verdict, missed))
    size = np.nan_to_num(check.high[rows], nan=np.inf)
    return [int(k) for k in rows[np.argsort(-size, kind="stable")]]


def _list_worst(outcome: Outcome, check: ToleranceCheck) -> Iterator[str]:
    v, d, rows = outcome.visits, outcome.decisions, worst_rows(check)
    for k in rows[:WORST]:
        name, reason = v.names[v.name[k]], d.reasons[d.why[k]].text
        size = "error not known"
        if not np.isnan(check.expected[k]):
            size = f"{check.expected[k] / MM:.3f} mm, 95 % below "
            size += f"{check.high[k] / MM:.3f}"
        place = f"{v.files[v.file[k]]}:{v.line[k]}" + (f" {name}" if name else "")
        told = f"  {place}: {WORDS[Verdict(check.verdict[k])]}, {size}"
        yield f"{told}: {reason}" if reason else told
    if len(rows) > WORST:
        yield f"  and {len(rows) - WORST} more"


def tolerance_json(check: ToleranceCheck) -> dict[str, Any]:
    """Describe the verdict, one entry a visit in every list; lengths in mm."""
    return {
        "tolerance_mm": check.tolerance / MM,
        "passes": check.passes,
        **{word.replace(" ", "_"): check.count(one) for one, word in WORDS.items()},
        "expected_outside": check.outside,
        "verdict": [ALL_WORDS[Verdict(k)] for k in check.verdict.tolist()],
        "before_mm": np.round(check.before / MM, 5).tolist(),
        "expected_mm": np.round(check.expected / MM, 5).tolist(),
        "bound_5_mm": np.round(check.low / MM, 5).tolist(),
        "bound_95_mm": np.round(check.high / MM, 5).tolist(),
    }
