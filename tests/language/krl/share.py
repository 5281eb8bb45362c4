"""Which share of the motion lines of KRL programs is corrected.

python -m tests.language.krl.share FOLDER --cell CELL --model MODEL

Every source that no other source of its folder owns is compensated, in memory. Lines
that hold no target, whose target is computed while the program runs, and moves of
external axes do not count.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import numpy as np

from postproc.compensation.compensate import compensate
from postproc.compensation.options import Options
from postproc.compensation.outcome import Status
from postproc.compensation.program_files import find_pages
from postproc.exceptions import PostprocError
from postproc.language.visits import Meaning

NO_TARGETS = (Meaning.HOME, Meaning.RELATIVE_TOOL, Meaning.RELATIVE_UFRAME, Meaning.BY)
NO_TARGET = (
    "holds no target",
    "the program runs",
    "that runs",
    "external",
    "does not state all",
)


def outcomes(path: Path, cell: Path, model: Path) -> Counter[str]:
    """Count the motion lines of a job: corrected, without a target, and reasons."""
    found: Counter[str] = Counter()
    done = compensate(path, cell, model, options=Options(timing=False))
    v, status = done.visits, done.decisions.status
    for file in np.unique(v.place.file).tolist():
        for line in np.unique(v.place.line[v.place.file == file]).tolist():
            rows = np.flatnonzero((v.place.file == file) & (v.place.line == line))
            why = next((v.reasons[k].text for k in v.reason[rows].tolist() if k), "")
            if (
                any(word in why for word in NO_TARGET)
                or v.target.meaning[rows[0]] in NO_TARGETS
            ):
                found["no target"] += 1
            elif (status[rows] == Status.CORRECTED).all():
                found["corrected"] += 1
            else:
                found[why or "rejected where it is driven"] += 1
    return found


def main() -> int:
    """Print the share, and the reasons for the rest."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cell", type=Path, required=True)
    parser.add_argument("--model", type=Path, required=True)
    given = parser.parse_args()
    total: Counter[str] = Counter()
    sources = [p for p in given.folder.rglob("*") if p.suffix.lower() == ".src"]
    pages = {page for path in sources for page in find_pages(path).paths}
    for path in sorted(set(sources) - pages):
        try:
            total += outcomes(path, given.cell, given.model)
        except PostprocError as exc:
            print(f"{path.name}: {exc}")
            total["refused"] += 1
    refused = total.pop("refused", 0)
    some = total.total() - total["no target"]
    share = 100.0 * total["corrected"] / max(some, 1)
    print(f"{len(sources)} sources ({refused} refused), {some} lines with a target, ")
    print(f"{total['corrected']} corrected ({share:.0f} %)")
    for why, count in total.most_common():
        print(f"{count:6d} {why}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
