"""Refusing surveys that cannot be what they say, with the likely reason."""

from __future__ import annotations

import numpy as np

from postproc.accuracy.measurement import Measurements
from postproc.accuracy.mistakes import CLOSE, likely_cure
from postproc.accuracy.observability import observe
from postproc.accuracy.tool_groups import find_groups
from postproc.exceptions import MeasurementError
from postproc.model.effects.geometry import Geometry
from postproc.model.kinematics import Batch
from postproc.robot.arm import Arm
from postproc.robot.pose import MM
from postproc.robot.state import States, make_states

FAR = 0.05  # [m] no arm that works is off by more
APART = 10.0  # rows this many times farther off than the typical one are another kind
MANY = 0.1  # share of such rows from which the file is at fault, not the rows
PROBES = 400  # random poses that show what could be determined at best
ENOUGH = 0.75  # share of the determinable directions that a survey must show
OTHER_UNIT = 50.0  # no arm's positions differ so much in size
SOME = 0.02  # share of rows in another unit that is no accident
TOOL_APART = 1e-3  # [m] tools that differ by less are told by the fit, not refused


def check_survey(survey: Measurements, arm: Arm) -> None:
    """Check units, frame, tools and number of rows of a survey in the base frame.

    Raises:
        MeasurementError: With the likely reason and the cure.
    """
    check_rows(survey, arm)
    check_units(survey)
    check_tools(survey, arm)
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


def check_units(survey: Measurements) -> None:
    """Refuse rows in metres among rows in millimetres.

    Raises:
        MeasurementError: Naming the first such row.
    """
    size = np.linalg.norm(survey.position, axis=1)
    typical = float(np.median(size))
    other = (size * OTHER_UNIT < typical) | (size > OTHER_UNIT * typical)
    if other.mean() > SOME:
        metres = size < np.sqrt(float(size.max()) * float(size.min()))
        line = int(survey.line[np.argmax(metres)])
        problem = f"{int(metres.sum())} of {len(survey)} rows look like metres"
        cure = "The others are in millimetres: write all of them so"
        raise MeasurementError(survey.path, problem, cure, line=line)


def check_tools(survey: Measurements, arm: Arm) -> None:
    """Refuse rows of several tools that have no tool_id of their own.

    Raises:
        MeasurementError: Saying how the tools lie to each other, and a row of each.
    """
    batch = Batch(arm, survey.states)
    left = survey.position - batch.walk.tcp
    X = Geometry.propose(arm, survey.states).columns(batch)
    X = X.reshape(-1, X.shape[2])
    scale = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    fitted = np.linalg.lstsq(X / scale, left.reshape(-1), rcond=1e-6)[0]
    left = left - (X / scale @ fitted).reshape(-1, 3)
    for tool in np.unique(survey.states.tool_id):
        rows = np.flatnonzero(survey.states.tool_id == tool)
        found = find_groups(left[rows], batch.walk.flange[rows])
        if found is not None and found.apart > TOOL_APART:
            first = sorted(rows[np.argmax(found.which == k)] for k in found.kinds)
            raise MeasurementError(
                survey.path,
                f"the rows were measured with {len(first)} tools (first seen in rows "
                f"{', '.join(survey.ids[i] for i in first)}); from the first one the "
                f"others are at {found.describe()} in the flange frame",
                "Add a column tool_id and the points to [survey] in the cell file, or "
                "columns tool_x_mm, tool_y_mm, tool_z_mm, or split the file",
                line=int(survey.line[first[1]]),
            )


def check_registered(
    survey: Measurements, registered: Measurements, arm: Arm, typical: float
) -> None:
    """Check a survey in the tracker's frame by what its registration leaves.

    Args:
        survey: The measurements, tracker frame.
        registered: The same in the base frame, as far as they could be placed.
        arm: The arm.
        typical: Median distance that the registration leaves [m].

    Raises:
        MeasurementError: With the likely reason and the cure.
    """
    check_rows(survey, arm)
    check_units(survey)
    if typical > CLOSE:
        check_tools(registered, arm)
        problem = f"the registration leaves {typical / MM:.0f} mm"
        raise MeasurementError(survey.path, problem, likely_cure(survey, arm))


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
