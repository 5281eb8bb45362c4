"""One virtual arm with an undeclared effect: planted, measured, diagnosed, scored."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from postproc.calibration.diagnosis.investigate import trace
from postproc.calibration.diagnosis.model_update import Revision
from postproc.calibration.effect_selection import attribute_drift
from postproc.calibration.regression import Fit, fit_effects
from postproc.model.effect_sum import Combination
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.effects.base_shift import rigid_columns
from postproc.model.effects.effect import Effect, Origin, Parameter
from postproc.model.kinematics import ArmStates
from postproc.simulation import VirtualArm, VirtualArrivals, stream
from tests.calibration.planted import (
    ARM,
    NAMED,
    TRACKER,
    Campaign,
    campaign,
    displacement,
    part_sizes,
    planted_arm,
    states_of,
    survey,
)

FRESH = 200  # poses at which the true error is checked


@dataclass(frozen=True)
class Trial:
    """One arm, diagnosed and scored.

    Attributes:
        kind: What was planted.
        seed: Of everything.
        size: rms after projection over the noise.
        truth: (effect, joints, source joint) of every planted law.
        verdict: What the tool said.
        found: Effect, joint, source, p-value and group of every finding.
        right: Whether every planted law is among the findings or their groups.
        alone: Whether it is without its group, too.
        parts: Joint, own size and whether it was named, of a law of several joints.
        true_mm: True mean error at fresh poses before, after, and of an informed fit.
        registered_mm: The same with one rigid displacement taken out of each.
        seconds: Processor time of the search.
    """

    kind: str
    seed: int
    size: float
    truth: list[tuple[str, list[int], int]]
    verdict: str
    found: list[dict[str, object]]
    right: bool
    alone: bool
    parts: list[tuple[int, float, bool]]
    true_mm: tuple[float, float, float]
    registered_mm: tuple[float, float, float]
    seconds: float


@dataclass(frozen=True, eq=False)
class Known(Effect):
    """The planted effect itself, of unknown size: what an informed fit uses.

    Attributes:
        table: Displacement at every row, survey first, then fresh poses, (m, 3) [m].
    """

    name = "known"
    table: np.ndarray

    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("size", "1", 1.0, "size"),)

    def columns(self, batch: ArmStates) -> np.ndarray:
        return self.table[batch.states.order.astype(int)][:, :, None]


def kinds_of(kind: str, seed: int) -> tuple[str, ...]:
    """Names of the effects that a kind plants."""
    if kind == "none":
        return ()
    if kind == "two":
        rng = np.random.default_rng([seed, 2])
        return tuple(map(str, rng.choice(NAMED, 2, replace=False)))
    return (kind,)


def run(kind: str, seed: int, size: float) -> Trial:
    """Plant, measure, diagnose, score."""
    planted = kinds_of(kind, seed)
    c = campaign(seed, planted, size)
    base = c.base_fit()
    start = time.process_time()
    traced = trace(base, seed=0)
    seconds = time.process_time() - start
    found: list[dict[str, object]] = [
        {
            "effect": f.effect,
            "joint": f.joint,
            "source": f.source,
            "p": f.p_value,
            "group": [list(x) for x in f.confusable_with],
        }
        for f in traced.findings
    ]
    laws = [law for law in c.arm.laws if law.effect != "backlash"]
    truth = [(law.effect, list(law.joints), law.source) for law in laws]
    hits = [_hit(law, found) for law in truth]
    kept = attribute_drift(traced.search.fit, None)  # as `diagnose` writes it
    plain, registered = true_errors(c, seed, base, kept)
    return Trial(
        kind, seed, size, truth, traced.verdict, found,
        all(h >= 1 for h in hits), all(h >= 2 for h in hits),
        _parts(c, found), plain, registered, seconds,
    )  # fmt: skip


def _parts(
    c: Campaign, found: Sequence[dict[str, object]]
) -> list[tuple[int, float, bool]]:
    """Tell of every joint of a law of several how large it is and whether it is named.

    None of them are parts where a campaign has other effects besides.
    """
    if len(c.planted) != 1:
        return []
    effect = c.arm.laws[-1].effect
    return [
        (joint, size, _hit((effect, [joint], 0), found) > 0)
        for joint, size in part_sizes(c).items()
    ]


def _hit(law: tuple[str, list[int], int], found: Sequence[dict[str, object]]) -> int:
    """2 where a finding names the law, 1 where one of its group does, else 0.

    A law without a name is hit by a curve on its joint; a coupling must name the joint
    that drives, an error of a drive the drive.
    """
    effect, joints, source = law
    effect = effect or "curve"
    best = 0
    for f in found:
        names = [[f["effect"], f["joint"]], *f["group"]]  # type: ignore[misc]
        for k, (name, joint) in enumerate(names):
            driven = k > 0 or not source or str(f["source"]).endswith(f" {source}")
            place = joint in joints or (joint is None and not joints)
            if name == effect and place and driven:
                best = max(best, 1 if k else 2)
    return best


Errors = tuple[float, float, float]


def true_errors(
    c: Campaign, seed: int, before: Fit, after: Fit, surveyed: bool = False
) -> tuple[Errors, Errors]:
    """True mean errors [mm] that three fits leave at fresh poses.

    Args:
        c: The campaign.
        seed: Of the fresh poses.
        before, after: Fits of its rows.
        surveyed: Whether the fresh poses are visited at temperatures of the survey,
            not at the later ones of an arm that still warms.

    Returns:
        As they are, and with the rigid displacement that fits each best taken out.
    """
    fresh = _fresh(c.arm, seed, len(c.states))
    if surveyed:
        seen = stream(seed, "temperature").choice(c.arrivals.temperature, FRESH)
        fresh = replace(fresh, temperature=seen)
    truth, batch = c.arm.error(fresh), ArmStates(ARM, states_of(fresh))
    informed = _informed(c, seed, fresh, truth)
    told = ("arm", "state")
    left = [
        truth - moved(before, batch, told),
        truth - moved(after, batch, told),
        truth - moved(informed, batch, (*told, "setup")),
    ]
    plain = [_mean_mm(e) for e in left]
    registered = [_mean_mm(without_rigid(batch, e)) for e in left]
    return (plain[0], plain[1], plain[2]), (registered[0], registered[1], registered[2])


def moved(fit: Fit, batch: ArmStates, origins: tuple[Origin, ...]) -> np.ndarray:
    """What effects of some origins do to other states, (n, 3) [m]."""
    keep = tuple(e for e in fit.combination.effects if e.belongs_to() in origins)
    values = fit.values[fit.combination.where(*origins)]
    moved = Combination(keep).error(batch, values)
    first = fit.combination.effects[0]
    if isinstance(first, Revision):
        moved = moved + first.model.effects.error(batch, first.model.values)
    return moved


def _mean_mm(left: np.ndarray) -> float:
    return float(np.linalg.norm(left, axis=1).mean() * 1e3)


def without_rigid(batch: ArmStates, left: np.ndarray) -> np.ndarray:
    """Take the rigid displacement out of errors that fits them best, (n, 3) [m]."""
    rigid = rigid_columns(batch).reshape(-1, 6)
    motion = np.linalg.lstsq(rigid, left.reshape(-1))[0]
    return left - (rigid @ motion).reshape(-1, 3)


def _fresh(arm: VirtualArm, seed: int, rows: int) -> VirtualArrivals:
    """Other poses, visited after the survey."""
    fresh = survey(arm, seed + 10**6, FRESH)
    later = 14.0 * rows + fresh.time
    return replace(
        fresh,
        order=fresh.order + rows,
        time=later,
        temperature=arm.temperature(later, 22.0),
    )


def _informed(c: Campaign, seed: int, fresh: VirtualArrivals, truth: np.ndarray) -> Fit:
    """Fit the base and exactly the planted effects, sizes unknown."""
    rows = len(c.states)
    clean = planted_arm(seed, rows=rows)
    effects: list[Effect] = list(propose(BASE_EFFECTS, ARM, c.states))
    if c.planted:
        seen = sum(displacement(clean, seed, p, c.arrivals, rows) for p in c.planted)
        there = truth - clean.error(fresh)
        effects.append(Known(np.concatenate([seen, there])))
    batch = ArmStates(ARM, c.states)
    return fit_effects(batch, c.position, tuple(effects), tuple(TRACKER))
