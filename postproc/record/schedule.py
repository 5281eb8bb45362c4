"""When a robot is to be checked again."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date, datetime, timedelta

import numpy as np
from scipy.stats import t

from postproc.record.rows import VerdictRow

FEWEST = 4  # checks from which the rate of a drift is estimated
UPPER = 0.9  # quantile of the rate that counts
LONGEST = 365  # [days]


def next_check(verdicts: Sequence[VerdictRow], tolerance_mm: float) -> date | None:
    """Return when the mean error is expected to pass a tolerance.

    What drifts as a random walk lets the mean square of the error grow in proportion to
    time: the rate is that of a line through the squares of the checks in control, and
    its upper 90 % counts.

    Args:
        verdicts: Of checks, since the last event.
        tolerance_mm: The tolerance.

    Returns:
        None where too few checks tell; today or earlier where a check is due.
    """
    told = [v for v in verdicts if v.in_control]
    if len(told) < FEWEST:
        return None
    days = np.array([datetime.fromisoformat(v.date).timestamp() / 86400 for v in told])
    square = np.array([v.mean_mm**2 for v in told])
    last, away = datetime.fromisoformat(told[-1].date).date(), days - days.mean()
    spread = float(away @ away)
    if spread < 1.0:
        return None
    slope = float(away @ square) / spread
    left = square - square.mean() - slope * away
    std = float(np.sqrt(left @ left / (len(told) - 2) / spread))
    rate = slope + float(t.ppf(UPPER, len(told) - 2)) * std
    room = tolerance_mm**2 - float(square.mean() + slope * away[-1])
    days_left = room / rate if rate > 0 else LONGEST
    return last + timedelta(days=float(np.clip(days_left, 0, LONGEST)))
