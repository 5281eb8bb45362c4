"""Studies on simulated arms, whose truth is known."""

from __future__ import annotations

import numpy as np

from postproc.accuracy.batch import Batch
from postproc.accuracy.full import fit_survey, model_of
from postproc.accuracy.methods import fit_method
from postproc.accuracy.model import Model
from postproc.accuracy.survey import design_survey
from postproc.robot.state import States, make_states
from tests.accuracy.simulator import (
    NJ,
    PLATE,
    TOOL,
    Simulated,
    random_arm,
    random_states,
    survey_of,
)
from tests.accuracy.test_fit import informed

MM = 1e-3


def fitted(states: States, measured: np.ndarray, effects: object = None) -> Model:
    """Fit a model to measured positions of a simulated arm."""
    survey = survey_of(states, measured)
    return model_of(fit_survey(survey, NJ, effects, None), survey)  # type: ignore[arg-type]


def truth_of(arm: Simulated, states: States) -> np.ndarray:
    """Return the true errors of an arm, (n, 3) [m]."""
    true = arm.tcp(states.q, states.direction, states.tool)
    return true - Batch(NJ, states).walk.tcp


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
        noisy = arm.measure(held, rng)[0] - Batch(NJ, held).walk.tcp
        p = model.predict(NJ, held)
        ours.append(np.linalg.norm(truth - p.error, axis=1).mean() / MM)
        best = informed(states, measured, held)
        theirs.append(np.linalg.norm(truth - best, axis=1).mean() / MM)
        covered.append((np.abs(truth - p.error) < 1.96 * p.std_model).mean())
        wide = model.measured_std(NJ, held)
        single.append((np.abs(noisy - p.error) < 1.96 * wide).mean())
    return [
        f"- held-out true error: ours {np.mean(ours):.4f} mm, informed least squares "
        f"{np.mean(theirs):.4f} mm, ratio {np.mean(ours) / np.mean(theirs):.3f}",
        f"- 95 % intervals of the error hold {100 * np.mean(covered):.1f} % of the "
        f"coordinates (per arm {100 * np.min(covered):.0f} to "
        f"{100 * np.max(covered):.0f} %)",
        f"- 95 % intervals of a measured row hold {100 * np.mean(single):.1f} %",
    ]


def other_tools(seeds: int) -> list[str]:
    """A tool 100 mm longer than the surveyed ones."""
    shift = np.array([0.0, 0.0, 0.1])
    inside, stated, real, here, there = [], [], [], [], []
    for seed in range(seeds):
        rng = np.random.default_rng(1000 + seed)
        arm = random_arm(rng)
        for tools, three in ((TOOL[None], False), (PLATE, True)):
            states = random_states(300, rng, tools)
            model = fitted(states, arm.measure(states, rng)[0])
            longer = random_states(200, rng, tools + shift)
            p = model.predict(NJ, longer)
            gap = truth_of(arm, longer) - p.error
            if three:
                there.append(left(model, arm, longer))
                here.append(left(model, arm, random_states(200, rng, tools)))
            else:
                inside.append((np.abs(gap) < 1.96 * p.std_model).mean())
                stated.append(np.linalg.norm(p.std_model, axis=1).mean() / MM)
                real.append(np.sqrt((gap**2).sum(axis=1).mean()) / MM)
    return [
        f"- one-point survey: stated standard error {np.mean(stated):.3f} mm, real rms "
        f"error {np.sqrt(np.mean(np.square(real))):.3f} mm, 95 % intervals hold "
        f"{100 * np.mean(inside):.0f} %; every such visit is guarded",
        f"- three-point survey: {np.mean(there):.4f} mm there, {np.mean(here):.4f} mm "
        f"at the surveyed points, ratio {np.mean(there) / np.mean(here):.2f}",
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


def designs(seeds: int, poses: int = 80) -> list[str]:
    """Latin hypercube against D-optimal, every pose from both sides."""
    found = {"lhs": [], "optimal": []}
    for seed in range(seeds):
        for mode, errors in found.items():
            rng = np.random.default_rng(3000 + seed)
            arm = random_arm(rng)
            d = design_survey(NJ, TOOL[None], poses, mode, seed=seed)
            q = np.repeat(d.q, 2, axis=0)
            side = np.stack([d.side, -d.side], axis=1).reshape(-1, 6)
            states = make_states(q, side, TOOL)
            measured, _ = arm.measure(states, rng)
            held = random_states(300, rng, TOOL[None])
            errors.append(left(fitted(states, measured), arm, held))
    ratio = np.mean(found["optimal"]) / np.mean(found["lhs"])
    return [
        f"- {poses} poses: Latin hypercube {np.mean(found['lhs']):.4f} mm, D-optimal "
        f"{np.mean(found['optimal']):.4f} mm, ratio {ratio:.2f}"
    ]
