"""The noise of poses that a fit has not seen, by the noise of its rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.calibration.diagnosis.held_out import ISO_RP
from postproc.calibration.regression import Fit
from postproc.model.noise import Noise, angle_step, poses_of
from postproc.robot.state import States

ENOUGH_REPEATS = 5  # that tell scatter of arrivals from errors of a pose


def expected_noise(fitted: Fit) -> Noise:
    """Return the noise of other poses than those of a fit.

    Rounded joint angles are an error of the file: it is taken off the scatter of
    poses, as far as rounding can be the cause. Where hardly any pose was approached
    twice in the same way, scatter of arrivals and what no effect describes are one sum:
    what exceeds the repeatability of the data sheet is taken to be an error of the
    pose, which a mean over arrivals has as well.
    """
    noise, states = fitted.noise, fitted.batch.states
    limit = angle_step(states.q) ** 2 / 12.0
    of_pose = "pose" in fitted.whitener.estimated
    rounding = min((noise.pose_joint if of_pose else noise.joint) ** 2, limit)
    if of_pose:
        noise = replace(noise, pose_joint=_less(noise.pose_joint, rounding))
    else:
        noise = replace(noise, joint=_less(noise.joint, rounding))
    noise = replace(noise, rounding=float(np.sqrt(rounding)))
    if repeated_approaches(states) >= ENOUGH_REPEATS:
        return noise
    sheet = fitted.batch.arm.repeatability / ISO_RP
    total = float(noise.arrival_variance(fitted.design.jacobian).mean())
    share = max(0.0, 1.0 - sheet**2 / max(total, 1e-300))
    joint, shift = share * noise.joint**2, share * noise.stop**2
    return replace(
        noise, joint=_less(noise.joint, joint), stop=_less(noise.stop, shift),
        pose_joint=float(np.hypot(noise.pose_joint, joint**0.5)),
        pose=float(np.hypot(noise.pose, shift**0.5)),
    )  # fmt: skip


def repeated_approaches(states: States) -> int:
    """Count the stops beyond the first at a pose that is approached in one way."""
    key = np.column_stack([poses_of(states), states.direction, states.order])
    stops = np.unique(key, axis=0)
    return len(stops) - len(np.unique(stops[:, :-1], axis=0))


def _less(std: float, variance: float) -> float:
    """Take a variance off a standard deviation."""
    return float(np.sqrt(max(0.0, std**2 - variance)))
