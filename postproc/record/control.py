"""Whether an arm is as it was: a check against all that was known before it.

Readings are compared with what the survey and all checks since expect of them, so that
what a survey left at a pose, and what comes again every month, is no alarm. Two tests
share the false alarms: Hotelling's T2 of one check, and `Averages` over checks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.record.averages import NO_AVERAGES, Averages
from postproc.record.causes import (
    Change,
    Power,
    Shown,
    causes_of,
    limit_of,
    readings_of,
    weigh,
)
from postproc.record.check_rows import CheckRows
from postproc.record.events import Event
from postproc.record.knowledge import Expected, Knowledge
from postproc.robot.pose import MM

FALSE_ALARMS = 0.01  # of checks of an arm that is as it was, both tests together
TRUSTED = 60.0  # degrees of freedom that the expected variance counts as
CLOSE = 3.0  # nats within which another cause may be it as well


@dataclass(frozen=True, eq=False)
class CheckVerdict:
    """What a check says of an arm.

    Attributes:
        statistic, limit: Of T2, scaled to the scatter of earlier checks.
        free: Its degrees of freedom.
        drift, drift_limit: The largest average of the causes, as the log of the
            odds that chance exceeds it, and its limit.
        errors: Lengths of what is left of the readings of the arm, (n,) [m].
        shown: Causes, the likeliest first, with readings that may have gone wrong.
        power: What the check can tell.
    """

    statistic: float
    limit: float
    free: int
    drift: float
    drift_limit: float
    errors: Floats
    shown: tuple[Shown, ...]
    power: Power

    @property
    def in_control(self) -> bool:
        """Whether neither test raises an alarm."""
        return self.statistic <= self.limit and self.drift <= self.drift_limit

    @property
    def likely(self) -> tuple[Shown, ...]:
        """The likeliest cause, and others that may be it as well."""
        best = self.shown[0].nats
        return tuple(s for s in self.shown if s.nats > best - CLOSE)

    @property
    def mean_mm(self) -> float:
        """Mean of the errors [mm]."""
        return float(self.errors.mean()) / MM

    @property
    def within_mm(self) -> float:
        """What 95 % of the errors lie within [mm]."""
        return float(np.quantile(self.errors, 0.95)) / MM

    @property
    def worst_mm(self) -> float:
        """The largest error [mm]."""
        return float(self.errors.max()) / MM


@dataclass(frozen=True, eq=False)
class Watch:
    """A robot under control: what is known, and how it has been in checks so far.

    Attributes:
        knowledge: Of the arm.
        averages: Of what every cause explains.
        squares, free: Sum of T2 of checks in control, and of degrees of freedom.
    """

    knowledge: Knowledge
    averages: Averages = NO_AVERAGES
    squares: float = 0.0
    free: float = 0.0

    @property
    def scale(self) -> float:
        """Variance of readings over what is expected of it, by checks so far."""
        return max(1.0, (TRUSTED + self.squares) / self.certainty)

    @property
    def certainty(self) -> float:
        """Degrees of freedom from which that variance is known."""
        return TRUSTED + self.free

    def after(self, event: Event) -> Watch:
        """Return what is left of it after an event: averages begin again."""
        return replace(
            self, knowledge=self.knowledge.after(event), averages=NO_AVERAGES
        )

    def judge(self, rows: CheckRows) -> tuple[CheckVerdict, Watch]:
        """Judge a check, and take it in where it is in control."""
        expected = self.knowledge.visiting(rows).expect(rows)
        causes, averages = self._average(expected)
        drift, drift_limit = averages.test(
            causes, expected, self.certainty, FALSE_ALARMS / 2
        )
        limit = self._limit(expected)
        ranked = weigh([*causes, *readings_of(rows.ids)], expected, self.scale)
        verdict = CheckVerdict(
            expected.statistic / self.scale, limit, expected.free, drift, drift_limit,
            errors_of(expected, rows), tuple(ranked),
            Power.of(causes, expected, limit, self.scale),
        )  # fmt: skip
        if not verdict.in_control:
            return verdict, self
        return verdict, self._with(rows, expected, averages)

    def foresee(self, rows: CheckRows) -> Power:
        """Say what a check can tell, whatever its readings are."""
        expected = self.knowledge.visiting(rows).expect(rows)
        causes = causes_of(self.knowledge.model)
        return Power.of(causes, expected, self._limit(expected), self.scale)

    def take_in(self, rows: CheckRows) -> Watch:
        """Take in a check that is in control, or was read for a new model."""
        expected = self.knowledge.visiting(rows).expect(rows)
        return self._with(rows, expected, self._average(expected)[1])

    def _limit(self, expected: Expected) -> float:
        """Return the limit of T2."""
        return limit_of(expected.free, FALSE_ALARMS / 2, self.certainty)

    def _average(self, expected: Expected) -> tuple[tuple[Change, ...], Averages]:
        """Return the causes, and the averages of what they explain up to a check."""
        causes = causes_of(self.knowledge.model)
        return causes, self.averages.add(causes, expected, self.scale)

    def _with(self, rows: CheckRows, expected: Expected, averages: Averages) -> Watch:
        """Return it with a check."""
        return Watch(
            self.knowledge.update(rows), averages, self.squares + expected.statistic,
            self.free + expected.free,
        )  # fmt: skip


def errors_of(
    expected: Expected, rows: CheckRows, counted: Bools | None = None
) -> Floats:
    """Return the lengths of what is left of the arm's readings, (n,) [m].

    The tracker is where the fixed points and the readings that count have it.

    Args:
        expected: The readings.
        rows: The check.
        counted: Rows of the arm that count for that, (n,); None: all.
    """
    left, G = expected.left, rows.placing
    if G.shape[1]:
        weight = 1.0 / np.sqrt(np.diag(rows.noise))
        if counted is not None:
            weight[: 3 * len(rows)] *= np.repeat(counted, 3)
        placed = np.linalg.lstsq(G * weight[:, None], left * weight)[0]
        left = left - G @ placed
    return np.asarray(np.linalg.norm(left[: 3 * len(rows)].reshape(-1, 3), axis=1))
