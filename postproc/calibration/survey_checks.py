"""Refusing surveys that cannot be what they say, with the likely reason."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.direction_signs import (
    Sided,
    all_reversed,
    find_change_of_sign,
)
from postproc.calibration.likely_causes import (
    CLOSE,
    LEAST_OFFSET,
    UNKNOWN,
    Cause,
    cause_in_any_frame,
    find_cause,
    find_cause_in_tracker_frame,
    find_moved_tracker,
    guess_offset,
    no_error,
    wrong_directions,
)
from postproc.calibration.measurements import Measurements
from postproc.calibration.nest_check import FEWEST, find_groups
from postproc.calibration.orientations import Turns
from postproc.calibration.registration import (
    STOPS,
    covers_a_plane,
    register,
    typical_gap,
)
from postproc.calibration.regression import observe
from postproc.exceptions import MeasurementError
from postproc.model.effect_sum import Combination
from postproc.model.effects.base_shift import rigid_motions
from postproc.model.effects.geometry import Geometry
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.robot.arm import Arm
from postproc.robot.pose import MM
from postproc.robot.state import States, make_states

FAR = 0.05  # [m] no arm that works is off by more
APART = 10.0  # rows this many times farther off than the typical one are another kind
MANY = 0.1  # share of such rows from which the file is at fault, not the rows
PROBES = 400  # random poses that show what could be determined at best
ENOUGH = 0.75  # share of the determinable directions that a survey must show
STILL = 1e-4  # readings move by more of what the poses do, in whatever unit
ENOUGH_ROWS_OF_ARM = 12  # that tell an arm from another
OTHER_ARM = (
    0.7  # of what the nominal arm leaves: a model that leaves more knows nothing
)
LEAST_OF_ARM = 2e-4  # [m] that such a model leaves
MAY_BE = {1: " or the base or the tracker turned", 6: " or the tool turned"}
TOOL_APART = 1e-3  # [m] tools that differ by less are told by the fit, not refused


def check_survey(survey: Measurements, arm: Arm) -> Sided:
    """Check units, frame, tools and number of rows of a survey in the base frame.

    Returns:
        The rows beside geometry, for `check_signs` and `ask_about_steps`.

    Raises:
        MeasurementError: With the likely reason and the cure.
    """
    check_rows(survey, arm)
    check_places(survey, arm)
    gap = survey.position - ArmStates(arm, survey.states).walk.tcp
    _check_cause(survey, find_cause(survey, arm, no_error))
    _check_frame(survey, arm, gap, "nominal")
    check_tools(survey, arm)
    _check_kinds(survey, gap)
    sided = as_surveyed(survey, arm)
    _check_change_of_sign(survey, sided)
    _check_joint_step(survey, sided)
    return sided


def check_against(survey: Measurements, arm: Arm, model: Model) -> None:
    """Check rows in the base frame against a model: units, frame, arm, directions.

    Raises:
        MeasurementError: With the likely reason and the cure.
    """

    def error(states: States) -> Floats:
        return model.error(arm, states)

    if len(survey) == 0:
        return
    gap = (
        survey.position - ArmStates(arm, survey.states).walk.tcp - error(survey.states)
    )
    _check_cause(survey, find_cause(survey, arm, error))
    _check_frame(survey, arm, gap, "predicted")
    wrong = wrong_directions(survey, arm, model)
    if wrong is not None:
        cure = (
            "Change the sign of the columns (lambda is 1 if the joint arrived in its "
            "positive direction), or fit a new model if the survey had the same error "
            "(--set measurements.lambda_sign=-1 turns all of them)"
        )
        raise MeasurementError(survey.path, wrong, cure)
    sided = as_surveyed(survey, arm, model)
    _check_change_of_sign(survey, sided)
    _check_joint_step(survey, sided)
    _check_arm(survey, arm, error(survey.states))


def _check_change_of_sign(survey: Measurements, sided: Sided) -> None:
    """Refuse rows of which lambda has the other sign from one row on."""
    found = None if survey.inferred.all() else find_change_of_sign(sided)
    if found is None:
        return
    rows, place = found
    at = int(np.argmax(rows)) if place == "from" else int(rows.sum()) - 1
    row = survey.ids[at]
    where = f"from row {row} on" if place == "from" else f"until row {row}"
    raise MeasurementError(
        survey.path,
        f"lambda has the other sign in {int(rows.sum())} of {len(rows)} rows, {where}",
        "Change the sign of these rows (lambda is 1 if the joint arrived in its "
        "positive direction)",
        line=int(survey.line[at]),
    )


def _check_joint_step(survey: Measurements, sided: Sided) -> None:
    """Refuse rows of which a joint is off by far from one row on."""
    found = sided.joint_change
    if found is None or abs(found.by) < LEAST_OFFSET:
        return
    guess = guess_offset(survey.states, survey.position, found.joint, found.by)
    guess = replace(guess, look=guess.look + MAY_BE.get(found.joint + 1, ""))
    rows = np.arange(len(survey)) >= found.first
    _check_cause(survey, Cause(guess, rows, "from"))


def as_surveyed(survey: Measurements, arm: Arm, model: Model | None = None) -> Sided:
    """Take the rows of a survey in the base frame, beside geometry.

    Args:
        survey: The rows.
        arm: The arm.
        model: What is known of the arm, or None. Beside a model the base, the tool and
            the zeros of the joints are free.
    """
    batch = ArmStates(arm, survey.states)
    left = survey.position - batch.walk.tcp
    if model is not None:
        nowhere = np.zeros_like(survey.states.direction)
        left = left - model.error(arm, survey.states.with_(direction=nowhere))
    if model is None:
        free = Geometry.propose(arm, survey.states).columns(batch)
    else:
        parts = [rigid_motions(batch.walk.tcp), batch.walk.flange, batch.jacobian]
        free = np.concatenate(parts, axis=2)
    return Sided.of(batch, free, left)


def check_signs(survey: Measurements, sided: Sided) -> None:
    """Refuse lambda columns by which links run ahead of their drives.

    Raises:
        MeasurementError: With what to state of them.
    """
    if survey.inferred.all() or not all_reversed(sided):
        return
    raise MeasurementError(
        survey.path,
        "by the lambda columns the links of all joints run ahead of their drives: "
        "backlash does not do that, unless they run on when drives stop",
        "lambda is 1 if the joint arrived in its positive direction. Where the columns "
        "have the other sign, add --set measurements.lambda_sign=-1; else =1",
    )


def ask_about_steps(survey: Measurements, sided: Sided) -> tuple[str, ...]:
    """Ask about a joint that is off by a little from one row on."""
    found = sided.joint_change
    if found is None:
        return ()
    return (
        f"{survey.path.name}: rows from {survey.ids[found.first]} on look like joint "
        f"{found.joint + 1} is off by {np.rad2deg(found.by):+.3f} deg"
        f"{MAY_BE.get(found.joint + 1, '')}: was it mastered in between, or did it "
        "slip? No zero fits all rows: fit those before it, and diagnose the others "
        "with that model",
    )


def _check_cause(survey: Measurements, cause: Cause | None) -> None:
    """Refuse rows that a mistake explains; one of all rows is named by its cure."""
    if cause is None:
        return
    if cause.place != "all":
        line = int(survey.line[cause.first])
        problem = cause.problem(survey)
        raise MeasurementError(survey.path, problem, cause.guess.cure, line=line)
    problem = "measured positions are not those of the joint angles"
    raise MeasurementError(survey.path, problem, cause.guess.all_rows)


def _check_frame(survey: Measurements, arm: Arm, gap: Floats, what: str) -> None:
    """Refuse rows that are far off as a whole."""
    typical = float(np.median(np.linalg.norm(gap, axis=1)))
    if typical > FAR:
        if what == "nominal":
            check_tools(survey, arm)
        problem = f"measured and {what} positions differ by {typical / MM:.0f} mm"
        enough = len(survey) >= STOPS
        cure = cause_in_any_frame(survey, arm) if enough else UNKNOWN
        raise MeasurementError(survey.path, problem, cure)


def _check_kinds(survey: Measurements, gap: Floats) -> None:
    """Refuse rows of which many are far off, and the others not."""
    size = np.linalg.norm(gap, axis=1)
    limit = max(APART * float(np.median(size)), CLOSE)
    apart = size > limit
    if apart.mean() > MANY:
        line = int(survey.line[np.argmax(apart)])
        problem = (
            f"{int(apart.sum())} of {len(survey)} rows have errors of more than "
            f"{limit / MM:.0f} mm, the others have not"
        )
        cure = "Two tools or two units in one file? Add tool_id, or split the file"
        raise MeasurementError(survey.path, problem, cure, line=line)


def _check_arm(survey: Measurements, arm: Arm, error: Floats) -> None:
    """Refuse rows of which a model explains nothing: they are another arm's.

    Base, tool and zeros of the joints may differ from those of the model's survey, and
    change once within the rows: an arm that was mastered or moved since is no other.
    """
    n = len(survey)
    if n < ENOUGH_ROWS_OF_ARM:
        return
    whole = _Misfit.of(survey, arm, error)
    half = max(n // 2, ENOUGH_ROWS_OF_ARM)
    ends = np.arange(half), np.arange(n - half, n)
    if whole.other and all(_Misfit.of(survey[e], arm, error[e]).other for e in ends):
        raise MeasurementError(
            survey.path,
            "the model does not fit these rows: its error is "
            f"{whole.by_model / MM:.2f} mm, that of the nominal arm "
            f"{whole.nominal / MM:.2f} mm (base, tool and joint zeros fitted in both)",
            "Are they another arm's? After a crash or a repair, fit a new model",
        )


@dataclass(frozen=True)
class _Misfit:
    """What a model and the nominal arm leave of rows, beside base, tool and zeros.

    Attributes:
        by_model, nominal: Typical errors [m].
    """

    by_model: float
    nominal: float

    @classmethod
    def of(cls, survey: Measurements, arm: Arm, error: Floats) -> Self:
        """Fit base, tool and zeros to rows whose errors are predicted, (n, 3) [m]."""
        batch = ArmStates(arm, survey.states)
        free = np.concatenate(
            [rigid_motions(batch.walk.tcp), batch.walk.flange, batch.jacobian], axis=2
        ).reshape(-1, 15)
        free = free / np.maximum(np.linalg.norm(free, axis=0), 1e-300)
        read = survey.position - batch.walk.tcp
        return cls(_typical_beside(free, read - error), _typical_beside(free, read))

    @property
    def other(self) -> bool:
        """Whether the model knows nothing of the rows."""
        left = self.by_model
        return left > OTHER_ARM * self.nominal and left > LEAST_OF_ARM


def _typical_beside(columns: Floats, left: Floats) -> float:
    """Return the median distance that columns (3 n, p) leave of rows (n, 3) [m].

    Robust: the rows that are farthest off count less.
    """
    weight, rest = np.ones(len(left)), left
    for _ in range(5):
        root = np.repeat(np.sqrt(weight), 3)
        rows, target = columns * root[:, None], left.reshape(-1) * root
        fitted = np.linalg.lstsq(rows, target, rcond=1e-6)[0]
        rest = (left.reshape(-1) - columns @ fitted).reshape(-1, 3)
        size = np.linalg.norm(rest, axis=1)
        ratio = size / max(3.0 * float(np.median(size)), 1e-12)
        weight = 1.0 / np.maximum(ratio, 1.0) ** 2
    return float(np.median(np.linalg.norm(rest, axis=1)))


def check_places(survey: Measurements, arm: Arm) -> None:
    """Refuse readings that are one place, where the poses are not.

    Raises:
        MeasurementError: How far apart both are.
    """
    read = np.linalg.norm(np.ptp(survey.position, axis=0))
    posed = np.linalg.norm(np.ptp(ArmStates(arm, survey.states).walk.tcp, axis=0))
    if read < STILL * posed:
        problem = (
            f"all {len(survey)} positions lie within {read / MM:.3f} mm, the poses "
            f"within {posed / MM:.0f} mm"
        )
        cure = "The tracker was not read at every pose, or these are other columns"
        raise MeasurementError(survey.path, problem, cure)


def check_tools(survey: Measurements, arm: Arm) -> None:
    """Refuse rows of several tools that have no tool_id of their own.

    Raises:
        MeasurementError: Saying how the tools lie to each other, and a row of each.
    """
    batch = ArmStates(arm, survey.states)
    left = survey.position - batch.walk.tcp
    X = Geometry.propose(arm, survey.states).columns(batch)
    X = X.reshape(-1, X.shape[2])
    scale = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    size = np.linalg.norm(left, axis=1)
    used = size <= max(APART * float(np.median(size)), CLOSE)
    if 1.0 - used.mean() > FEWEST:  # they are too many for outliers
        used[:] = True
    at = np.repeat(used, 3)
    fitted = np.linalg.lstsq((X / scale)[at], left.reshape(-1)[at], rcond=1e-6)[0]
    left = left - (X / scale @ fitted).reshape(-1, 3)
    for tool in np.unique(survey.states.tool_id):
        rows = np.flatnonzero((survey.states.tool_id == tool) & used)
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
    check_places(survey, arm)
    _check_stations(survey, arm)
    _check_moved_tracker(survey, registered, arm)
    if typical > CLOSE:
        check_tools(registered, arm)
        problem = f"the registration leaves {typical / MM:.0f} mm"
        raise MeasurementError(survey.path, problem, cause_in_any_frame(survey, arm))


def _check_stations(survey: Measurements, arm: Arm) -> None:
    """Refuse rows of the tracker's frame that a mistake explains, by station."""
    for rows in _rows_of_stations(survey):
        _check_cause(rows, find_cause_in_tracker_frame(rows, arm))


