"""The native kernels, where they are installed; numpy does the same without them.

What most of a correction's time goes into is written in Rust too, in `native/`: row by
row instead of pass by pass over whole arrays. The functions in Python that they stand
for ask `native` and do the work themselves where it is None, to the last digits the
same: sums and sines may differ by a few units in the last place.

    python -m postproc.kernels      tells which of both does the work
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import wraps
from types import SimpleNamespace
from typing import Any

import numpy as np

from postproc.arrays import Floats

SOURCES = "7fc1a07984aab797"  # hash of the kernels that belong to these modules
SWITCH = "POSTPROC_KERNELS"  # environment variable: `numpy` leaves the kernels alone


def _native() -> Any:
    """Load the kernels; None where they are missing, of other sources or unwanted."""
    if os.environ.get(SWITCH, "") == "numpy":
        return None
    try:
        import postproc_kernels as built
    except ImportError:
        return None
    if getattr(built, "SOURCES", None) != SOURCES:
        return None
    functions = {k: v for k, v in vars(built).items() if callable(v)}
    return SimpleNamespace(**{k: _guarded(v) for k, v in functions.items()})


def _guarded(function: Callable[..., Any]) -> Callable[..., Any]:
    """Make a panic of native code an exception like those of numpy."""

    @wraps(function)
    def call(*args: Any) -> Any:
        try:
            return function(*args)
        except BaseException as exc:
            if type(exc).__name__ != "PanicException":
                raise
            raise RuntimeError(f"{function.__name__}: {exc}") from None

    return call


def floats(rows: Floats) -> Floats:
    """Return numbers as the kernels take them."""
    return np.ascontiguousarray(rows, dtype=float)


native = _native()

if __name__ == "__main__":
    print("numpy" if native is None else f"native kernels {SOURCES}")
