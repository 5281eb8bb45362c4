"""The cell file: the robot's surroundings as the program finds them at its start."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import (
    Field,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    field_validator,
    model_validator,
)

from postproc.arrays import Floats
from postproc.exceptions import CellError
from postproc.files import path_in
from postproc.robot.arm import Arm, load_arm
from postproc.robot.arm_file import (
    Controller,
    Sextuple,
    Strict,
    Triple,
    parse_toml,
    read_toml,
    validate,
)
from postproc.robot.pose import MM, pose_from_record, rotation_from_zyz

Source = Literal["cad", "tracker", "taught"]
Effect = Literal["motionless", "moves", "sets-frames"]
SurveyMode = Literal["lhs", "optimal", "d-optimal"]
DESIGN = frozenset("mode seed reversals order".split())  # how poses are chosen
ArmNumber = PositiveInt  # which arm of its controller
ANY_TOOL = 3  # probe points of a survey that holds for any tool
MOTIONLESS = "motionless"  # beside names: the key whose value lists patterns
STILL = "still"  # what that was called

NO_ANGLES = [0.0, 0.0, 0.0]
TAUGHT_POINTS = ("the origin", "a point on +x", "a point at +y")
MOUNTINGS = {
    "floor": (0.0, 0.0, -1.0),
    "ceiling": (0.0, 0.0, 1.0),
    "wall": (1.0, 0.0, 0.0),
}  # where weight pulls in the arm's base frame
LONGEST_MM = 50_000.0  # no frame is farther away: a longer one has a wrong unit


class FrameSection(Strict):
    """A frame: where it is, and where that is known from."""

    xyz_mm: Triple
    euler_zyz_deg: Triple = NO_ANGLES
    source: Source = "cad"
    taught_deg: list[Sextuple] | None = None
    taught_direction: list[Sextuple] | None = None

    RENAMED: ClassVar[Mapping[str, str]] = {"taught_lambda": "taught_direction"}

    @model_validator(mode="before")
    @classmethod
    def _from_list(cls, value: object) -> object:
        """Accept the six numbers of a POS as well as the two named triples."""
        if isinstance(value, list) and len(value) == 6:
            return {"xyz_mm": value[:3], "euler_zyz_deg": value[3:]}
        return value

    @model_validator(mode="after")
    def _plausible(self) -> FrameSection:
        if max(abs(v) for v in self.xyz_mm) > LONGEST_MM:
            raise ValueError(f"xyz_mm is beyond {LONGEST_MM:g} mm: is it in mm?")
        if max(abs(v) for v in self.euler_zyz_deg) > 360.0:
            raise ValueError("euler_zyz_deg is beyond 360 deg")
        if self.taught_deg is not None:
            if self.source != "taught":
                raise ValueError('taught_deg needs source = "taught"')
            if len(self.taught_deg) != len(TAUGHT_POINTS):
                raise ValueError(f"taught_deg needs {', '.join(TAUGHT_POINTS)}")
        if (rows := self.taught_direction) is not None:
            name, given = "taught_direction", self.taught_deg
            if given is None or len(rows) != len(given):
                raise ValueError(f"{name} needs a row for each row of taught_deg")
            if any(side not in (-1.0, 0.0, 1.0) for row in rows for side in row):
                raise ValueError(f"{name} holds -1, 0 (not known) or 1 per joint")
        return self

    def record(self) -> tuple[float, ...]:
        """Return x, y, z [mm], a, e, r [deg]."""
        return (*self.xyz_mm, *self.euler_zyz_deg)


class RobotSection(Strict):
    """Which arm, how it is mounted, and what its controller does.

    Attributes:
        arm: Name of a shipped arm, or an arm file.
        arm_number: Which arm of its controller it is.
        controller: Whose controller runs the programs, or several; default: as the arm
            file has it.
        serial_number: Of the robot, kept with the models that are fitted for it.
        absolute_accuracy: Whether the controller compensates the arm itself.
        mounting: Where weight pulls in the arm's base frame: "floor" along -z,
            "ceiling" along +z, "wall" along +x, or a vector of any length. Without it
            weight pulls along -z of the world, in which [base] places the arm.
    """

    arm: str
    arm_number: ArmNumber = 1
    controller: Controller | list[Controller] | None = None
    serial_number: str | None = None
    absolute_accuracy: bool = False
    mounting: Literal["floor", "ceiling", "wall"] | Triple | None = None

    @field_validator("mounting", mode="before")
    @classmethod
    def _direction(cls, value: object) -> object:
        """Check that a mounting is one of the words, or a vector with a direction."""
        if isinstance(value, str) and value in MOUNTINGS:
            return value
        if isinstance(value, list) and len(value) == 3:
            numbers = [v for v in value if isinstance(v, int | float)]
            if len(numbers) == 3 and 0.0 < sum(v * v for v in numbers) < np.inf:
                return value
        raise ValueError(
            '"floor", "ceiling", "wall", or the direction in which weight pulls in the '
            "base frame of the arm, such as [1, 0, 0]"
        )


class JointPositionSection(Strict):
    """Where $HOME or $CAL_SYS is."""

    joints_deg: Sextuple


class PayloadSection(Strict):
    """What the arm carries, tool included."""

    mass_kg: NonNegativeFloat
    com_mm: Triple = NO_ANGLES


class EnvironmentSection(Strict):
    """The state that compensation is made for."""

    temperature_c: Annotated[float, Field(ge=-30.0, le=80.0)]


class MotionSection(Strict):
    """The speeds that hold on the controller where a program sets none.

    Attributes:
        linear_mm_s: Of the TCP along lines and arcs.
        override: Of all speeds, in percent.
        linear_limit_mm_s: The largest of the TCP that the controller allows.
    """

    linear_mm_s: PositiveFloat | None = None
    linear_limit_mm_s: PositiveFloat | None = None
    override: Annotated[float, Field(gt=0.0, le=100.0)] | None = None


class TrackerSection(Strict):
    """Where the laser tracker stands, in the arm's base frame."""

    xyz_mm: Triple


