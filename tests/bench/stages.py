"""One program through the whole pipeline in a process of its own."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from postproc.cli.job_files import Destination
from postproc.cli.reports import Reports
from postproc.compensation import workers
from postproc.compensation.compensate import compensate
from postproc.compensation.program_files import ProgramFiles
from postproc.model.model import load_model
from postproc.robot.cell import load_cell
from tests.bench.made import KINDS

KIBI = 1024
ENOUGH = 10_000  # targets for the kernels


def measure(kind: str, n: int, cell: Path, model: Path) -> dict[str, float]:
    """Compensate a program of n targets.

    Returns:
        Seconds of every stage, the whole, and peak memory [MiB].
    """
    made = KINDS[kind](n)
    with TemporaryDirectory() as folder:
        place = Path(folder) / made.name
        place.write_bytes(made.source)
        if made.variables is not None:
            place.with_suffix(".lsv").write_bytes(made.variables)
        lines = made.source.count(b"\n")
        del made
        start = time.perf_counter()
        given = ProgramFiles.open(place)
        loaded, fitted = load_cell(cell), load_model(model)
        read = time.perf_counter() - start
        crowd = workers.available()  # as the command line does
        outcome = compensate(given, loaded, fitted, processes=crowd)
        pipeline = time.perf_counter() - start
        begin = time.perf_counter()
        out, told = place.with_name("out.pdl"), place.with_name("report.json")
        Destination(given, (cell, model)).write(outcome, out, Reports.of([told]))
        write = time.perf_counter() - begin
    found = {
        "targets": len(outcome.visits), "lines": lines, "read": read,
        **outcome.stages, "write": write, "all": pipeline + write,
        "peak_mib": peak_mib(),
    }  # fmt: skip
    return found


def peak_mib() -> float:
    """Return the most memory this process has held [MiB], without those it forked.

    Not by getrusage: a process begins with the peak of the one that started it.
    """
    status = Path("/proc/self/status").read_text(encoding="ascii")
    (peak,) = (row for row in status.splitlines() if row.startswith("VmHWM"))
    return int(peak.split()[1]) / KIBI


def main() -> None:
    """Print what was measured as JSON: kind, n, cell, model; --kernels: alone too.

    They are measured right after the pipeline, on the first targets: a machine that
    others use too is not as fast a minute later.
    """
    kind, n, cell, model = sys.argv[1:5]
    found = measure(kind, int(n), Path(cell), Path(model))
    if "--kernels" in sys.argv:  # they load libraries that the pipeline does not need
        from tests.bench.kernels import planned, ruckig_alone, toppra_alone

        arm, q = planned(KINDS[kind](min(int(n), ENOUGH)), Path(cell))
        found["toppra"], found["ruckig"] = toppra_alone(arm, q), ruckig_alone(arm, q)
    print(json.dumps(found))


if __name__ == "__main__":
    main()
