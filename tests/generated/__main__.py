"""Many random programs: followed as they run, and landing where they say.

python -m tests.generated --count 1000        (or: make generated)
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from postproc.model.model import Model, load_model
from postproc.robot.cell import Cell, load_cell
from tests.conftest import make_job
from tests.generated.flows import flows
from tests.generated.found import Found, lines
from tests.generated.landing import lands

_SETUP: list[tuple[Cell, Model]] = []


def begin(folder: str) -> None:
    """Load the cell and the model once in each process."""
    cell = load_cell(Path(folder) / "cell.toml")
    _SETUP.append((cell, load_model(Path(folder) / "model.json")))


def check(seed: int) -> Found:
    """Check one program."""
    try:
        flows(seed)
        return lands(seed, *_SETUP[0])
    except AssertionError as wrong:
        return Found(wrong=[(seed, 0, str(wrong)[:500])])


def main() -> int:
    """Check the programs and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=5000)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    whole = Found()
    with tempfile.TemporaryDirectory() as name:
        folder = str(make_job(Path(name)))
        with ProcessPoolExecutor(given.jobs, None, begin, (folder,)) as pool:
            seeds = range(given.first, given.first + given.count)
            for found in pool.map(check, seeds, chunksize=10):
                whole.add(found)
    print(f"{given.count} programs, {len(whole.wrong)} findings")
    print("\n".join(lines(whole)))
    for seed, line, what in whole.wrong:
        print(f"WRONG: program {seed}, line {line}: {what}")
    return 1 if whole.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