class SurveySection(Strict):
    """How the arm is surveyed: probe points (SMR nests) in the flange frame, and poses.

    A 6D probe also has an orientation there; without it, the flange's own orientation
    cannot be told from the probe's.

    Attributes:
        points_mm: The points, tool_id 0, 1, ..
        points: The points by name, instead.
        euler_zyz_deg: Orientation of a 6D probe.
        levelled: Whether z of the tracker's frame points up, set by its level.
        mode: How poses are chosen, see `design_survey`.
        seed: Of the random draws of poses.
        reversals: How often every joint turns back in small steps, too.
        order: Of the poses: as they are drawn, or so that moves are short.
    """

    points_mm: list[Triple] = Field(default_factory=list)
    points: dict[str, Triple] = Field(default_factory=dict)
    euler_zyz_deg: Triple | None = None
    levelled: bool = False
    mode: SurveyMode = "lhs"
    seed: NonNegativeInt = 0
    reversals: NonNegativeInt = 0
    order: Literal["drawn", "short"] = "drawn"

    @property
    def names_points(self) -> bool:
        """Whether more is stated than how poses are chosen."""
        return not self.model_fields_set or bool(self.model_fields_set - DESIGN)


class SimulationSection(Strict):
    """Which virtual arm runs the programs of this cell.

    Attributes:
        seed: Of every random draw.
        effects: Further effects, comma separated; any motion of a part by its text.
        backlash_model: What gears do in their gaps; `mixed` draws it for each gear.
        track_rate_hz: Readings in a second of a tracker that follows the tool.
    """

    seed: NonNegativeInt = 1
    effects: str | None = None
    backlash_model: Literal["sharp", "elastic", "gravity", "inertia", "mixed"] = "sharp"
    track_rate_hz: Annotated[float, Field(ge=1.0, le=1000.0)] = 100.0


Limits = Annotated[list[PositiveFloat], Field(min_length=6, max_length=6)]
JOINT_DEG = [5.0, 5.0, 5.0, 10.0, 10.0, 10.0]


class VerifySection(Strict):
    """Whether `compensate` asks for a second opinion on what it writes."""

    second_opinion: bool = False


