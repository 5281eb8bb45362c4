"""Kill batches at random moments, resume them, and compare with an undisturbed run.

python -m tests.chaos --runs 200 --files 300        (or: make chaos)
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from postproc.batch.run import default_log
from postproc.files import TEMPORARY
from tests.conftest import make_job
from tests.plant import contents, grow, pages, program

ORPHANED = 60.0  # [s] after which no worker of a killed run is left, however busy


@dataclass(frozen=True)
class Plant:
    """A source tree with what belongs to it, and what an undisturbed run makes of it.

    Attributes:
        root: A folder of its own.
        cell: The cell file.
        model: The model file.
        jobs: Number of worker processes.
    """

    root: Path
    cell: Path
    model: Path
    jobs: int

    @property
    def source(self) -> Path:
        """The tree of programs."""
        return self.root / "src"

    def command(self, target: Path, *more: str) -> list[str]:
        """Return the command of a batch."""
        tool = [sys.executable, "-c", "from postproc.cli import main; main()", "batch"]
        files = ["--cell", str(self.cell), "--model", str(self.model)]
        return [
            *tool,
            str(self.source),
            str(target),
            *files,
            "-j",
            str(self.jobs),
            *more,
        ]

    def run(self, target: Path, *more: str) -> int:
        """Run a batch to its end and return its exit code."""
        command = self.command(target, *more)
        done = subprocess.run(command, capture_output=True, text=True, timeout=3600)
        if done.returncode not in (0, 1, 2) or "Traceback" in done.stderr:
            raise AssertionError(f"exit {done.returncode}: {done.stderr}")
        return done.returncode


def build(source: Path, files: int) -> None:
    """Write programs, a job of pages, a file that fails, and files to copy."""
    grow(source, files - 5, 1)
    pages(source / "pages", 2, 2)
    (source / "bad.pdl").write_bytes(b"PROGRAM bad\0")
    (source / "big.bin").write_bytes(random.Random(1).randbytes(2_000_000))
    (source / "far.pdl").write_bytes(
        program("far", 1, 1).replace(
            b"END far", b"  MOVE LINEAR TO POS(9000, 0, 0, 0, 180, 0, '')\r\nEND far"
        )
    )


def kill_and_resume(plant: Plant, after: float, want: dict[str, str]) -> int:
    """Kill a run, check what it left, resume, and check what that makes of it.

    Args:
        plant: What to run.
        after: When to kill [s].
        want: The tree of an undisturbed run.

    Returns:
        Number of files that were there when the run was killed.
    """
    target = plant.root / "dst"
    shutil.rmtree(target, ignore_errors=True)
    default_log(target).unlink(missing_ok=True)
    command = plant.command(target)
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    time.sleep(after)
    workers = list(descendants(process.pid))
    process.kill()
    process.wait()
    left = contents(target) if target.exists() else {}
    there = {p: d for p, d in left.items() if not p.endswith(TEMPORARY)}
    partial = {place for place in there if there[place] != want.get(place)}
    assert not partial, f"partly written: {sorted(partial)}"
    gone(workers)
    plant.run(target, "--resume")
    assert contents(target) == want, "another tree after --resume"
    return len(there)


def descendants(pid: int) -> Iterator[int]:
    """Yield the processes that a process has started, and theirs."""
    parents = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                stat = (folder / "stat").read_text()
            except OSError:
                continue
            parents[int(folder.name)] = int(stat.rpartition(")")[2].split()[1])
    found = {pid}
    while more := {p for p, parent in parents.items() if parent in found} - found:
        found |= more
    yield from found - {pid}


def gone(pids: list[int]) -> None:
    """Wait until processes have ended.

    Raises:
        AssertionError: One is still there after `ORPHANED` seconds.
    """
    end = time.monotonic() + ORPHANED
    while left := [pid for pid in pids if alive(pid)]:
        assert time.monotonic() < end, f"workers outlive their run: {left}"
        time.sleep(0.02)


def alive(pid: int) -> bool:
    """Tell whether a process is there and no zombie."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] not in "ZX"


def chaos(plant: Plant, runs: int, seed: int) -> int:
    """Kill and resume many times; return how often some of the files were there."""
    reference = plant.root / "undisturbed"
    start = time.monotonic()
    plant.run(reference)
    lasting = time.monotonic() - start
    want, rng, found = contents(reference), random.Random(seed), []
    for number in range(runs):
        after = rng.uniform(0.0, lasting)
        found.append(kill_and_resume(plant, after, want))
        if sys.stderr.isatty() or number % 10 == 9:
            print(f"{number + 1}: killed after {after:.2f} s, {found[-1]} files were "
                  f"there, resumed to the same tree", flush=True)  # fmt: skip
    return sum(0 < n < len(want) for n in found)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--files", type=int, default=300)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--seed", type=int, default=7)
    args = parser.parse_args()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with tempfile.TemporaryDirectory(prefix="postproc-chaos-") as folder:
        root = make_job(Path(folder))
        plant = Plant(root, root / "cell.toml", root / "model.json", args.jobs)
        build(plant.source, args.files)
        part = chaos(plant, args.runs, args.seed)
    print(f"{args.runs} runs killed and resumed: every tree identical, no partial file")
    print(f"{part} of them were killed with some of the files written")


if __name__ == "__main__":
    main()
