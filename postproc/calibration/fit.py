"""The second sentence: measurements become a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from postproc.arrays import Floats, data_frame
from postproc.calibration.backward_elimination import ENOUGH
from postproc.calibration.baselines import fit_method, too_wide
from postproc.calibration.effect_selection import Progress, model_of, no_progress
from postproc.calibration.measurements import Measurements
from postproc.calibration.monument_frame import monuments_of
from postproc.calibration.nest_check import find_groups, find_wrong_nest
from postproc.calibration.predict import predict
from postproc.calibration.registration import (
    NEAR_FLANGE,
    NEAR_POINT,
    find_undetermined_axes,
    register,
    typical_gap,
)
from postproc.calibration.regression import NEARLY, Fit, fit_effects
from postproc.calibration.report import FitReport, report_fit, report_method
from postproc.calibration.reversal_test import (
    Reversals,
    newer_widths,
    split_reversals,
)
from postproc.calibration.stops import pool_readings
from postproc.calibration.survey_checks import (
    ask_about_steps,
    check_orientations,
    check_registered,
    check_signs,
    check_stops,
    check_survey,
    list_losses,
)
from postproc.calibration.survey_files import (
    MeasurementFile,
    read_measurements,
    survey_frame,
)
from postproc.calibration.tables import DETECT, TableFormat
from postproc.calibration.validation import FitTask, Validated, validate_fit
from postproc.calibration.weight_direction import direction_warning, level_warning
from postproc.exceptions import MeasurementError, ModelError
from postproc.model.doubt import Doubt
from postproc.model.effect_sum import Combination
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.effects.placement import Placement
from postproc.model.effects.probe import Probe
from postproc.model.effects.station_shift import StationShift
from postproc.model.effects.tool_shift import ToolShift
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model, Monument
from postproc.model.model_file import Method
from postproc.model.noise import angle_step
from postproc.model.provenance import Provenance
from postproc.model.registration import Registration
from postproc.model.statistics import ErrorStatistics
from postproc.robot.arm import Arm
from postproc.robot.cell import Cell, as_cell
from postproc.robot.pose import MM
from postproc.robot.state import States
from postproc.threads import in_one_thread

if TYPE_CHECKING:
    from postproc.arrays import DataFrame

Frame = Literal["base", "tracker"]

SAME_POINT = 1e-4  # [m] nests that are nearer are one, or the cell has not said
NOTABLE = 0.002  # [mm] at the tool by rounded joint angles
OPEN = 0.01  # [mm] at the tool by effects that rows neither show nor rule out
FEWEST_FREE = 30.0  # degrees of freedom of readings that can contradict each other
CONTRADICTING = 0.25  # part of the variance that means of readings have at least
TURNED = 3e-3  # [rad] that a plate may be turned by, as far as a tracker can tell


@dataclass(frozen=True, eq=False)
class Calibration:
    """A model, and what the fit found.

    Attributes:
        model: The model.
        report: What the fit found, with the measured error before and after.
        survey: The rows in the base frame.
        cell: The cell that it was fitted in.
        frame: The frame of the measured positions.
    """

    model: Model
    report: FitReport
    survey: Measurements
    cell: Cell
    frame: Frame = "base"

    @property
    def rejected(self) -> str:
        """Why the model must not be used; "" where it may be."""
        return self.report.rejected

    def __str__(self) -> str:
        """Say in some lines what was found, and what new poses may expect."""
        report = self.report
        lines = [
            f"model {self.model.id} of {self.model.arm_name}: "
            f"{', '.join(dict.fromkeys(e.name for e in self.model.effects.effects))}",
            "" if report.held_out is None else report.held_out.describe(),
            f"measured error  {report.before.tell()}",
            f"error after fit {report.after.tell()}",
            *(f"warning: {warning}" for warning in report.warnings),
            f"not to be used: {self.rejected}" if self.rejected else "",
        ]
        return "\n".join(line for line in lines if line)

    def score(
        self,
        file: str | Path | bytes,
        *,
        name: str = "measurements.csv",
        reading: TableFormat = DETECT,
    ) -> ErrorStatistics:
        """Say what the model leaves of other measurements, which it has not seen.

        Args:
            file: Measurements in the frame of those that it was fitted to.
            name: File name of measurements that are given as bytes.
            reading: What the user knows of the file.

        Raises:
            PostprocError: It cannot be read, or has no positions.
        """
        frame = "tracker" if self.frame == "tracker" else None
        own = self.cell.measurements.model_copy(update={"frame": frame})
        found = predict(
            file,
            replace(self.cell, measurements=own),
            self.model,
            name=name,
            reading=reading,
        )
        if found.residual is None:
            cure = "Give a file with x_mm, y_mm and z_mm"
            raise MeasurementError(found.table.path, "has no positions", cure)
        return ErrorStatistics.of(found.residual)

    def save(self, path: str | Path) -> None:
        """Write the model file.

        Raises:
            ModelError: The model must not be used.
            OutputError: The place cannot be written to.
        """
        if self.rejected:
            raise ModelError(path, "is not written: the fit is rejected", self.rejected)
        self.model.save(path)

    def to_frame(self) -> DataFrame:
        """Return a data frame of the parameters, one a row.

        Columns: name, value, std_error, unit, share (of the error explained) and
        determined (part of what is known that these rows tell).
        """
        rows = self.report.parameters
        names = ("name", "value", "std_error", "unit", "share", "determined")
        return data_frame({name: [getattr(p, name) for p in rows] for name in names})


def fit(
    *files: MeasurementFile,
    cell: Cell | str | Path,
    method: Method = "full",
    effects: Sequence[str] | None = None,
    frame: Frame | None = None,
    program: str | Path | None = None,
    name: str = "measurements.csv",
    reading: TableFormat = DETECT,
    seed: int = 0,
    progress: Progress = no_progress,
) -> Calibration:
    """Fit a model to measurement files.

    Nothing is written: `Calibration.save` does that.

    Args:
        files: Measurements in visit order, as `read_measurements` takes them.
        cell: The cell, or its file: arm, probe points, tracker.
        method: "full" or one of the source's methods.
        effects: Names of the effects that "full" fits; None: geometry and backlash,
            and whatever else the survey gives evidence for.
        frame: Frame of the measured positions. In the tracker's, the tracker's place
            and the probe points are fitted too. Default: as the cell says, else the
            base frame.
        program: The survey program, for files that hold ids and positions only.
        name: File name of measurements that are given as bytes.
        reading: What the user knows of the files.
        seed: Of random layers, for methods that have one.
        progress: Told what is being done.

    Raises:
        MeasurementError: A file that cannot be read or cannot determine the geometry.
        PostprocError: An unknown effect, or one whose covariate was not recorded.
    """
    cell = as_cell(cell)
    progress("read measurements")
    survey = read_measurements(
        *files, cell=cell, program=program, name=name, reading=reading
    )
    return fit_measurements(
        survey,
        cell,
        method=method,
        effects=effects,
        frame=survey_frame(cell, frame),
        seed=seed,
        progress=progress,
    )


@in_one_thread
def fit_measurements(
    survey: Measurements,
    cell: Cell,
    *,
    method: Method = "full",
    effects: Sequence[str] | None = None,
    frame: Frame = "base",
    seed: int = 0,
    progress: Progress = no_progress,
    validate: bool = True,
) -> Calibration:
    """Fit a model to measurements, see `fit`.

    Args:
        survey: The rows.
        cell: As `fit` takes it, and so are those that follow.
        method: "full" or one of the source's methods.
        effects: Names of effects, or None.
        frame: Frame of the measured positions.
        seed: Of random layers.
        progress: Told what is being done.
        validate: Whether poses are held out, to find what new ones will be left, and to
            take simpler effects where those leave less. It takes several fits.
    """
    rows = _prepare(survey, cell, frame)
    if method != "full":
        return _with_provenance(_fit_published(rows, cell, frame, method, seed))
    task = FitTask(
        rows.survey, cell.arm, effects, rows.tracker, rows.setup, rows.mounted
    )
    fitted = task.fit(progress=progress)
    found = Validated(fitted, None)
    if validate:
        progress("predict poses that are held out")
        found = validate_fit(task, fitted)
    progress("report")
    return _with_provenance(_conclude(rows, found, cell, frame, task.doubt(found.fit)))


def _with_provenance(found: Calibration) -> Calibration:
    """Return a calibration whose model tells where it comes from."""
    model = replace(found.model, provenance=Provenance.today(found.cell))
    return replace(found, model=model)


@dataclass(frozen=True, eq=False)
class PreparedRows:
    """A survey that is ready to be fitted.

    Attributes:
        survey: One row a stop and probe point, base frame.
        tracker: Tracker position in the base frame, (3,) [m], or None.
        setup: Names of effects of the set-up, fitted besides.
        placed: Registration of rows in the tracker's frame, or None.
        points: Where the cell has the nests, flange frame, (k, 3) [m], or None.
        monuments: Fixed points, in the base frame as far as it is known.
        reversals: Steps behind reversals, taken out of the survey.
        mounted: Whether the cell states the mounting in so many words.
    """

    survey: Measurements
    tracker: Floats | None
    setup: tuple[str, ...]
    placed: Registration | None
    points: Floats | None
    monuments: tuple[Monument, ...]
    reversals: Reversals | None
    mounted: bool = False


def _prepare(survey: Measurements, cell: Cell, frame: Frame) -> PreparedRows:
    """Average readings, register rows in the tracker's frame, and check them.

    Raises:
        MeasurementError: The rows cannot be those of this arm, or of any.
    """
    survey = pool_readings(survey)
    tracker, setup = cell.tracker, several_points(survey)
    placed, points, monuments = None, None, monuments_of(survey)
    if frame == "tracker":
        points = points_of_cell(survey)
        survey, placed = into_base_frame(survey, cell.arm)
        if cell.is_levelled:
            level = level_warning(placed, cell.arm.weight)
            survey = replace(survey, warnings=(*survey.warnings, *level))
        tracker, setup = placed.origin, (Placement.name,)
        monuments = in_base_frame(monuments, placed)
    survey, reversals = split_reversals(survey, cell.arm)
    sided = check_survey(survey, cell.arm)
    if cell.measurements.lambda_sign is None:
        check_signs(survey, sided)
    asked = ask_about_steps(survey, sided)
    if frame == "base":
        setup = (*setup, *file_shifts(survey, cell.arm, cell.tracker))
    survey = check_orientations(survey, cell.arm)
    notes = (*survey.warnings, *list_losses(cell.arm, survey), *asked)
    survey = replace(survey, warnings=notes)
    mounted = cell.file.robot.mounting is not None
    return PreparedRows(
        survey, tracker, setup, placed, points, monuments, reversals, mounted
    )


def _fit_published(
    rows: PreparedRows, cell: Cell, frame: Frame, method: Method, seed: int
) -> Calibration:
    """Fit a method of the literature."""
    survey, arm = rows.survey, cell.arm
    model = fit_method(method, survey, arm, seed)
    notes = (*survey.warnings, *too_wide(model, survey, arm))
    survey = replace(survey, warnings=notes)
    model = replace(model, registration=rows.placed)
    report = report_method(model, survey, arm)
    return Calibration(model, report, survey, cell, frame)


def _conclude(
    rows: PreparedRows,
    found: Validated,
    cell: Cell,
    frame: Frame,
    doubt: Doubt | None,
) -> Calibration:
    """Make the model of a fit and its report.

    Where the cell does not state the mounting, and the rows contradict what follows
    from that, nobody but the user knows: no model is to be used.
    """
    fitted, survey, arm = found.fit, rows.survey, cell.arm
    direction = direction_warning(fitted)
    asked = "" if rows.mounted or found.error is None else "".join(direction)
    model = model_of(fitted, survey, found.widening, doubt)
    model = replace(model, registration=rows.placed, monuments=rows.monuments)
    widths = newer_widths((), model, arm, rows.reversals)
    model = replace(model, flank_widths=widths)
    notes = (
        *survey.warnings,
        *find_moved_tools(fitted, survey),
        *drifts(fitted),
        *wrong_nests(fitted, rows.points),
        *_rounding(model, fitted),
        *_contradicting_readings(fitted),
        *_explain_doubt(doubt, fitted),
        *found.notes,
        *direction,
        *file_steps(fitted, survey),
    )
    survey = replace(survey, warnings=notes)
    report = report_fit(fitted, survey, model)
    report = replace(report, held_out=found.error, rejected=found.rejected or asked)
    survey = survey.with_states(fitted.batch.states)
    return Calibration(model, report, survey, cell, frame)


def find_moved_tools(fitted: Fit, survey: Measurements) -> tuple[str, ...]:
    """Tell of rows that look as if the tool, or the nest, had moved between them."""
    told = [
        f"the tool or its nest slipped {_at(survey, effect.row)}: fitted as "
        "tool_shift, not compensated"
        for effect in fitted.combination.effects
        if isinstance(effect, ToolShift)
    ]
    found = find_groups(fitted.residual, fitted.batch.walk.flange)
    if found is None:
        return tuple(told)
    far = f"{found.describe()} in the flange frame"
    if found.step is not None:
        where = _at(survey, float(survey.states.order[found.step]))
        cure = "run postproc diagnose, or fit without --effects"
        return (*told, f"the tool or its nest has moved by {far} {where}: {cure}")
    return (
        *told,
        f"the rows look like several tools, the others at {far} from the first: if "
        "they are, add tool_id; if not, run postproc diagnose",
    )


def _rounding(model: Model, fitted: Fit) -> tuple[str, ...]:
    """Name what rounded joint angles of the file do at the tool."""
    batch = fitted.batch
    variance = model.noise.rounding_variance(batch.states.q, batch.jacobian)
    size = float(np.sqrt(variance.sum(axis=1).mean())) / MM
    if size < NOTABLE:
        return ()
    step = float(np.rad2deg(angle_step(batch.states.q)))
    return (
        f"the joint angles of the file are rounded to {step:.3g} deg: that is "
        f"{size:.3f} mm at the tool (rms), which no effect can take out of these rows. "
        "Write more decimals, or give the survey program (--program)",
    )


def _contradicting_readings(fitted: Fit) -> tuple[str, ...]:
    """Ask about readings that differ by far more than their means are off.

    Means of readings of one stop scatter by what a reading does over the root of their
    number, at least. Those of a pose that was approached from both sides do not: what
    each differs by is the same.
    """
    states = fitted.batch.states
    several = (states.readings > 1) & (fitted.rows.weight > 0)
    free = 3.0 * float(several.sum()) - fitted.effective
    if free < FEWEST_FREE:
        return ()
    more = float((states.readings[several] - 1.0).sum())
    within = float(states.scatter[several].sum()) / (3.0 * more)
    expected = within / states.readings[several]
    seen = float((fitted.residual[several] ** 2).sum()) / free
    if seen > CONTRADICTING * float(expected.mean()):
        return ()
    apart, left = (float(np.sqrt(v)) / MM for v in (within, seen))
    return (
        f"readings of one stop scatter by {apart:.3f} mm per axis, but the model "
        f"leaves {left:.3f} mm of their means: they are not readings of one stop. If "
        "poses were approached from both sides, add lambda1 to lambda6; backlash is "
        "not corrected without them",
    )


def _explain_doubt(doubt: Doubt | None, fitted: Fit) -> tuple[str, ...]:
    """Name what may be there, where stated errors are notably larger for it."""
    if doubt is None:
        return ()
    c, effects = fitted.combination, doubt.effects.effects
    variance = doubt.variance(c, c.at(fitted.batch, fitted.values))
    size = float(np.sqrt(variance.sum(axis=1).mean())) / MM
    if size < OPEN:
        return ()
    names = " or ".join(dict.fromkeys(e.name for e in effects))
    otherwise = any(e.settings().get("along") is not None for e in effects)
    state = ", and state mounting under [robot]" if otherwise else ""
    return (
        f"these rows do not show whether there is {names}: it is not corrected, but "
        f"stated standard errors include {size:.3f} mm at the tool (rms) for it. "
        f"Measure more poses, with more decimals of joint angles{state}",
    )


def drifts(fitted: Fit) -> tuple[str, ...]:
    """Tell what is left with and without what passed in time, and what state counts."""
    c, told, used = fitted.combination, [], fitted.rows.weight > 0
    left = _mean_mm(fitted.residual[used])
    for effect, part in zip(c.effects, c.slices, strict=True):
        if state := effect.refers_to():
            kept = _mean_mm((fitted.residual + fitted.move(part))[used])
            told.append(
                f"{effect.name} over time: the mean error of the rows is {left:.4f} mm "
                f"with it, {kept:.4f} mm without it. Predictions are for {state}"
            )
    return tuple(told)


def _mean_mm(vectors: Floats) -> float:
    """Average the lengths of vectors (n, 3) [m], in mm."""
    return float(np.linalg.norm(vectors, axis=1).mean()) / MM


def wrong_nests(fitted: Fit, points: Floats | None = None) -> tuple[str, ...]:
    """Tell of a nest that does not lie where the cell says.

    Args:
        fitted: The fit.
        points: Where the cell has the nests, flange frame, (k, 3) [m], of rows in the
            tracker's frame, whose probe points were found with the tracker; None where
            it does not say.
    """
    c, told = fitted.combination, []
    for effect, part in zip(c.effects, c.slices, strict=True):
        turned = np.zeros((1, 1))
        if isinstance(effect, Placement) and points is not None:
            arms = points - points.mean(axis=0)
            moved = np.cross(np.eye(3)[:, None], arms).reshape(3, -1)
            turning: Floats = moved.T @ moved
            part, turned = effect.points(part), TURNED**2 * turning
            beside = _points(fitted.batch.states) - points
        elif isinstance(effect, Probe):
            beside = np.zeros(3)
        else:
            continue
        offset = beside + fitted.values[part].reshape(-1, 3)
        covariance = fitted.covariance[part, part] + turned
        found = find_wrong_nest(effect.tools, offset, covariance)
        told += [] if found is None else [str(found)]
    return tuple(told)


def points_of_cell(survey: Measurements) -> Floats | None:
    """Say where the cell has the nests, (k, 3) [m], None where it has one or none."""
    points = _points(survey.states)
    gaps = np.linalg.norm(points[:, None] - points, axis=2)
    apart = gaps[np.triu_indices(len(points), 1)]
    return points if apart.min(initial=np.inf) > SAME_POINT and len(apart) else None


def _points(states: States) -> Floats:
    """Take the probe point of every tool_id, flange frame, (k, 3) [m]."""
    ids = np.unique(states.tool_id)
    return np.stack([states.tool[states.tool_id == k].mean(axis=0) for k in ids])


def _at(survey: Measurements, order: float) -> str:
    """Name the first row from a place in the visit order."""
    return f"at row {survey.ids[int(np.argmax(survey.states.order >= order))]}"


def file_shifts(
    survey: Measurements, arm: Arm, tracker: Floats | None
) -> tuple[str, ...]:
    """Name the step between files of the base frame, where there is evidence for it.

    Geometry and backlash are fitted to all rows, with and without it.

    Args:
        survey: The measurements in the base frame, of several files or of one.
        arm: The arm.
        tracker: Tracker position in the base frame, (3,) [m], or None.
    """
    if not StationShift.may_show(survey.states):
        return ()
    batch = ArmStates(arm, survey.states)
    origin = None if tracker is None else (tracker[0], tracker[1], tracker[2])
    names = (*BASE_EFFECTS, *several_points(survey))
    fits = [
        fit_effects(
            batch, survey.position, propose(effects, arm, survey.states), origin,
            until=NEARLY,
        )
        for effects in (names, (*names, StationShift.name))
    ]  # fmt: skip
    gain = fits[1].log_evidence - fits[0].log_evidence
    return (StationShift.name,) if gain > ENOUGH else ()


def file_steps(fitted: Fit, survey: Measurements) -> tuple[str, ...]:
    """Tell by how much files of the base frame lie beside the first."""
    c, told = fitted.combination, []
    for effect, part in zip(c.effects, c.slices, strict=True):
        if not isinstance(effect, StationShift):
            continue
        moved = np.linalg.norm(fitted.move(part), axis=1)
        for s in effect.stations:
            size = float(moved[survey.states.station == s].mean()) / MM
            told.append(
                f"{survey.stations[s]} lies {size:.3f} mm beside {survey.stations[0]}: "
                "another station of the tracker, or the base has moved. Fitted as "
                f"station_shift, not compensated; the model is in the base frame of "
                f"{survey.stations[0]}"
            )
    return tuple(told)


def several_points(survey: Measurements) -> tuple[str, ...]:
    """Name the effect of a probe plate's nests, where there are several."""
    return (Probe.name,) if len(np.unique(survey.states.tool_id)) > 1 else ()


