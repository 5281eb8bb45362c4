"""Natural cubic splines through the waypoints of many runs at once."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_banded

from postproc.arrays import Bools, Floats


def derivatives(s: Floats, q: Floats, begins: Bools) -> tuple[Floats, Floats]:
    """Differentiate at the waypoints the natural spline through each run.

    With the step h and the slope m of an interval, the first derivatives d satisfy
    d_i / h_i + 2 d_i (1/h_i + 1/h_i+1) + .. = 3 (m_i / h_i + m_i+1 / h_i+1), and
    2 d_0 + d_1 = 3 m_0 at a free end (de Boor: A Practical Guide to Splines,
    chapter 4); runs do not see each other.

    Args:
        s: Path positions, increasing within each run, (k,).
        q: Waypoints, (k, p).
        begins: True at the first waypoint of each run, (k,); a run has two or more.

    Returns:
        First and second derivatives, (k, p) each.
    """
    ends = np.append(begins[1:], True)
    h = np.append(np.diff(s), 1.0)
    h[ends] = 1.0
    slope = np.vstack([np.diff(q, axis=0), np.zeros((1, q.shape[1]))]) / h[:, None]
    after = np.where(ends, 0.0, 1.0 / h)  # weight of the interval after a waypoint
    before = np.append(0.0, after[:-1])
    bands = np.zeros((3, len(s)))
    bands[0, 1:], bands[1], bands[2, :-1] = after[:-1], 2 * (before + after), before[1:]
    pull = after[:, None] * slope
    right = 3 * (pull + np.vstack([np.zeros((1, q.shape[1])), pull[:-1]]))
    first = np.asarray(solve_banded((1, 1), bands, right))
    following = np.vstack([first[1:], first[-1:]])
    second = (6 * slope - 4 * first - 2 * following) / h[:, None]
    last = np.flatnonzero(ends)
    before_last = slope[last - 1] * 6 - 2 * first[last - 1] - 4 * first[last]
    second[last] = -before_last / h[last - 1, None]
    return first, second
