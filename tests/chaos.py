"""Kill batches at random moments and resume them; end long runs by signals.

python -m tests.chaos --runs 200 --files 300 --signals 50        (or: make chaos)
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

STARTING = 0.5  # [s] that Python takes until it runs a program
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


def kill_and_resume(plant: Plant, after: float, want: dict[str, str]) -> int | None:
    """Kill a run, check what it left, resume, and check what that makes of it.

    Args:
        plant: What to run.
        after: When to kill [s].
        want: The tree of an undisturbed run.

    Returns:
        Number of files that were there when the run was killed; None where it had come
        to its end before.
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
    if process.wait() != -signal.SIGKILL:
        return None
    left = contents(target) if target.exists() else {}
    there = {p: d for p, d in left.items() if not p.endswith(TEMPORARY)}
    partial = {place for place in there if there[place] != want.get(place)}
    assert not partial, f"partly written: {sorted(partial)}"
    gone(workers)
    plant.run(target, "--resume")
    assert contents(target) == want, "another tree after --resume"
    return len(there)


@dataclass(frozen=True)
class LongRun:
    """A compensation that takes some seconds, in a folder of its own.

    Attributes:
        folder: Where its program lies, and nothing else.
        cell: The cell file.
        model: The model file.
    """

    folder: Path
    cell: Path
    model: Path

    def begun(self) -> subprocess.Popen[bytes]:
        """Start it, with a report and a page."""
        tool = [sys.executable, "-c", "from postproc.cli import main; main()"]
        files = ["--cell", self.cell, "--model", self.model]
        pages = ["--report", "job.json", "--report", "job.html"]
        command = [*tool, "compensate", "job.pdl", *map(str, files), *pages]
        env = {**os.environ, "XDG_CACHE_HOME": str(self.folder / "cache")}
        pipe = subprocess.PIPE
        return subprocess.Popen(
            command, cwd=self.folder, env=env, stdout=pipe, stderr=pipe
        )

    def end(self, after: float, number: int, want: dict[str, str]) -> float | None:
        """Send a signal at some moment, and check what is left.

        Args:
            after: When to send it [s].
            number: The signal.
            want: All that an undisturbed run writes.

        Returns:
            How long the run took to end [s]; None where it had ended before.
        """
        for path in self.folder.iterdir():
            if path.name != "job.pdl":
                shutil.rmtree(path) if path.is_dir() else path.unlink()
        process = self.begun()
        time.sleep(after)
        workers = list(descendants(process.pid))
        sent = time.monotonic()
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
        lasted = time.monotonic() - sent
        assert b"Traceback" not in said and b"internal error" not in said, said
        there = contents(self.folder)
        assert not [p for p in there if p.endswith(TEMPORARY)], f"left behind: {there}"
        there = {p: d for p, d in there.items() if not p.startswith("cache/")}
        if process.returncode in (0, 1):
            other = {p for p in {*there, *want} if there.get(p) != want.get(p)}
            assert other <= {"job.json", "job.html"}, other  # these tell seconds too
            assert set(there) == set(want)
            return None
        assert process.returncode in (-number, 128 + number), process.returncode
        assert set(there) in ({"job.pdl"}, set(want)), f"half of it: {sorted(there)}"
        gone(workers)
        return lasted


def end_many(run: LongRun, times: int, seed: int) -> float:
    """End a run at random moments that land; return how long the slowest took [s]."""
    start = time.monotonic()
    process = run.begun()
    _, said = process.communicate()
    assert process.returncode in (0, 1), said
    lasting, rng, found = time.monotonic() - start, random.Random(seed), [0.0]
    want = {p: d for p, d in contents(run.folder).items() if not p.startswith("cache/")}
    while len(found) <= times:
        number = (signal.SIGTERM, signal.SIGINT)[len(found) % 2]
        # The interpreter itself takes some milliseconds until it asks what we want.
        after = rng.uniform(STARTING if number == signal.SIGINT else 0.0, lasting)
        lasted = run.end(after, number, want)
        if lasted is not None:
            found.append(lasted)
    return max(found)


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
    """Kill and resume many times; return how often some of the files were there.

    A kill counts where it lands: a run that has ended before is begun again.
    """
    reference = plant.root / "undisturbed"
    start = time.monotonic()
    plant.run(reference)
    lasting = time.monotonic() - start
    want, rng, found = contents(reference), random.Random(seed), []
    while (number := len(found)) < runs:
        after = rng.uniform(0.0, lasting)
        there = kill_and_resume(plant, after, want)
        if there is None:
            continue
        found.append(there)
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
    parser.add_argument("--signals", type=int, default=50)
    parser.add_argument("--targets", type=int, default=20_000)
    args = parser.parse_args()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with tempfile.TemporaryDirectory(prefix="postproc-chaos-") as folder:
        root = make_job(Path(folder))
        plant = Plant(root, root / "cell.toml", root / "model.json", args.jobs)
        build(plant.source, args.files)
        part = chaos(plant, args.runs, args.seed)
        (root / "long").mkdir()
        (root / "long/job.pdl").write_bytes(program("job", args.targets, 1))
        run = LongRun(root / "long", plant.cell, plant.model)
        slowest = end_many(run, args.signals, args.seed)
    print(f"{args.runs} runs killed and resumed: every tree identical, no partial file")
    print(f"{part} of them were killed with some of the files written")
    print(f"{args.signals} long runs ended by a signal, the slowest in {slowest:.2f} s")


if __name__ == "__main__":
    main()
