"""Rows that a model predicts: when they were read, and where the tracker stood."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.calibration.measurements import POSITION, Measurements, from_table, steady
from postproc.calibration.monument_frame import at_monuments
from postproc.calibration.registration import (
    covers_a_plane,
    predict_registered,
    station_of,
)
from postproc.calibration.survey_checks import (
    check_against,
    check_own_registration,
    check_stops,
)
from postproc.calibration.survey_files import MeasuredFrame, carrying_load
from postproc.calibration.text_table import TextTable
from postproc.exceptions import MeasurementError, PostprocError
from postproc.model.effects.effect import Effect
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model, PredictedReading
from postproc.model.registration import Registration
from postproc.model.variance import moment_variance
from postproc.robot.cell import Cell
from postproc.robot.pose import MM
from postproc.robot.state import States

LATER = 1e9  # [s], or rows: a moment after any survey
MOVED = 0.01  # [m] rows that are further off were read from another station
STOPS = 6  # from which rows tell where their tracker stood
CURE = "Find it from these rows: --set measurements.refit_registration=true"


@dataclass(frozen=True)
class Readings:
    """What is asked of the readings of a survey's set-up.

    Attributes:
        frame: Frame of the measured positions, "base" or "tracker"; None where only
            the error of the arm is asked for.
        refit: What of the set-up is found from the rows themselves: "registration",
            or None where the set-up is that of the model's survey.
        after: Whether the rows were read after the survey: what passes with time is as
            at its end.
    """

    frame: MeasuredFrame | None = None
    refit: str | None = None
    after: bool = False

    def __post_init__(self) -> None:
        if self.refit not in (None, "registration"):
            raise PostprocError(f"refit {self.refit!r}: write registration")

    @property
    def is_asked(self) -> bool:
        """Whether readings are predicted."""
        return self.frame is not None or self.refit is not None


@dataclass(frozen=True, eq=False)
class ReadRows:
    """Rows in the base frame, with what their set-up would read.

    Attributes:
        rows: The rows, at their probe points.
        read: What is read there.
        note: How they were placed in space and time, lines for a terminal.
    """

    rows: Measurements
    read: PredictedReading
    note: str


def rows_of(table: TextTable, cell: Cell, positions: bool) -> Measurements:
    """Read rows as a survey's are read, with what the cell knows of the load."""
    rows = from_table(table, cell.arm, cell.nests, positions=positions)
    return carrying_load(steady(rows), cell)


def read_setup(
    table: TextTable, cell: Cell, model: Model, readings: Readings
) -> ReadRows:
    """Read rows in the base frame with what their set-up would read.

    Raises:
        PostprocError: The set-up is not known, and not to be found from the rows.
    """
    rows = rows_of(table, cell, positions=readings.refit is not None)
    rows, known = at_moments(rows, table, model, readings.after)
    if readings.refit is not None:
        return _own_registration(rows, cell, model)
    clock = clock_missing(model, known, cell, rows.states)
    model = model.without_clock(known)
    read = table.has(*POSITION)
    if readings.frame != "tracker":
        rows, note = at_monuments(rows, model.monuments) if read else (rows, "")
        if read:
            check_against(rows, cell.arm, model)
        return ReadRows(rows, model.reading(cell.arm, rows.states), note + clock)
    if not read:
        if model.registration is None:
            problem = "the model holds no registration: it was fitted in the base frame"
            raise MeasurementError(table.path, problem, CURE)
        rows = _place_rows(rows, model.registration)
        return ReadRows(rows, model.reading(cell.arm, rows.states), clock)
    return _of_tracker(rows, cell, model, clock)


def _of_tracker(rows: Measurements, cell: Cell, model: Model, clock: str) -> ReadRows:
    """Place rows of the tracker's frame: by fixed points, the survey, or themselves.

    Raises:
        MeasurementError: They tell too little of where the tracker stood.
    """
    arm, placed = cell.arm, model.registration
    base, note = at_monuments(rows, model.monuments, whole=True)
    if note and placed is not None:
        base = replace(base, states=on_survey_nests(rows, placed))
    elif not note:
        if placed is None:
            return _own_registration(rows, cell, model)
        base = _place_rows(
            rows, station_of(placed, arm, rows.states, rows.position, rows.stations)
        )
    read = model.reading(arm, base.states)
    left = base.position - ArmStates(arm, base.states).walk.tcp - read.error
    off = float(np.median(np.linalg.norm(left, axis=1))) if len(left) else 0.0
    if off > MOVED and not note:
        found = _own_registration(rows, cell, model)
        where = (
            f"\nread from another station than the model's survey ({off / MM:.0f} mm "
            "off its registration)"
        )
        return replace(found, note=where + found.note)
    check_against(base, arm, model)
    placing = note or "\nin the set-up of the model's survey"
    return ReadRows(
        base, read, placing + clock + _own_registration_error(rows, cell, model)
    )


