"""Campaigns of every awkward kind: a fit ends well, or in words.

python -m tests.awkward [--count 200] [--first 0]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from postproc.calibration.diagnosis.diagnose import extend_model
from postproc.calibration.fit import Frame, fit_measurements
from postproc.calibration.survey_files import read_measurements
from postproc.exceptions import PostprocError
from postproc.robot.cell import load_cell
from postproc.robot.state import States
from tests.calibration.simulator import HIGH, LOW, PLATE, random_arm, random_states

EFFECTS = (None, ("geometry", "backlash"), ("geometry", "backlash", "compliance"))


@dataclass(frozen=True)
class Campaign:
    """What is to be measured, and what was read; SI, the arm's base frame.

    Attributes:
        states: What was commanded.
        position: What was read, (n, 3) [m].
        unknown: Whether base and probe are not known: the tracker's frame.
        sides: Whether the file tells directions.
    """

    states: States
    position: np.ndarray
    unknown: bool = False
    sides: bool = True


Kind = Callable[[Campaign, np.random.Generator], Campaign]


def measured(states: States, rng: np.random.Generator) -> Campaign:
    """Measure states of a drawn arm."""
    return Campaign(states, random_arm(rng).measure(states, rng)[0])


def posed(change: Callable[[np.ndarray, np.random.Generator], np.ndarray]) -> Kind:
    """Make a kind of other joint angles (n, 6) [rad]."""

    def kind(c: Campaign, rng: np.random.Generator) -> Campaign:
        return measured(c.states.with_(q=change(c.states.q, rng)), rng)

    return kind


def read(change: Callable[[np.ndarray, np.random.Generator], np.ndarray]) -> Kind:
    """Make a kind of other readings (n, 3) [m]."""

    def kind(c: Campaign, rng: np.random.Generator) -> Campaign:
        return replace(c, position=change(c.position, rng))

    return kind


def tiny_volume(q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Leave a hundredth of every range."""
    middle = rng.uniform(LOW, HIGH) * 0.8
    return np.asarray(middle + 0.01 * (q - q.mean(axis=0)))


