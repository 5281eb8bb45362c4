"""Measure a plant: many files, a second run, memory, workers, a cluster.

python -m tests.plant_bench --files 10000        (or: make plant-bench)

Writes docs/studies/plant.md. Ratios are of runs that take turns in the same minutes.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from unittest.mock import patch

from postproc.compensation.options import DEFAULT_OPTIONS
from postproc.compensation.output.sidecar import restore_file
from postproc.compensation.scale import micro_batch
from postproc.compensation.scale.micro_batch import Given
from postproc.model.model import load_model
from postproc.robot.cell import load_cell
from tests.batch.dask_cluster import Cluster
from tests.chaos import Plant
from tests.conftest import ROOT, make_job
from tests.plant import contents, grow
from tests.plant_watch import Cost, watched

TARGETS = 100
MANY = 1000  # targets of the files that a cluster is given
SOME = 100  # files that are compensated in this process
ROUNDS = 2  # of runs that are compared with each other
STEPS = 40_000_000  # of the plain loop: some seconds
PAGE = ROOT / "docs" / "studies" / "plant.md"


@dataclass
class Findings:
    """What was measured: rows of a table."""

    rows: list[tuple[str, str, str]] = field(default_factory=list)

    def add(self, what: str, found: str, wanted: str = "") -> None:
        """Add a row, and print it."""
        self.rows.append((what, found, wanted))
        print(f"{what}: {found}" + (f" (wanted: {wanted})" if wanted else ""))
        sys.stdout.flush()


def load() -> str:
    """Say how busy the machine is."""
    return "load " + ", ".join(f"{value:.1f}" for value in os.getloadavg())


def many_files(plant: Plant, files: int, found: Findings) -> None:
    """Compensate a large tree, then look at it again."""
    target = plant.root / "dst"
    first = _run(plant.command(target))
    found.add(f"{files} files of {TARGETS} targets, --jobs {plant.jobs}",
              f"{first.seconds:.0f} s ({files / first.seconds:.1f} files/s, {load()})",
              "200 s for 10,000 files on 2 cores")  # fmt: skip
    each = 1000 * first.cpu / files
    found.add("CPU of it, all processes", f"{first.cpu:.0f} s, {each:.0f} ms a file")
    pairs = "; ".join(f"{young:.0f} -> {old:.0f}" for young, old in first.growth())
    found.add("memory of its processes, early -> at the end [MB]", pairs, "flat")
    again = _run(plant.command(target, "--resume"))
    found.add("the second run, --resume", f"{again.seconds:.1f} s ({load()})",
              "20 s for 10,000 files")  # fmt: skip
    restored, want = 0, contents(plant.source)
    for path in target.rglob("*.pdl"):
        restore_file(path)
        restored += 1
    there = {p: h for p, h in contents(target).items() if not p.endswith(".json")}
    assert there == want, "restored files are not the sources"
    found.add("programs restored from their records, byte for byte", str(restored))


def passes(plant: Plant, found: Findings) -> None:
    """Compare programs side by side in passes with the same ones one by one."""
    cell, model = load_cell(plant.cell), load_model(plant.model)
    paths = sorted(plant.source.rglob("*.pdl"))[:SOME]
    programs = [Given(path.name, path.read_bytes(), None, {}) for path in paths]

    def spent(visits: int) -> float:
        with patch.object(micro_batch, "PASS", visits):
            start = time.process_time()
            micro_batch.compensate_batch(programs, cell, model, DEFAULT_OPTIONS)
            return time.process_time() - start

    spent(micro_batch.PASS)  # every line is parsed once
    runs = {"alone": lambda: spent(0), "beside": lambda: spent(micro_batch.PASS)}
    took = _in_turns(runs)
    alone, beside = (1000 * took[name] / ROUNDS / len(paths) for name in runs)
    text = f"{alone:.0f} ms, {beside:.0f} ms ({alone / beside:.1f} times)"
    found.add("CPU of a file, alone and beside others", text)


def workers(plant: Plant, found: Findings) -> None:
    """Compare two workers with one, and with a plain loop in the same minutes."""
    one, two = Plant(*_place(plant), 1), Plant(*_place(plant), 2)
    runs: dict[str, Callable[[], float]] = {
        "one": lambda: _seconds(one.command(plant.root / "one")),
        "loop1": lambda: loops(1),
        "two": lambda: _seconds(two.command(plant.root / "two")),
        "loop2": lambda: loops(2),
    }
    spent = _in_turns(runs)
    gain, plain = spent["one"] / spent["two"], 2 * spent["loop1"] / spent["loop2"]
    found.add("two workers against one", f"{gain:.2f} times ({load()})")
    found.add("a plain loop in two processes against one", f"{plain:.2f} times")
    found.add("the first of the second", f"{gain / plain:.2f}", "0.85")
    assert contents(plant.root / "one") == contents(plant.root / "two")


def cluster(plant: Plant, found: Findings) -> None:
    """Compare a cluster with as many local workers; kill one of its."""
    local, there = plant.root / "local", plant.root / "cluster"
    with Cluster(plant.root / "scratch", workers=plant.jobs) as dask:
        scheduler = ("--jobs", dask.address)
        runs: dict[str, Callable[[], float]] = {
            "local": lambda: _seconds(plant.command(local)),
            "cluster": lambda: _seconds(plant.command(there, *scheduler)),
        }
        spent = _in_turns(runs)
        share = spent["local"] / spent["cluster"]
        what = f"Dask, {plant.jobs} workers of one thread, against --jobs {plant.jobs}"
        found.add(f"{what}, files of {MANY} targets",
                  f"{100 * share:.0f} % ({load()})", "90 %")  # fmt: skip
        assert contents(there) == contents(local)
        killed = plant.root / "killed"
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        process = subprocess.Popen(plant.command(killed, *scheduler), **quiet)
        time.sleep(spent["cluster"] / ROUNDS / 2)
        assert process.poll() is None, "the run was over before a worker was killed"
        dask.kill_one()
        assert process.wait() in (0, 1)
        assert contents(killed) == contents(local)
        found.add("a worker killed in the middle", "the same bytes", "the same bytes")


def loops(processes: int) -> float:
    """Run the plain loop in some processes at once; return the seconds it took."""
    start = time.monotonic()
    running = [multiprocessing.Process(target=_count) for _ in range(processes)]
    for process in running:
        process.start()
    for process in running:
        process.join()
    return time.monotonic() - start


def _count() -> None:
    total = 0
    for number in range(STEPS):
        total += number & 7


def _in_turns(runs: dict[str, Callable[[], float]]) -> dict[str, float]:
    """Run everything in turns; return the sums of seconds."""
    spent = dict.fromkeys(runs, 0.0)
    for _ in range(ROUNDS):
        for name, run in runs.items():
            spent[name] += run()
    return spent


def _run(command: list[str]) -> Cost:
    cost = watched(command)
    if cost.exit_code not in (0, 1):
        raise SystemExit(cost.said)
    return cost


def _seconds(command: list[str]) -> float:
    return _run(command).seconds


def _place(plant: Plant) -> tuple[Path, Path, Path]:
    return plant.root, plant.cell, plant.model


def page(found: Findings, arguments: str) -> str:
    """Write the page."""
    lines = [
        "# A plant: what was measured",
        "",
        f"`make plant-bench` (`python -m tests.plant_bench {arguments}`) wrote this",
        f"page on {platform.system()} {platform.machine()}, {os.cpu_count()} cores,",
        f"Python {platform.python_version()}.",
        "",
        "| what | measured | wanted |",
        "|---|---|---|",
        *(f"| {a} | {b} | {c} |" for a, b, c in found.rows),
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=10_000)
    parser.add_argument("--compared", type=int, default=800, help="files of the ratios")
    parser.add_argument("--page", type=Path, default=PAGE)
    args = parser.parse_args()
    found = Findings()
    found.add("before the start", load())
    with tempfile.TemporaryDirectory(prefix="postproc-plant-") as folder:
        root = make_job(Path(folder))
        many, few, long = (
            Plant(root / name, root / "cell.toml", root / "model.json", jobs)
            for name, jobs in (("many", 2), ("few", 2), ("long", 4))
        )
        grow(many.source, args.files, TARGETS)
        grow(few.source, args.compared, TARGETS)
        grow(long.source, args.compared // 4, MANY)
        for part in (
            lambda: many_files(many, args.files, found),
            lambda: passes(few, found),
            lambda: workers(few, found),
            lambda: cluster(long, found),
        ):
            part()
            command = f"--files {args.files} --compared {args.compared}"
            args.page.write_text(page(found, command))


if __name__ == "__main__":
    main()
