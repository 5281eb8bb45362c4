"""Where the time goes: every kind of program at every length, into benchmarks.md.

Run by ``make bench``. Each program runs in a process of its own, the short ones first;
a length that would not fit into what is left of the budget is left out, and says so.
The budget counts from the first program on; 10,000 targets run in any case.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

from postproc import _native
from tests.bench.beside import TARGETS, Beside, side_by_side
from tests.bench.languages import compared, files_table, measure_files
from tests.bench.made import KINDS
from tests.bench.memory import watched
from tests.bench.stages import STAGES

ROOT = Path(__file__).parents[2]
CELL = ROOT / "programs" / "cell.toml"
WORK = ROOT / "demo"
TABLE = ROOT / "docs" / "studies" / "benchmarks.md"
LENGTHS = (1_000, 10_000, 100_000, 1_000_000)
ALWAYS = 10_000  # targets that fit into any budget
LIBRARIES = ("numpy", "scipy", "toppra", "ruckig", "lark", "pin")
ABOUT_STAGES = """Seconds. `all` is from opening the files to written output, record and
JSON report; the start of Python is not in it. `unbroken` is one fly run without a stop,
`milling` stops every 25,000 points. `parse` resolves too, `plan` holds the inverse
kinematics, `solve` predicts, `plan again` is every round of corrections. Programs of
40,000 targets and more are corrected by one process for a core: their stages from
`plan` to `plan again` are seconds of all processes, which together are more than `all`.
MiB is the most that all of them hold, shared pages counted once."""
ABOUT_KERNELS = """toppra by itself solves the same joint angles once, a gridpoint a
waypoint, and ruckig moves from stop to stop between them. The pipeline calls them only
for a model with an effect that depends on the speed, which this one has not. All is of
the longest program that ran, in one process; growth is from 10,000 targets to that."""
ABOUT_LANGUAGES = """One milled job in the words of each language: processor time in one
process, `python -m tests.bench.languages`. Lines of KRL and RAPID are longer."""
ABOUT_FILES = """The same as one fly run, from files to written output and reports, by a
process for a core, `python -m tests.bench.languages --files`: seconds as above, and
processor seconds of all processes."""
Row = dict[str, float]


def model() -> Path:
    """Return the model of ``make demo``; make it where there is none."""
    made = WORK / "model.json"
    if not made.exists():
        WORK.mkdir(exist_ok=True)
        survey, data = WORK / "survey.pdl", WORK / "survey.csv"
        run("survey", "--cell", CELL, "-o", survey)
        run("simulate", survey, "--cell", CELL, "-o", data)
        run("fit", data, "--cell", CELL, "-o", made)
    return made


def run(*arguments: str | Path) -> float:
    """Run a command of ours; return its seconds. Exit code 1 is a result."""
    start = time.perf_counter()
    command = [Path(sys.executable).with_name("postproc"), *arguments]
    own = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=own)
    if done.returncode not in (0, 1):
        raise SystemExit(done.stderr)
    return time.perf_counter() - start


def measure(kind: str, n: int, fitted: Path) -> Row:
    """Compensate a made program in a process of its own."""
    command = [sys.executable, "-m", "tests.bench.stages", kind, str(n)]
    kernels = ["--kernels"] if n >= ALWAYS else []
    command += [str(CELL), str(fitted), *kernels]
    out, errors, code, most = watched(command, ROOT)
    if code:
        raise SystemExit(errors)
    row: Row = json.loads(out)
    row["peak_mib"] = max(row["peak_mib"], most)
    return row


def from_the_command_line(fitted: Path) -> tuple[float, float]:
    """Compensate the shortest program as a user does; return its seconds.

    The first run, which compiles our modules, does not count.

    Returns:
        With the motion in time, and without it.
    """
    with TemporaryDirectory() as folder:
        place = Path(folder) / "milling.pdl"
        place.write_bytes(KINDS["milling"](LENGTHS[0]).source)
        given = (place, "--cell", CELL, "--model", fitted)
        timed = [run("compensate", *given) for _ in range(4)]
        plain = [
            run("compensate", *given, "--set", "compensation.timing=false")
            for _ in range(4)
        ]
        return min(timed[1:]), min(plain[1:])


def measure_all(fitted: Path, budget: float) -> dict[tuple[str, int], Row]:
    """Measure what fits into so many seconds, the short programs first."""
    rows: dict[tuple[str, int], Row] = {}
    end = time.perf_counter() + budget
    for n in LENGTHS:
        for kind in KINDS:
            last = rows.get((kind, n // 10))
            if n > ALWAYS and last is None:
                continue
            expected = 10 * last["all"] if n > ALWAYS and last else 0.0
            if n <= ALWAYS or time.perf_counter() + expected < end:
                print(f"{kind} {n}", file=sys.stderr, flush=True)
                rows[kind, n] = measure(kind, n, fitted)
    return rows


def stage_table(rows: dict[tuple[str, int], Row]) -> list[str]:
    """Write seconds by stage."""
    head = ["program", "targets", *STAGES, "all", "targets/s", "us/target", "MiB"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for kind in KINDS:
        for n in LENGTHS:
            row = rows.get((kind, n))
            if row is None:
                blank = " |" * (len(head) - 3)
                lines.append(f"| {kind} | {n:,} | not run: over the budget |{blank}")
                continue
            cells = [f"{row.get(stage, 0.0):.2f}" for stage in STAGES]
            rate, each = row["targets"] / row["all"], row["all"] / row["targets"]
            cells += [f"{row['all']:.2f}", f"{rate:,.0f}", f"{each * 1e6:.0f}"]
            told = [kind, f"{row['targets']:,.0f}", *cells, f"{row['peak_mib']:,.0f}"]
            lines.append("| " + " | ".join(told) + " |")
    return lines


def share_table(rows: dict[tuple[str, int], Row]) -> list[str]:
    """Write how toppra and ruckig by themselves compare, and how time grows."""
    lines = [
        "| program | toppra alone, us a waypoint | ruckig alone, us a move | pipeline, "
        "us a target | pipeline / toppra | growth exponent, time | .. memory |",
        "|---|---|---|---|---|---|---|",
    ]
    for kind in KINDS:
        own = {n: row for (k, n), row in rows.items() if k == kind}
        if LENGTHS[1] not in own:
            continue
        row, largest = own[LENGTHS[1]], own[max(own)]
        each = largest["all"] / largest["targets"]
        growth = [exponent(row, largest, key) for key in ("all", "peak_mib")]
        lines.append(
            f"| {kind} | {largest['toppra'] * 1e6:.1f} | "
            f"{largest['ruckig'] * 1e6:.1f} | {each * 1e6:.0f} | "
            f"{each / largest['toppra']:.1f} | {' | '.join(growth)} |"
        )
    return lines


def exponent(row: Row, longer: Row, key: str) -> str:
    """Write how what a program takes grows with its targets."""
    if longer is row:
        return "-"
    more = longer["targets"] / row["targets"]
    return f"{math.log(longer[key] / row[key]) / math.log(more):.2f}"


def beside_lines(beside: Beside, rows: dict[tuple[str, int], Row]) -> list[str]:
    """Write what a user would write today, beside ours; also of the longest program."""
    longest = rows[max(key for key in rows if key[0] == "milling")]
    rate = longest["targets"] / longest["all"]
    return [
        "| | a second | times |",
        "|---|---|---|",
        f"| lines, lark for every line | {beside.lark:,.0f} | 1 |",
        f"| lines, by their shapes | {beside.shapes:,.0f} | "
        f"{beside.shapes / beside.lark:.0f} |",
        f"| targets, loop with a numeric inverse (scipy) | {beside.loop:,.0f} | 1 |",
        f"| targets, the same solved in arrays | {beside.solved:,.0f} | "
        f"{beside.solved / beside.loop:.0f} |",
        f"| targets, the whole pipeline, the same {TARGETS:,} | {beside.ours:,.0f} | "
        f"{beside.ours / beside.loop:.0f} |",
        f"| targets, the whole pipeline, {longest['targets']:,.0f} | {rate:,.0f} | "
        f"{rate / beside.loop:.0f} |",
        "",
        f"Loop and arrays give the same commands to {beside.apart * 1e6:.3f} um.",
    ]


def machine() -> str:
    """Describe the machine and the versions."""
    cpu = platform.processor() or platform.machine()
    names = Path("/proc/cpuinfo")
    if names.exists():
        told = [r for r in names.read_text().splitlines() if r.startswith("model name")]
        cpu = told[0].partition(":")[2].strip() if told else cpu
    libraries = ", ".join(f"{name} {version(name)}" for name in LIBRARIES)
    return (
        f"{os.cpu_count()} cores ({cpu}), Python {platform.python_version()}, "
        f"{libraries}; core {_native.SOURCES}; "
        f"OMP_NUM_THREADS={os.environ.get('OMP_NUM_THREADS', 'unset')}."
    )


def main() -> None:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--budget", type=float, default=540.0, help="seconds")
    budget = parser.parse_args().budget
    fitted = model()
    load = os.getloadavg()[0]
    helps = min(run("--help") for _ in range(3))
    timed, plain = from_the_command_line(fitted)
    beside = side_by_side(CELL, fitted)
    rows = measure_all(fitted, budget)
    text = [
        "# Where the time goes",
        f"Written by `make bench`. {machine()} Load at the beginning: {load:.1f}.",
        "## Stages",
        ABOUT_STAGES,
        "\n".join(stage_table(rows)),
        "## Kernels and growth",
        ABOUT_KERNELS,
        "\n".join(share_table(rows)),
        "## Side by side",
        "\n".join(beside_lines(beside, rows)),
        "## Languages",
        ABOUT_LANGUAGES,
        "\n".join(compared()),
        ABOUT_FILES,
        "\n".join(files_table(measure_files(LENGTHS[-1]))),
        "## From the command line",
        f"`postproc --help`: {helps:.2f} s. `postproc compensate` of 1,000 milling "
        f"targets from the command line, start of Python included: {timed:.2f} s, with "
        f"`--set compensation.timing=false` {plain:.2f} s.",
    ]
    TABLE.write_text("\n\n".join(text) + "\n", encoding="utf-8")
    print("\n\n".join(text))


if __name__ == "__main__":
    main()