def _own_registration(rows: Measurements, cell: Cell, model: Model) -> ReadRows:
    """Find the tracker and the probe from the rows themselves.

    Raises:
        MeasurementError: The rows tell too little, or fit the arm in no frame.
    """
    arm = cell.arm
    check_stops(rows, arm)
    check_own_registration(rows, arm)
    placed, read = predict_registered(
        model, arm, rows.states, rows.position, rows.stations
    )
    at = ", ".join(f"{v / MM:.1f}" for v in placed.tracker)
    note = f"\nregistration refitted: tracker at {at} mm in the base frame"
    base = _place_rows(rows, placed)
    spent = 6 * len(placed.transforms) + 3 * len(placed.probes)
    return ReadRows(base, read, f"{note}, {spent} numbers of {3 * len(rows)} readings")


def _own_registration_error(rows: Measurements, cell: Cell, model: Model) -> str:
    """Say what is left where the registration is found from the rows themselves."""
    poses = len(np.unique(np.round(rows.states.q, 4), axis=0))
    if poses < STOPS or not covers_a_plane(cell.arm, rows.states):
        return ""
    placed, read = predict_registered(
        model, cell.arm, rows.states, rows.position, rows.stations
    )
    base = _place_rows(rows, placed)
    left = base.position - ArmStates(cell.arm, base.states).walk.tcp - read.error
    spent = 6 * len(placed.transforms) + 3 * len(placed.probes)
    free = max(left.size - spent, 1)
    mean = float(np.linalg.norm(left, axis=1).mean()) * np.sqrt(left.size / free)
    return (
        f"\nregistered from its own rows the file would leave {mean / MM:.4f} mm on "
        f"average ({spent} numbers of {left.size} readings counted)"
    )


def _place_rows(rows: Measurements, placed: Registration) -> Measurements:
    """Put rows in the tracker's frame into the base frame, at the probe points.

    Raises:
        MeasurementError: A probe point that the registration does not know.
    """
    states = on_survey_nests(rows, placed)
    position = placed.to_base(rows.position, rows.states.station)
    return replace(rows, states=states, position=position)


def on_survey_nests(
    rows: Measurements, placed: Registration, cure: str = CURE
) -> States:
    """Put tools where the registration has the probe points.

    Args:
        rows: The rows.
        placed: The registration.
        cure: What to do about a probe point that it does not know.

    Raises:
        MeasurementError: A probe point that the registration does not know.
    """
    try:
        return placed.on_probes(rows.states)
    except KeyError as exc:
        problem = f"tool_id {exc} is no probe point of the model's survey"
        raise MeasurementError(rows.path, problem, cure) from None


# When the rows were read.


def at_moments(
    rows: Measurements, table: TextTable, model: Model, after: bool
) -> tuple[Measurements, frozenset[str]]:
    """Place rows in the survey's time; return the clocks that they have, too.

    A row whose order is not given comes after the survey's steps. The rows of the
    survey's own file have its moments.

    Args:
        rows: The rows.
        table: Their file.
        model: The model, for its survey.
        after: Whether they were read after the survey.
    """
    states = rows.states
    if after:
        return rows.with_states(after_survey(states)), frozenset(("order", "time"))
    known = {"time"} if len(rows) and not np.isnan(states.time).any() else set()
    if table.has("order") or table.sha256 in model.data_sha256:
        return rows, frozenset({"order", *known})
    states = states.with_(order=np.arange(len(rows)) + LATER)
    return rows.with_states(states), frozenset(known)


def after_survey(states: States) -> States:
    """Return states that come after all moments of any survey."""
    later = np.arange(len(states)) + LATER
    return states.with_(order=later, time=np.full(len(states), LATER))


def describe_missing_setup(model: Model) -> str:
    """Say what residuals hold besides, where the arm alone is predicted."""
    passing = [
        e.name
        for e in model.effects.effects
        if e.belongs_to() == "setup" and e.refers_to() and e.driven_by == "time"
    ]
    if not passing:
        return ""
    names = ", ".join(dict.fromkeys(passing))
    return (
        f"\nresiduals are those of the arm alone and hold {names} of these readings: "
        "--set measurements.frame=base (or tracker) predicts it, too"
    )


def clock_missing(
    model: Model, known: frozenset[str], cell: Cell, states: States
) -> str:
    """Say which effects pass with time, where rows have no clock, and what it costs."""
    lost = model.without_clock(known)
    pairs = zip(model.effects.effects, lost.effects.effects, strict=True)
    changed = [was for was, now in pairs if now is not was]
    if not changed or len(states) == 0:
        return ""
    at = ArmStates(cell.arm, states)
    spread = np.sqrt(moment_variance(lost.effects, at, lost.values).mean()) / MM
    clocks = sorted({_column(effect) for effect in changed})
    return (
        f"\nno {' and no '.join(clocks)} in the file: "
        f"{', '.join(e.name for e in changed)} at the mean over the survey, +- "
        f"{spread:.4f} mm per axis. The column gives the moment, after_survey of "
        "[measurements] the end of the survey"
    )


def _column(effect: Effect) -> str:
    """Name the column of the clock that an effect follows."""
    return "time_s" if getattr(effect, "clock", "") == "time" else "order"
