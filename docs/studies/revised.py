"""What fresh rows make of a model: how far it is off afterwards, and how sure.

PYTHONPATH=. python docs/studies/revised.py [--seeds 1 20]

Each virtual arm is surveyed at 300 poses. Later it is measured again: at 100 poses all
over its range, at 250 or at 40 within 20 deg of a pose. In between nothing has changed,
or the base moves by 0.2 mm and 0.1 mrad along and about every axis (standard
deviations), or the tool is bent by 0.3 mm, or joint 5 has a wave of 0.2 mm, or joint 2
yields by 0.3 mm. The fresh rows are diagnosed with the model of the survey, and the
models before and after are compared with what the arm does now: anywhere in its range,
and round the pose. *Hold* is the share of coordinates in their 95 % intervals.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from postproc.calibration.diagnosis.diagnose import extend_model
from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.measurements import Measurements
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.robot.pose import MM, lengths
from postproc.robot.state import States
from postproc.simulation import (
    Planted,
    VirtualArm,
    VirtualArrivals,
    sample_survey,
    stream,
    virtual_arm,
)
from postproc.simulation.reference import WORKING_RANGE
from tests.calibration.planted import ARM, BASE, TRACKER, states_of
from tests.calibration.simulator import survey_of

SURVEYED, JUDGED = 300, 150  # poses
NEAR = np.deg2rad(20.0)
MIDDLES = np.deg2rad(
    [[-60, 60], [-30, 50], [-140, -50], [-100, 100], [-80, 80], [-100, 100]]
)
CHANGES: dict[str, tuple[Planted, ...]] = {
    "nothing": (),
    "base moved": (),
    "tool bent": (),
    "wave of joint 5": (Planted("transmission", 5, peak_mm=0.2),),
    "joint 2 yields": (Planted("compliance", 2, peak_mm=0.3),),
}
CAMPAIGNS = {"100, all over": 100, "250, round a pose": 250, "40, round a pose": 40}


@dataclass(frozen=True)
class Change:
    """What has changed since the survey.

    Attributes:
        arm: The arm as it is now, without what its base and its tool do.
        turn, shift: Of the base, a rotation (3, 3) and a translation (3,) [m].
        bent: Of the tool, in the flange frame, (3,) [m].
    """

    arm: VirtualArm
    turn: np.ndarray
    shift: np.ndarray
    bent: np.ndarray

    @classmethod
    def draw(cls, seed: int, name: str) -> Change:
        """Draw it."""
        rng = np.random.default_rng([seed, 9])
        turn, shift, bent = (rng.normal(0, s, 3) for s in (1e-4, 2e-4, 3e-4))
        arm = virtual_arm(seed, (*map(Planted, BASE), *CHANGES[name]))
        moved = float(name == "base moved")
        about = Rotation.from_rotvec(moved * turn).as_matrix()
        return cls(arm, about, moved * shift, float(name == "tool bent") * bent)

    def seen(self, position: np.ndarray, states: States) -> np.ndarray:
        """Move positions (n, 3) [m] as base and tool have moved."""
        flange = ArmStates(ARM, states).walk.flange[:, :3, :3]
        return (position + flange @ self.bent) @ self.turn.T + self.shift

    def truth(self, there: VirtualArrivals) -> np.ndarray:
        """Return the errors of the arm now, (n, 3) [m]."""
        nominal = self.arm.nominal_tcp(there)
        return self.seen(nominal + self.arm.error(there), states_of(there)) - nominal


def measured(
    arm: VirtualArm, there: VirtualArrivals, name: str, change: Change | None = None
) -> Measurements:
    """Measure an arm."""
    states = states_of(there)
    position = arm.measure(there, TRACKER, stream(arm.seed, name))
    if change is not None:
        position = change.seen(position, states)
    return replace(survey_of(states, position), sha256=name)


def around(seed: int) -> np.ndarray:
    """Draw the surroundings of a pose, (6, 2) [rad]."""
    middle = np.random.default_rng([seed, 5]).uniform(*MIDDLES.T)
    return np.stack([middle - NEAR, middle + NEAR], axis=1)


def left(model: Model, change: Change, seed: int, within: np.ndarray) -> list[float]:
    """Return the mean error of a model [mm], and how many intervals hold it."""
    there = sample_survey(change.arm, JUDGED, seed=seed + 2000, within=within)
    said = model.predict(ARM, states_of(there))
    off = np.abs(said.error - change.truth(there))
    return [lengths(off).mean() / MM, (off < 1.96 * said.std_model).mean()]


@dataclass(frozen=True)
class Outcome:
    """One campaign: errors [mm] and shares before and after, and what was named."""

    figures: np.ndarray
    verdict: str
    named: tuple[str, ...]


def outcome(seed: int, name: str, poses: int, whole: bool) -> Outcome:
    """Survey an arm, measure it again and diagnose that."""
    arm, change = virtual_arm(seed, BASE), Change.draw(seed, name)
    survey = measured(arm, sample_survey(arm, SURVEYED, seed=seed), "old")
    model = model_of(fit_survey(survey, ARM, None, TRACKER), survey)
    within = WORKING_RANGE if whole else around(seed)
    fresh = sample_survey(change.arm, poses, seed=seed + 1000, within=within)
    rows = measured(change.arm, fresh, "new", change)
    found = extend_model(rows, ARM, model, tracker=TRACKER)
    figures = [
        left(m, change, seed, place)
        for place in (WORKING_RANGE, around(seed))
        for m in (model, found.model)
    ]
    named = tuple(
        f.effect + ("" if f.joint is None else f" {f.joint}")
        for f in found.diagnosis.findings
    )
    return Outcome(np.array(figures), found.diagnosis.verdict, named)


def table(first: int, last: int) -> Iterator[str]:
    """Write the rows of the table."""
    yield (
        "| changed | fresh poses | anywhere, before | after | hold | round the pose, "
        "before | after | hold | verdict | named |"
    )
    yield "|---|---|---|---|---|---|---|---|---|---|"
    for name in CHANGES:
        for title, poses in CAMPAIGNS.items():
            whole = "all over" in title
            found = [outcome(s, name, poses, whole) for s in range(first, last + 1)]
            (a, _), (b, held), (c, _), (d, near) = np.mean(
                [one.figures for one in found], axis=0
            )
            told, named = (
                ", ".join(f"{k} {v}" for k, v in Counter(some).most_common())
                for some in (
                    [one.verdict for one in found],
                    [n for one in found for n in one.named],
                )
            )
            yield (
                f"| {name} | {title} | {a:.4f} | {b:.4f} | {held:.0%} | {c:.4f} "
                f"| {d:.4f} | {near:.0%} | {told} | {named} |"
            )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(1, 20))
    given = parser.parse_args()
    for line in table(*given.seeds):
        print(line, flush=True)


if __name__ == "__main__":
    main()