def into_base_frame(
    survey: Measurements, arm: Arm
) -> tuple[Measurements, Registration]:
    """Register a survey in the tracker's frame with the nominal arm.

    Raises:
        MeasurementError: The positions fit the arm in no frame.
    """
    nothing = Combination(())
    found = register(
        arm, survey.states, survey.position, nothing, np.zeros(0), survey.stations
    )
    notes = []
    for name, T in zip(found.stations, found.transforms, strict=True):
        xyz = ", ".join(f"{v / MM:.1f}" for v in T[:3, 3])
        of = f" of {name}" if len(found.stations) > 1 else ""
        notes.append(f"tracker{of} at {xyz} mm in the base frame")
    for k, name in enumerate(found.tool_ids):
        xyz = ", ".join(f"{v / MM:.2f}" for v in found.probes[k])
        notes.append(f"probe point {name} at {xyz} mm in the flange frame")
    turned = None
    if survey.rotation is not None:
        turned = found.rotations(survey.states.station) @ survey.rotation
    registered = replace(
        survey,
        states=found.on_probes(survey.states),
        position=found.to_base(survey.position, survey.states.station),
        rotation=turned,
        warnings=(*survey.warnings, *notes, *probe_note(found, arm, survey.states)),
    )
    typical = typical_gap(found, arm, survey.states, survey.position)
    check_registered(survey, registered, arm, typical)
    check_stops(survey, arm)
    return registered, found


