"""Workers on other machines: a Dask cluster that somebody else has started.

Sources go out as bytes and results come back as bytes, so that workers need no disk of
ours. What a lost worker had is done by another one; that is the scheduler's work.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from importlib.util import find_spec
from time import monotonic
from typing import Any

from postproc import __version__
from postproc.batch.plan import JobSetup, Result
from postproc.batch.workers import Chunk, Working, run_tasks
from postproc.exceptions import PostprocError

CONNECT = 30.0  # [s] in which the scheduler and a first worker must answer
COUNT = 2.0  # [s] between two looks at how many workers there are

_one_at_a_time = threading.Lock()


class ClusterPool:
    """The workers of a Dask cluster."""

    losses: tuple[type[BaseException], ...]

    def __init__(self, setups: Sequence[JobSetup], address: str) -> None:
        """Connect to a scheduler, with the certificates that Dask's configuration has.

        Args:
            setups: What units mean by their `setup`.
            address: For instance ``tls://host:8786``.

        Raises:
            PostprocError: Dask is not installed, or nobody answers.
        """
        if find_spec("distributed") is None:
            raise PostprocError(
                "A Dask scheduler needs: pip install 'postproc[cluster]'"
            )
        from distributed import KilledWorker

        self.losses = (KilledWorker,)
        try:
            self._client = _connect(address)
        except (OSError, ValueError, RuntimeError) as exc:
            raise PostprocError(
                f"{address}: no scheduler with workers answers ({exc}). Start them as "
                "docs/cluster.md says, with TLS and --host, which keeps others out"
            ) from None
        self._pool = self._client.get_executor(pure=False)
        # As results of tasks, they are made again when the worker that has them is
        # lost, and every worker fetches them once.
        self._setups = [
            self._client.submit(_keep, setup, key=f"setup-{setup.digest}")
            for setup in setups
        ]
        self._counted, self._lanes = -COUNT, 1

    def lanes(self) -> int:
        """Return the number of workers; they may come and go."""
        if monotonic() - self._counted >= COUNT:
            self._lanes = max(len(self._client.nthreads()), 1)
            self._counted = monotonic()
        return self._lanes

    def submit(self, chunk: Chunk) -> Working:
        """Give a chunk to the cluster."""
        setup = self._setups[chunk[0].unit.setup]
        future: Working = self._pool.submit(_run, chunk, setup, __version__)
        return future

    def renew(self) -> None:
        """Do nothing: the cluster replaces its workers."""

    def close(self) -> None:
        """Take back what is not done, and leave the cluster as it was."""
        self._pool.shutdown(wait=False)
        self._client.close(timeout=CONNECT)


def _connect(address: str) -> Any:
    """Connect to a scheduler, and wait for its first worker.

    Raises:
        OSError, ValueError, RuntimeError: Nobody answers, or a certificate is missing.
    """
    from distributed import Client
    from distributed.security import Security

    class OwnClient(Client):  # type: ignore[misc]
        """A client that only we close: one that never connected hangs over it."""

        def __del__(self) -> None:
            """Leave it."""

    security = Security()
    context = security.get_connection_args("client").get("ssl_context")
    if address.startswith("tls:") and context is None:
        raise ValueError(
            "tls:// needs certificates: name them in the configuration of Dask"
        )
    client = OwnClient(
        address, timeout=CONNECT, security=security, set_as_default=False
    )
    client.wait_for_workers(1, timeout=CONNECT)
    return client


def _keep(setup: JobSetup) -> JobSetup:
    """Have a setup at hand in a worker."""
    return setup


def _run(chunk: Chunk, setup: JobSetup, version: str) -> list[Result]:
    """Do a chunk in a worker: one at a time in a process, whatever its threads."""
    with _one_at_a_time:
        return run_tasks(chunk, setup, version)