def fixed_joint(q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Let one or two joints stand still."""
    out = q.copy()
    for j in rng.choice(6, rng.integers(1, 3), replace=False):
        out[:, j] = out[0, j]
    return out


def two_poses(q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Repeat two poses again and again."""
    return np.asarray(q[:2][np.arange(len(q)) % 2])


def many_repeats(q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Repeat some poses, and no others."""
    return np.asarray(q[rng.integers(0, max(len(q) // 8, 12), len(q))])


def singular(q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Stretch the wrist."""
    out = q.copy()
    out[:, 4] = 0.0
    return out


def drifting(position: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Let the tracker drift by up to a millimetre."""
    share = np.linspace(0.0, 1.0, len(position))[:, None]
    return np.asarray(position + share * rng.normal(0, 5e-4, 3))


def slipping(position: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Knock the tracker at one row."""
    after = np.arange(len(position)) >= rng.integers(1, len(position))
    return np.asarray(position + after[:, None] * rng.normal(0, 1e-3, 3))


def gross(position: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Put some rows anywhere within 20 mm."""
    out = position.copy()
    rows = rng.choice(len(out), max(len(out) // 20, 1), replace=False)
    out[rows] += rng.uniform(-0.02, 0.02, (len(rows), 3))
    return out


def in_metres(position: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Write some rows, or all, in metres."""
    some = rng.random(len(position)) < rng.choice([0.03, 0.3, 1.0])
    return np.where(some[:, None], position * 1e-3, position)


def no_noise(position: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Round to a tenth of a millimetre."""
    return np.round(position, 4)


def noisy(position: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Read with a millimetre of noise."""
    return np.asarray(position + rng.normal(0, 1e-3, position.shape))


def stale(position: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Read some rows twice."""
    return np.asarray(position[np.maximum(np.arange(len(position)) // 2 * 2, 0)])


def one_place(position: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Read one place again and again."""
    return np.repeat(position[:1], len(position), axis=0)


def one_nest(c: Campaign, rng: np.random.Generator) -> Campaign:
    """Measure one nest only."""
    n = len(c.states)
    tool = np.repeat(PLATE[:1], n, axis=0)
    return measured(c.states.with_(tool=tool, tool_id=np.zeros(n, dtype=int)), rng)


def few_rows(c: Campaign, rng: np.random.Generator) -> Campaign:
    """Leave hardly any rows."""
    rows = np.arange(rng.integers(1, 30))
    return replace(c, states=c.states[rows], position=c.position[rows])


def in_tracker_frame(c: Campaign, rng: np.random.Generator) -> Campaign:
    """Know nothing of base and probe; of several nests, where they are to 10 mm."""
    R = Rotation.from_rotvec(rng.normal(0, 1.5, 3)).as_matrix()
    return replace(c, position=(c.position - rng.normal(0, 3, 3)) @ R, unknown=True)


def without_sides(c: Campaign, rng: np.random.Generator) -> Campaign:
    """Tell no directions."""
    return replace(c, sides=False)


def unknown_sides(c: Campaign, rng: np.random.Generator) -> Campaign:
    """Say of every direction that it is not known."""
    return replace(c, states=c.states.with_(direction=0.0 * c.states.direction))


def one_side(c: Campaign, rng: np.random.Generator) -> Campaign:
    """Come from one side only."""
    return measured(c.states.with_(direction=np.ones_like(c.states.direction)), rng)


POSES: tuple[Kind, ...] = tuple(map(
    posed, (tiny_volume, fixed_joint, two_poses, many_repeats, singular)
))  # fmt: skip
ROWS: tuple[Kind, ...] = tuple(map(
    read, (drifting, slipping, gross, in_metres, no_noise, noisy, stale, one_place)
))  # fmt: skip
OTHERS: tuple[Kind, ...] = (
    one_nest, few_rows, in_tracker_frame, in_tracker_frame, without_sides,
    unknown_sides, one_side,
)  # fmt: skip


def draw(seed: int) -> Campaign:
    """Draw a campaign: one to four things are awkward about it."""
    rng = np.random.default_rng(seed)
    states = random_states(int(rng.choice([40, 90, 200])), rng, PLATE)
    campaign = measured(states, rng)
    kinds: list[Kind] = [POSES[seed % len(POSES)]] if rng.random() < 0.7 else []
    more = rng.permutation(len(OTHERS))[: rng.integers(0, 3)]
    kinds += [OTHERS[k] for k in sorted(more)]
    if rng.random() < 0.7 or not kinds:
        kinds.insert(len(kinds), ROWS[seed // len(POSES) % len(ROWS)])
    # What changes poses or readings comes before what changes the frame.
    kinds.sort(key=lambda kind: kind in (few_rows, in_tracker_frame))
    for kind in kinds:
        campaign = kind(campaign, rng)
    return campaign


def write(c: Campaign, folder: Path) -> tuple[Path, Path]:
    """Write cell and measurements as a user has them."""
    points = [[round(float(v) * 1e3, -1 if c.unknown else 3) for v in p] for p in PLATE]
    several = len(np.unique(c.states.tool_id)) > 1
    known = f"[survey]\npoints_mm = {points}\n" if several or not c.unknown else ""
    cell = folder / "cell.toml"
    cell.write_text(f'[robot]\narm = "nj220-2.7"\n{known}')
    q = [f"q{j}_deg" for j in range(1, 7)]
    sides = [f"lambda{j}" for j in range(1, 7)] if c.sides else []
    lines = [",".join(["id", *q, *sides, "x_mm,y_mm,z_mm,tool_id"])]
    for k in range(len(c.states)):
        numbers = [f"{v:.5f}" for v in np.rad2deg(c.states.q[k])]
        numbers += [f"{v:.0f}" for v in c.states.direction[k][: len(sides)]]
        numbers += [f"{v * 1e3:.4f}" for v in c.position[k]]
        lines.append(",".join([str(k), *numbers, str(c.states.tool_id[k])]))
    data = folder / "rows.csv"
    data.write_text("\n".join(lines) + "\n")
    return cell, data


def run(seed: int, diagnosed: bool = True) -> str:
    """Fit a campaign, and diagnose it with its own model.

    Returns:
        "fitted", or "refused: " and why.

    Raises:
        Exception: Anything but a refusal in words; warnings of numpy too.
    """
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("error")
        campaign = draw(seed)
        frame: Frame = "tracker" if campaign.unknown else "base"
        cell_path, data = write(campaign, Path(name))
        try:
            return "fitted" + _fitted(seed, cell_path, data, frame, diagnosed)
        except PostprocError as exc:
            return "refused: " + str(exc).replace(name, "")


def _fitted(
    seed: int, cell_path: Path, data: Path, frame: Frame, diagnosed: bool
) -> str:
    """Fit and diagnose; return the verdict."""
    cell = load_cell(cell_path)
    survey = read_measurements(data, cell=cell)
    effects = EFFECTS[seed % len(EFFECTS)]
    found = fit_measurements(survey, cell, effects=effects, frame=frame)
    read_as = found.model.reading(cell.arm, found.survey.states)
    numbers = [found.model.values, found.model.covariance, read_as.error, read_as.std]
    if not all(np.isfinite(x).all() for x in numbers):
        raise ArithmeticError("a fit that is no number")
    if not diagnosed or len(found.survey) > 100:
        return ""
    setup = ("registration",) if frame == "tracker" else ()
    told = extend_model(found.survey, cell.arm, found.model, setup=setup)
    return f", {told.diagnosis.verdict}"


def main() -> int:
    """Run campaigns; return 1 when one ends in a traceback."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    ends: Counter[str] = Counter()
    wrong = 0
    for seed in range(given.first, given.first + given.count):
        begun = time.perf_counter()
        try:
            end = run(seed)
        except Exception as exc:
            wrong += 1
            traceback.print_exc()
            end = f"WRONG: {type(exc).__name__}: {exc}"
        ends[end.split(":")[0]] += 1
        print(f"{seed}: {time.perf_counter() - begun:.1f} s, {end}", flush=True)
    print(f"{given.count} campaigns: " + ", ".join(f"{k} {n}" for k, n in ends.items()))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