def _rows_of_stations(survey: Measurements) -> Iterator[Measurements]:
    """Take the rows of one station after the other, each as the only one."""
    for number in range(len(survey.stations)):
        rows = survey[survey.states.station == number]
        here = np.zeros(len(rows), dtype=np.int64)
        yield rows.with_states(rows.states.with_(station=here))


def _check_moved_tracker(
    survey: Measurements, registered: Measurements, arm: Arm
) -> None:
    """Refuse rows of one station that were read from two places.

    Args:
        survey: The rows, tracker frame.
        registered: The same in the base frame, as far as they could be placed.
        arm: The arm.
    """
    tcp = ArmStates(arm, registered.states).walk.tcp
    far = np.linalg.norm(registered.position - tcp, axis=1) > CLOSE
    if far.mean() <= MANY:
        return
    for rows in _rows_of_stations(survey):
        first = find_moved_tracker(rows, arm)
        if first is not None:
            raise MeasurementError(
                survey.path,
                f"{len(rows) - first} of {len(rows)} rows, from row {rows.ids[first]} "
                "on, look read from another place of the tracker",
                "Name both in a column station, or give each a file of its own",
                line=int(rows.line[first]),
            )


def check_own_registration(survey: Measurements, arm: Arm) -> None:
    """Check rows in the tracker's frame that find their own registration.

    Raises:
        MeasurementError: With the likely reason and the cure.
    """
    _check_stations(survey, arm)
    nothing = Combination(())
    placed = register(
        arm, survey.states, survey.position, nothing, np.zeros(0), survey.stations
    )
    states = placed.on_probes(survey.states)
    position = placed.to_base(survey.position, states.station)
    registered = replace(survey, states=states, position=position)
    _check_moved_tracker(survey, registered, arm)
    typical = typical_gap(placed, arm, survey.states, survey.position)
    if typical > CLOSE:
        problem = f"the registration leaves {typical / MM:.0f} mm"
        raise MeasurementError(survey.path, problem, cause_in_any_frame(survey, arm))


