"""Let joints 4 to 6 bend under weight at once, and see what is named.

    python -m tests.bends [--arms 8] [--first 61000] [--jobs 2]

Every arm bends across joints 4, 5 and 6 by 0.2, 0.4 or 0.6 mm each at the tool, and is
measured with 1, 2 and 5 times its noise. Printed is how often each joint is named,
alone or with one other name, of those that rows can tell: which are worth `TELLS` nats
to a fit that knows the other two. Beside it stands what unseen poses are left, and what
a fit that knows all three leaves.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from postproc.calibration.diagnosis.investigate import trace
from postproc.calibration.diagnosis.search import with_effects
from postproc.calibration.effect_selection import attribute_drift
from postproc.calibration.regression import Fit
from postproc.model.effects.bending import Bending
from postproc.model.kinematics import ArmStates
from postproc.simulation import Planted, stream, virtual_arm
from tests.calibration.planted import ARM, BASE, TRACKER, Campaign, states_of, survey
from tests.undeclared_trial import moved

JOINTS = (4, 5, 6)
SIZES = (0.2, 0.4, 0.6)  # [mm] at the tool, each joint
NOISES = (1.0, 2.0, 5.0)
ROWS, UNSEEN = 400, 300
TELLS = 10.0  # nats


@dataclass(frozen=True)
class Trial:
    """One arm, diagnosed.

    Attributes:
        seed, size, noise: Of everything; [mm]; times the arm's own.
        worth: What each joint is worth to a fit that knows the others [nats].
        alone, paired: Joints that are named, alone or with at most one other name.
        told: Joints that are named at all, in whatever group.
        left: Mean error of unseen poses before, after, and of an informed fit [mm].
    """

    seed: int
    size: float
    noise: float
    worth: tuple[float, ...]
    alone: tuple[int, ...]
    paired: tuple[int, ...]
    told: tuple[int, ...]
    left: tuple[float, float, float]

    def __str__(self) -> str:
        worth = " ".join(f"{w:.0f}" for w in self.worth)
        left = " ".join(f"{x:.4f}" for x in self.left)
        return (
            f"{self.seed} {self.size} mm, noise x{self.noise:g}: worth {worth} nats, "
            f"paired {self.paired} told {self.told} left {left}"
        )


def campaign(seed: int, size: float, noise: float) -> Campaign:
    """Measure an arm whose joints 4 to 6 bend."""
    planted = tuple(Planted("bending", j, size) for j in JOINTS)
    every = (*map(Planted, BASE), *planted)
    arm = virtual_arm(seed, every, rows=ROWS, tracker=TRACKER)
    arm = replace(
        arm,
        joint_noise=noise * arm.joint_noise,
        tracker_noise=(noise * arm.tracker_noise[0], noise * arm.tracker_noise[1]),
    )
    arrivals = survey(arm, seed, ROWS)
    position = arm.measure(arrivals, TRACKER, stream(seed, "tracker"))
    return Campaign(arm, planted, arrivals, states_of(arrivals), position, (1, 1, 1))


def run(job: tuple[int, float, float]) -> Trial:
    """Plant, measure, diagnose, score."""
    c = campaign(*job)
    base = c.base_fit()
    laws = [p for p in Bending.propose(ARM, c.states).pieces() if p.joints[0] in JOINTS]
    informed = with_effects(base, (*base.combination.effects, *laws))
    found = trace(base, seed=0)
    groups = [
        [(f.effect, f.joint), *((r.effect, r.joint) for r in f.rivals)]
        for f in found.findings
    ]
    named = {
        most: tuple(
            j
            for j in JOINTS
            if any(("bending", j) in g and len(g) <= most for g in groups)
        )
        for most in (1, 2, 99)
    }
    kept = attribute_drift(found.search.fit, None)
    return Trial(
        *job, tuple(worth(informed, k) for k in range(len(laws))),
        named[1], named[2], named[99], left(c, base, kept, informed),
    )  # fmt: skip


def worth(informed: Fit, number: int) -> float:
    """Tell what one of the laws is worth to a fit that knows the others [nats]."""
    effects = list(informed.combination.effects)
    del effects[len(effects) - len(JOINTS) + number]
    return float(informed.log_evidence - with_effects(informed, effects).log_evidence)


def left(c: Campaign, *fits: Fit) -> tuple[float, float, float]:
    """Tell what fits leave of the true errors of unseen poses, mean [mm]."""
    fresh = survey(c.arm, c.arm.seed + 10**6, UNSEEN)
    truth, batch = c.arm.error(fresh), ArmStates(ARM, states_of(fresh))
    rest = (truth - moved(f, batch, ("arm", "state")) for f in fits)
    a, b, d = (1e3 * float(np.linalg.norm(r, axis=1).mean()) for r in rest)
    return a, b, d


def summary(trials: list[Trial]) -> str:
    """Write the table."""
    lines = [
        "| noise | arms | joints that rows can tell | named alone | "
        "alone or with one other | in any group | others that are named | "
        "after / informed, median, max |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for noise in NOISES:
        some = [t for t in trials if t.noise == noise]
        tell = [
            (t, j)
            for t in some
            for j, w in zip(JOINTS, t.worth, strict=True)
            if w >= TELLS
        ]
        kinds = ("alone", "paired", "told")
        counts = [sum(j in getattr(t, kind) for t, j in tell) for kind in kinds]
        more = sum(len(t.told) for t in some) - counts[2]
        ratio = np.array([t.left[1] / t.left[2] for t in some])
        lines.append(
            f"| {noise:g} | {len(some)} | {len(tell)} | {counts[0]} | {counts[1]} | "
            f"{counts[2]} | {more} | {np.median(ratio):.2f}, {ratio.max():.2f} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Run, print a line for each and the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, default=8)
    parser.add_argument("--first", type=int, default=61_000)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    seeds = range(given.first, given.first + given.arms)
    jobs = [(s, SIZES[k % len(SIZES)], n) for k, s in enumerate(seeds) for n in NOISES]
    trials = []
    with ProcessPoolExecutor(given.jobs) as pool:
        for trial in pool.map(run, jobs):
            print(trial, flush=True)
            trials.append(trial)
    print(summary(trials))


if __name__ == "__main__":
    main()
