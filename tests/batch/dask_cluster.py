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
        port = free_port()
        self.address = f"tcp://127.0.0.1:{port}"
        here = ["--host", "127.0.0.1", "--no-dashboard"]
        here += ["--dashboard-address", "127.0.0.1:0"]  # an HTTP server in any case
        self._scheduler = _started([*SCHEDULER, *here, "--port", str(port)])
        options = ["--nthreads", "1", "--no-nanny", *here]
        place = ["--local-directory", str(scratch)]
        self.workers = [
            _started([*WORKER, self.address, *options, *place]) for _ in range(workers)
        ]

    @property
    def processes(self) -> tuple[subprocess.Popen[bytes], ...]:
        """Return the scheduler and its workers."""
        return (self._scheduler, *self.workers)

    def kill_one(self) -> None:
        """Kill the first worker."""
        self.workers[0].send_signal(signal.SIGKILL)
        self.workers[0].wait()

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        for process in reversed(self.processes):
            process.kill()
            process.wait()


def free_port() -> int:
    """Find a port of loopback that nothing listens at."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port: int = free.getsockname()[1]
    return port


def _started(command: list[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
