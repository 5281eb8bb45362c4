"""What of the misses at corrected stops comes from the noise of the survey.

    python docs/studies/survey_noise.py [--arms 100 .. 115] [--jobs 3]

Virtual arms are surveyed and land as in `tests.language.true_error`, in PDL2. Four
models of each: the fit as it is; an informed one, that is told the true covariance of
every reading and which effects the arm has; the fit to a survey without noise; the fit
to four times as many poses. What the informed one leaves is the survey's.
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.fit import several_points
from postproc.calibration.measurements import Measurements
from postproc.calibration.regression import Fit
from postproc.calibration.survey_files import read_measurements
from postproc.model.effects import BASE_EFFECTS
from postproc.model.model import Model
from postproc.robot.cell import Cell
from postproc.simulation import VirtualArm, virtual_arm
from tests.conftest import POSES
from tests.language.true_error import driven, fitted, landed

KINDS = ("fit", "informed", "no noise", "4 x poses")
STEPS = 3  # of Gauss and Newton; the fit it begins with is near


def covariances(
    survey: Measurements, arm: VirtualArm, cell: Cell, J: np.ndarray
) -> np.ndarray:
    """Return the true covariance of every reading, (n, 3, 3) [m^2]."""
    assert cell.tracker is not None
    fixed, with_range = arm.tracker_noise
    reach = np.linalg.norm(survey.position - cell.tracker, axis=1)
    sigma = (fixed + with_range * reach)[:, None, None]
    joints: np.ndarray = (J * arm.joint_noise**2) @ np.swapaxes(J, 1, 2)
    return joints + sigma**2 * np.eye(3)


def informed(cell: Cell, survey: Measurements, arm: VirtualArm) -> Model:
    """Fit by least squares, weighted with the true covariances."""
    setup = several_points(survey)
    found = fit_survey(survey, cell.arm, BASE_EFFECTS, cell.tracker, setup)
    c, batch = found.combination, found.batch
    root = np.linalg.cholesky(
        np.linalg.inv(covariances(survey, arm, cell, batch.jacobian))
    )
    for _ in range(STEPS):
        found = _stepped(found, root)
    residual = found.error - c.error_at(_moved(found), batch, found.values)
    return model_of(replace(found, residual=residual), survey)


def _moved(fit: Fit):
    shift = fit.design.shift(fit.values)
    return fit.batch.move(fit.combination.deviation(fit.values), shift)


def _stepped(fit: Fit, root: np.ndarray) -> Fit:
    """Linearise a fit where it is, and solve it anew."""
    at, n = _moved(fit), len(fit.error)
    design = fit.design.at(fit.combination, at)
    residual = fit.error - fit.combination.error_at(at, fit.batch, fit.values)
    X = np.stack([design.times(e) for e in np.eye(len(fit.values))], axis=2)
    X = (np.swapaxes(root, 1, 2) @ X).reshape(3 * n, -1)
    y = residual + design.times(fit.values)
    y = np.einsum("nji,nj->ni", root, y).reshape(-1)
    square = X.T @ X + np.diag(fit.prior_std**-2.0)
    return replace(fit, values=np.linalg.solve(square, X.T @ y), design=design)


def means(seed: int, jobs: int) -> list[float]:
    """Return the mean miss at corrected stops with each model [mm]."""
    models = []
    for survey in ({}, {"quiet": True}, {"poses": 4 * POSES}):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            cell, model = fitted(seed, folder, **survey)
            models.append(model)
            if not survey:
                rows = read_measurements(folder / "survey.csv", cell=cell)
                models.append(informed(cell, rows, virtual_arm(seed)))
    some = list(itertools.islice(driven(seed, cell), jobs))
    out = []
    for model in models:
        found = [landed(seed, cell, model, job, n, "job.pdl") for n, job in some]
        out.append(float(np.concatenate([one.after[one.sure] for one in found]).mean()))
    return out


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, nargs="+", default=[*range(100, 116)])
    parser.add_argument("--jobs", type=int, default=3)
    given = parser.parse_args()
    print("| arm | " + " | ".join(KINDS) + " |\n|" + "---|" * (len(KINDS) + 1))
    found = []
    for arm in given.arms:
        found.append(means(arm, given.jobs))
        print(
            f"| {arm} | " + " | ".join(f"{m:.4f}" for m in found[-1]) + " |", flush=True
        )
    all_ = np.mean(found, axis=0)
    print("| all | " + " | ".join(f"{m:.4f}" for m in all_) + " |")


if __name__ == "__main__":
    main()
