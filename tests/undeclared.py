"""Trace undeclared effects on virtual arms, and count how often the answer is right.

    python -m tests.undeclared --seeds 60 --none 200 --jobs 2

The data come from the virtual arm, which shares no code with the model. An effect is
drawn by seed, the fitter is not told, and the truth is opened only to score. Results
are kept line by line beside the table, so that an interrupted run goes on.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path

from tests.calibration.planted import NAMED, NAMELESS, REVISED, SIZES, WAVES
from tests.undeclared_trial import Trial, run

SEEDS, NONE = 60, 200  # of a full run
FIRST_SEED = 7000  # seeds below are for trying things out


def jobs_of(seeds: int, none: int) -> list[tuple[str, int, float]]:
    """List kind, seed and size of every trial; an unfinished list holds all kinds."""
    kinds = (*NAMED, *REVISED, *WAVES, *NAMELESS, "two")
    planted = [
        (k / seeds, (kind, FIRST_SEED + k, SIZES[k % len(SIZES)]))
        for k in range(seeds)
        for kind in kinds
    ]
    nothing = [(k / none, ("none", FIRST_SEED + k, 0.0)) for k in range(none)]
    return [job for _, job in sorted([*planted, *nothing], key=lambda j: j[0])]


def _run(job: tuple[str, int, float]) -> str:
    return json.dumps(asdict(run(*job)))


def run_all(jobs: Iterable[tuple[str, int, float]], log: Path, workers: int) -> None:
    """Run the trials that the log does not hold yet."""
    done = {(t.kind, t.seed, t.size) for t in read_log(log)}
    todo = [j for j in jobs if j not in done]
    with log.open("a") as out, ProcessPoolExecutor(workers) as pool:
        for k, line in enumerate(pool.map(_run, todo, chunksize=4)):
            out.write(line + "\n")
            out.flush()
            if k % 20 == 0:
                print(f"{k + 1} of {len(todo)}", flush=True)


def read_log(log: Path) -> list[Trial]:
    """Read the trials of a log."""
    if not log.exists():
        return []
    lines = log.read_text().splitlines()
    return [_trial(json.loads(line)) for line in lines]


def _trial(data: dict[str, object]) -> Trial:
    truth = [tuple(law) for law in data["truth"]]  # type: ignore[attr-defined]
    errors = {k: tuple(data[k]) for k in ("true_mm", "registered_mm")}  # type: ignore[arg-type]
    return Trial(**{**data, "truth": truth, **errors})  # type: ignore[arg-type]


def main() -> None:
    """Run and write the table."""
    from tests.undeclared_table import write_table

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--none", type=int, default=NONE)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--skip", type=int, default=0, help="leave out the first ones")
    parser.add_argument("--log", type=Path, default=Path("build/undeclared.jsonl"))
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("docs/studies/undeclared.md")
    )
    chosen = parser.parse_args()
    chosen.log.parent.mkdir(parents=True, exist_ok=True)
    every = jobs_of(chosen.seeds, chosen.none)
    jobs = every[chosen.skip :]
    run_all(jobs, chosen.log, chosen.jobs)
    smaller = f" SEEDS={chosen.seeds} NONE={chosen.none}"
    full = (chosen.seeds, chosen.none) == (SEEDS, NONE)
    command = "make undeclared" + ("" if full else smaller)
    if chosen.skip:
        command = f"python -m tests.undeclared --skip {chosen.skip}"
    asked = [t for t in read_log(chosen.log) if (t.kind, t.seed, t.size) in set(jobs)]
    write_table(asked, chosen.output, len(every), command)


if __name__ == "__main__":
    main()
