"""The source's two protocols: its simulation, and one like its experiment."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from postproc.calibration.baselines import MethodRow, Trial, compare_in
from postproc.calibration.measurements import Measurements
from postproc.model.effects import elm
from postproc.model.effects.elm import HiddenLayer
from postproc.model.kinematics import NOMINAL, Deviation, walk
from postproc.robot.arm import DH, load_arm
from postproc.robot.state import make_states
from postproc.simulation import sample_survey, stream, virtual_arm
from postproc.simulation.reference import WORKING_RANGE

Array = NDArray[np.float64]
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
UNITS = {
    "rad": 1.0, "deg": np.deg2rad(1.0), "0.1 deg": np.deg2rad(0.1), "mrad": 1e-3,
}  # fmt: skip
VOLUMES = (5.0, 10.0, 20.0, 30.0, 40.0, math.inf)  # half widths [deg]
# What the source's joints may do [rad], (6, 2); axes 4 and 6 one turn.
LIMITS = np.deg2rad(
    [[-180.0, 180], [-75, 95], [-256, 10], [-180, 180], [-125, 125], [-180, 180]]
)


def working_volume(half: float, whole: Array, seed: int) -> Array:
    """Draw a volume round some pose, wholly inside the joints' ranges.

    Args:
        half: Half its width in every joint [deg], inf for the whole range.
        whole: Ends of the ranges, (6, 2) [rad].
        seed: Of the centre.

    Returns:
        Ends of every joint's range, (6, 2) [rad].
    """
    if math.isinf(half):
        return whole
    width = np.minimum(np.deg2rad(half), (whole[:, 1] - whole[:, 0]) / 2)
    rng = np.random.default_rng([seed, round(half)])
    centre = rng.uniform(whole[:, 0] + width, whole[:, 1] - width)
    return np.stack([centre - width, centre + width], axis=1)


@dataclass(frozen=True)
class Simulated:
    """Mean and standard deviation of e [mm] per centre, (centres, 2)."""

    before: Array
    after: Array


def simulation(lengths: str, unit: str, half: float, centres: int) -> Simulated:
    """Run the source's simulation: 500 Latin-hypercube joints, 300 to train.

    Args:
        lengths: Which reading of the table's lengths.
        unit: Of the table's angular errors.
        half: Half the width of the working volume [deg].
        centres: How many volumes.
    """
    a, d = (np.array(v) * MM for v in LENGTHS[lengths])
    dh = DH(a, d, ALPHA, THETA, np.ones(6), np.eye(6))
    turn = UNITS[unit]
    link = np.stack(
        [D_A * MM, D_D * MM, D_ALPHA * turn, D_THETA * turn, np.zeros(6)], axis=1
    )
    real = Deviation(np.zeros(6), link, np.zeros(3))
    before, after = [], []
    for seed in range(centres):
        low, high = working_volume(half, LIMITS, seed).T
        cube = qmc.LatinHypercube(6, seed=seed).random(TRAIN + TEST)
        q = low + cube * (high - low)
        tool = np.zeros((len(q), 3))
        error = walk(dh, q, tool, real).tcp - walk(dh, q, tool, NOMINAL).tcp
        train, test = make_states(q[:TRAIN]), make_states(q[TRAIN:])
        layer = HiddenLayer.draw(train, NEURONS, seed, directions=True)
        beta = elm.train(layer, train, error[:TRAIN]).reshape(3, -1)
        left = error[TRAIN:] - layer(test) @ beta.T
        before.append(_mean_std(error[TRAIN:]))
        after.append(_mean_std(left))
    return Simulated(np.array(before), np.array(after))


def _mean_std(error: Array) -> tuple[float, float]:
    size = np.linalg.norm(error, axis=1) / MM
    return float(size.mean()), float(size.std())


ARM_EFFECTS = (
    "geometry", "tool", "backlash", "compliance", "counterbalance", "transmission",
    "coupling", "load_backlash", "windup",
)  # fmt: skip


def experiment(
    seed: int, effects: tuple[str, ...], half: float
) -> tuple[MethodRow, ...]:
    """Run a protocol like the source's experiment: 300 rows to fit, 150 to test.

    Args:
        seed: Of the arm, of its working volume and of the campaign.
        effects: Of the arm.
        half: Half the width of the working volume [deg].
    """
    nominal = load_arm("nj220-2.7")
    arm = virtual_arm(seed, effects)
    within = working_volume(half, WORKING_RANGE, seed)
    survey = sample_survey(arm, 450, seed=seed, within=within)
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
    trial = Trial(rows[train], rows[test], tracker, truth[test])
    return compare_in([trial], nominal, seed)
