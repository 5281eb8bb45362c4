"""Workers that are this very process, for tests of what is around them."""

from __future__ import annotations

from concurrent.futures import Future

from postproc import __version__
from postproc.batch.workers import run_tasks


class InlinePool:
    """Does a chunk when it is given it."""

    losses = ()

    def __init__(self, setups):
        self.setups = setups
        self.tasks = []

    def lanes(self):
        return 1

    def submit(self, chunk):
        future = Future()
        self.tasks += chunk
        setup = self.setups[chunk[0].unit.setup]
        future.set_result(run_tasks(chunk, setup, __version__))
        return future

    def renew(self):
        pass

    def close(self):
        pass
