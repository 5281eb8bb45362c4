"""Write docs/studies/accuracy.md: how accurate the fits are, and how sure of it.

PYTHONPATH=. python docs/studies/accuracy.py [--seeds 20] [--shared ../shared]
"""

from __future__ import annotations

import argparse
import os
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from measured import blind, ur10
from simulated import (
    against_the_limit,
    designs,
    learning_curve,
    other_tools,
    timings,
)

from postproc.exceptions import PostprocError
from tests.awkward import run

OUT = Path(__file__).parent / "accuracy.md"


def awkward(count: int) -> list[str]:
    """Count how surveys of every awkward kind end; a traceback ends the study."""
    ends = Counter(run(seed).split(":")[0] for seed in range(count))
    told = [f"- {end}: {number}" for end, number in ends.most_common()]
    return [
        f"{count} drawn campaigns (`make awkward`: tiny volumes, a joint that stands "
        "still, two poses, unknown base and probe, metres, a drifting tracker, ..), "
        "fitted, up to 100 rows diagnosed too, with the verdict; or refused in words. "
        "None ends in a traceback.",
        "",
        *told,
    ]


def main() -> None:
    """Run all studies and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=20)
    default = os.environ.get("POSTPROC_SHARED", "../shared")
    parser.add_argument("--shared", type=Path, default=Path(default))
    given = parser.parse_args()
    n = given.seeds
    sections: list[tuple[str, Callable[[], list[str]]]] = [
        (
            f"Against the statistical limit: {n} simulated arms, 300 rows",
            lambda: against_the_limit(n),
        ),
        ("A tool 100 mm longer than the surveyed one", lambda: other_tools(n)),
        (
            "How many rows: held-out true error, mm",
            lambda: learning_curve(max(n // 4, 1)),
        ),
        ("How long a fit takes", timings),
        ("Where to measure", lambda: designs(max(n // 2, 1))),
        (
            "A real arm: UR10, tracker frame, nothing known of base and probe",
            lambda: ur10(given.shared / "data" / "ipa-ur10"),
        ),
        (
            "Blind campaigns: fitted on the survey, error on the verification, mm",
            lambda: blind(given.shared / "blind"),
        ),
        ("Awkward surveys", lambda: awkward(200)),
    ]
    text = [
        "# Accuracy",
        "",
        f"Written by `PYTHONPATH=. python docs/studies/accuracy.py --seeds {n}`.",
    ]
    for title, study in sections:
        try:
            lines = study()
        except PostprocError as exc:  # the data are not there
            lines = [f"not run: {exc}"]
        text += ["", f"## {title}", "", *lines]
        print("\n".join(["", title, *lines]), flush=True)
    OUT.write_text("\n".join([*text, ""]))


if __name__ == "__main__":
    main()
