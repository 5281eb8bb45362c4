"""Memory of a process and of those that it forks, watched from outside."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

from tests.chaos import descendants

EVERY = 1.0  # [s]; a look at 2 GiB costs 20 ms
KIBI = 1024


def watched(command: list[str], folder: Path) -> tuple[str, str, int, float]:
    """Run a command; return output, errors, exit code and its most memory [MiB].

    Pages that several of its processes share count once. What is held for less than
    `EVERY` may be missed.
    """
    most = 0.0
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        while process.poll() is None:
            most = max(most, held_mib(process.pid))
            time.sleep(EVERY)
        out, errors = process.communicate()
    return out, errors, process.returncode, most


def held_mib(pid: int) -> float:
    """Return what a process and all below it hold now [MiB]; 0 where it is gone."""
    return sum(map(_own_mib, (pid, *descendants(pid))))


def _own_mib(pid: int) -> float:
    """Return what one process holds, its share of what others hold too."""
    try:
        told = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii")
    except OSError:
        return 0.0
    (own,) = (row for row in told.splitlines() if row.startswith("Pss:"))
    return int(own.split()[1]) / KIBI
