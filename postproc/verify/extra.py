"""Whether the libraries of the second opinion are installed, and can be loaded."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from postproc.exceptions import PostprocError

PACKAGES = {"pinocchio": "pin", "toppra": "toppra"}  # what is imported: its package
NEEDED = {"pinocchio": "SE3", "toppra": "SplineInterpolator"}  # what each must have
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


def load() -> None:
    """Load all of them.

    Raises:
        PostprocError: One is not installed or cannot be loaded; it names the command.
    """
    require()
    if problem := explain_missing():
        raise PostprocError(problem)


def explain_missing() -> str:
    """Return why one of them cannot be loaded, or "".

    A library of another build fails by an error of any kind, and another package of
    the same name loads but has no arms.
    """
    for module, needed in NEEDED.items():
        try:
            getattr(import_module(module), needed)
        except Exception as exc:
            cause = " ".join(str(exc).split()) or type(exc).__name__
            which = f"a library is broken ({module}: {cause})"
            return f"no second opinion: {which}: {INSTALL}"
    return ""
