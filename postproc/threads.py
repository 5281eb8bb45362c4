"""Pools of threads: numerical libraries start none while the package computes.

For products of small matrices threads cost more than they gain: they wait for each
other, and a fit takes up to thirty times as long. Processes use the cores instead.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from postproc.operating_system import count_cores

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
R = TypeVar("R")

# The pools' sizes, as libraries read them when they are loaded.
POOLS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "RAYON_NUM_THREADS",
)


def start_no_threads() -> None:
    """Let libraries that are loaded from now on start none, here and in children.

    What the user says in the environment stays.
    """
    for name in POOLS:
        os.environ.setdefault(name, "1")
    _POOLS.stated |= "numpy" not in sys.modules


class _Pools:
    """The pools of this process, and how many calls want them small.

    The first call makes them so and the last one gives them back, whichever threads
    these run in and however deep they are nested.

    Attributes:
        stated: The environment said how large they are before they were made.
    """

    def __init__(self) -> None:
        self.stated = any(name in os.environ for name in POOLS)
        self._calls = 0
        self._controller: Any = None
        self._limits: Any = None
        self.renew()

    def renew(self) -> None:
        """Begin with a lock that nobody holds; what is limited stays so."""
        self._lock = threading.Lock()

    def limit(self) -> None:
        """Make them small."""
        with self._lock:
            self._calls += 1
            if self._calls == 1:
                self._controller = _controller()
                self._limits = self._controller.limit(limits=1)

    def give_back(self) -> None:
        """Make them as large as before, where no other call is left."""
        with self._lock:
            self._calls -= 1
            if self._calls == 0:
                self._let_any_thread()
                self._limits.restore_original_limits()
                self._let_any_thread()
                self._limits = None

    def _let_any_thread(self) -> None:
        """Let this thread give back what another one took, which is done with it.

        Newer versions of threadpoolctl let the thread alone that came first.
        """
        for library in self._controller.lib_controllers:
            if hasattr(library, "clear_controlling_thread"):
                library.clear_controlling_thread(force=True)


_POOLS = _Pools()
if hasattr(os, "register_at_fork"):  # another thread may have held the lock just then
    os.register_at_fork(after_in_child=_POOLS.renew)


def _controller() -> ThreadpoolController:
    """Find the pools of all libraries that are loaded."""
    import scipy.linalg  # noqa: F401  # its pool is its own, and must be there
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@contextmanager
def one_thread() -> Iterator[None]:
    """Let numerical libraries compute in one thread for the length of a block.

    Nothing is done where the environment states how large pools are: so they are.
    """
    if _POOLS.stated:
        yield
        return
    _POOLS.limit()
    try:
        yield
    finally:
        _POOLS.give_back()


def share_cores(processes: int) -> None:
    """Let the native core use as many threads as one of some processes has cores.

    Processes that are forked from this one from now on do the same.
    """
    from postproc import _native  # loads numpy, which reads the pools' sizes then

    _native.use_cores(max(count_cores() // processes, 1))


def in_one_thread(work: Callable[P, R]) -> Callable[P, R]:
    """Let numerical libraries compute in one thread while a function works."""

    @wraps(work)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        with one_thread():
            return work(*args, **kwargs)

    return run
