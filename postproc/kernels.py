"""The native kernels, where they are installed; numpy does the same without them.

What most of a correction's time goes into is written in Rust too, in `native/`: row by
row instead of pass by pass over whole arrays. The functions in Python that they stand
for ask `native` and do the work themselves where it is None, to the last digits the
same: sums and sines may differ by a few units in the last place.
"""

from __future__ import annotations

import os
from typing import Any

INTERFACE = 3  # of the kernels that these modules were written for
SWITCH = "POSTPROC_KERNELS"  # environment variable: `numpy` leaves the kernels alone


def _native() -> Any:
    """Load the kernels; None where they are missing, of other sources or unwanted."""
    if os.environ.get(SWITCH, "") == "numpy":
        return None
    try:
        import postproc_kernels
    except ImportError:
        return None
    return postproc_kernels if postproc_kernels.INTERFACE == INTERFACE else None


native = _native()
