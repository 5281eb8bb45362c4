"""The readings of a check, ready to be compared with what is expected of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.calibration.measurements import Measurements
from postproc.calibration.monument_frame import CommonPoints
from postproc.calibration.readings import after_survey, on_survey_nests
from postproc.calibration.stops import pool_readings, stops_of
from postproc.exceptions import MeasurementError
from postproc.model.effects.base_shift import rigid_motions
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.model.noise import poses_of
from postproc.model.registration import rigid_fit
from postproc.robot.arm import Arm
from postproc.robot.state import States

FEWEST = 3  # rows of the arm
LEAST = 1e-6  # [m] that effects do not describe of a pose, at least
CURE = "Read the nests of the survey, or fit a survey with this tool"


@dataclass(frozen=True, eq=False)
class CheckRows:
    """Readings of a check in the base frame, as far as fixed points tell it.

    Attributes:
        states: States of the n rows of the arm.
        ids: Their names.
        position: Measured, (n, 3) [m].
        pose: Number of the pose of each, (n,), whatever side it was come to from.
        arrival: Number of pose and side, (n,).
        pose_columns: Derivatives by what is unknown of its pose, (n, 3, 9).
        pose_variance: Variances of that where no check has been, (n, 9).
        fixed: By how much fixed points lie beside where the survey had them, (f, 3).
        noise: Covariance of all readings, arm before fixed points, (m, m) [m^2].
        placing: Derivatives by the place of the tracker, (m, 6); (m, 0) where it is
            known.
    """

    states: States
    ids: tuple[str, ...]
    position: Floats
    pose: Ints
    arrival: Ints
    pose_columns: Floats
    pose_variance: Floats
    fixed: Floats
    noise: Floats
    placing: Floats

    def __len__(self) -> int:
        """Return the number of rows of the arm."""
        return len(self.states)

    def only(self, rows: Bools) -> CheckRows:
        """Return some of the rows of the arm, and all fixed points."""
        every = np.concatenate([np.repeat(rows, 3), np.ones(self.fixed.size, bool)])
        return CheckRows(
            self.states[rows],
            tuple(n for n, kept in zip(self.ids, rows, strict=True) if kept),
            self.position[rows], self.pose[rows], self.arrival[rows],
            self.pose_columns[rows],
            self.pose_variance[rows], self.fixed,
            self.noise[np.ix_(every, every)], self.placing[every],
        )  # fmt: skip


def place_check(rows: Measurements, arm: Arm, model: Model, frame: str) -> CheckRows:
    """Bring the readings of a check into the base frame of a model's survey.

    Three fixed points of the survey tell where the tracker stands; without them the
    arm itself must. What they leave open of that is part of `placing`.

    Args:
        rows: The readings.
        arm: The arm.
        model: The model of its survey.
        frame: Of the readings: "base" or "tracker".

    Raises:
        MeasurementError: A nest that the survey did not have, or hardly any rows.
    """
    rows = pool_readings(rows)
    if len(rows) < FEWEST:
        raise MeasurementError(
            rows.path, f"has {len(rows)} readings of the arm", "Read three at least"
        )
    if model.registration is not None:
        rows = rows.with_states(on_survey_nests(rows, model.registration, CURE))
    states, points = after_survey(rows.states), CommonPoints.of(rows, model.monuments)
    points = points if points.are_enough else CommonPoints.of(rows, ())
    batch = ArmStates(arm, states)
    effects = model.effects
    expected = batch.walk.tcp + effects.error(batch, model.values)
    T, is_free = np.eye(4), True
    if points.names:
        T = rigid_fit(points.here, points.there)
    elif frame == "tracker":
        T = rigid_fit(rows.position, expected)
    else:
        is_free = False
    position = rows.position @ T[:3, :3].T + T[:3, 3]
    fixed = points.here @ T[:3, :3].T + T[:3, 3] - points.there
    placing = rigid_motions(np.concatenate([position, points.there]))
    placing = placing.reshape(-1, 6)[:, : 6 if is_free else 0]
    at, pose = effects.at(batch, model.values), poses_of(states)
    return CheckRows(
        states, rows.ids, position, pose, _number_arrivals(pose, states),
        _pose_columns(at), _pose_variance(model, at), fixed,
        _noise(rows, model, at, position, points.there), placing,
    )  # fmt: skip


def _number_arrivals(pose: Ints, states: States) -> Ints:
    """Number poses by the side that joints come to them from as well, (n,)."""
    key = np.concatenate([pose[:, None], states.direction], axis=1)
    return np.asarray(np.unique(key, axis=0, return_inverse=True)[1].reshape(-1))


def _pose_columns(at: ArmStates) -> Floats:
    """Differentiate the TCP by an error of every joint and a shift, (n, 3, 9)."""
    shift = np.tile(np.eye(3), (len(at), 1, 1))
    return np.concatenate([at.jacobian, shift], axis=2)


def _pose_variance(model: Model, at: ArmStates) -> Floats:
    """Return the variances of what no effect describes of a pose, (n, 9).

    A survey that hardly visits a pose twice has it in the scatter of its arrivals: it
    is taken to be as large as that, and what checks have in common tells.
    """
    noise = model.noise
    all_of_it = model.unmodelled_covariance(model.effects, at, model.values)[:, :3]
    of_joints = noise.pose_variance(at.jacobian) - noise.pose**2
    shift = np.maximum(all_of_it - of_joints, noise.stop**2)
    angle = max(noise.pose_joint, noise.joint) * np.array(noise.by_joint)
    joints = np.tile(angle**2, (len(at), 1))
    return np.concatenate([joints, np.maximum(shift, LEAST**2)], axis=1)


def _noise(
    rows: Measurements, model: Model, at: ArmStates, position: Floats, known: Floats
) -> Floats:
    """Return the covariance of all readings: of one arrival its rows share the error.

    The survey's readings of fixed points have the noise of those of the check.
    """
    noise, n, spread = model.noise, len(rows), model.reading_spread
    stop = stops_of(rows.states, rows.visit)
    same = stop[:, None] == stop
    turned = at.jacobian * noise.joint_std
    shared = np.einsum("nij,mkj->nmik", turned, turned) + noise.stop**2 * np.eye(3)
    shared = np.where(same[:, :, None, None], shared, 0.0)
    read = noise.tracker_std(position) ** 2 / rows.states.readings
    shared[range(n), range(n)] += read[:, None, None] * np.eye(3)
    shared[range(n), range(n)] += [
        np.diag(v) for v in noise.rounding_variance(rows.states.q, at.jacobian)
    ]
    out = np.zeros((3 * (n + len(known)), 3 * (n + len(known))))
    out[: 3 * n, : 3 * n] = shared.transpose(0, 2, 1, 3).reshape(3 * n, 3 * n)
    fixed = np.repeat(2.0 * noise.tracker_std(known) ** 2, 3)
    out[range(3 * n, len(out)), range(3 * n, len(out))] = fixed
    return spread**2 * out
