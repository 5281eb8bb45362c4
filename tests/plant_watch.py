"""What a command costs while it runs: time, CPU, and the memory of its processes."""

from __future__ import annotations

import os
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

from tests.chaos import descendants

EVERY = 2.0  # [s] between two looks
YOUNG = 60.0  # [s] after which a worker has met programs of every kind


@dataclass(frozen=True)
class Cost:
    """What a command cost.

    Attributes:
        seconds: From start to end.
        cpu: CPU of it and all its processes up to the last look at each [s].
        exit_code: How it ended.
        said: What it said on stderr.
        memory: Resident memory of every process that was seen, by process id: the
            time since the start [s] and megabytes, look by look.
    """

    seconds: float
    cpu: float
    exit_code: int
    said: str
    memory: dict[int, list[tuple[float, float]]]

    def growth(self) -> list[tuple[float, float]]:
        """Return, for the processes of the whole run, memory when young and at its end.

        Each is the largest of a tenth of the run, in megabytes: from `YOUNG`, or a
        tenth of the run where that is longer, and the last tenth.
        """
        tenth = self.seconds / 10
        begin, end = max(YOUNG, tenth), self.seconds - tenth
        found = []
        for looks in self.memory.values():
            young = [mb for at, mb in looks if begin <= at < begin + tenth]
            old = [mb for at, mb in looks if at >= end]
            if young and old:
                found.append((max(young), max(old)))
        return found


def watched(command: list[str]) -> Cost:
    """Run a command to its end and watch what it costs."""
    memory: dict[int, list[tuple[float, float]]] = {}
    cpu: dict[int, float] = {}
    start = time.monotonic()
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    while True:
        try:
            _, said = process.communicate(timeout=EVERY)
            break
        except subprocess.TimeoutExpired:
            at = time.monotonic() - start
            for pid in (process.pid, *descendants(process.pid)):
                if megabytes := resident(pid):
                    memory.setdefault(pid, []).append((at, megabytes))
                    cpu[pid] = max(cpu.get(pid, 0.0), worked(pid))
    seconds = time.monotonic() - start
    total = sum(cpu.values())
    return Cost(seconds, total, process.returncode, said, memory)


def resident(pid: int) -> float:
    """Return the resident memory of a process [MB], 0 where it is gone."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0.0
    lines = [line for line in status.splitlines() if line.startswith("VmRSS:")]
    return int(lines[0].split()[1]) / 1000 if lines else 0.0


def worked(pid: int) -> float:
    """Return the CPU that a process has used [s], 0 where it is gone.

    Not what `getrusage` says of children: workers are children of a server process
    that nobody waits for.
    """
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return 0.0
    user, system = stat.rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")
