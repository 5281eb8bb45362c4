"""Fixed points that the tracker read in between: what moves there is the tracker's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Floats, Ints
from postproc.calibration.evidence import Normal, maximise
from postproc.calibration.text_table import TextTable
from postproc.exceptions import MeasurementError
from postproc.model.effects.base_shift import rigid_motions
from postproc.model.effects.tracker_drift import TrackerDrift
from postproc.model.noise import TRACKER_FIXED
from postproc.robot.pose import MM

# Readings of fixed points, as files hold them.

REFERENCE = "reference"
NOT, UNNAMED = ("", "0", "0.0", "false"), ("1", "1.0", "true")
POSITION = ("x_mm", "y_mm", "z_mm")
ONE_POINT = 5e-3  # [m] readings that lie further apart are of several points


@dataclass(frozen=True, eq=False)
class ReferenceRows:
    """Readings of fixed points (monuments), in the frame of the survey's positions.

    Attributes:
        path: The file (the first of several).
        name: Monument of every reading, (m,).
        position: (m, 3) [m].
        time: [s], NaN where it was not recorded, (m,).
        order: Place among the survey's rows, (m,).
        line: 1-based line, (m,).
    """

    path: Path
    name: tuple[str, ...]
    position: Floats
    time: Floats
    order: Floats
    line: NDArray[np.int64]

    def __getitem__(self, rows: Bools) -> ReferenceRows:
        """Return some of the readings."""
        return ReferenceRows(
            self.path,
            tuple(n for n, kept in zip(self.name, rows, strict=True) if kept),
            self.position[rows], self.time[rows], self.order[rows], self.line[rows],
        )  # fmt: skip

    @property
    def which(self) -> NDArray[np.int64]:
        """Number of every reading's monument, (m,)."""
        return np.unique(np.array(self.name), return_inverse=True)[1]


def is_reference(table: TextTable) -> Bools:
    """Tell which rows of a table are readings of a fixed point, (n,)."""
    if not table.has(REFERENCE):
        return np.zeros(len(table), dtype=bool)
    return np.array([t.lower() not in NOT for t in table.text(REFERENCE)], dtype=bool)


def split_references(table: TextTable) -> tuple[TextTable, ReferenceRows | None]:
    """Part the rows of the arm from the readings of fixed points.

    Raises:
        MeasurementError: A reading without coordinates, or nothing but such readings.
    """
    fixed = is_reference(table)
    if not fixed.any():
        return table, None
    if fixed.all():
        cure = "Put the rows of the arm into the same file"
        raise MeasurementError(table.path, "has rows on monuments only", cure)
    some, arm = _rows(table, fixed), _rows(table, ~fixed)
    some.require(*POSITION)
    for column in POSITION:
        empty = np.isnan(some.numbers(column, empty=True))
        if empty.any():
            raise MeasurementError(
                some.path,
                f"a row on a monument has no {column}",
                "Fill it in or remove the row",
                line=int(some.line[np.argmax(empty)]),
            )
    names = [t.lower() for t in some.text(REFERENCE)]
    unknown = np.full(len(some), np.nan)
    time = some.numbers("time_s", empty=True) if some.has("time_s") else unknown
    position = some.block(POSITION) * MM
    between = np.cumsum(~fixed, dtype=float)[fixed] - 0.5
    order = some.numbers("order") if some.has("order") else between
    rows = ReferenceRows(
        table.path,
        tuple("1" if n in UNNAMED else n for n in names),
        position, time, order, some.line,
    )  # fmt: skip
    return arm, rows


def _rows(table: TextTable, which: Bools) -> TextTable:
    return replace(table, cells=table.cells[which], line=table.line[which])


def join_references(
    parts: Sequence[tuple[ReferenceRows | None, float]],
) -> ReferenceRows | None:
    """Put the readings of several files one after the other.

    Args:
        parts: Readings of every file, and by how much their order moves.
    """
    found = []
    for rows, offset in parts:
        if rows is not None:
            found.append(replace(rows, order=rows.order + offset))
    if not found:
        return None
    return ReferenceRows(
        found[0].path,
        tuple(n for rows in found for n in rows.name),
        np.concatenate([rows.position for rows in found]),
        np.concatenate([rows.time for rows in found]),
        np.concatenate([rows.order for rows in found]),
        np.concatenate([rows.line for rows in found]),
    )


def check_references(rows: ReferenceRows) -> None:
    """Refuse readings that tell nothing of a drift.

    Raises:
        MeasurementError: A point that was read once, or whose readings lie apart.
    """
    for k in np.unique(rows.which):
        own = np.flatnonzero(rows.which == k)
        name, line = rows.name[own[0]], int(rows.line[own[0]])
        if len(own) == 1:
            raise MeasurementError(
                rows.path,
                f"monument {name!r} was read once, which shows no drift",
                "Read it several times during the survey, or remove the row",
                line=line,
            )
        away = rows.position[own] - rows.position[own[0]]
        far = np.linalg.norm(away, axis=1)
        if far.max() > ONE_POINT:
            raise MeasurementError(
                rows.path,
                f"monument {name!r} is {far.max() / MM:.1f} mm from its place in line "
                f"{line}",
                "Give every monument a name of its own in column reference",
                line=int(rows.line[own[np.argmax(far)]]),
            )


