"""The tool's rotation, as far as a model knows it."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.exceptions import ModelError
from postproc.model.kinematics import Batch
from postproc.model.model import Model
from postproc.robot.arm import Arm
from postproc.robot.state import States

UNSURE_RAD = 3e-4  # [rad] 0.03 mm at 0.1 m from the TCP
UNSURE_TURN = "the tool's rotation is not known well enough there to correct it"


def turn(model: Model, arm: Arm, states: States) -> Floats:
    """Predict the tool's rotation from nominal to actual.

    Returns:
        Rotation vectors in the base frame, (n, 3) [rad].
    """
    effects, values, _ = model.compensable()
    return effects.turn(Batch(arm, states), values)


def turn_std(model: Model, arm: Arm, states: States) -> Floats:
    """Standard error of the predicted rotation per axis, (n, 3) [rad]."""
    effects, values, covariance = model.compensable()
    at = effects.at(Batch(arm, states), values)
    X = effects.rotation_columns(at)
    variance = np.einsum("nip,nip->ni", X @ covariance, X)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def unsure_turn(model: Model, arm: Arm, states: States) -> Bools:
    """Tell where the rotation is not known well enough to be corrected, (n,)."""
    return np.asarray(np.linalg.norm(turn_std(model, arm, states), axis=1) > UNSURE_RAD)


def refuse_unknown_rotations(model: Model) -> None:
    """Refuse a model that tells where one point of the tool lands, not how it turns.

    Raises:
        ModelError: The survey does not show all rotations, or the method has none.
    """
    cure = "Leave --orientation out, or fit a model with --method full from a survey "
    if model.method != "full" or not len(model.covariance):
        problem = f"the method {model.method} says nothing of the tool's rotation"
        raise ModelError("--orientation", problem, f"{cure}of three points")
    if not model.ranges.see_all_rotations:
        raise ModelError(
            "--orientation",
            "the model was surveyed at one point of the tool: it does not know how "
            "the tool is turned",
            f"{cure}of three points that span a plane ([survey] points_mm in the cell "
            "file), or of a 6D probe of known mounting",
        )
