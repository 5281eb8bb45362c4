"""What a diagnosis says, and where a residual lives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.cross_validation import HeldOutError
from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.model_update import FrameShift
from postproc.calibration.diagnosis.score import LENGTHS, ResidualTest
from postproc.calibration.measurements import DroppedRow
from postproc.calibration.regression import Fit
from postproc.calibration.report import DirectionReport
from postproc.model.covariate import covariate, unit
from postproc.model.effects import BY_NAME, EFFECTS
from postproc.model.effects.effect import Candidate, Effect, Family
from postproc.model.kinematics import ArmStates
from postproc.model.statistics import ErrorStatistics
from postproc.robot.pose import MM

# What a diagnosis says.

Verdict = Literal["effect", "noise", "unexplained", "rejected"]


@dataclass(frozen=True)
class Finding:
    """An effect that the given model lacked.

    Attributes:
        effect: Name.
        joint: Joint 1 to 6, or None.
        nameless: Whether it only says that something is there, not what.
        of_setup: Whether it is, or may be, the set-up's: then it is not compensated.
        source: Joint or covariate that drives it, or None.
        p_value: Probability that noise alone looks like it anywhere in the library.
        evidence: Log marginal likelihood ratio with and without it [nats].
        share: Part of the residual's variance that it explains.
        peak_mm: Largest displacement over the rows.
        parameters: Value, standard error and unit by name, units people use.
        confusable_with: Names (effect, joint) that explain the same within a few nats.
        settings: What is not linear: order, row, time constant and the like.
        held_out_gain: Fall of the squared held-out error per row, in noise variances,
            and its standard error.
        impossible: Values of it that physics forbids, in words.
        family: What it is called: of a cell without a name its place and driver.
        rivals: The same of all that explain the same, those without a name too.
        told: Place, driver, law and size of what has no name.
    """

    effect: str
    joint: int | None
    nameless: bool
    of_setup: bool
    source: str | None
    p_value: float
    evidence: float
    share: float
    peak_mm: float
    parameters: dict[str, tuple[float, float, str]]
    confusable_with: tuple[tuple[str, int | None], ...]
    settings: dict[str, Any]
    held_out_gain: tuple[float, float]
    impossible: tuple[str, ...] = ()
    family: Family | None = None
    rivals: tuple[Family, ...] = ()
    told: str = ""

    @property
    def lawful(self) -> bool:
        """Whether it is a cause with a law, and no function that may have any shape."""
        return not (self.nameless or BY_NAME[self.effect].free)

    def to_dict(self) -> dict[str, Any]:
        """Return the finding as plain data."""
        return {
            "effect": self.effect,
            "joint": self.joint,
            "source": self.source,
            "p_value": self.p_value,
            "share": self.share,
            "peak_mm": self.peak_mm,
            "parameters": {k: list(v) for k, v in self.parameters.items()},
            "confusable_with": [
                {"effect": effect, "joint": joint}
                for effect, joint in self.confusable_with
            ],
            "told": self.told,
            "group": [str(family) for family in self.rivals],
            "kept": True,
            "setup_effects": self.of_setup,
            "impossible": list(self.impossible),
        }


@dataclass(frozen=True)
class ResidualPlace:
    """Where a residual lives: one direction, one covariate, and how clearly.

    Attributes:
        direction: ``joint 3``, ``base x``, ``tool z``, or the name of an effect.
        driver: The covariate.
        evidence: [nats].
        p_value: Probability that noise alone reaches that anywhere.
    """

    direction: str
    driver: str
    evidence: float
    p_value: float


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The answer to "what is left, and why".

    Attributes:
        verdict: "effect", "noise", "unexplained": structure that no name explains, or
            "rejected": held-out poses are worse off with the extended model.
        noise_floor_mm: Mean length of one row's error at best.
        noise_floor_source: Where that comes from.
        n_fit: Rows that each held-out row was predicted from.
        n_held_out: Rows held out, each once.
        before, after: Errors on held-out rows of the given and the extended model.
        vap_mm: Multi-directional pose accuracy variation before and after, if known.
        findings: Effects added, in that order.
        leftovers: What the final residual still shows, the most telling first.
        places: Where what is left lives, best first.
        next_measurements: Poses to measure next, (k, 6) [rad].
        why_next: What they are for.
        dropped: Rows that count less than fully, and why.
        directions: Wrong directions, or None where the file has none.
        not_excluded: What the rows could not have shown, in words.
        fixed_points: What readings of fixed points say of the tracker, in words.
        flanks: What reversals among the rows tell of the flanks of the joints.
        set_anew: Where base and tool are now, None where they are as they were.
        notes: How rows were read, in words.
        explained: Part of the squared held-out error above the noise floor that the
            additions explain; None where nothing was added.
        expected: What the extended model is expected to leave of new poses; None where
            it must not be used.
    """

    verdict: Verdict
    noise_floor_mm: float
    noise_floor_source: str
    n_fit: int
    n_held_out: int
    before: ErrorStatistics
    after: ErrorStatistics
    vap_mm: tuple[float, float] | None
    findings: tuple[Finding, ...]
    leftovers: tuple[ResidualTest, ...]
    places: tuple[ResidualPlace, ...]
    next_measurements: Floats
    why_next: str
    dropped: tuple[DroppedRow, ...]
    directions: DirectionReport | None
    not_excluded: tuple[str, ...] = ()
    fixed_points: tuple[str, ...] = ()
    flanks: str = ""
    set_anew: FrameShift | None = None
    explained: float | None = None
    notes: tuple[str, ...] = ()
    expected: HeldOutError | None = None

    @property
    def named(self) -> float | None:
        """Part of that error whose causes have names."""
        total = sum(f.share for f in self.findings)
        if self.explained is None or total <= 0.0:
            return self.explained
        share = sum(f.share for f in self.findings if f.lawful)
        return self.explained * share / total

    @property
    def times_floor(self) -> float:
        """How often the noise floor held-out rows are left."""
        return self.after.mean_mm / max(self.noise_floor_mm, 1e-12)

    def headlines(self) -> list[str]:
        """Say what is expected of new poses, unless rejected, and the verdict."""
        expected = [] if self.expected is None else [self.expected.describe()]
        return [*expected, f"verdict: {self.verdict}", self.story()]

    def story(self) -> str:
        """Tell in a sentence what is named, and what remains."""
        remains = (
            f"{self.after.mean_mm:.4f} mm remain, {self.times_floor:.1f} times the "
            "noise floor"
        )
        if self.verdict == "rejected":
            return (
                f"the error of held-out poses is {self.after.mean_mm:.4f} mm with the "
                f"extended model and {self.before.mean_mm:.4f} mm with the given one: "
                "no model is written. The rows are too few, or those of another arm"
            )
        if self.named is None:
            return f"nothing was added: {remains}"
        named = "; ".join(_causes([f for f in self.findings if f.lawful])) or "nothing"
        text = f"{self.named:.0%} of the error is named: {named}; "
        if shapes := _causes([f for f in self.findings if not f.lawful]):
            share = (self.explained or 0.0) - self.named
            text += f"{share:.0%} has a shape and no law: {'; '.join(shapes)}; "
        return text + remains

    def to_dict(self) -> dict[str, Any]:
        """Return the content of the JSON report."""
        degrees = (self.next_measurements * 57.29577951308232).round(4)
        vap = None
        if self.vap_mm is not None:
            vap = {"before": self.vap_mm[0], "after": self.vap_mm[1]}
        return {
            "verdict": self.verdict,
            "story": self.story(),
            "named_share": self.named,
            "times_noise_floor": self.times_floor,
            "noise_floor_mm": self.noise_floor_mm,
            "noise_floor_source": self.noise_floor_source,
            "n_fit": self.n_fit,
            "n_held_out": self.n_held_out,
            "expected": None if self.expected is None else asdict(self.expected),
            "before": statistics(self.before),
            "after": statistics(self.after),
            "vap_mm": vap,
            "effects": [f.to_dict() for f in self.findings],
            "leftover": [
                {"what": x.what, "p_value": x.p_value} for x in self.leftovers[:3]
            ],
            "where": [
                {
                    "direction": p.direction,
                    "covariate": p.driver,
                    "evidence_nats": p.evidence,
                    "p_value": p.p_value,
                }
                for p in self.places
            ],
            "next_measurements": degrees.tolist(),
            "next_measurements_why": self.why_next,
            "downweighted_rows": [
                {"id": d.id, "line": d.line, "why": d.why} for d in self.dropped
            ],
            "directions": None if self.directions is None else asdict(self.directions),
            "undetectable": list(self.not_excluded),
            "monuments": list(self.fixed_points),
            "flanks_at_stops": self.flanks,
            "notes": list(self.notes),
            "frame_shift": None if self.set_anew is None else self.set_anew.to_dict(),
        }


