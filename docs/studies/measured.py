"""Studies on measured data and on campaigns whose answers are not known here."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.fit import into_base_frame
from postproc.calibration.measurements import Measurements, read_survey_file
from postproc.calibration.registration import register
from postproc.model.effect_sum import Combination
from postproc.model.effects import BASE_EFFECTS
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.robot.arm import Arm, load_arm

MM = 1e-3
UR10_EFFECTS = ("geometry", "backlash", "compliance", "joint_spline")
SETUP = ("registration",)
BLIND_TOOL = np.array([[0.08, -0.04, 0.15]])
FLANGE = np.zeros((1, 3))


def describe(name: str, error: np.ndarray) -> str:
    """Write one row of a table of errors (n, 3) [m]."""
    e = np.linalg.norm(error, axis=1) / MM
    return (
        f"| {name} | {e.mean():.4f} | {np.median(e):.4f} | "
        f"{np.percentile(e, 95):.3f} | {e.max():.3f} | {len(e)} |"
    )


HEAD = [
    "| rows held out | mean mm | median | p95 | max | n |",
    "|---|---|---|---|---|---|",
]


BLOCKS = (
    "Blocks of consecutive rows are 9 of 30 blocks drawn at random, 30 % of the rows; "
    "what stands between them is fitted. Whole fifths leave out 300 rows in a row, a "
    "harder question. The orientations in these files are not used: how the probe is "
    "mounted is not declared."
)


def held_out(
    series: Measurements, arm: Arm, test: np.ndarray, effects: tuple[str, ...]
) -> np.ndarray:
    """Register and fit on the other rows, and return the errors left on these."""
    train = np.setdiff1d(np.arange(len(series)), test)
    survey, placed = into_base_frame(series[train], arm)
    fit = fit_survey(survey, arm, effects, placed.tracker, SETUP)
    tool = np.tile(placed.probes[0], (len(test), 1))
    batch = ArmStates(arm, series.states[test].with_(tool=tool))
    gap = placed.to_base(series.position[test]) - batch.walk.tcp
    return np.asarray(gap - fit.combination.error(batch, fit.values))


def ur10(folder: Path) -> list[str]:
    """Series B on itself, and on series D with only the registration refitted."""
    arm = load_arm("ur10")
    b = read_survey_file(folder / "measurements_joint_configurations.csv", arm, FLANGE)
    lines, n = list(HEAD), len(b)
    for seed in range(3):
        test = np.sort(np.random.default_rng(seed).permutation(n)[int(0.7 * n) :])
        lines.append(describe(f"random 30 %, seed {seed}",
                              held_out(b, arm, test, UR10_EFFECTS)))  # fmt: skip
    geometry = held_out(b, arm, test, ("geometry",))
    lines.append(describe(f"the same rows, geometry alone, seed {seed}", geometry))
    block = np.arange(n) * 30 // n
    for seed in range(2):
        chosen = np.random.default_rng(seed).permutation(30)[:9]
        test = np.flatnonzero(np.isin(block, chosen))
        lines.append(describe(f"9 of 30 blocks of consecutive rows, seed {seed}",
                              held_out(b, arm, test, UR10_EFFECTS)))  # fmt: skip
    fifths = [held_out(b, arm, np.flatnonzero(np.arange(n) * 5 // n == k), UR10_EFFECTS)
              for k in range(5)]  # fmt: skip
    lines.append(describe("each fifth in turn", np.concatenate(fifths)))
    return [*lines, *_other_series(folder, arm, b), "", BLOCKS]


def _other_series(folder: Path, arm: Arm, b: Measurements) -> list[str]:
    d = read_survey_file(folder / "measurements_iso_cubes.csv", arm, FLANGE)
    survey, placed = into_base_frame(b, arm)
    fit = fit_survey(survey, arm, UR10_EFFECTS, placed.tracker, SETUP)
    effects, values, _ = model_of(fit, survey).compensable()
    rows = [_registered(arm, d, Combination(()), np.zeros(0))]
    rows.append(_registered(arm, d, effects, values))
    dropped = [
        f"- row {survey.ids[i]}: {fit.rows.distance[i]:.1f} sigma, its neighbours "
        f"disagree, weight {fit.rows.weight[i]:.2f}"
        for i in np.flatnonzero(fit.rows.weight < 1)
    ]
    return [
        describe("series D, nominal arm", rows[0]),
        describe("series D, B's model, only registration refitted", rows[1]),
        "",
        "Rows of series B that count less than fully in a fit of all of them; the "
        "table above counts every held-out row:",
        "",
        *dropped,
    ]


def _registered(
    arm: Arm, series: Measurements, effects: Combination, values: np.ndarray
) -> np.ndarray:
    placed = register(arm, series.states, series.position, effects, values)
    tool = np.tile(placed.probes[0], (len(series), 1))
    batch = ArmStates(arm, series.states.with_(tool=tool))
    gap = placed.to_base(series.position) - batch.walk.tcp
    return np.asarray(gap - effects.error(batch, values))


def blind(folder: Path) -> list[str]:
    """Fit X_survey, test on X_verify."""
    arm = load_arm("nj220-2.7")
    lines = [
        "| campaign | not compensated | geometry and backlash | full: mean | p95 | max "
        "| 95 % intervals hold | effects kept |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in "abcdefgh":
        survey = read_survey_file(folder / f"{name}_survey.csv", arm, BLIND_TOOL)
        verify = read_survey_file(folder / f"{name}_verify.csv", arm, BLIND_TOOL)
        error = verify.position - ArmStates(arm, verify.states).walk.tcp
        base = _model(survey, arm, BASE_EFFECTS)
        full = _model(survey, arm, None)
        left = [
            np.linalg.norm(e, axis=1) / MM
            for e in (
                error,
                error - base.error(arm, verify.states),
                error - full.error(arm, verify.states),
            )
        ]
        # A tool that slipped in the survey is another one in the verification.
        alone = error - full.error(arm, verify.states)
        read = full.reading(arm, verify.states)
        held = (np.abs(alone) < 1.96 * read.std).mean()
        more = [e.name for e in full.effects.effects if e.name not in BASE_EFFECTS]
        lines.append(
            f"| {name} | {left[0].mean():.3f} | {left[1].mean():.4f} "
            f"| {left[2].mean():.4f} | {np.percentile(left[2], 95):.3f} "
            f"| {left[2].max():.3f} | {100 * held:.0f} % | {', '.join(more) or '-'} |"
        )
    return lines


def _model(survey: Measurements, arm: Arm, effects: tuple[str, ...] | None) -> Model:
    return model_of(fit_survey(survey, arm, effects, None), survey)