class VariablesSection(Strict):
    """What other programs do to variables that they share with ours."""

    constant: list[str] = Field(default_factory=list)


class LimitSection(Strict):
    """When a correction is not trusted.

    Attributes:
        correction_mm, correction_deg: Most that a target moves and turns.
        conflict_mm: Arrivals at one point whose corrections differ by more do not
            agree.
        averaged_mm: Most that one correction for arrivals that do not agree leaves of
            each; more is listed, and the exit code is 1.
        correction_step_mm: Most that the correction changes along 100 mm of a
            continuous path.
        wrist_deg: Axis 5 nearer to zero than this is the wrist singularity.
        joint_deg: Most that every joint turns by a correction, at a target and on the
            way to it.
        elbow_mm, wrist_centre_mm: Most that elbow and wrist centre move likewise.
        segment_ms: What a piece of a move with points on its way lasts at the
            programmed speed, at least.
        reapproach_mm: Most that a stop that is inserted before a target is away.
        payload_mm: Most that a load which was not surveyed adds to the standard error.
    """

    correction_mm: PositiveFloat = 5.0
    correction_deg: PositiveFloat = 1.0
    conflict_mm: PositiveFloat = 0.02
    averaged_mm: PositiveFloat = 0.3
    payload_mm: PositiveFloat = 0.1
    correction_step_mm: PositiveFloat = 0.5
    wrist_deg: PositiveFloat = 3.0
    joint_deg: Limits = JOINT_DEG
    elbow_mm: PositiveFloat = 10.0
    wrist_centre_mm: PositiveFloat = 10.0
    segment_ms: PositiveFloat = 50.0
    reapproach_mm: PositiveFloat = 10.0

    RENAMED: ClassVar[Mapping[str, str]] = {
        "agree_mm": "conflict_mm",
        "step_mm": "correction_step_mm",
        "approach_mm": "reapproach_mm",
    }


SharedPoints = Literal["mean", "clone", "leave"]
PointFrame = Literal["base", "uframe", "tracker"]
MAX_INSERTED = 1_000  # points that are inserted into a program


class CompensationSection(Strict):
    """How the programs of this cell are compensated.

    Attributes:
        orientation: Correct the orientation of targets as well as their position.
        shared_points: What is done with a point that several arrivals share: "mean"
            gives it the mean of corrections that agree within limits.conflict_mm, else
            the one whose worst arrival is best, where that helps every arrival;
            "clone" gives moves whose arrivals do not agree points of their own, and the
            same as "mean" to those that cannot have them;
            "leave" corrects no point that several moves go to.
        edit_exported: Edit variables that other programs may read.
        assume_motion: Assume that a routine that the cell does not name moves the arm,
            also where the shipped list has it as motionless.
        max_inserted: The most points that are inserted into a program.
        preload_backlash: Insert a stop where a move begins, which brings the gears to
            the flank on which the move holds them.
        reapproach: Insert a stop before each target whose approach direction is
            uncertain.
        path_tolerance_mm: Insert points where a path is predicted to be left by more;
            default: insert none.
        timing: Plan the program in time, before and after; default: `compensate` and
            `explain` do if it is short. Where points are inserted it is planned so.
    """

    orientation: bool = False
    shared_points: SharedPoints = "mean"
    edit_exported: bool = False
    assume_motion: bool = False
    max_inserted: NonNegativeInt = MAX_INSERTED
    preload_backlash: bool = False
    reapproach: bool = False
    path_tolerance_mm: PositiveFloat | None = None
    timing: bool | None = None


class JobSection(Strict):
    """What the programs of this cell must keep to.

    Attributes:
        tolerance_mm: Largest true error of a target.
        tolerances_mm: .. of targets whose name, or whose program file, fits a pattern.
        operator: Who is responsible for the programs, for reports.
    """

    tolerance_mm: PositiveFloat | None = None
    tolerances_mm: dict[str, PositiveFloat] = Field(default_factory=dict)
    operator: str | None = None

    @model_validator(mode="after")
    def _has_a_default(self) -> JobSection:
        """Refuse patterns without a tolerance of all other targets."""
        if self.tolerances_mm and self.tolerance_mm is None:
            raise ValueError("tolerances_mm needs tolerance_mm, for all other targets")
        return self