def _causes(findings: Sequence[Finding]) -> list[str]:
    """List causes, each with its joints."""
    joints: dict[str, list[int]] = {}
    cells = [str(f.family) for f in findings if f.told and f.family is not None]
    for f in findings:
        if f.told:
            continue
        joints.setdefault(f.effect, []).extend([f.joint] if f.joint else [])
    out = []
    for effect, own in joints.items():
        places = ", ".join(map(str, sorted(set(own))))
        of = "" if not own else f" of joint{'s' * (len(set(own)) > 1)} {places}"
        out.append(effect + of)
    return [*out, *dict.fromkeys(cells)]


def statistics(spread: ErrorStatistics) -> dict[str, float]:
    """Return mean, standard deviation, 95th percentile and maximum [mm]."""
    return {
        "mean_mm": spread.mean_mm,
        "std_mm": spread.std_mm,
        "p95_mm": spread.p95_mm,
        "max_mm": spread.max_mm,
    }


# What rows cannot show, however large it is.


def not_excluded(batch: ArmStates) -> tuple[str, ...]:
    """Say what may hide in what looks like noise: what no candidate asked for."""
    out = [what for kind in EFFECTS for what in kind.not_tried(batch)]
    finest = max(min(LENGTHS), 1.0 / np.sqrt(max(len(batch), 1)))
    out.append(f"functions of two joints finer than {finest:.0%} of their ranges")
    return tuple(out)


