"""The process that workers are forked from.

It loads the package by itself: started first, it does so while this process loads what
it needs on its own.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from multiprocessing import forkserver, resource_tracker
from multiprocessing.context import ForkServerContext

READY = "postproc.batch.ready"

# Numerical libraries and their pools: processes use the cores, not threads.
POOLS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "RAYON_NUM_THREADS",
)


def start_server() -> ForkServerContext:
    """Start the process unless it runs already, and do not wait for it."""
    for name in POOLS:
        os.environ.setdefault(name, "1")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([READY])
    # Ctrl-C goes to the whole group, and is for us to answer. The tracker comes first:
    # starting it ends all blocking of that signal.
    resource_tracker.ensure_running()
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
    return context
