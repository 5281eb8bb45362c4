"""Many short stretches of a long array, as one list of places."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


def spans(begin: Ints, count: Ints) -> Ints:
    """List begin, begin + 1, .., begin + count - 1 of every span.

    >>> spans(np.array([3, 10]), np.array([2, 3])).tolist()
    [3, 4, 10, 11, 12]
    """
    offset = np.cumsum(count) - count
    return np.repeat(begin - offset, count) + np.arange(int(count.sum()))
