"""A real scheduler and worker processes on loopback."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from pathlib import Path

SCHEDULER = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
WORKER = [sys.executable, "-m", "distributed.cli.dask_worker"]


class Cluster:
    """A scheduler and single-thread workers without a nanny, until the block ends."""

    def __init__(self, scratch: Path, workers: int) -> None:
        """Start them.

        Args:
            scratch: Folder for what workers put aside.
            workers: How many.
        """
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{port}"
        here = ["--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
        self._scheduler = _started([*SCHEDULER, *here])
        options = ["--nthreads", "1", "--no-nanny", "--no-dashboard"]
        place = ["--local-directory", str(scratch)]
        self.workers = [
            _started([*WORKER, self.address, *options, *place]) for _ in range(workers)
        ]

    def kill_one(self) -> None:
        """Kill the first worker."""
        self.workers[0].send_signal(signal.SIGKILL)
        self.workers[0].wait()

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        for process in (*self.workers, self._scheduler):
            process.kill()
            process.wait()


def _started(command: list[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