# What they say of the tracker.

NATS = 3.0  # that a drift must be worth: 20 to 1
COVERED = 0.8  # of the survey that the readings must span
UNSEEN = 0.3  # of the survey that may pass between two of them
SURE = 3.0  # standard errors that what counts as the arm's must stand above
APART = 0.1  # [m] that fixed points lie apart which show a turn
JUMPS = np.repeat([1e-4, 3e-5], 3)  # [m], [rad] prior scales of a jump
PASSES = 20


@dataclass(frozen=True, eq=False)
class TrackerMotion:
    """What readings of fixed points say of the tracker's drift.

    Attributes:
        drift: The form of the drift.
        jump: When the tracker was knocked, by the drift's clock, between the two
            readings that show it; None where it was not.
        center: Middle of the fixed points, (3,) [m]; turns are about it.
        values: Parameters of the drift, all 0 where none shows, (p,).
        nats: Log evidence of a drift over that of none.
        unsure: Standard error of a steady drift over the whole survey [m].
        covered: Share of the survey that the readings span.
        unseen: Largest share of the survey that passes between two readings.
        points: Number of fixed points.
        rank: Directions that they span: 0, 1, or 2, which tell all turns.
        readings: Number of readings.
    """

    drift: TrackerDrift
    jump: float | None
    center: Floats
    values: Floats
    nats: float
    unsure: float
    covered: float
    unseen: float
    points: int
    rank: int
    readings: int

    @property
    def drifts(self) -> bool:
        """Whether the tracker moved."""
        return self.nats >= NATS

    @property
    def stands(self) -> bool:
        """Whether the tracker was watched over the survey and did not move."""
        return self.is_watched and not self.drifts

    @property
    def is_watched(self) -> bool:
        """Whether the tracker was watched all along the survey."""
        return self.covered >= COVERED and self.unseen <= UNSEEN

    def move(self, passed: Floats, position: Floats) -> Floats:
        """Return what the drift adds to readings at positions (n, 3), (n, 3) [m]."""
        motions = rigid_motions(position - self.center)
        slow = self.drift.in_time(passed, motions)
        return np.asarray(_with_jump(slow, self.jump, passed, motions) @ self.values)

    def leaves(self, peak: float) -> bool:
        """Tell whether what passes with time by a peak [m] is not the tracker's.

        A tracker that moves, and whose turns nobody sees, may have turned.
        """
        turns_seen = self.is_watched and self.rank == 2
        return bool((self.stands or turns_seen) and peak > SURE * self.unsure)

    @property
    def peak_mm(self) -> float:
        """How far the middle of the points seemed to move [mm]."""
        return float(np.linalg.norm(self._at_points, axis=1).max()) / MM

    @property
    def statistics(self) -> dict[str, float]:
        """Figures for a model file."""
        return {
            "reference_readings": float(self.readings),
            "reference_points": float(self.points),
            "reference_drift_mm": self.peak_mm if self.drifts else 0.0,
            "reference_unsure_mm": self.unsure / MM,
        }

    def tell(self) -> tuple[str, ...]:
        """Say in words what was found."""
        found = f"moved by up to {self.peak_mm:.4f} mm; the rows are corrected for it"
        if not self.drifts:
            found = "did not move while they were read"
        if self.stands:
            found = f"did not move (detectable: {self.unsure / MM:.4f} mm per axis)"
        told = [
            f"{self.readings} readings of {self.points} monuments: the tracker " + found
        ]
        if self.jump is not None:
            told.append(
                f"the tracker jumped at {self.drift.clock} {self.jump:g}, between two "
                "readings of monuments: rows near it may have a lower weight"
            )
        if self.rank < 2:
            which = "turns" if self.rank == 0 else "turn about their line"
            cure = "measure three monuments that are not on one line"
            told.append(f"the tracker's {which} cannot be determined: {cure}")
        if self.covered < COVERED:
            told.append(
                f"the readings of monuments span {self.covered:.0%} of the survey: "
                "the tracker's motion during the rest is not known"
            )
        elif not self.is_watched:
            told.append(
                f"{self.unseen:.0%} of the survey lie between two readings of "
                "monuments: the tracker's motion meanwhile is not known. Measure a "
                "monument every 20 rows or so"
            )
        return tuple(told)

    @property
    def _at_points(self) -> Floats:
        """Return the drift at the middle of the points all along, (k, 3) [m]."""
        passed = self.drift.start + self.drift.duration * np.linspace(0, 1, 21)
        return self.move(passed, np.tile(self.center, (21, 1)))


def exclude_effects(motion: TrackerMotion | None) -> tuple[str, ...]:
    """Name the effects that readings of fixed points, if there are any, rule out."""
    return (TrackerDrift.name,) if motion is not None and motion.stands else ()


