"""Write detection.md: which mistakes in a survey a fit finds, and how often.

PYTHONPATH=. python docs/studies/detected.py [--seeds 40]
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import beta

from postproc.calibration.effect_selection import fit_survey
from postproc.calibration.fit import into_base_frame, points_of_cell, wrong_nests
from postproc.calibration.measurements import Measurements
from postproc.model.effects import BASE_EFFECTS
from postproc.model.effects.placement import Placement
from tests.calibration.simulator import (
    NJ,
    PLATE,
    random_arm,
    random_states,
    survey_of,
)

OUT = Path(__file__).parent / "detection.md"
ROWS = 300
STAND = np.array([3.0, -2.0, 1.5])  # [m] of the tracker, where it is not known
MM = 1e-3
TEXT = """# Mistakes in a survey

Written by `make detection`, which is
`PYTHONPATH=. python docs/studies/detected.py --seeds {n}`: {n} simulated arms of 300
rows for every line, geometry, tool and backlash drawn, tracker 0.025 mm, joints 4 urad.
One mistake is planted, the survey is fitted, and what the fit says is compared with it.
Bounds are exact 95 % ones of a binomial share (Clopper and Pearson).

*Found*: an outlier is dropped or weighed down; a wrong direction is fitted the other
way or as not known; a nest is named, alone or in a group. *Invented*: rows, directions
or nests that were right and are treated so as well. An outlier *at the end* of a
joint's range is the row with the largest or smallest angle of one joint, drawn;
*inside* is any other. Of directions, those count whose gap is wide enough for its row
to tell it (2 sigma).
"""


@dataclass(frozen=True)
class Score:
    """How many mistakes there were and were found, and how many were invented."""

    found: int
    planted: int
    invented: int
    right: int

    def __add__(self, other: Score) -> Score:
        return Score(
            self.found + other.found, self.planted + other.planted,
            self.invented + other.invented, self.right + other.right,
        )  # fmt: skip


def share(count: int, n: int) -> str:
    """Write a share with its exact 95 % bounds."""
    if n == 0:
        return "-"
    low = beta.ppf(0.025, count, n - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, n - count) if count < n else 1.0
    return f"{count} of {n}: {100 * low:.3g} to {100 * high:.3g} %"


def outlier(seed: int, size: float, at_end: bool) -> Score:
    """Put one row off in a drawn direction; ask whether it counts less."""
    rng = np.random.default_rng(seed)
    arm, states = random_arm(rng), random_states(ROWS, rng)
    position, _ = arm.measure(states, rng)
    ends = np.concatenate([states.q.argmin(axis=0), states.q.argmax(axis=0)])
    inside = np.setdiff1d(np.arange(ROWS), ends)
    row = int(rng.choice(ends if at_end else inside))
    way = rng.standard_normal(3)
    position[row] += size * way / np.linalg.norm(way)
    fit = fit_survey(survey_of(states, position), NJ, BASE_EFFECTS, None)
    less = fit.rows.weight < 1.0
    others = int(less.sum() - less[row])
    return Score(int(less[row]), 1, others, ROWS - 1)


def directions(seed: int, rate: float) -> Score:
    """Turn directions in the file; ask which were believed."""
    rng = np.random.default_rng(seed)
    arm, states = random_arm(rng), random_states(ROWS, rng)
    position, _ = arm.measure(states, rng)
    wrong = rng.random((ROWS, 6)) < rate
    told = np.where(wrong, -states.direction, states.direction)
    survey = survey_of(states.with_(direction=told), position)
    fit = fit_survey(survey, NJ, BASE_EFFECTS, None)
    gaps = 2 * np.linalg.norm(
        fit.combination.direction_slopes(fit.batch, fit.values), axis=1
    )
    noise = np.sqrt(fit.whitener.variance(fit.noise).mean(axis=1))[:, None]
    telling = gaps > 2 * noise
    changed = fit.batch.states.direction != told
    turned = fit.batch.states.direction == -told
    return Score(
        int((changed & wrong & telling).sum()), int((wrong & telling).sum()),
        int((turned & ~wrong).sum()), int((~wrong).sum()),
    )  # fmt: skip


def nest(seed: int, size: float, tracker: bool) -> Score:
    """Put one nest of three off in a drawn direction; ask whether it is named.

    Args:
        seed: Of the arm, its poses and the tracker's place.
        size: [m].
        tracker: Whether the rows are in the tracker's frame, which is not known.
    """
    rng = np.random.default_rng(seed)
    arm, states = random_arm(rng), random_states(ROWS, rng, PLATE)
    which, way = int(rng.integers(3)), rng.standard_normal(3)
    off = size * way / np.linalg.norm(way)
    moved = states.tool + np.where(states.tool_id[:, None] == which, off, 0.0)
    position, _ = arm.measure(states.with_(tool=moved), rng)
    survey: Measurements = survey_of(states, position)
    told = " ".join(_told_seen_from(survey, seed) if tracker else _told(survey))
    named = re.search(r"nest (\d) lies|has it, ([\d or]+):", told)
    ids = re.findall(r"\d", (named.group(1) or named.group(2)) if named else "")
    if size == 0.0:
        return Score(0, 0, int(bool(ids)), 1)
    return Score(int(str(which) in ids), 1, int(bool(ids) and str(which) not in ids), 1)


def _told(survey: Measurements) -> tuple[str, ...]:
    """Say what a fit tells of the nests."""
    return wrong_nests(fit_survey(survey, NJ, BASE_EFFECTS, None, ("probe",)))


def _told_seen_from(survey: Measurements, seed: int) -> tuple[str, ...]:
    """Say it of the same rows as a tracker sees them that stands anywhere."""
    turn = Rotation.random(random_state=seed).as_matrix()
    seen = replace(survey, position=(survey.position - STAND) @ turn)
    points, (placed, found) = points_of_cell(seen), into_base_frame(seen, NJ)
    fit = fit_survey(placed, NJ, BASE_EFFECTS, found.tracker, (Placement.name,))
    return wrong_nests(fit, points)


Trial = Callable[[int], Score]


def trials() -> dict[str, Trial]:
    """List what is planted."""
    out: dict[str, Trial] = {}
    for size in (0.15, 0.3, 1.0, 10.0):
        for where in ("at the end of a range", "inside"):
            end = where.startswith("at")
            out[f"outlier of {size:g} mm, {where}"] = lambda seed, size=size, end=end: (
                outlier(seed, size * MM, end)
            )
    for rate in (0.0, 0.01, 0.05, 0.1):
        out[f"{100 * rate:g} % of the directions wrong"] = lambda seed, rate=rate: (
            directions(seed, rate)
        )
    for size in (0.0, 0.2, 0.5):
        for where in ("", ", tracker frame"):
            out[f"one nest of three off by {size:g} mm{where}"] = (
                lambda seed, size=size, where=where: nest(seed, size * MM, bool(where))
            )
    return out


def main() -> None:
    """Run the study and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=40)
    n = parser.parse_args().seeds
    lines = [*TEXT.format(n=n).splitlines(), ""]
    lines += ["| planted | found | invented |", "|---|---|---|"]
    for name, trial in trials().items():
        score = sum((trial(seed) for seed in range(n)), Score(0, 0, 0, 0))
        found, wrong = share(score.found, score.planted), score.invented
        lines.append(f"| {name} | {found} | {share(wrong, score.right)} |")
        print(lines[-1], flush=True)
    OUT.write_text("\n".join([*lines, ""]))


if __name__ == "__main__":
    main()
