"""Many random programs: followed as they run, and landing where they say.

python -m tests.generated --count 1000 --language pdl2        (or: make generated)

Programs are drawn in no language, written, and run by a small walk of what was drawn.
PDL2 has a generator of its own, too: `own` draws with it. Of `all`, every program is
written in all languages, which must see the same in it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from postproc.model.model import Model, load_model
from postproc.robot.cell import Cell, load_cell
from tests.any_controller import told
from tests.conftest import CELL, make_job
from tests.generated.flows import flows
from tests.generated.found import Found, lines
from tests.generated.landing import lands
from tests.generated.neutral.alike import alike
from tests.generated.neutral.landing import lands as neutral_lands

LANGUAGES = ("own", "pdl2", "rapid", "krl", "all")
_SETUP: list[tuple[Cell, Model]] = []


def begin(folder: str) -> None:
    """Load the cell and the model once in each process."""
    cell = load_cell(Path(folder) / "cell.toml")
    _SETUP.append((cell, load_model(Path(folder) / "model.json")))


def check(language: str, seed: int) -> Found:
    """Check one program."""
    try:
        if language == "all":
            return alike(seed, *_SETUP[0])
        if language != "own":
            return neutral_lands(seed, language, *_SETUP[0])
        flows(seed)
        return lands(seed, *_SETUP[0])
    except Exception as wrong:  # whatever it is, it must not be
        kind = "" if isinstance(wrong, AssertionError) else type(wrong).__name__
        return Found(wrong=[(seed, 0, f"{kind} {wrong}"[:500])])


def main() -> int:
    """Check the programs and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--language", choices=LANGUAGES, default="pdl2")
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=5000)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    whole = Found()
    with tempfile.TemporaryDirectory() as name:
        folder = str(make_job(Path(name), told(CELL)))
        one = partial(check, given.language)
        with ProcessPoolExecutor(given.jobs, None, begin, (folder,)) as pool:
            seeds = range(given.first, given.first + given.count)
            for found in pool.map(one, seeds, chunksize=10):
                whole.add(found)
    print(f"{given.count} programs of {given.language}, {len(whole.wrong)} findings")
    print("\n".join(lines(whole)))
    for seed, line, what in whole.wrong:
        print(f"WRONG: program {seed}, line {line}: {what}")
    return 1 if whole.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