class MeasurementSection(Strict):
    """How measurement files of this cell are written; what is not stated is detected.

    Attributes:
        columns: A column map (TOML), its place relative to the cell file.
        delimiter: Between cells: itself, or tab, space, comma, semicolon.
        decimal: "." or ",".
        encoding: Name of a Python codec.
        unit: Of coordinates in files that do not state it; default: mm, where they are
            as large as those of an arm.
        angle_unit: Of joint angles in files that do not state it.
        sheet: Of a workbook: the sheet with the measurements.
        frame: Frame of the measured positions; default: the arm's base frame.
        instrument: What measured, kept with the models that are fitted.
        refit_registration: `predict` finds the place of the tracker from the rows.
        after_survey: `predict` takes what passes with time as at the survey's end.
        lambda_sign: Of the lambda columns: -1 turns all of them; 1 says that they are
            right, though links seem to run ahead of their drives.
    """

    columns: str | None = None
    delimiter: str | None = None
    decimal: Literal[".", ","] | None = None
    encoding: str | None = None
    unit: Literal["mm", "m", "inch", "ft"] | None = None
    angle_unit: Literal["deg", "rad"] | None = None
    sheet: str | None = None
    frame: PointFrame | None = None
    instrument: str | None = None
    refit_registration: bool = False
    after_survey: bool = False
    lambda_sign: Literal[1, -1] | None = None


AS_USUAL, DETECTED = CompensationSection(), MeasurementSection()


class FrameTableEntry(Strict):
    """The frames that one call of a frame routine sets."""

    tool: FrameSection | None = None
    base: FrameSection | None = None
    uframe: FrameSection | None = None


class FramesSection(Strict):
    """Tables of routines that set frames, by routine name and arguments."""

    routines: dict[str, dict[str, FrameTableEntry]] = Field(default_factory=dict)


class CellFile(Strict):
    """A whole cell file."""

    robot: RobotSection
    tool: FrameSection | None = None
    base: FrameSection | None = None
    uframe: FrameSection | None = None
    home: JointPositionSection | None = None
    calibration: JointPositionSection | None = None
    payload: PayloadSection | None = None
    environment: EnvironmentSection | None = None
    motion: MotionSection = MotionSection()
    tracker: TrackerSection | None = None
    survey: SurveySection | None = None
    simulation: SimulationSection = SimulationSection()
    aux: dict[str, Literal["gun", "track", "positioner"]] = Field(default_factory=dict)
    limits: LimitSection = LimitSection()
    compensation: CompensationSection = CompensationSection()
    job: JobSection = JobSection()
    measurements: MeasurementSection = MeasurementSection()
    routines: dict[str, Effect | list[str]] = Field(default_factory=dict)
    frames: FramesSection = FramesSection()
    variables: VariablesSection = VariablesSection()
    verify: VerifySection = VerifySection()
    taught: list[str] = Field(default_factory=list)

    @field_validator("routines", mode="before")
    @classmethod
    def _no_old_word(cls, given: object) -> object:
        """Refuse `still`, as a key of patterns or as what a routine does."""
        for name, what in given.items() if isinstance(given, dict) else ():
            if what == STILL or (name == STILL and isinstance(what, list)):
                raise ValueError(f"{STILL} is called {MOTIONLESS}")
        return given

    @field_validator("routines")
    @classmethod
    def _one_list(cls, given: dict[str, Effect | list[str]]) -> dict[str, object]:
        """Take a list of patterns under `motionless` alone."""
        for name, what in given.items():
            if isinstance(what, list) and name != MOTIONLESS:
                raise ValueError(
                    f"{name} has a list: only `{MOTIONLESS}` lists routines, such as "
                    f'{MOTIONLESS} = ["spot", "lrobot.*"]'
                )
        return dict(given)


@dataclass(frozen=True)
class Frame:
    """A frame of the cell: its pose (4, 4) [m], its record [mm, deg] and its source."""

    pose: Floats
    record: tuple[float, ...]
    source: Source


