"""The noise of poses that a fit has not seen, by the noise of its rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.calibration.diagnosis.held_out import ISO_RP
from postproc.calibration.regression import Fit
from postproc.model.noise import Noise, angle_step, poses_of
from postproc.robot.state import States

ENOUGH_REPEATS = 5  # that tell scatter of arrivals from errors of a pose
CHANCE = 1.0  # standard errors of the errors of poses, within which there are none


def expect_noise(fitted: Fit) -> Noise:
    """Return the noise of other poses than those of a fit.

    Rounded joint angles are an error of the file: it is taken off the scatter of
    poses, as far as rounding can be the cause. Where hardly any pose was approached
    twice in the same way, what exceeds the repeatability of the data sheet may be an
    error of the pose, which a mean over arrivals has as well. It is taken to be one as
    a whole where each pose has one visit: scatter of arrivals and what no effect
    describes are one sum there. Where poses were approached in several ways, an error
    that belongs to one of them is taken to be no larger than what all of them share.
    """
    noise = _without_rounding(fitted)
    if count_repeats(fitted.batch.states) >= ENOUGH_REPEATS:
        return noise
    J = fitted.design.jacobian
    sheet = fitted.batch.arm.repeatability / ISO_RP
    total = max(float(noise.arrival_variance(J).mean()), 1e-300)
    share = max(0.0, 1.0 - sheet**2 / total)
    if _of_pose(fitted):
        share = min(share, float(noise.pose_variance(J).mean()) / total)
    joint, shift = share * noise.joint**2, share * noise.stop**2
    return replace(
        noise, joint=_less(noise.joint, joint), stop=_less(noise.stop, shift),
        pose_joint=float(np.hypot(noise.pose_joint, joint**0.5)),
        pose=float(np.hypot(noise.pose, shift**0.5)),
    )  # fmt: skip


def _of_pose(fitted: Fit) -> bool:
    """Return True if the rows tell errors of poses from scatter of stops."""
    return "pose" in fitted.whitener.estimated


def _without_rounding(fitted: Fit) -> Noise:
    """Take rounded joint angles off the scatter, and errors of poses that are chance.

    The errors of a pose are chance where their variance is within a standard error of
    the variance that rounding and the mean over visits have.
    """
    noise, J = fitted.noise, fitted.design.jacobian
    limit = angle_step(fitted.batch.states.q) ** 2 / 12.0
    of_pose = _of_pose(fitted)
    rounding = min((noise.pose_joint if of_pose else noise.joint) ** 2, limit)
    noise = replace(noise, rounding=rounding**0.5)
    if not of_pose:
        return replace(noise, joint=_less(noise.joint, rounding))
    noise = replace(noise, pose_joint=_less(noise.pose_joint, rounding))
    beside = float(replace(noise, pose_joint=rounding**0.5, pose=0.0)
                   .pose_variance(J).mean()) + _mean_of_visits(fitted)  # fmt: skip
    if float(noise.pose_variance(J).mean()) > CHANCE * _spread(fitted) * beside:
        return noise
    return replace(noise, pose_joint=0.0, pose=0.0)


def _spread(fitted: Fit) -> float:
    """Return the relative standard error of a variance over the poses of a fit."""
    return float(np.sqrt(2.0 / (3.0 * max(fitted.poses, 1))))


def _mean_of_visits(fitted: Fit) -> float:
    """Return the variance per axis of the mean over the visits of a pose [m^2]."""
    states, noise = fitted.batch.states, fitted.noise
    stops = max(len(np.unique(states.order)), 1)
    read = noise.tracker_std(fitted.position) ** 2 / states.readings
    arrived = float(noise.arrival_variance(fitted.design.jacobian).mean())
    of_stop = arrived + float(read.mean()) * stops / max(len(states), 1)
    return of_stop * fitted.poses / stops


def count_repeats(states: States) -> int:
    """Count the stops beyond the first at a pose that is approached in one way."""
    key = np.column_stack([poses_of(states), states.direction, states.order])
    stops = np.unique(key, axis=0)
    return len(stops) - len(np.unique(stops[:, :-1], axis=0))


def _less(std: float, variance: float) -> float:
    """Take a variance off a standard deviation."""
    return float(np.sqrt(max(0.0, std**2 - variance)))
