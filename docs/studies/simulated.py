"""Studies on simulated arms, whose truth is known."""

from __future__ import annotations

import time

import numpy as np

from postproc.calibration.baselines import fit_method
from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.pose_design import design_survey
from postproc.model.effects import BASE_EFFECTS
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.robot.state import States, make_states
from tests.calibration.simulator import (
    NJ,
    PLATE,
    TOOL,
    Simulated,
    random_arm,
    random_states,
    survey_of,
)
from tests.calibration.test_orientations import NOISE as TURN_NOISE
from tests.calibration.test_orientations import oriented
from tests.calibration.test_regression import informed

MM = 1e-3


def fitted(states: States, measured: np.ndarray, effects: object = None) -> Model:
    """Fit a model to measured positions of a simulated arm."""
    survey = survey_of(states, measured)
    return model_of(fit_survey(survey, NJ, effects, None), survey)  # type: ignore[arg-type]


def truth_of(arm: Simulated, states: States) -> np.ndarray:
    """Return the true errors of an arm, (n, 3) [m]."""
    true = arm.tcp(states.q, states.direction, states.tool)
    return true - ArmStates(NJ, states).walk.tcp


def left(model: Model, arm: Simulated, held: States) -> float:
    """Return the mean true error that a model leaves [mm]."""
    gap = truth_of(arm, held) - model.error(NJ, held)
    return float(np.linalg.norm(gap, axis=1).mean() / MM)


def against_the_limit(seeds: int) -> list[str]:
    """Held-out true error against the informed fit, and coverage, 300 rows."""
    ours, theirs, covered, single = [], [], [], []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        arm = random_arm(rng)
        states = random_states(300, rng, PLATE)
        measured, _ = arm.measure(states, rng)
        model = fitted(states, measured)
        held = random_states(500, rng, PLATE)
        truth = truth_of(arm, held)
        noisy = arm.measure(held, rng)[0] - ArmStates(NJ, held).walk.tcp
        p = model.predict(NJ, held)
        ours.append(np.linalg.norm(truth - p.error, axis=1).mean() / MM)
        best = informed(states, measured, held)
        theirs.append(np.linalg.norm(truth - best, axis=1).mean() / MM)
        covered.append((np.abs(truth - p.error) < 1.96 * p.std_model).mean())
        read = model.reading(NJ, held)
        single.append((np.abs(noisy - read.error) < 1.96 * read.std).mean())
    return [
        f"- held-out true error: ours {np.mean(ours):.4f} mm, informed least squares "
        f"{np.mean(theirs):.4f} mm, ratio {np.mean(ours) / np.mean(theirs):.3f}",
        f"- 95 % intervals of the error hold {100 * np.mean(covered):.1f} % of the "
        f"coordinates (per arm {100 * np.min(covered):.0f} to "
        f"{100 * np.max(covered):.0f} %)",
        f"- 95 % intervals of a measured row hold {100 * np.mean(single):.1f} %",
    ]


LONGER = np.array([0.0, 0.0, 0.1])  # [m] tool against the surveyed one


def other_tools(seeds: int) -> list[str]:
    """A tool 100 mm longer than the surveyed ones."""
    return [*_one_point(10 * seeds), *_three_points(seeds), *_six_d(seeds)]


def _one_point(seeds: int) -> list[str]:
    """One point leaves three rotations unseen: each arm draws them once."""
    inside, stated, real = [], [], []
    for seed in range(seeds):
        rng = np.random.default_rng(1000 + seed)
        arm = random_arm(rng)
        states = random_states(300, rng, TOOL[None])
        model = fitted(states, arm.measure(states, rng)[0], BASE_EFFECTS)
        longer = random_states(200, rng, TOOL[None] + LONGER)
        p = model.predict(NJ, longer)
        gap = truth_of(arm, longer) - p.error
        inside.append((np.abs(gap) < 1.96 * p.std_model).mean())
        stated.append((p.std_model**2).sum(axis=1).mean())
        real.append((gap**2).sum(axis=1).mean())
    return [
        f"- one-point survey, {seeds} arms: stated standard error "
        f"{np.sqrt(np.mean(stated)) / MM:.3f} mm, real rms error "
        f"{np.sqrt(np.mean(real)) / MM:.3f} mm, 95 % intervals hold "
        f"{100 * np.mean(inside):.1f} % (standard error of that figure "
        f"{100 * np.std(inside) / np.sqrt(seeds):.1f}); every such visit is rejected",
    ]


