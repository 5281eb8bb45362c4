"""Refusing surveys that cannot be what they say, with the likely reason."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.batch import Batch
from postproc.accuracy.combination import Combination
from postproc.accuracy.geometry import Geometry
from postproc.accuracy.measurement import Measurements
from postproc.accuracy.observability import observe
from postproc.accuracy.registration import register
from postproc.accuracy.turns import Turns
from postproc.exceptions import MeasurementError
from postproc.pose import MM
from postproc.robot.arm import Arm
from postproc.robot.state import States, make_states

Array = NDArray[np.float64]

FAR = 0.05  # [m] no arm that works is off by more
CLOSE = 0.01  # [m] a mended survey agrees at least so well
APART = 10.0  # rows this many times farther off than the typical one are another kind
MANY = 0.1  # share of such rows from which the file is at fault, not the rows
TRIED = 60  # rows that a guess is tried on
PROBES = 400  # random poses that show what could be determined at best
ENOUGH = 0.75  # share of the determinable directions that a survey must show
TURNED = np.deg2rad(1.0)  # no flange that works is off by more
NOTHING = Combination(())


def check_survey(survey: Measurements, arm: Arm) -> None:
    """Check units, frame and number of rows of a survey in the base frame.

    Raises:
        MeasurementError: With the likely reason and the cure.
    """
    check_rows(survey, arm)
    gap = survey.position - Batch(arm, survey.states).walk.tcp
    size = np.linalg.norm(gap, axis=1)
    typical = float(np.median(size))
    if typical > FAR:
        problem = f"measured and nominal positions differ by {typical / MM:.0f} mm"
        raise MeasurementError(survey.path, problem, likely_cure(survey, arm))
    apart = size > max(APART * typical, CLOSE)
    if apart.mean() > MANY:
        line = int(survey.line[np.argmax(apart)])
        problem = (
            f"{int(apart.sum())} of {len(survey)} rows are more than "
            f"{max(APART * typical, CLOSE) / MM:.0f} mm off, the others are not"
        )
        cure = "Two tools or two units in one file? Add tool_id, or split the file"
        raise MeasurementError(survey.path, problem, cure, line=line)


def check_registered(survey: Measurements, arm: Arm, typical: float) -> None:
    """Check a survey in the tracker's frame by what its registration leaves.

    Args:
        survey: The measurements, tracker frame.
        arm: The arm.
        typical: Median distance that the registration leaves [m].

    Raises:
        MeasurementError: With the likely reason and the cure.
    """
    check_rows(survey, arm)
    if typical > CLOSE:
        problem = f"the registration leaves {typical / MM:.0f} mm"
        raise MeasurementError(survey.path, problem, likely_cure(survey, arm))


def likely_cure(survey: Measurements, arm: Arm) -> str:
    """Name the mistake that would explain the positions, if one does."""
    few = survey[np.unique(np.linspace(0, len(survey) - 1, TRIED).astype(np.int64))]
    for cure, states, position in _guesses(few.states, few.position):
        if register(arm, states, position, NOTHING, np.zeros(0)).typical < CLOSE:
            return cure
    return "Check units, joint order and signs, the tool and the frame (--frame)"


def _guesses(states: States, position: Array) -> Iterator[tuple[str, States, Array]]:
    """List mistakes that people make, most frequent first, each undone."""
    q = states.q

    def turned(angles: Array) -> States:
        return states.with_(q=angles)

    yield (
        "The positions look like the tracker's frame: use --frame tracker",
        states,
        (position),
    )
    yield "The positions look like metres: write millimetres", states, position / MM
    yield (
        "The joint angles look like radians: write degrees",
        turned(np.rad2deg(q)),
        (position),
    )
    for j in range(6):
        sign = np.where(np.arange(6) == j, -1.0, 1.0)
        yield (
            f"Joint {j + 1} looks like it has the other sign",
            turned(q * sign),
            (position),
        )
    for i, j in combinations(range(6), 2):
        order = np.arange(6)
        order[[i, j]] = j, i
        cure = f"Joints {i + 1} and {j + 1} look swapped: correct the columns"
        yield cure, turned(q[:, order]), position


def check_rows(survey: Measurements, arm: Arm) -> None:
    """Check that the rows can determine the geometry.

    Raises:
        MeasurementError: Too few different poses.
    """
    possible = determinable(arm, survey)
    seen = _rank(arm, survey.states) if len(survey) else 0
    if seen < ENOUGH * possible:
        poses = len(np.unique(np.round(survey.states.q, 4), axis=0))
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
    tools = np.unique(np.concatenate([np.zeros((0, 3)), survey.states.tool]), axis=0)
    tools = tools if len(tools) else np.zeros((1, 3))
    tool = tools[np.arange(PROBES) % len(tools)]
    return _rank(arm, make_states(rng.uniform(low, high, (PROBES, 6)), tool=tool))


def _rank(arm: Arm, states: States) -> int:
    """Count the directions of the geometry that states show."""
    geometry = Geometry.propose(arm, states)
    names = tuple(p.name for p in geometry.parameters())
    scales = np.array([p.scale for p in geometry.parameters()])
    X = geometry.columns(Batch(arm, states)).reshape(-1, len(names)) * scales
    return observe(X, names).rank


def check_orientations(survey: Measurements, arm: Arm) -> Measurements:
    """Check measured orientations, base frame; what cannot be used is left out.

    Raises:
        MeasurementError: The declared mounting of the probe is not the measured one.
    """
    if survey.rotation is None or len(survey) == 0:
        return survey
    batch = Batch(arm, survey.states)
    apart = Turns.of(batch, survey.rotation, None).typical
    if apart > TURNED:
        text = (
            f"the measured orientations scatter by {np.rad2deg(apart):.1f} deg about "
            "the arm's: they are not R = Rx Ry Rz of a probe on the flange, and are "
            "not used"
        )
        warnings = (*survey.warnings, text)
        return replace(survey, rotation=None, warnings=warnings)
    if survey.mounting is not None:
        apart = Turns.of(batch, survey.rotation, survey.mounting).typical
        if apart > TURNED:
            problem = f"the probe is mounted {np.rad2deg(apart):.1f} deg off"
            cure = "Correct [survey] euler_zyz_deg in the cell file, or leave it out"
            raise MeasurementError(survey.path, problem, cure)
    return survey
