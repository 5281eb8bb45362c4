"""Damage programs, many thousand of them, and see what becomes of them.

python -m tests.fuzz --count 20000 --seed 0        (or: make fuzz)

Of four one is a task of RAPID, one a job of KRL, the others are PDL2, unless --language
names one. Each is read and rewritten with other numbers in all of its targets; every
ninth is compensated and restored. The same numbers give the same programs.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import traceback
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from postproc.model.model import Model, load_model
from postproc.robot.cell import Cell, load_cell
from tests.any_controller import told
from tests.conftest import CELL, make_job
from tests.fuzz.case import HangError, compensated, rewrite
from tests.fuzz.originals import damaged_of

WHOLE = 9  # every so many are compensated, not only rewritten
_SETUP: list[tuple[Cell, Model]] = []


def begin(folder: str) -> None:
    """Load the cell and the model, and warm the parser up, once in each process."""
    cell = load_cell(Path(folder) / "cell.toml")
    _SETUP.append((cell, load_model(Path(folder) / "model.json")))
    files = {"job.pdl": b"PROGRAM a\nBEGIN\nEND a", "job.lsv": b"n INT Priv 1"}
    compensated(files, *_SETUP[0])


def attempt(language: str, seed: int, number: int) -> tuple[int, str, str, float]:
    """Damage one program; return its number, what came of it, why, and the time [s]."""
    cell, model = _SETUP[0]
    files = damaged_of(seed, number, language)
    begun = time.process_time()
    said = ""
    try:
        kind = rewrite(files, cell)
        if number % WHOLE == 0:
            kind = compensated(files, cell, model)
    except HangError as hang:
        kind, said = "hang", f"{hang}: {where()}"
    except Exception:  # whatever it is, it is what we are looking for
        kind, said = "failed", traceback.format_exc()
    return number, kind, said, time.process_time() - begun


def where() -> str:
    """Name the innermost lines of ours that were running."""
    frames = traceback.extract_tb(sys.exc_info()[2])
    return " < ".join(f"{Path(f.filename).name}:{f.lineno}" for f in frames[-2:-6:-1])


def keep(folder: Path, language: str, seed: int, number: int) -> None:
    """Write the files of a case for a closer look."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in damaged_of(seed, number, language).items():
        (folder / f"{seed}-{number}-{name}").write_bytes(data)


def main() -> int:
    """Run the cases; exit 1 where one fails or hangs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--language", choices=("pdl2", "rapid", "krl"), default="")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="write failing programs there")
    given = parser.parse_args()
    counted: Counter[str] = Counter()
    slowest = 0.0
    with tempfile.TemporaryDirectory() as name:
        folder = str(make_job(Path(name), told(CELL)))
        with ProcessPoolExecutor(given.jobs, None, begin, (folder,)) as pool:
            numbers = range(given.first, given.first + given.count)
            seeds = [given.seed] * len(numbers)
            for number, kind, said, took in pool.map(
                partial(attempt, given.language), seeds, numbers, chunksize=50
            ):
                counted[kind] += 1
                slowest = max(slowest, took)
                if said:
                    print(f"{given.seed}:{number}: {kind}: {said}", flush=True)
                    if given.keep:
                        keep(given.keep, given.language, given.seed, number)
    said = ", ".join(f"{n} {kind}" for kind, n in sorted(counted.items()))
    print(f"{given.count} damaged programs: {said}; slowest {slowest:.2f} s")
    return 1 if counted["failed"] or counted["hang"] else 0


if __name__ == "__main__":
    sys.exit(main())