def in_base_frame(
    monuments: tuple[Monument, ...], placed: Registration
) -> tuple[Monument, ...]:
    """Convert fixed points from the frame of the first station to the base frame."""
    if not monuments:
        return ()
    places = placed.to_base(np.array([xyz for _, xyz in monuments])).tolist()
    return tuple(
        (name, (x, y, z))
        for (name, _), (x, y, z) in zip(monuments, places, strict=True)
    )


def probe_note(placed: Registration, arm: Arm, states: States) -> tuple[str, ...]:
    """Say in one sentence what a tool that never turned leaves unknown of its probe."""
    axes = find_undetermined_axes(placed, arm, states)
    if len(axes) == 0:
        return ()
    how = "never turned" if len(axes) == 3 else "turned about one axis only"
    where = (
        ""
        if len(axes) == 3
        else " along "
        + " and ".join("(" + ", ".join(f"{v:.2f}" for v in axis) + ")" for axis in axes)
    )
    near = NEAR_POINT if np.abs(states.tool).max() > 0 else NEAR_FLANGE
    return (
        f"the tool {how}: the position of the probe{where} in the flange frame is not "
        f"determined; that of the cell is used (+- {near / MM:.0f} mm). Predictions "
        "are valid only for this orientation of the tool. Measure poses with other "
        "orientations",
    )