def check_stops(survey: Measurements, arm: Arm) -> None:
    """Check that every station's rows can place the tracker.

    Raises:
        MeasurementError: Naming a station with fewer than six stops, or one whose
            stops lie about a line.
    """
    for number, name in enumerate(survey.stations):
        rows = survey.states.station == number
        of = f" of station {name}" if name else ""
        poses = len(np.unique(np.round(survey.states.q[rows], 4), axis=0))
        if poses >= STOPS and covers_a_plane(arm, survey.states[rows]):
            continue
        where = ", all about one line," if poses >= STOPS else ""
        raise MeasurementError(
            survey.path,
            f"{int(rows.sum())} rows{of} at {poses} poses{where} do not determine the "
            "place of the tracker",
            f"Measure {STOPS} poses or more, spread over the workspace. If several "
            "files are of one station, add a column station",
        )


def check_rows(survey: Measurements, arm: Arm) -> None:
    """Check that the rows can determine the geometry.

    Raises:
        MeasurementError: Too few different poses.
    """
    possible = determinable(arm, survey)
    seen = _rank(arm, survey.states) if len(survey) else 0
    if seen < ENOUGH * possible:
        poses = len(np.unique(np.round(survey.states.q, 4), axis=0))
        rows = int(survey.states.readings.sum())
        raise MeasurementError(
            survey.path,
            f"the poses are too few or too alike: {rows} rows, {poses} poses, which "
            f"determine {seen} of {possible} independent geometric parameters",
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
    X = geometry.columns(ArmStates(arm, states)).reshape(-1, len(names)) * scales
    return observe(X, names).rank


def list_losses(arm: Arm, survey: Measurements) -> tuple[str, ...]:
    """Say what a fit lacks, or a model cannot be used for, for want of the arm file."""
    told = []
    if arm.file.links is None:
        told.append(
            "the arm file has no [links]: joint compliance under the arm's own weight "
            "is fitted with general shapes, which extrapolate less well; gaps that "
            "depend on the weight cannot be fitted and remain in the residuals"
        )
    if arm.file.joints.drive_coupling is None and survey.inferred.any():
        told.append(
            "the arm file has no drive_coupling: directions of joints are inferred for "
            "drives without coupling"
        )
    return tuple(told)


# Whether the orientations of a 6D probe can be used.

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
    batch = ArmStates(arm, survey.states)
    apart = Turns.of(batch, survey.rotation, None).typical
    if apart > TURNED:
        why = (
            f"they differ by {np.rad2deg(apart):.1f} deg from the arm's and are not "
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
            cure = "Correct [survey] euler_zyz_deg in the cell file, or remove it"
            raise MeasurementError(survey.path, problem, cure)
        return survey
    told = f"measured orientations are not used: {why}"
    return replace(survey, rotation=None, warnings=(*survey.warnings, told))