def tracker_motion(rows: ReferenceRows, time: Floats, order: Floats) -> TrackerMotion:
    """Fit the tracker's drift to readings of fixed points.

    Every point stands where the mean of its readings is; what its readings do in time
    is a rigid motion of the tracker's frame, with prior scale and noise by marginal
    likelihood, and none where the evidence does not call for it.

    Args:
        rows: The readings.
        time: Of the arm's rows, (n,) [s], NaN where not recorded.
        order: Of the arm's rows, (n,).
    """
    check_references(rows)
    timed = not (np.isnan(time).any() or np.isnan(rows.time).any())
    own, other = (rows.time, time) if timed else (rows.order, order)
    start = float(min(own.min(), other.min()))
    span = max(float(max(own.max(), other.max())) - start, 1e-9)
    drift = TrackerDrift(start, span, "time" if timed else "order")
    which = rows.which
    places = np.stack(
        [rows.position[which == k].mean(axis=0) for k in np.unique(which)]
    )
    center = places.mean(axis=0)
    motions = rigid_motions(places[which] - center)
    y = _about_mean(rows.position, which).reshape(-1)
    free = 3.0 * (len(own) - len(places))
    slow = drift.in_time(own, motions)

    def fit_motion(jump: float | None) -> tuple[Floats, float, float]:
        """Fit one form of motion: values, nats and noise."""
        columns = _about_mean(_with_jump(slow, jump, own, motions), which)
        smooth, sudden = (np.array([p.scale for p in drift.parameters()]), JUMPS)
        scales = smooth if jump is None else np.concatenate([smooth, sudden])
        group = np.repeat([0, 1], [len(smooth), len(scales) - len(smooth)])
        values, nats, sigma = _fit(columns.reshape(len(y), -1) * scales, y, free, group)
        return values * scales, nats, sigma

    jump, (values, nats, sigma) = None, fit_motion(None)
    moments = np.unique(own)
    knocked = {t: fit_motion(t) for t in ((moments[1:] + moments[:-1]) / 2).tolist()}
    if knocked:
        likeliest = max(knocked, key=lambda t: knocked[t][1])
        at_once, more, scatter = knocked[likeliest]
        more -= float(np.log(len(knocked)))  # any moment was as likely beforehand
        if more > nats + NATS:
            jump, values, nats, sigma = likeliest, at_once, more, scatter
    spread = _about_mean((own - start)[:, None] / span, which)
    steady = float(np.sqrt((spread**2).sum()))
    covers = float(np.ptp(own)) / max(float(np.ptp(other)), 1e-9)
    apart = float(np.diff(np.sort(own)).max()) / max(float(np.ptp(other)), 1e-9)
    size = np.linalg.svd(places - center, compute_uv=False)
    return TrackerMotion(
        drift, jump, center, values if nats >= NATS else 0.0 * values, nats,
        sigma / max(steady, 1e-9), covers, apart, len(places),
        int((size > APART).sum()), len(own),
    )  # fmt: skip


def _with_jump(
    slow: Floats, jump: float | None, passed: Floats, motions: Floats
) -> Floats:
    """Put six motions (n, 3, 6) after a jump beside a slow drift's (n, 3, p)."""
    if jump is None:
        return slow
    after = np.where((passed > jump)[:, None, None], motions, 0.0)
    return np.concatenate([slow, after], axis=2)


def _about_mean(values: Floats, which: NDArray[np.int64]) -> Floats:
    """Take from values (m, ..) the mean of each fixed point's."""
    out = np.array(values, dtype=float)
    for k in np.unique(which):
        out[which == k] -= out[which == k].mean(axis=0)
    return out


def _fit(X: Floats, y: Floats, free: float, group: Ints) -> tuple[Floats, float, float]:
    """Fit scaled columns (m, p) to readings (m,), noise and prior scales unknown.

    Args:
        X: Columns.
        y: Readings.
        free: Degrees of freedom of the readings.
        group: Which columns share a prior scale, (p,).

    Returns:
        Values (p,), nats over those of no column, noise [m].
    """
    gram, moment, square = X.T @ X, X.T @ y, float(y @ y)

    def normal(sigma: float) -> Normal:
        v = sigma**2
        noise = free * float(np.log(v))
        return Normal(gram / v, moment / v, square / v, noise, free)

    scale = np.zeros(int(group.max()) + 1)
    sigma = still = _noise(square, free)
    for _ in range(PASSES):
        found = maximise(normal(sigma), group, scale)
        left = y - X @ found.mean
        before, scale = sigma, found.log_scale
        sigma = _noise(float(left @ left), free - found.effective)
        if abs(np.log(sigma / before)) < 1e-3:
            break
    found = maximise(normal(sigma), group, scale)
    alone = normal(still)
    none = alone.log_noise + alone.square + free * np.log(2 * np.pi)
    return found.mean, found.log_evidence + 0.5 * none, sigma


def _noise(square: float, free: float) -> float:
    """Estimate the noise, no less than a tracker's data sheet says, per axis [m]."""
    return max(float(np.sqrt(square / max(free, 1.0))), TRACKER_FIXED)
