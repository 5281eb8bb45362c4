"""Count the motion lines of RAPID files whose targets may be corrected.

python -m tests.language.rapid.yields FOLDER

A folder with one PROC main is a task; other files are tasks of their own. Lines that
only external axes move, or whose targets show when the program runs, do not count.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from postproc.exceptions import PostprocError
from postproc.language.analysis.goals import RUN_TIME
from postproc.language.language import Start
from postproc.language.rapid.files import RapidFileName
from postproc.language.rapid.language import Rapid
from postproc.language.text.source import source_from_bytes

BESIDE = (RUN_TIME, "external axes")  # reasons of lines that do not count


def tasks(root: Path) -> Iterator[list[Path]]:
    """Yield the files of every task below a folder, the one with main first."""
    files = [p for p in sorted(root.rglob("*")) if RapidFileName(p.name).is_program]
    for folder in sorted({path.parent for path in files}):
        own = [path for path in files if path.parent == folder]
        mains = [path for path in own if b"proc main" in path.read_bytes().lower()]
        others = [path for path in own if path not in mains]
        yield from ([main, *others] for main in mains)
        if not mains:
            yield from ([path] for path in own)


def reasons_of(task: list[Path]) -> list[str]:
    """Return why each motion line of a task is left, "" for those that are not."""
    sources = [source_from_bytes(path.name, path.read_bytes()) for path in task]
    found = Rapid().read(sources, Start())
    visits, lines = found.visits, dict[tuple[int, int], str]()
    for k in range(len(visits)):
        place = int(visits.place.file[k]), int(visits.place.line[k])
        why = visits.reasons[int(visits.reason[k])].text
        lines[place] = lines.get(place, "") or why
    counted = [why for why in lines.values() if not any(b in why for b in BESIDE)]
    missed = sum(map(len, found.missed.values()))
    return [*counted, *["it is never reached"] * missed]


def main(root: Path) -> None:
    """Print the share, and what leaves the others."""
    counted = Counter[str]()
    for task in tasks(root):
        try:
            counted.update(reasons_of(task))
        except PostprocError as problem:
            print(f"refused: {problem}")
    total = sum(counted.values())
    print(f"{counted.pop('', 0)} of {total} motion lines may be corrected")
    for why, count in counted.most_common():
        print(f"{count:5} {why}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
