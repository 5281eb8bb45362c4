"""What a fit found, for people."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.calibration.cross_validation import HeldOutError
from postproc.calibration.direction_labels import judge_directions
from postproc.calibration.expected_noise import ENOUGH_REPEATS, count_repeats
from postproc.calibration.measurements import DroppedRow, Measurements
from postproc.calibration.regression import Fit, Unseen, observe
from postproc.calibration.reversal_test import tell_open, tell_widths
from postproc.model.effects.effect import Effect
from postproc.model.kinematics import ArmStates
from postproc.model.model import FreePart, Model
from postproc.model.statistics import ErrorStatistics
from postproc.robot.arm import Arm
from postproc.robot.pose import MM

CORRELATED = 0.9
KNOWN = 1e-14  # part of its prior variance that is left at least of anything known
EXCUSED = 2.0  # standard errors by which a value may be where physics forbids it
SHOWN_UNITS = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "rad/(N m)": ("urad/(N m)", 1e6)}


@dataclass(frozen=True)
class ParameterRow:
    """One line of the parameter table, in the unit that people use.

    Attributes:
        share: Part of the squared error that it explains; shares add up.
        determined: 0 (at its prior) .. 1 (by the data alone).
    """

    name: str
    value: float
    std_error: float
    unit: str
    share: float
    determined: float


@dataclass(frozen=True)
class Found:
    """What one effect does at one joint, or along none.

    Attributes:
        effect: Its name.
        joint: 1 to 6, or None.
        size_mm: Root mean square of the TCP's displacement over the rows used.
        max_mm: The largest.
        evidence: Log of how much likelier the rows are with it than without, all else
            and the prior scales as they are [nats].
        setup: Whether it is the survey's own, and never compensated.
        impossible: Values that physics forbids, in words.
        wave: Order per turn of a single wave, its amplitude and the standard error of
            that [mrad], or None.
    """

    effect: str
    joint: int | None
    size_mm: float
    max_mm: float
    evidence: float
    setup: bool
    impossible: tuple[str, ...]
    wave: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class WrongDirection:
    """A direction of the file that is probably wrong.

    Attributes:
        id, line: The row.
        joint: 1 to 6.
        probability: That it is wrong.
    """

    id: str
    line: int
    joint: int
    probability: float


@dataclass(frozen=True)
class DirectionReport:
    """What the rows say of the directions in their file.

    Attributes:
        rate: Estimated share of wrong ones.
        telling: How many directions the rows can tell.
        turned: How many were fitted the other way.
        unsure: How many were fitted as not known.
        likeliest: Those that are likelier wrong than not, likeliest first.
    """

    rate: float
    telling: int
    turned: int
    unsure: int
    likeliest: tuple[WrongDirection, ...]


@dataclass(frozen=True)
class FreeForms:
    """What functions without a law have in the predicted errors of the rows.

    Attributes:
        names: The effects; none where named ones leave nothing to them.
        rms_mm: Root mean square over the rows of what they predict together.
        std_mm: Of its standard error.
    """

    names: tuple[str, ...] = ()
    rms_mm: float = 0.0
    std_mm: float = 0.0

    @classmethod
    def of(cls, part: FreePart) -> Self:
        """Sum up what free forms predict."""
        if not part.names:
            return cls()
        sizes = ((v**2).sum(axis=1).mean() for v in (part.error, part.std))
        rms, std = (float(np.sqrt(v) / MM) for v in sizes)
        return cls(part.names, rms, std)

    def tell(self) -> str:
        """Say it in one line."""
        if not self.names:
            return "free forms: none, the named effects predict every correction"
        names = ", ".join(self.names)
        return f"free forms ({names}): {self.rms_mm:.3f} +- {self.std_mm:.3f} mm rms"


@dataclass(frozen=True)
class FitReport:
    """Everything worth telling about a fit.

    Attributes:
        parameters: The table.
        shares: Part of the squared error explained, by effect.
        correlated: Pairs of parameters with their correlation, above 0.9.
        dropped: Rows left out or down-weighted, and why.
        spared: Ids of rows that stand out, as their neighbours do: kept.
        unseen: Directions that the rows do not determine.
        before, after: Measured errors, and what the fit leaves of them.
        tracker_mm: Estimated standard deviation of the tracker, typical, per axis.
        repeatability_mm: Estimated scatter of arrivals, typical, per axis.
        pose_mm: Estimated error of a pose that no effect describes, per axis.
        repeated: Where the repeatability comes from: "estimated", or the data sheet at
            the most, where nothing was approached twice in one way.
        split: How far stops and poses could be told apart, in words.
        effective: Effective number of parameters.
        warnings: What else to know.
        orientation_mrad: Estimated scatter of orientations about each axis, or None.
        found: What every effect does at every joint, largest first.
        directions: Wrong directions, or None where the file has none.
        free: What functions without a law predict; None for published methods.
        flanks: What reversals tell of the flanks of the joints, and what they leave
            open; "" without reversals.
        held_out: What new poses are expected to be left, None where none were held out.
        rejected: Why the model must not be used; "" where it may be.
    """

    parameters: tuple[ParameterRow, ...]
    shares: dict[str, float]
    correlated: tuple[tuple[str, str, float], ...]
    dropped: tuple[DroppedRow, ...]
    spared: tuple[str, ...]
    unseen: tuple[Unseen, ...]
    before: ErrorStatistics
    after: ErrorStatistics
    tracker_mm: float
    repeatability_mm: float
    effective: float
    warnings: tuple[str, ...]
    orientation_mrad: float | None = None
    found: tuple[Found, ...] = ()
    directions: DirectionReport | None = None
    free: FreeForms | None = None
    flanks: str = ""
    held_out: HeldOutError | None = None
    rejected: str = ""
    pose_mm: float = 0.0
    split: str = ""
    repeated: str = "estimated"


def report_fit(fit: Fit, survey: Measurements, model: Model) -> FitReport:
    """Put a fit into words and numbers.

    Args:
        fit: The fit.
        survey: Its rows.
        model: What it became.
    """
    used = fit.rows.weight > 0
    shares = _shares(fit)
    effects: dict[str, float] = {}
    for effect, part in zip(
        fit.combination.effects, fit.combination.slices, strict=True
    ):
        own = float(shares[part].sum())
        effects[effect.name] = effects.get(effect.name, 0.0) + own
    jacobian = fit.batch.jacobian
    arrival = np.sqrt(model.noise.arrival_variance(jacobian).mean())
    tracker = fit.noise.tracker_std(survey.position).mean()
    C, names = fit.covariance / np.outer(fit.std, fit.std), fit.combination.names
    pairs = np.argwhere(np.triu(np.abs(C) > CORRELATED, 1))
    return FitReport(
        parameters=_table(fit, shares),
        shares=effects,
        correlated=tuple((names[i], names[j], float(C[i, j])) for i, j in pairs),
        dropped=survey.dropped + list_downweighted(fit, survey),
        spared=tuple(survey.ids[i] for i in np.flatnonzero(fit.rows.spared)),
        unseen=observe(fit.normal().root(), fit.combination.names, floor=1.0).unseen,
        before=ErrorStatistics.of(fit.error[used]),
        after=ErrorStatistics.of(fit.residual[used]),
        tracker_mm=float(tracker / MM),
        repeatability_mm=float(arrival / MM),
        effective=fit.effective,
        warnings=survey.warnings,
        orientation_mrad=None if fit.turns is None else fit.turns.std * 1e3,
        found=find(fit),
        directions=report_directions(fit, survey),
        free=FreeForms.of(model.free_part(fit.batch.arm, fit.batch.states[used])),
        flanks="; ".join(
            filter(
                None,
                (
                    tell_widths(model.flank_widths),
                    tell_open(model, fit.batch.arm, jacobian),
                ),
            )
        ),
        pose_mm=float(np.sqrt(model.noise.pose_variance(jacobian).mean()) / MM),
        split=_split(fit),
        repeated="estimated"
        if count_repeats(fit.batch.states) >= ENOUGH_REPEATS
        else "estimated, at most the data sheet's: no approach was repeated",
    )


def _split(fit: Fit) -> str:
    """Describe which parts of the scatter the rows could tell apart."""
    stops = np.unique(fit.batch.states.order)
    repeated = count_repeats(fit.batch.states)
    if repeated >= ENOUGH_REPEATS:
        return f"by {repeated} repeated approaches"
    rows = f"{len(stops)} stops at {fit.poses} poses"
    return f"one sum with arrivals, split by the data sheet: {rows}, none twice alike"


def report_method(model: Model, survey: Measurements, arm: Arm) -> FitReport:
    """Report a method that has no named parameters."""
    error = survey.position - ArmStates(arm, survey.states).walk.tcp
    left = error - model.predict_measured(arm, survey.states)
    return FitReport(
        parameters=(),
        shares={},
        correlated=(),
        dropped=survey.dropped,
        spared=(),
        unseen=(),
        before=ErrorStatistics.of(error),
        after=ErrorStatistics.of(left),
        tracker_mm=0.0,
        repeatability_mm=0.0,
        effective=float(len(model.values)),
        warnings=survey.warnings,
    )


def report_directions(fit: Fit, survey: Measurements) -> DirectionReport | None:
    """Tell which directions of the file the fit has not believed, if any."""
    told, used = survey.states.direction, fit.batch.states.direction
    if (told == used).all():
        return None
    judged = judge_directions(fit, told)
    rows, joints = np.nonzero(judged.probability > 0.5)
    order = np.argsort(-judged.probability[rows, joints], kind="stable")
    likeliest = tuple(
        WrongDirection(
            survey.ids[i], int(survey.line[i]), int(j) + 1,
            float(judged.probability[i, j]),
        )
        for i, j in zip(rows[order], joints[order], strict=True)
    )  # fmt: skip
    changed = used != told
    turned, unsure = (
        int((changed & (used != 0)).sum()),
        int((changed & (used == 0)).sum()),
    )
    telling = int(judged.telling.sum())
    return DirectionReport(judged.rate, telling, turned, unsure, likeliest)


def find(fit: Fit) -> tuple[Found, ...]:
    """Say what every effect does at every joint, largest first."""
    c = fit.combination
    joint = np.array([p.joint or 0 for p in c.parameters])
    used = fit.rows.weight > 0
    found = []
    for effect, part in zip(c.effects, c.slices, strict=True):
        for j in np.unique(joint[part]):
            own = np.zeros(len(joint), dtype=bool)
            own[part] = joint[part] == j
            moved = fit.design.times(np.where(own, fit.values, 0.0))[used]
            size = np.linalg.norm(moved, axis=1) / MM
            found.append(
                Found(
                    effect.name, int(j) or None, float(np.sqrt((size**2).mean())),
                    float(size.max(initial=0.0)), evidence_of(fit, own),
                    effect.belongs_to() == "setup", impossible(fit, own),
                    _wave(effect, fit.values[part], fit.covariance[part, part]),
                )
            )  # fmt: skip
    return tuple(sorted(found, key=lambda f: -f.size_mm))


def _wave(
    effect: Effect, values: Floats, covariance: Floats
) -> tuple[float, float, float] | None:
    """Return order and amplitude of a single wave."""
    found = effect.amplitude(values, covariance)
    if found is None:
        return None
    order, _ = effect.nonlinear()["order"]
    return order, found[0] * 1e3, found[1] * 1e3


def evidence_of(fit: Fit, own: Bools) -> float:
    """Log ratio of the likelihoods with and without some parameters [nats].

    At fixed prior scales it is the density of the prior at 0 over that of the posterior
    (Dickey, 1971), with mean m, covariance C and prior covariance S
    (m^T C^-1 m + log |C| - log |S|) / 2.
    """
    scale = fit.prior_std[own]
    C = fit.covariance[np.ix_(own, own)] / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(C)
    values = np.clip(values, KNOWN, 1.0)
    along = vectors.T @ (fit.values[own] / scale)
    return float((along**2 / values + np.log(values)).sum() / 2)


def impossible(fit: Fit, own: Bools) -> tuple[str, ...]:
    """Name the values that physics forbids, where no doubt of the fit excuses them."""
    std, told = np.sqrt(np.diag(fit.stated)), []
    for k in np.flatnonzero(own):
        p = fit.combination.parameters[k]
        if p.positive and fit.values[k] + EXCUSED * std[k] < 0.0:
            unit, factor = SHOWN_UNITS.get(p.unit, (p.unit, 1.0))
            value, error = fit.values[k] * factor, std[k] * factor
            told.append(f"{p.name} = {value:.3g} +- {error:.2g} {unit} is negative")
    return tuple(told)


def _shares(fit: Fit) -> Floats:
    """Part of the squared error that each parameter explains, (p,)."""
    total = float((fit.error**2).sum())
    shares: Floats = fit.design.moment(fit.error) * fit.values / max(total, 1e-300)
    return shares


def _table(fit: Fit, shares: Floats) -> tuple[ParameterRow, ...]:
    rows, std = [], np.sqrt(np.diag(fit.stated))
    for k, (name, p) in enumerate(
        zip(fit.combination.names, fit.combination.parameters, strict=True)
    ):
        unit, factor = SHOWN_UNITS.get(p.unit, (p.unit, 1.0))
        known = 1.0 - (fit.std[k] / fit.prior_std[k]) ** 2
        rows.append(
            ParameterRow(
                name, float(fit.values[k] * factor), float(std[k] * factor), unit,
                float(shares[k]), float(np.clip(known, 0.0, 1.0)),
            )
        )  # fmt: skip
    return tuple(rows)


def list_downweighted(fit: Fit, survey: Measurements) -> tuple[DroppedRow, ...]:
    """List the rows that count less than fully, and why, worst first."""
    out = []
    less = np.flatnonzero(fit.rows.weight < 1.0)
    for i in less[np.argsort(-fit.rows.distance[less], kind="stable")]:
        w, d = fit.rows.weight[i], fit.rows.distance[i]
        size = np.linalg.norm(fit.residual[i]) / MM
        what = "dropped" if w == 0 else f"weight {w:.2f}"
        why = f"{what}: off by {size:.3f} mm, {d:.1f} sigma; its neighbours disagree"
        out.append(DroppedRow(survey.ids[i], int(survey.line[i]), why))
    return (*out, *_list_orientation_weights(fit, survey))


def _list_orientation_weights(fit: Fit, survey: Measurements) -> Iterator[DroppedRow]:
    """List the rows whose position counts more than their orientation."""
    if fit.turns is None:
        return
    size = np.linalg.norm(fit.turns.residual, axis=1)
    for i in np.flatnonzero((fit.turns.weight < 1.0) & (fit.rows.weight > 0)):
        w = fit.turns.weight[i]
        what = "orientation " + ("dropped" if w == 0 else f"weight {w:.2f}")
        sigma = size[i] / fit.turns.std
        why = f"{what}: off by {size[i] * 1e3:.2f} mrad, {sigma:.1f} sigma"
        yield DroppedRow(survey.ids[i], int(survey.line[i]), why)
