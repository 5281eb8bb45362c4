"""How long compensation takes on this machine, stage by stage.

Run by ``make bench`` with ``postproc`` on the PATH. Uses the model of ``make demo``,
and makes one when there is none. Prints a line a program, seconds in every stage.
"""

from __future__ import annotations

import json
import subprocess
import time
from pathlib import Path

HERE = Path(__file__).parent
CELL = HERE / "cell.toml"
WORK = HERE.parent / "demo"
PROGRAMS = ("handling", "spot", "drilling", "milling")


def postproc(*arguments: str | Path) -> None:
    """Run a command; exit code 1 is a result, 2 is not."""
    done = subprocess.run(
        ["postproc", *map(str, arguments)], capture_output=True, text=True
    )
    if done.returncode not in (0, 1):
        raise SystemExit(done.stderr)


def model() -> Path:
    """Return the demo's model; make it where there is none."""
    made = WORK / "model.json"
    if not made.exists():
        WORK.mkdir(exist_ok=True)
        program, data = WORK / "survey.pdl", WORK / "survey.csv"
        postproc("survey", "--cell", CELL, "-o", program)
        postproc("simulate", program, "--cell", CELL, "-o", data)
        postproc("fit", data, "--cell", CELL, "-o", made)
    return made


def measure(program: str, fitted: Path) -> dict[str, float]:
    """Compensate one program; return its visits, its seconds and its stages."""
    report = WORK / f"{program}.bench.json"
    source = HERE / f"{program}.pdl"
    output = WORK / f"{program}.bench.pdl"
    start = time.perf_counter()
    postproc("compensate", source, "--cell", CELL, "--model", fitted,
             "-o", output, "--report", report)  # fmt: skip
    wall = time.perf_counter() - start
    found = json.loads(report.read_text(encoding="utf-8"))
    return {"targets": len(found["targets"]), "wall": wall, **found["stages_s"]}


def main() -> None:
    """Print the table."""
    fitted = model()
    rows = {program: measure(program, fitted) for program in PROGRAMS}
    columns = list(next(iter(rows.values())))
    print(f"{'program':10s}" + "".join(f"{c:>10s}" for c in columns) + "   targets/s")
    for program, row in rows.items():
        cells = "".join(
            f"{row[c]:10.0f}" if c == "targets" else f"{row.get(c, 0.0):10.3f}"
            for c in columns
        )
        print(f"{program:10s}{cells}{row['targets'] / row['wall']:12.0f}")


if __name__ == "__main__":
    main()