@dataclass(frozen=True)
class Cell:
    """The robot's surroundings, in SI units; the file's own sections stay in `file`.

    Attributes:
        path: Where the cell was read from.
        arm: The arm.
        arm_number: Which arm of its controller it is.
        tool: TCP in the flange frame at program start.
        base: The arm's base in the world at program start.
        uframe: The user frame in the world at program start.
        home: $HOME, (6,) [rad], or None.
        calibration: $CAL_SYS, (6,) [rad], or None.
        payload_mass: [kg], NaN where not declared.
        payload_com: Centre of mass in the flange frame, (3,) [m].
        temperature: [deg C], NaN where not declared.
        tracker: Tracker position in the base frame, (3,) [m], or None.
        probes: Probe points of a survey in the flange frame, (k, 3) [m]; the tool's TCP
            where the cell lists none. Row i belongs to tool_id i.
        probe_names: Names of the probe points, () where the cell numbers them.
        mounting: Orientation of a 6D probe in the flange frame, (3, 3), or None.
        aux: Kind of every declared auxiliary axis.
        limits: Guards, in the units of their names.
        compensation: How programs are compensated.
        measurements: How measurement files are written; its column map is a whole path.
        routines: What outside routines do, by lower-case name.
        motionless: Lower-case patterns of outside routines, ``name`` or
            ``program.name``, that neither move the arm nor set frames.
        frame_tables: Frames set by routines, by lower-case name, then arguments.
        taught: Lower-case names of points that were taught with the robot.
        taught_sides: From which side the joints arrived at the three points of taught
            frames, where that is stated, (3, 6) from -1 to 1.
        taught_frames: Records of the frames that were taught with the robot, with the
            joint angles of their three points, (3, 6) [rad], or None.
        constant: Lower-case patterns of variables and shared data, ``name``,
            ``name[index]`` or ``program.name``, that no other program changes.
    """

    path: Path
    file: CellFile
    arm: Arm
    arm_number: int
    tool: Frame
    base: Frame
    uframe: Frame
    home: Floats | None
    calibration: Floats | None
    payload_mass: float
    payload_com: Floats
    temperature: float
    tracker: Floats | None
    probes: Floats
    mounting: Floats | None
    aux: Mapping[int, str]
    limits: LimitSection
    routines: Mapping[str, Effect]
    frame_tables: Mapping[str, Mapping[str, FrameTableEntry]]
    taught: frozenset[str]
    taught_frames: Mapping[tuple[float, ...], Floats | None]
    motionless: tuple[str, ...] = ()
    constant: tuple[str, ...] = ()
    compensation: CompensationSection = AS_USUAL
    measurements: MeasurementSection = DETECTED
    taught_sides: Mapping[tuple[float, ...], Floats] = field(default_factory=dict)
    probe_names: tuple[str, ...] = ()

    @property
    def controllers(self) -> tuple[Controller, ...]:
        """Return whose controllers may run the programs, () where nothing is said."""
        said = self.file.robot.controller or self.arm.file.controller
        if isinstance(said, str):
            return (said,)
        return tuple(said or ())

    @property
    def is_levelled(self) -> bool:
        """Whether z of the tracker's own frame points up."""
        return self.file.survey is not None and self.file.survey.levelled

    @property
    def nests(self) -> Floats | Mapping[str, Floats]:
        """Return the probe points by name, or as numbered, (k, 3) [m]."""
        if not self.probe_names:
            return self.probes
        return dict(zip(self.probe_names, self.probes, strict=True))


def _frame(section: FrameSection | None) -> Frame:
    """Convert a frame section; a missing one is the identity."""
    if section is None:
        return Frame(np.eye(4), (0.0,) * 6, "cad")
    record = section.record()
    return Frame(pose_from_record(np.array(record)), record, section.source)


def as_cell(cell: Cell | str | Path) -> Cell:
    """Return a cell that is given itself, or by its file.

    Raises:
        CellError, ArmError: See `load_cell`.
    """
    return cell if isinstance(cell, Cell) else load_cell(cell)


