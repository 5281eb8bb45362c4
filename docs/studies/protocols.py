"""The source's two protocols: its simulation, and one like its experiment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from postproc.calibration.measurements import Measurements
from postproc.calibration.published import MethodRow, compare_on
from postproc.model.effects import elm
from postproc.model.effects.elm import HiddenLayer
from postproc.model.kinematics import NOMINAL, Deviation, walk
from postproc.robot.arm import DH, load_arm
from postproc.robot.state import make_states
from postproc.simulation import sample_survey, stream, virtual_arm

MM = 1e-3
NEURONS, TRAIN, TEST = 40, 300, 200
# Table 1 of the source: nominal a, d [mm], alpha, theta [deg], then their errors.
ALPHA = np.deg2rad([-90.0, 0, -90, 90, -90, 0])
THETA = np.deg2rad([0.0, -90, 0, 0, 0, 180])
D_A = np.array([-0.7, -0.4, 0.5, 0.5, -0.1, -0.2])
D_D = np.array([-1.03, -0.15, -0.006, -0.1, 0.0003, 0.05])
D_ALPHA = np.array([-0.00003, -0.002, 0.08, -0.08, 0.05, -0.06])
D_THETA = np.array([-0.0003, 0.0, 0.0, 0.0052, 0.0003, -0.0105])
LENGTHS = {
    "printed": ([400.0, 175, 250, 0, 0, 0], [0.0, 0, 0, 125.33, 0, 230]),
    "as built": ([400.0, 1175, 250, 0, 0, 0], [0.0, 0, 0, 1125.33, 0, 230]),
}
UNITS = {"rad": 1.0, "deg": np.deg2rad(1.0), "0.1 deg": np.deg2rad(0.1)}
RANGES = {"whole": 1.0, "half": 0.5}
LOW = np.deg2rad([-180.0, -75, -256, -180, -125, -180])
HIGH = np.deg2rad([180.0, 95, 10, 180, 125, 180])


@dataclass(frozen=True)
class Simulated:
    """Mean and standard deviation of e, before and after [mm], over the seeds."""

    before: tuple[float, float]
    after: tuple[float, float]


def simulation(lengths: str, unit: str, span: str, seeds: int) -> Simulated:
    """Run the source's simulation: 500 Latin-hypercube joints, 300 to train."""
    a, d = (np.array(v) * MM for v in LENGTHS[lengths])
    dh = DH(a, d, ALPHA, THETA, np.ones(6), np.eye(6))
    turn = UNITS[unit]
    link = np.stack(
        [D_A * MM, D_D * MM, D_ALPHA * turn, D_THETA * turn, np.zeros(6)], axis=1
    )
    real = Deviation(np.zeros(6), link, np.zeros(3))
    before, after = [], []
    for seed in range(seeds):
        middle, half = (LOW + HIGH) / 2, (HIGH - LOW) / 2 * RANGES[span]
        cube = qmc.LatinHypercube(6, seed=seed).random(TRAIN + TEST)
        q = middle + half * (2 * cube - 1)
        tool = np.zeros((len(q), 3))
        error = walk(dh, q, tool, real).tcp - walk(dh, q, tool, NOMINAL).tcp
        train, test = make_states(q[:TRAIN]), make_states(q[TRAIN:])
        layer = HiddenLayer.draw(train, NEURONS, seed, directions=True)
        beta = elm.train(layer, train, error[:TRAIN]).reshape(3, -1)
        left = error[TRAIN:] - layer(test) @ beta.T
        before.append(np.linalg.norm(error[TRAIN:], axis=1) / MM)
        after.append(np.linalg.norm(left, axis=1) / MM)
    return Simulated(_mean_std(before), _mean_std(after))


def _mean_std(errors: list[np.ndarray]) -> tuple[float, float]:
    mean = float(np.mean([e.mean() for e in errors]))
    return mean, float(np.mean([e.std() for e in errors]))


ARM_EFFECTS = (
    "geometry", "tool", "backlash", "compliance", "counterbalance", "transmission",
    "coupling", "load_backlash", "windup",
)  # fmt: skip


def experiment(seed: int, effects: tuple[str, ...]) -> tuple[MethodRow, ...]:
    """Run a protocol like the source's experiment: 300 rows to fit, 150 to test."""
    nominal = load_arm("nj220-2.7")
    arm = virtual_arm(seed, effects)
    survey = sample_survey(arm, 450, seed=seed)
    tracker = np.array([4.0, -1.5, 1.2])
    measured = arm.measure(survey, tracker, stream(seed, "tracker"))
    truth = arm.nominal_tcp(survey) + arm.error(survey)
    states = make_states(
        survey.q, np.sign(survey.side), survey.tool[:, :3, 3], travel=survey.travel
    )
    rows = Measurements(
        path="virtual",  # type: ignore[arg-type]
        states=states,
        position=measured,
        ids=tuple(map(str, range(450))),
        line=np.arange(450),
        inferred=np.zeros(450, dtype=bool),
        sha256="",
    )
    train, test = np.arange(300), np.arange(300, 450)
    return compare_on(
        rows[train], rows[test], nominal, tracker, seed, truth=truth[test]
    )
