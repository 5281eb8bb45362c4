"""Whether the libraries of the second opinion are installed, without loading them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from postproc.exceptions import PostprocError

PACKAGES = {"pinocchio": "pin", "toppra": "toppra"}  # what is imported: its package
INSTALL = "pip install pin toppra"


def missing() -> list[str]:
    """Name the packages that are not installed."""
    return [name for module, name in PACKAGES.items() if find_spec(module) is None]


def require() -> None:
    """Check that all of them are installed.

    Raises:
        PostprocError: Naming the command that installs them.
    """
    if lacks := missing():
        names = " and ".join(lacks)
        raise PostprocError(
            f"the second opinion needs {names}, not installed here: {INSTALL}"
        )


@contextmanager
def libraries() -> Iterator[None]:
    """Check that all are installed, and say so where one of them cannot be loaded.

    Raises:
        PostprocError: Naming the command that installs them.
    """
    require()
    try:
        yield
    except ImportError as exc:
        raise PostprocError(broken(exc)) from None


def broken(exc: ImportError) -> str:
    """Say that a library cannot be loaded."""
    return f"no second opinion: a library is broken ({exc}): {INSTALL}"