def load_cell(
    file: str | Path | bytes,
    *,
    name: str = "cell.toml",
    changes: Sequence[str] = (),
) -> Cell:
    """Read a cell file.

    Args:
        file: Its path, or its text as bytes.
        name: Of text, for messages; an arm file it names lies beside this path.
        changes: Keys of `CHANGEABLE` sections for this run, as
            ``compensation.orientation=true``; the value ``none`` stands for the
            default.

    Raises:
        CellError: The file cannot be read, or a key, unit or value is wrong; the
            message names the place and the cure.
        ArmError: The arm it names cannot be loaded.
    """
    if isinstance(file, bytes):
        path, read = Path(name), parse_toml(Path(name), file, CellFile, CellError)
    else:
        path, read = Path(file), read_toml(Path(file), CellFile, CellError)
    for change in changes:
        read = _with_change(read, change)
    return _cell_of(path, read)


CHANGEABLE: Mapping[str, type[Strict]] = {
    "compensation": CompensationSection,
    "environment": EnvironmentSection,
    "job": JobSection,
    "measurements": MeasurementSection,
    "payload": PayloadSection,
    "simulation": SimulationSection,
    "survey": SurveySection,
    "tracker": TrackerSection,
    "verify": VerifySection,
}


def _with_change(file: CellFile, change: str) -> CellFile:
    """Return a cell file with one key changed for a run.

    Raises:
        CellError: There is no such key, or the value is wrong.
    """
    place, _, text = change.partition("=")
    name, _, key = place.strip().partition(".")
    if name not in CHANGEABLE or not key or not text.strip():
        cure = f"Write SECTION.KEY=VALUE. Sections: {', '.join(CHANGEABLE)}"
        raise CellError(f"--set {change}", "names no section, key and value", cure)
    stated = getattr(file, name)
    data = {} if stated is None else stated.model_dump(exclude_unset=True)
    data.pop(key, None)
    value = _value(text.strip())
    if value != "none":
        whole = key == "columns" and isinstance(value, str)
        data[key] = str(Path(str(value)).absolute()) if whole else value
    elif key not in CHANGEABLE[name].model_fields:
        data[key] = value
    if not data and CellFile.model_fields[name].default is None:
        return file.model_copy(update={name: None})
    section = validate(f"--set {change}", data, CHANGEABLE[name], CellError)
    return file.model_copy(update={name: section})


def verify_section(changes: Sequence[str]) -> tuple[VerifySection, tuple[str, ...]]:
    """Return [verify] as changes alone make it, and the other changes.

    Raises:
        CellError: There is no such key, or the value is wrong.
    """
    own = [change for change in changes if change.strip().startswith("verify.")]
    file = CellFile.model_construct()
    for change in own:
        file = _with_change(file, change)
    return file.verify, tuple(change for change in changes if change not in own)


def _value(text: str) -> object:
    """Read a value as TOML has it; a bare word is a text.

    >>> _value("0.1"), _value("true"), _value("clone"), _value('"a b"')
    (0.1, True, 'clone', 'a b')
    """
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text


def _beside(folder: Path, section: MeasurementSection) -> MeasurementSection:
    """Return what is stated of measurement files, with the whole path of its map."""
    if section.columns is None:
        return section
    return section.model_copy(update={"columns": str(path_in(folder, section.columns))})


