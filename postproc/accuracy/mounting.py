"""Whether the orientations of a 6D probe can be used."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.accuracy.measurement import Measurements
from postproc.accuracy.turns import Turns
from postproc.exceptions import MeasurementError
from postproc.model.kinematics import Batch
from postproc.robot.arm import Arm

TURNED = np.deg2rad(1.0)  # no flange that works is off by more


def check_orientations(survey: Measurements, arm: Arm) -> Measurements:
    """Check measured orientations, base frame; what cannot be used is left out.

    Without the probe's mounting they tell nothing of the flange that one point does
    not, so that only their own errors would enter.

    Raises:
        MeasurementError: The declared mounting of the probe is not the measured one.
    """
    if survey.rotation is None or len(survey) == 0:
        return survey
    batch = Batch(arm, survey.states)
    apart = Turns.of(batch, survey.rotation, None).typical
    if apart > TURNED:
        why = (
            f"they scatter by {np.rad2deg(apart):.1f} deg about the arm's: not "
            "R = Rx Ry Rz of a probe on the flange"
        )
    elif survey.mounting is None:
        why = (
            "the cell does not say how the probe is mounted: write euler_zyz_deg in "
            "[survey]"
        )
    else:
        apart = Turns.of(batch, survey.rotation, survey.mounting).typical
        if apart > TURNED:
            problem = f"the probe is mounted {np.rad2deg(apart):.1f} deg off"
            cure = "Correct [survey] euler_zyz_deg in the cell file, or leave it out"
            raise MeasurementError(survey.path, problem, cure)
        return survey
    told = f"measured orientations are not used: {why}"
    return replace(survey, rotation=None, warnings=(*survey.warnings, told))
