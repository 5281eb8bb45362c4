"""What a diagnosis says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from postproc.accuracy.diagnosis.omnibus import Leftover
from postproc.accuracy.measurement import DroppedRow
from postproc.arrays import Floats
from postproc.model.statistics import ErrorStatistics

Verdict = Literal["effect", "noise", "unexplained"]


@dataclass(frozen=True)
class Finding:
    """An effect that the given model lacked.

    Attributes:
        effect: Name.
        joint: Joint 1 to 6, or None.
        source: Joint or covariate that drives it, or None.
        p_value: Probability that noise alone looks like it anywhere in the library.
        evidence: Log marginal likelihood ratio with and without it [nats].
        share: Part of the residual's variance that it explains.
        peak_mm: Largest displacement over the rows.
        parameters: Value, standard error and unit by name, units people use.
        confusable_with: (effect, joint) that explain the same within a few nats.
        settings: What is not linear: order, row, time constant and the like.
        held_out_gain: Fall of the squared held-out error per row, in noise variances,
            and its standard error.
    """

    effect: str
    joint: int | None
    source: str | None
    p_value: float
    evidence: float
    share: float
    peak_mm: float
    parameters: dict[str, tuple[float, float, str]]
    confusable_with: tuple[tuple[str, int | None], ...]
    settings: dict[str, Any]
    held_out_gain: tuple[float, float]

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
            "kept": True,
        }


@dataclass(frozen=True)
class Place:
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
        verdict: "effect", "noise", or "unexplained": structure that no name explains.
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
    leftovers: tuple[Leftover, ...]
    places: tuple[Place, ...]
    next_measurements: Floats
    why_next: str
    dropped: tuple[DroppedRow, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the content of the JSON report."""
        degrees = (self.next_measurements * 57.29577951308232).round(4)
        vap = None
        if self.vap_mm is not None:
            vap = {"before": self.vap_mm[0], "after": self.vap_mm[1]}
        return {
            "verdict": self.verdict,
            "noise_floor_mm": self.noise_floor_mm,
            "noise_floor_source": self.noise_floor_source,
            "n_fit": self.n_fit,
            "n_held_out": self.n_held_out,
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
            "rows_weighed_down": [
                {"id": d.id, "line": d.line, "why": d.why} for d in self.dropped
            ],
        }


def statistics(spread: ErrorStatistics) -> dict[str, float]:
    """Return mean, standard deviation, 95th percentile and maximum [mm]."""
    return {
        "mean_mm": spread.mean_mm,
        "std_mm": spread.std_mm,
        "p95_mm": spread.p95_mm,
        "max_mm": spread.max_mm,
    }