# Residuals seen from where they may live: a joint, a covariate, an order per turn.

LARGEST_ORDER = 60
OVERSAMPLED = 4  # orders tried per resolvable one


@dataclass(frozen=True, eq=False)
class Profile:
    """A residual along one direction against one covariate, before and after.

    Attributes:
        label, unit: The covariate; angles in degrees.
        values: (n,).
        direction: What the residual is read as, with its unit.
        before, after: Residual without and with the effect, (n,).
        lever: Millimetres of the TCP per unit of that residual, (n,).
    """

    label: str
    unit: str
    values: Floats
    direction: str
    before: Floats
    after: Floats
    lever: Floats


def profile(fit: Fit, place: int, candidate: Candidate) -> Profile:
    """Show an effect of a fit as its residual, with and without it.

    Args:
        fit: The fit with the effect.
        place: Place of the effect.
        candidate: The candidate that it was.
    """
    part = fit.combination.slices[place]
    moved = fit.move(part)
    joint = candidate.family.joint
    if joint is None:
        axis = moved / np.maximum(np.linalg.norm(moved, axis=1, keepdims=True), 1e-12)
        direction, scale = "along the effect [mm]", 1.0 / MM
        weight = np.ones(len(axis))
    else:
        axis = fit.batch.jacobian[:, :, joint - 1]
        direction, scale = f"joint {joint} [mrad]", 1e3
        weight = np.maximum((axis**2).sum(axis=1), 1e-9)
    effect = fit.combination.effects[place]
    if joint is not None and odd(effect, fit.batch):
        axis = axis * fit.batch.states.direction[:, joint - 1, None]
        direction = f"lambda x {direction}"
    seen = [
        scale * np.einsum("ni,ni->n", axis, r) / weight
        for r in (fit.residual + moved, fit.residual)
    ]
    name = candidate.source.split(" x ")[0]
    values, what = covariate(fit.batch, name), unit(name)
    if what == "rad":
        values, what = np.degrees(values), "deg"
    if what == "log rad":
        values, what = np.degrees(np.exp(values)), "deg"
    lever = np.sqrt(weight) / (scale * MM)
    return Profile(name, what, values, direction, seen[0], seen[1], lever)


def odd(effect: Effect, batch: ArmStates) -> bool:
    """Tell whether an effect turns round with the direction of arrival."""
    turned = batch.states.with_(direction=-batch.states.direction)
    there, back = effect.columns(batch), effect.columns(ArmStates(batch.arm, turned))
    return bool(np.allclose(there, -back) and np.any(there))


@dataclass(frozen=True, eq=False)
class Periodogram:
    """How much of a residual waves of one joint's angle would explain.

    Attributes:
        joint: Joint 1 to 6.
        orders: Waves per turn, (k,).
        power: Half of the fall of chi-square that a wave brings, (k,): about 1 where
            there is nothing.
    """

    joint: int
    orders: Floats
    power: Floats


def periodogram(projection: Projection, joint: int) -> Periodogram:
    """Compute the periodogram of a filtered residual in one joint's direction."""
    at = projection.at
    q = at.states.q[:, joint - 1]
    step = 2 * np.pi / max(float(np.ptp(q)), 0.1) / OVERSAMPLED
    orders = np.arange(1.0, LARGEST_ORDER, max(step, 0.05))
    axis = at.jacobian[:, :, joint - 1]
    waves = np.stack([np.sin(np.outer(q, orders)), np.cos(np.outer(q, orders))], axis=2)
    raw = axis[:, :, None] * waves.reshape(len(q), 1, -1)
    B = projection.filter(projection.fit.whiten(raw))
    B = B.reshape(len(B), len(orders), 2)
    gram = np.einsum("rok,rol->okl", B, B)
    along = np.einsum("rok,r->ok", B, projection.rest)
    size = np.trace(gram, axis1=1, axis2=2)[:, None, None]
    solved = np.linalg.solve(gram + 1e-6 * size * np.eye(2), along[:, :, None])[:, :, 0]
    return Periodogram(joint, orders, 0.5 * (along * solved).sum(axis=1))
