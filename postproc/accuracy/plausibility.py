"""Refusing surveys that cannot be what they say, with the likely reason."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.batch import Batch
from postproc.accuracy.geometry import Geometry
from postproc.accuracy.measurement import Measurements
from postproc.accuracy.observability import observe
from postproc.exceptions import MeasurementError
from postproc.pose import MM
from postproc.robot.arm import Arm
from postproc.robot.state import make_states

Array = NDArray[np.float64]

FAR = 0.05  # [m] no arm that works is off by more
PROBES = 400  # random poses that show what could be determined at best
ENOUGH = 0.75  # share of the determinable directions that a survey must show


def check_survey(survey: Measurements, arm: Arm) -> None:
    """Check units, frame and number of rows of a survey in the base frame.

    Raises:
        MeasurementError: With the likely reason and the cure.
    """
    _check_rows(survey, arm)
    gap = survey.position - Batch(arm, survey.states).walk.tcp
    typical = float(np.median(np.linalg.norm(gap, axis=1)))
    if typical > FAR:
        problem = f"measured and nominal positions differ by {typical / MM:.0f} mm"
        raise MeasurementError(survey.path, problem, _likely_cure(survey, arm))
    alone = np.linalg.norm(gap, axis=1) > 4 * FAR
    if alone.mean() > 0.2:
        line = int(survey.line[np.argmax(alone)])
        cure = (
            "Two units or two tools in one file? Split it, or give each row a tool_id"
        )
        problem = f"{int(alone.sum())} rows are off by more than {4 * FAR / MM:.0f} mm"
        raise MeasurementError(survey.path, problem, cure, line=line)


def _likely_cure(survey: Measurements, arm: Arm) -> str:
    """Name the unit mistake that would explain the positions, if one does."""
    tcp = Batch(arm, survey.states).walk.tcp
    turned = survey.states.with_(q=np.rad2deg(survey.states.q))
    tries = {
        "The positions look like metres: write millimetres": survey.position / MM - tcp,
        "The joint angles look like radians: write degrees": (
            survey.position - Batch(arm, turned).walk.tcp
        ),
    }
    for cure, gap in tries.items():
        if np.median(np.linalg.norm(gap, axis=1)) < FAR:
            return cure
    if _distances_agree(survey.position, tcp):
        return "The positions look like the tracker's frame: use --frame tracker"
    return "Check units, joint order and signs, the tool and the frame (--frame)"


def _distances_agree(measured: Array, nominal: Array) -> bool:
    """Tell whether distances between rows agree: then only the frame differs."""
    i = np.arange(len(measured) - 1)
    a = np.linalg.norm(measured[i + 1] - measured[i], axis=1)
    b = np.linalg.norm(nominal[i + 1] - nominal[i], axis=1)
    return bool(np.median(np.abs(a - b)) < FAR / 2)


def _check_rows(survey: Measurements, arm: Arm) -> None:
    """Check that the rows can determine the geometry.

    Raises:
        MeasurementError: Too few different poses.
    """
    possible = determinable(arm, survey)
    poses = len(np.unique(np.round(survey.states.q, 4), axis=0))
    geometry = Geometry.propose(arm, survey.states)
    names = tuple(p.name for p in geometry.parameters())
    scales = np.array([p.scale for p in geometry.parameters()])
    X = geometry.columns(Batch(arm, survey.states)).reshape(-1, len(names)) * scales
    seen = observe(X, names).rank if len(survey) else 0
    if seen < ENOUGH * possible:
        raise MeasurementError(
            survey.path,
            f"{len(survey)} rows at {poses} poses determine {seen} of {possible} "
            "directions of the geometry",
            "Measure more poses, spread over the workspace, all joints moving",
        )


def determinable(arm: Arm, survey: Measurements) -> int:
    """Count the directions of the geometry that any survey with its tools can show."""
    rng = np.random.default_rng(0)
    low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    tools = np.unique(survey.states.tool, axis=0)
    states = make_states(
        rng.uniform(low, high, (PROBES, 6)), tool=tools[np.arange(PROBES) % len(tools)]
    )
    geometry = Geometry.propose(arm, states)
    names = tuple(p.name for p in geometry.parameters())
    scales = np.array([p.scale for p in geometry.parameters()])
    X = geometry.columns(Batch(arm, states)).reshape(-1, len(names)) * scales
    return observe(X, names).rank
