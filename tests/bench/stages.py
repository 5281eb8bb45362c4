"""One program through the whole pipeline in a process of its own."""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from postproc.cli.job_files import Destination
from postproc.cli.reports import Reports
from postproc.compensation.compensate import compensate
from postproc.compensation.program_files import ProgramFiles
from postproc.compensation.scale import workers
from postproc.model.model import load_model
from postproc.robot.cell import load_cell
from tests.any_controller import any_controller
from tests.bench.made import KINDS

KIBI = 1024
STAGES = (
    "read", "parse", "plan", "solve", "decide", "plan again", "rewrite", "verify",
    "report", "write",
)  # fmt: skip
ENOUGH = 10_000  # targets for the kernels


def measure(kind: str, n: int, cell: Path, model: Path) -> dict[str, float]:
    """Compensate a program of n targets, see `measure_program`."""
    made = KINDS[kind](n)
    with TemporaryDirectory() as folder:
        place = Path(folder) / made.name
        place.write_bytes(made.source)
        if made.variables is not None:
            place.with_suffix(".lsv").write_bytes(made.variables)
        del made
        return measure_program(place, cell, model)


def measure_program(place: Path, cell: Path, model: Path) -> dict[str, float]:
    """Compensate a program, from opening its files to written output and reports.

    Returns:
        Seconds of every stage, the whole, processor seconds of all, and peak memory
        [MiB].
    """
    start, used = time.perf_counter(), processor_time()
    given = ProgramFiles.open(place)
    loaded, fitted = any_controller(load_cell(cell)), load_model(model)
    read = time.perf_counter() - start
    crowd = workers.available()  # as the command line does
    outcome = compensate(given, loaded, fitted, processes=crowd)
    pipeline = time.perf_counter() - start
    begin = time.perf_counter()
    out, told = place.with_name(f"out{place.suffix}"), place.with_name("report.json")
    Destination(given, (cell, model)).write(outcome, out, Reports.of([told]))
    write = time.perf_counter() - begin
    return {
        "targets": len(outcome.visits), "lines": place.read_bytes().count(b"\n"),
        "read": read, **outcome.stages, "write": write, "all": pipeline + write,
        "processor": processor_time() - used, "peak_mib": peak_mib(),
    }  # fmt: skip


def processor_time() -> float:
    """Return what this process and those that it has waited for have used [s]."""
    t = os.times()
    return t.user + t.system + t.children_user + t.children_system


def peak_mib() -> float:
    """Return the most memory this process has held [MiB], without those it forked.

    Not by getrusage: a process begins with the peak of the one that started it.
    """
    status = Path("/proc/self/status").read_text(encoding="ascii")
    (peak,) = (row for row in status.splitlines() if row.startswith("VmHWM"))
    return int(peak.split()[1]) / KIBI


def main() -> None:
    """Print what was measured as JSON: kind, n, cell, model; --kernels: alone too.

    `--program`, path, cell, model: of a program that is written already.

    They are measured right after the pipeline, on the first targets: a machine that
    others use too is not as fast a minute later.
    """
    if sys.argv[1] == "--program":
        print(json.dumps(measure_program(*map(Path, sys.argv[2:5]))))
        return
    kind, n, cell, model = sys.argv[1:5]
    found = measure(kind, int(n), Path(cell), Path(model))
    if "--kernels" in sys.argv:  # they load libraries that the pipeline does not need
        from tests.bench.kernels import planned, ruckig_alone, toppra_alone

        arm, q = planned(KINDS[kind](min(int(n), ENOUGH)), Path(cell))
        found["toppra"], found["ruckig"] = toppra_alone(arm, q), ruckig_alone(arm, q)
    print(json.dumps(found))


if __name__ == "__main__":
    main()