def _cell_of(path: Path, file: CellFile) -> Cell:
    arm = load_arm(file.robot.arm, beside=path.parent).mount(_weight(file))
    payload, tracker, survey = file.payload, file.tracker, file.survey
    turn = None if survey is None else survey.euler_zyz_deg
    return Cell(
        path=path,
        file=file,
        arm=arm,
        arm_number=file.robot.arm_number,
        tool=_frame(file.tool),
        base=_frame(file.base),
        uframe=_frame(file.uframe),
        home=_angles(file.home, "home", arm, path),
        calibration=_angles(file.calibration, "calibration", arm, path),
        payload_mass=np.nan if payload is None else payload.mass_kg,
        payload_com=np.array(NO_ANGLES if payload is None else payload.com_mm) * MM,
        temperature=file.environment.temperature_c if file.environment else np.nan,
        tracker=None if tracker is None else np.array(tracker.xyz_mm) * MM,
        probes=_probes(path, file),
        probe_names=() if survey is None else tuple(survey.points),
        mounting=None if turn is None else rotation_from_zyz(np.array(turn)),
        aux=_aux(file, path),
        limits=file.limits,
        compensation=file.compensation,
        measurements=_beside(path.parent, file.measurements),
        routines={
            name.lower(): what
            for name, what in file.routines.items()
            if not isinstance(what, list)
        },
        motionless=_patterns(file.routines.get(MOTIONLESS)),
        constant=_patterns(file.variables.constant),
        frame_tables={k.lower(): v for k, v in file.frames.routines.items()},
        taught=frozenset(name.lower() for name in file.taught),
        taught_frames={
            frame.record(): np.deg2rad(frame.taught_deg) if frame.taught_deg else None
            for frame in _frames_of(file)
            if frame.source == "taught"
        },
        taught_sides={
            frame.record(): np.array(frame.taught_direction, dtype=float)
            for frame in _frames_of(file)
            if frame.taught_direction is not None
        },
    )


def _weight(file: CellFile) -> Floats:
    """Return the direction in which weight pulls, (3,), base frame of the arm."""
    mounting = file.robot.mounting
    if isinstance(mounting, list):
        return np.array(mounting)
    if mounting is not None:
        return np.array(MOUNTINGS[mounting])
    return -_frame(file.base).pose[2, :3]  # -z of the world, turned into the base


def _patterns(said: object) -> tuple[str, ...]:
    """Return the patterns of a list, none of anything else."""
    return tuple(map(str.lower, said)) if isinstance(said, list) else ()


def _frames_of(file: CellFile) -> list[FrameSection]:
    """List the frames of the cell and of its tables."""
    tables = file.frames.routines.values()
    frames = [file.tool, file.base, file.uframe]
    for entry in (entry for table in tables for entry in table.values()):
        frames += [entry.tool, entry.base, entry.uframe]
    return [frame for frame in frames if frame is not None]


def _angles(
    section: JointPositionSection | None, name: str, arm: Arm, path: Path
) -> Floats | None:
    """Convert and check $HOME or $CAL_SYS."""
    if section is None:
        return None
    joints: Floats = np.deg2rad(section.joints_deg)
    if not arm.within_limits(joints[None])[0]:
        j = int(np.argmax((joints < arm.lower) | (joints > arm.upper)))
        raise CellError(
            path,
            f"{section.joints_deg[j]:g} deg is outside the range of axis {j + 1}",
            "Correct the angle or the arm file",
            place=f"$.{name}.joints_deg[{j + 1}]",
        )
    return joints


def _probes(path: Path, file: CellFile) -> Floats:
    """Convert the survey's probe points; the default is the tool's TCP.

    Raises:
        CellError: They are given twice, or not at all.
    """
    if file.survey is None or not file.survey.names_points:
        return _frame(file.tool).pose[None, :3, 3]
    numbered, named = file.survey.points_mm, list(file.survey.points.values())
    if bool(numbered) == bool(named):
        problem = "has points_mm and points" if named else "has no points"
        cure = (
            "Write points_mm = [[x, y, z], ..], or [survey.points] with lines as "
            "front = [x, y, z]"
        )
        raise CellError(path, problem, cure, place="$.survey")
    return np.array(numbered or named) * MM


def _aux(file: CellFile, path: Path) -> dict[int, str]:
    """Convert the keys of [aux] to axis numbers."""
    for key in file.aux:
        if not key.isdigit() or int(key) < 1:
            raise CellError(
                path, "not an axis number", 'Write 1 = "gun"', place=f"$.aux.{key}"
            )
    return {int(key): str(kind) for key, kind in file.aux.items()}


def explain_few_probes(cell: Cell) -> str:
    """Say what fewer than `ANY_TOOL` probe points mean, "" for enough of them."""
    count = len(cell.probes)
    if count >= ANY_TOOL:
        return ""
    return (
        f"{count} of {ANY_TOOL} probe points: the model will hold only for tools with "
        f"the tip there. Give {ANY_TOOL} under [survey] points_mm"
    )
