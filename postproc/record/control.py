"""Whether an arm is as it was: a check against all that was known before it.

Readings are compared with what the survey and all checks since expect of them, so that
what a survey left at a pose, and what comes again every month, is no alarm. Two tests
share the false alarms: Hotelling's T2 of one check, and an exponentially weighted
moving average over checks of what each cause explains (Lowry et al., A multivariate
exponentially weighted moving average control chart, Technometrics 34, 1992).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import chi2

from postproc.arrays import Bools, Floats
from postproc.record.causes import (
    Change,
    Shown,
    alike,
    causes_of,
    least_found,
    limit_of,
    project,
    readings_of,
    weigh,
)
from postproc.record.check_rows import CheckRows
from postproc.record.events import Event
from postproc.record.knowledge import Expected, Knowledge
from postproc.robot.pose import MM

FALSE_ALARMS = 0.01  # of checks of an arm that is as it was, both tests together
NEW = 0.3  # weight of the newest check in the average
DRAWS, SEED = 20_000, 9283  # of the law of the largest average
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
        found: Least change of every cause that is found in 95 %, in words.
        blind: Causes that this check cannot see.
        alike: Pairs of causes that it cannot tell apart.
    """

    statistic: float
    limit: float
    free: int
    drift: float
    drift_limit: float
    errors: Floats
    shown: tuple[Shown, ...]
    found: dict[str, float]
    blind: tuple[str, ...]
    alike: tuple[tuple[str, str], ...]

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
        averages: Of what every cause explains, by name.
        share: Sum of the squared weights in them.
        squares, free: Sum of T2 of checks in control, and of degrees of freedom.
    """

    knowledge: Knowledge
    averages: dict[str, Floats] = field(default_factory=dict)
    share: float = 0.0
    squares: float = 0.0
    free: float = 0.0

    @property
    def scale(self) -> float:
        """Variance of readings over what is expected of it, by checks so far."""
        return max(1.0, (TRUSTED + self.squares) / (TRUSTED + self.free))

    def after(self, event: Event) -> Watch:
        """Return what is left of it after an event: averages begin again."""
        knowledge = self.knowledge.after(event)
        return replace(self, knowledge=knowledge, averages={}, share=0.0)

    def judge(self, rows: CheckRows) -> tuple[CheckVerdict, Watch]:
        """Judge a check, and take it in where it is in control."""
        knowledge = self.knowledge.visiting(rows)
        expected, scale = knowledge.expect(rows), self.scale
        causes = causes_of(knowledge.model)
        averages, share = self._average(causes, expected)
        drift, drift_limit = self._drift(causes, expected, averages, share)
        limit = limit_of(expected.free, FALSE_ALARMS / 2, TRUSTED + self.free)
        statistic = expected.statistic / scale
        ranked = weigh([*causes, *readings_of(rows.ids)], expected, scale)
        found = {c.name: least_found(c, expected, limit, scale) for c in causes}
        verdict = CheckVerdict(
            statistic, limit, expected.free, drift, drift_limit,
            errors_of(expected, rows), tuple(ranked), found,
            tuple(name for name, least in found.items() if not np.isfinite(least)),
            _confusable(causes, expected),
        )  # fmt: skip
        if not verdict.in_control:
            return verdict, self
        return verdict, self._with(rows, expected, averages, share)

    def take_in(self, rows: CheckRows) -> Watch:
        """Take in a check that is in control, or was read for a new model."""
        knowledge = self.knowledge.visiting(rows)
        expected = knowledge.expect(rows)
        averages, share = self._average(causes_of(knowledge.model), expected)
        return self._with(rows, expected, averages, share)

    def _with(
        self,
        rows: CheckRows,
        expected: Expected,
        averages: dict[str, Floats],
        share: float,
    ) -> Watch:
        return Watch(
            self.knowledge.update(rows), averages, share,
            self.squares + expected.statistic, self.free + expected.free,
        )  # fmt: skip

    def _average(
        self, causes: Sequence[Change], expected: Expected
    ) -> tuple[dict[str, Floats], float]:
        """Average what the causes explain, each with unit variance in each check."""
        averages = {}
        for cause in causes:
            u, B = project(cause, expected)
            own = _whiten(B) @ u / np.sqrt(self.scale)
            before = self.averages.get(cause.name, np.zeros(len(own)))
            averages[cause.name] = (1.0 - NEW) * before + NEW * own
        return averages, (1.0 - NEW) ** 2 * self.share + NEW**2

    def _drift(
        self, causes: Sequence[Change], expected: Expected, averages: dict[str, Floats],
        share: float,
    ) -> tuple[float, float]:  # fmt: skip
        """Return the largest average and its limit, as minus log of chance.

        The causes overlap, and the scatter of readings is known from few: the law of
        the largest average is drawn.
        """
        root, sure = _root(expected.precision), TRUSTED + self.free
        rng = np.random.default_rng(SEED)
        draws = rng.standard_normal((DRAWS, root.shape[1]))
        draws /= np.sqrt(rng.chisquare(sure, DRAWS) / sure)[:, None]
        largest, seen = np.zeros(DRAWS), 0.0
        for cause in causes:
            known = _whiten(project(cause, expected)[1]) @ cause.columns(expected).T
            drawn = ((draws @ (known @ root).T) ** 2).sum(axis=1)
            free = int(np.linalg.matrix_rank(known @ root))
            if not free:
                continue
            largest = np.maximum(largest, -chi2.logsf(drawn, free))
            square = float((averages[cause.name] ** 2).sum()) / share
            seen = max(seen, -float(chi2.logsf(square, free)))
        return seen, float(np.quantile(largest, 1.0 - FALSE_ALARMS / 2))


def _whiten(B: Floats) -> Floats:
    """Return W with W B W' = 1 on what shows at all, (r, r)."""
    size, axes = np.linalg.eigh(B)
    shows = size > 1e-9 * max(float(size.max(initial=0.0)), 1e-300)
    scale = np.where(shows, 1.0 / np.sqrt(np.where(shows, size, 1.0)), 0.0)
    return np.asarray((axes * scale) @ axes.T)


def _root(M: Floats) -> Floats:
    """Return Q with Q Q' = M, (m, f)."""
    size, axes = np.linalg.eigh(M)
    kept = size > 1e-9 * size.max()
    return np.asarray(axes[:, kept] * np.sqrt(size[kept]))


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


def _confusable(
    causes: Sequence[Change], expected: Expected
) -> tuple[tuple[str, str], ...]:
    """List pairs of single causes that a check cannot tell apart."""
    single = [c for c in causes if "motor" not in c.name and "gear" not in c.name]
    return tuple(
        (one.name, other.name)
        for k, one in enumerate(single)
        for other in single[k + 1 :]
        if alike(one, other, expected)
    )