def _three_points(seeds: int) -> list[str]:
    here, there = [], []
    for seed in range(seeds):
        rng = np.random.default_rng(1000 + seed)
        arm = random_arm(rng)
        states = random_states(300, rng, PLATE)
        model = fitted(states, arm.measure(states, rng)[0])
        there.append(left(model, arm, random_states(200, rng, PLATE + LONGER)))
        here.append(left(model, arm, random_states(200, rng, PLATE)))
    return [
        f"- three-point survey: {np.mean(there):.4f} mm there, {np.mean(here):.4f} mm "
        f"at the surveyed points, ratio {np.mean(there) / np.mean(here):.2f}",
    ]


def _six_d(seeds: int) -> list[str]:
    here, there = [], []
    for seed in range(seeds):
        arm, survey = oriented(1000 + seed, 300)
        model = model_of(fit_survey(survey, NJ, BASE_EFFECTS, None), survey)
        rng = np.random.default_rng(seed)
        there.append(left(model, arm, random_states(200, rng, TOOL[None] + LONGER)))
        here.append(left(model, arm, random_states(200, rng, TOOL[None])))
    return [
        f"- one point with a 6D probe of known mounting ({TURN_NOISE * 1e3:.2f} mrad "
        f"of noise): {np.mean(there):.4f} mm there, {np.mean(here):.4f} mm at the "
        "surveyed point",
    ]


def learning_curve(seeds: int) -> list[str]:
    """Held-out true error by number of rows."""
    lines = ["| rows | full | EJA-ELM | geometry alone |", "|---|---|---|---|"]
    for rows in (40, 60, 80, 120, 200, 300, 400):
        cells: dict[str, list[float]] = {"full": [], "elm": [], "geometry": []}
        for seed in range(seeds):
            rng = np.random.default_rng(2000 + seed)
            arm = random_arm(rng)
            states = random_states(rows, rng, TOOL[None])
            measured, _ = arm.measure(states, rng)
            held = random_states(300, rng, TOOL[None])
            survey = survey_of(states, measured)
            models = {
                "full": fitted(states, measured),
                "elm": fit_method("eja-elm", survey, NJ, seed),
                "geometry": fitted(states, measured, ("geometry",)),
            }
            for name, model in models.items():
                cells[name].append(left(model, arm, held))
        row = " | ".join(f"{np.mean(v):.4f}" for v in cells.values())
        lines.append(f"| {rows} | {row} |")
    return lines


def designs(seeds: int, poses: tuple[int, ...] = (30, 80)) -> list[str]:
    """Latin hypercube against optimal designs, every pose from both sides."""
    modes = ("lhs", "d-optimal", "optimal")
    lines = [
        "Held-out true error in mm, and its ratio to that of the Latin hypercube.",
        "",
        "| poses | Latin hypercube | D-optimal | I-optimal (`survey.mode=optimal`) |",
        "|---|---|---|---|",
    ]
    for count in poses:
        found: dict[str, list[float]] = {mode: [] for mode in modes}
        for seed in range(seeds):
            for mode in modes:
                rng = np.random.default_rng(3000 + seed)
                arm = random_arm(rng)
                d = design_survey(NJ, TOOL[None], count, mode, seed=seed)
                q = np.repeat(d.q, 2, axis=0)
                side = np.stack([d.side, -d.side], axis=1).reshape(-1, 6)
                states = make_states(q, side, TOOL)
                measured, _ = arm.measure(states, rng)
                held = random_states(300, rng, TOOL[None])
                model = fitted(states, measured, BASE_EFFECTS)
                found[mode].append(left(model, arm, held))
        mean = {mode: np.mean(found[mode]) for mode in modes}
        cells = [f"{mean['lhs']:.4f}"]
        cells += [f"{mean[m]:.4f} ({mean[m] / mean['lhs']:.2f})" for m in modes[1:]]
        lines.append(f"| {count} | {' | '.join(cells)} |")
    return lines


def timings() -> list[str]:
    """How long `fit` thinks, by the processor's clock, all candidates tried."""
    lines = []
    for rows in (400, 12_000):
        rng = np.random.default_rng(0)
        arm = random_arm(rng)
        states = random_states(rows, rng)
        measured, _ = arm.measure(states, rng)
        start = time.process_time()
        fitted(states, measured)
        spent = time.process_time() - start
        lines.append(f"- {rows} rows: {spent:.1f} s on one core")
    return lines
