"""The registry of findings and reasons: code, severity, meaning and cure of each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Self


class Severity(StrEnum):
    """What a finding asks for."""

    NOTE = "note"  # nothing: it reports what was done, or assumed
    WARNING = "warning"  # a look: targets keep their values, or are less certain
    ERROR = "error"  # a change: as it is the program must not be uploaded


NOTE, WARNING, ERROR = Severity.NOTE, Severity.WARNING, Severity.ERROR


class Code(StrEnum):
    """What was found in a program or a tree of programs, or why a target stays.

    Attributes:
        severity: What it asks for.
        meaning: What it says of the program.
        cure: What can be done, "" where nothing has to be.

    >>> Code("tool-length").severity
    <Severity.WARNING: 'warning'>
    """

    severity: Severity
    meaning: str
    cure: str

    def __new__(
        cls, code: str, severity: Severity, meaning: str, cure: str = ""
    ) -> Self:
        """Keep what is known of a code beside it."""
        one = str.__new__(cls, code)
        one._value_ = code
        one.severity, one.meaning, one.cure = severity, meaning, cure
        return one

    # Text that is not understood.

    UNKNOWN_STATEMENT = (
        "unknown-statement",
        WARNING,
        "The grammar of the language has no such statement. Its text is unchanged. If "
        "it may move the arm, the next move is assumed to start at an unknown place.",
        "Check its spelling. If the controller accepts it, put it into a routine and "
        "declare that routine under [routines] of the cell.",
    )
    UNKNOWN_ROUTINE = (
        "unknown-routine",
        WARNING,
        "A routine is called that no given file holds. It may move the arm and set "
        "frames: targets after it keep their values until these are set again.",
        "Give its file, or declare under [routines] of the cell what it does.",
    )
    BLOCK_STRUCTURE = (
        "block-structure",
        WARNING,
        "Blocks of a program do not close, or close what was not opened.",
        "Close them: what runs when is not known otherwise.",
    )
    OPEN_BLOCK = (
        "open-block",
        ERROR,
        "A block is not closed, so that it is not known what runs when.",
        "Close it.",
    )
    END_MISSING = (
        "end-missing",
        WARNING,
        "The END of a program or routine is missing. It is assumed to end at the next "
        "END, or at the end of the file.",
        "Add it. Was the file cut off?",
    )
    NO_PROGRAM = (
        "no-program",
        WARNING,
        "The file holds no BEGIN .. END: there is nothing to follow.",
        "Give the file that holds the program.",
    )
    CALLED_BY_OTHERS = (
        "called-by-others",
        WARNING,
        "Another program calls this one, or a routine in it: place, frames and load at "
        "its beginning are not known.",
        "Set the frames in it, behind a move by joint angles.",
    )
    NO_MAIN = (
        "no-main",
        WARNING,
        "No single procedure main: from where routines are called, and with what "
        "settings, is not known.",
        "Put the module that holds main, and the others of its task, into the folder.",
    )
    UNDECLARED_VARIABLE = (
        "undeclared-variable",
        WARNING,
        "A variable is used and not declared: it has no value here.",
        "Declare it, or give the file that does.",
    )
    TOO_COMPLEX = (
        "too-complex",
        WARNING,
        "The program has too many branches or calls to be followed to its end. None of "
        "its targets is corrected.",
        "Split it, or compensate its routines one by one.",
    )
    LOOP_NOT_UNROLLED = (
        "loop-not-unrolled",
        NOTE,
        "A loop runs too often to be followed round by round; targets that depend on "
        "its counter keep their values.",
        "Where the targets in it matter, write them without the counter.",
    )

    # Where the arm is.

    ROUTINE_ASSUMED_MOTIONLESS = (
        "routine-assumed-motionless",
        NOTE,
        "A routine that no given file holds is on the shipped list of routines that "
        "neither move the arm nor set frames.",
        "If it does, declare it under [routines] of the cell; assume_motion of "
        "[compensation] ignores the list.",
    )
    MOTION_UNKNOWN = (
        "motion-unknown",
        WARNING,
        "This statement may move the arm and is not understood: place, frames and "
        "settings of the motion are not known after it.",
        "Declare under [routines] of the cell what the routine does, or give its file.",
    )
    FIRST_CAUSE = (
        "first-cause",
        WARNING,
        "The first statement with an unknown effect, and the number of targets that "
        "keep their values because of it.",
        "Declare this one first.",
    )
    NEVER_REACHED = (
        "never-reached",
        WARNING,
        "Moves that cannot be reached from the start of the program: the place from "
        "which the arm comes is not known.",
        "Compensate the program that calls their routine.",
    )
    OTHER_ARM = (
        "other-arm",
        WARNING,
        "A move of another arm than the cell's; it is unchanged.",
        "Compensate it with a cell of its arm ([robot] arm_number), and its model.",
    )
    CALL_NOT_FOLLOWED = (
        "call-not-followed",
        WARNING,
        "A function that is called in an expression may move the arm: the next move is "
        "assumed to start at an unknown place.",
        "Call it as a statement.",
    )
    RECURSION = (
        "recursion",
        WARNING,
        "A routine calls itself: it is not followed, and the next move is assumed to "
        "start at an unknown place.",
        "Write it as a loop.",
    )
    POSITION_UNKNOWN = (
        "position-unknown",
        WARNING,
        "A sensor guides the arm, or ceases to: the next move starts at an unknown "
        "place.",
        "Move to a known place before targets that have to be exact.",
    )
    HANDLER_MOVES = (
        "handler-moves",
        WARNING,
        "A condition handler may move the arm at any time: the start of every move is "
        "uncertain.",
        "Let the handler set a signal, and move in the program.",
    )
    HANDLER_CANCELS = (
        "handler-cancels",
        WARNING,
        "A condition handler may end any move early: the start of every move is "
        "uncertain.",
        "Let the handler set a signal, and end the move in the program.",
    )
    MANY_ORIGINS = (
        "many-origins",
        NOTE,
        "Too many moves may come before this one to be followed separately; the "
        "approach direction is not known.",
        "Start the approach from one place.",
    )
    ASSUMED_JOINT = (
        "assumed-joint",
        NOTE,
        "A move names no trajectory, and $MOVE_TYPE is not set: JOINT is assumed.",
        "Name the trajectory, or set $MOVE_TYPE.",
    )
    DIRECTION_UNCERTAIN = (
        "direction-uncertain",
        WARNING,
        "The approach direction of a joint at a corrected target is uncertain: the "
        "joint reversed shortly before, or the place before is not known. Up to half "
        "of its backlash may remain; the stated standard error includes it.",
        "Start the approach farther away, or so that the joint does not reverse.",
    )
    DIRECTION_DISAGREES = (
        "direction-disagrees",
        WARNING,
        "In the trajectory over time a joint arrives in the other direction than along "
        "the path; the correction is that of the path.",
        "Stop before the target, or approach it from farther away.",
    )
    CONFIGURATION_OVERRULED = (
        "configuration-overruled",
        NOTE,
        "The path arrives on another branch or turn than the configuration flags of "
        "the target name; the path decides.",
        "Write the configuration that the path arrives with.",
    )

    # Points that are passed.

    FLY_ASSUMED = (
        "fly-assumed",
        NOTE,
        "The program does not set how fly points are blended; the controller's "
        "defaults are assumed.",
        "Set them in the program.",
    )
    FLY_CORNER = (
        "fly-corner",
        NOTE,
        "The path passes fly points at a distance. A correction moves the corner; it "
        "does not lead the path through the point.",
        "If the point matters, stop there or make the zone smaller.",
    )
    FLY_UNKNOWN = (
        "fly-unknown",
        NOTE,
        "The program does not show whether the arm stops at these points or passes "
        "them. They are corrected for both cases.",
        "Write the zone as a constant.",
    )
    NO_TIME_LAW = (
        "no-time-law",
        NOTE,
        "No time law was found for a run: its times and speeds are estimates.",
    )
    SPEED_NOT_REACHED = (
        "speed-not-reached",
        WARNING,
        "The joints cannot follow the programmed speed; the controller slows down or "
        "stops, near a singularity as a rule.",
        "Go round the singularity, or program a lower speed.",
    )
    FLANK_ACCELERATION = (
        "flank-acceleration",
        NOTE,
        "Between two points the correction follows the backlash faster than the axis "
        "can accelerate; the controller may smooth the step.",
        "Program a lower speed there, or points that are farther apart.",
    )
    PATH_POINTS = (
        "path-points",
        NOTE,
        "Points were inserted into moves, so that these stay on their paths.",
    )
    BACKLASH_PRELOAD_SKIPPED = (
        "backlash-preload-skipped",
        NOTE,
        "The backlash is not preloaded before moves: it is open how the joints change "
        "their flanks there, by more than half of the path tolerance.",
        "Measure it: survey.reversals, or diagnose --path.",
    )
    FAST_STOP_UNCERTAIN = (
        "fast-stop-uncertain",
        NOTE,
        "JOINT moves reach targets fast: if links run on there to the other flank of "
        "their gaps, the targets are off by more than the path tolerance.",
        "Let these moves end at 20 % of the speed of the joints or less, or measure a "
        "path: diagnose --path.",
    )
    REAPPROACH_INSERTED = (
        "reapproach-inserted",
        NOTE,
        "Targets are approached again, from an inserted stop on the path already "
        "travelled.",
    )
    PATH_TOLERANCE_EXCEEDED = (
        "path-tolerance-exceeded",
        WARNING,
        "The predicted path error of a move is larger than the path tolerance.",
        "The message names the joints, their shares in mm, and what helps the move.",
    )

    # What the corrected program does.

    CYCLE_TIME_INCREASED = (
        "cycle-time-increased",
        WARNING,
        "The compensated program takes more than 3 % longer than the original.",
        "Check the corrections of its fastest moves.",
    )
    JOINT_LIMIT_EXCEEDED = (
        "joint-limit-exceeded",
        ERROR,
        "A joint exceeds a limit that the original program keeps.",
        "Move the target away from the limit.",
    )
    CLONED = (
        "cloned",
        NOTE,
        "Moves have a new point of their own, because another move to the same point "
        "needs another correction (--shared-points clone).",
    )
    NOT_CLONED = (
        "not-cloned",
        WARNING,
        "Moves to one point need different corrections, and the point cannot be "
        "written twice.",
        "Give the moves points of their own.",
    )

    # What is assumed.

    ABSOLUTE_ACCURACY = (
        "absolute-accuracy",
        NOTE,
        "The controller's own accuracy model is assumed to be off, as the cell states.",
        "Check that it is off: two corrections add up.",
    )
    CONTROLLER = (
        "controller",
        NOTE,
        "Neither the cell nor the arm file names the controller: a controller that "
        "runs the language of the program is assumed.",
        "Write controller = .. in the arm file.",
    )
    TOOL_LENGTH = (
        "tool-length",
        WARNING,
        "A tool is shorter than two millimetres: is it written in metres?",
        "Write millimetres.",
    )
    BASE_FRAME_MISMATCH = (
        "base-frame-mismatch",
        WARNING,
        "Joint angles and Cartesian targets of the program agree with another base "
        "frame than the cell's.",
        "Write the frame that the program was made with into [base] of the cell.",
    )
    ARCHIVE_BASE = (
        "archive-base",
        WARNING,
        "The archive has another base frame of the arm than the cell.",
        "Paste the lines of the message into [base] of the cell.",
    )
    LSV_PRECISION = (
        "lsv-precision",
        NOTE,
        "The controller lists values with two decimals. Corrected values that are "
        "listed and loaded again lose the accuracy that the message states.",
        "Keep the written files, not listings of them.",
    )
    PAGE = ("page", NOTE, "Another file is read with the program, as a part of it.")
    NOT_FOLLOWED = (
        "not-followed",
        NOTE,
        "A file that the program names is not read.",
        "Put it beside the program.",
    )

    # Variable files.

    NO_VARIABLE_FILE = (
        "no-variable-file",
        WARNING,
        "Targets have no value in the program, and its variable file is missing.",
        "Put it beside the program, or give it with --variables.",
    )
    LSV_LINE = (
        "lsv-line",
        NOTE,
        "A line of the variable file is not understood; it is kept.",
    )
    LSV_DUPLICATE = (
        "lsv-duplicate",
        WARNING,
        "A variable has two entries: which one the controller reads is not known.",
        "Delete one.",
    )
    LSV_PARTS = (
        "lsv-parts",
        WARNING,
        "An entry of records or arrays is not read as a whole.",
        "List the file again at the controller.",
    )
    LSV_INCOMPLETE = (
        "lsv-incomplete",
        WARNING,
        "A position has fewer than six values.",
        "Was the file cut off? List it again at the controller.",
    )
    LSV_TOO_MANY = (
        "lsv-too-many",
        WARNING,
        "A position has more than six values.",
        "List the file again at the controller.",
    )
    LSV_UNINITIALISED = (
        "lsv-uninitialised",
        WARNING,
        "A position has no value.",
        "Teach it, or delete it.",
    )
    LSV_UNUSED = ("lsv-unused", NOTE, "Variables of the file that no program uses.")
    LSV_UNDECLARED = (
        "lsv-undeclared",
        WARNING,
        "The program uses variables of the file and does not declare them.",
        "Declare them, or give the file of this program.",
    )
    LSV_OTHER_PROGRAM = (
        "lsv-other-program",
        WARNING,
        "The program uses no variable of the file.",
        "Is it the file of another program?",
    )

    # Why a target keeps its values: what stands in the program.

    NO_TARGET = (
        "no-target",
        NOTE,
        "The move has no target numbers of its own: it goes home, a step, or to a part "
        "of an axis position.",
    )
    TAUGHT_POINT = (
        "taught-point",
        NOTE,
        "The point was taught with the robot: it contains the arm's error already.",
    )
    NO_VALUE = (
        "no-value",
        WARNING,
        "The target, or a frame of it, has no value in the program or its variable "
        "file.",
        "Give the variable file, or teach the point.",
    )
    RUNTIME_VALUE = (
        "runtime-value",
        WARNING,
        "The target, or a number of it, is known only while the program runs.",
        "Write the numbers in the program.",
    )
    UNREADABLE_NUMBER = (
        "unreadable-number",
        WARNING,
        "A number of the target cannot be read, or makes no position.",
        "Correct the number.",
    )
    PARTIAL_TARGET = (
        "partial-target",
        WARNING,
        "The target names some of its numbers only; the others stay what they are.",
        "Write all of its numbers.",
    )
    COMPUTED_TARGET = (
        "computed-target",
        WARNING,
        "The program computes the target, so that no numbers can be written for it.",
        "Write the target as a position of its own, or correct the point it is "
        "computed from.",
    )
    NUMBERS_NOT_OWN = (
        "numbers-not-own",
        WARNING,
        "The numbers of the target do not stand in one place that belongs to it alone.",
        "Write the numbers of the target one by one, in the move or in a variable.",
    )
    EXPORTED_VARIABLE = (
        "exported-variable",
        WARNING,
        "Other programs may read the variable of the target too.",
        "Set edit_exported in [compensation] of the cell where the others are "
        "compensated with it.",
    )
    NUMBERS_USED_ELSEWHERE = (
        "numbers-used-elsewhere",
        WARNING,
        "The program uses the numbers of the target for something else too, and a "
        "correction would change that.",
        "Give the move a point of its own.",
    )
    FRAME_UNKNOWN = (
        "frame-unknown",
        WARNING,
        "Tool, base or user frame of the move is not known.",
        "Write the frame in the program, or in the cell file.",
    )
    TAUGHT_FRAME = (
        "taught-frame",
        WARNING,
        "A frame of the target was taught with the arm and contains its error.",
        "Give the joint angles of its points in the cell file, or measure the frame.",
    )
    REMOTE_TOOL = (
        "remote-tool",
        WARNING,
        "The tool stands still and the arm holds the part.",
        "Such targets are not corrected; check them by hand.",
    )
    EXTERNAL_AXES = (
        "external-axes",
        WARNING,
        "A track, a positioner or an axis that the cell does not declare moves the arm "
        "or the part.",
        "Declare the axis under [aux] of the cell.",
    )
    TRAJECTORY_UNKNOWN = (
        "trajectory-unknown",
        WARNING,
        "How the arm moves to the target is not known, or not followed.",
        "Name the trajectory in the move.",
    )
    ENDS_ELSEWHERE = (
        "ends-elsewhere",
        WARNING,
        "The move may end before its target, or beside it: a search, a trigger, a "
        "condition, a spline.",
        "Such targets are not corrected; check them by hand.",
    )
    SENSOR_GUIDED = (
        "sensor-guided",
        WARNING,
        "A sensor may move the arm away from the programmed path.",
        "Switch the sensor off before targets that have to be exact.",
    )
    CONVEYOR = (
        "conveyor",
        WARNING,
        "The work object moves, on a conveyor or with a mechanical unit.",
        "Such targets are not corrected; check them by hand.",
    )
    COORDINATED_ARMS = (
        "coordinated-arms",
        WARNING,
        "The arm moves together with another one.",
        "Such targets are not corrected; check them by hand.",
    )
    SOFT_AXIS = (
        "soft-axis",
        WARNING,
        "An axis is soft and gives way.",
        "End that before targets that have to be exact.",
    )
    AXIS_OFFSET = (
        "axis-offset",
        WARNING,
        "External axes are offset by the program.",
        "End the offset before targets that have to be exact.",
    )
    SETTING_UNTRACKED = (
        "setting-untracked",
        WARNING,
        "The program changes a setting that moves the arm away from its targets and is "
        "not followed.",
        "Reset it before targets that have to be exact.",
    )
    ACCURATE_POINT = (
        "accurate-point",
        WARNING,
        "S of the point has bit 4: it was taught while the controller's own accuracy "
        "model was on, and does not hold the pose of an arm without it.",
        "Teach the point again with that model off. Subtract 16 from S only where its "
        "numbers are known to be meant without the model.",
    )
    LOAD_UNKNOWN = (
        "load-unknown",
        WARNING,
        "The payload is not known, and how far the arm sags depends on it.",
        "Write the load as constants in the program.",
    )
    BESIDE_PROGRAM = (
        "beside-program",
        WARNING,
        "A concurrent program, an interrupt or a trap may move the arm, or change the "
        "settings of the move.",
        "Let it set a signal, and act in the program. If it calls an unavailable "
        'routine that moves nothing, write NAME = "motionless" under [routines] of the '
        "cell.",
    )

    # Why a target keeps its values: what the plan finds.

    OUT_OF_REACH = (
        "out-of-reach",
        WARNING,
        "The arm cannot reach the target as it is written.",
        "Check the target and its frames.",
    )
    TARGET_BEYOND_LIMIT = (
        "target-beyond-limit",
        WARNING,
        "A joint is beyond its limit at the target as it is written, or on the path to "
        "it.",
        "Check the target and its turns.",
    )
    CONFIGURATION_UNKNOWN = (
        "configuration-unknown",
        WARNING,
        "The branch or the turns with which the arm reaches the target are not known.",
        "Write configuration flags, or a joint target before it.",
    )
    CONFIGURATION_CONTRADICTED = (
        "configuration-contradicted",
        WARNING,
        "The path arrives on another branch or turn than the configuration flags name: "
        "the controller stops there, or may stop.",
        "Write the flags that the path arrives with.",
    )
    CONFIGURATION_BORDER = (
        "configuration-border",
        WARNING,
        "After the correction an axis would be so near a border of the configuration "
        "flags that they could become wrong.",
        "Move the target a little, or go there by joint angles.",
    )
    SINGULAR_WRIST = (
        "singular-wrist",
        WARNING,
        "The wrist is near its singularity, where a correction turns axes by a large "
        "angle.",
        "Turn the tool, or lower wrist_deg in the cell.",
    )
    SINGULAR_PATH = (
        "singular-path",
        WARNING,
        "The path to the target goes out of reach or through a singularity.",
        "Lead the path round it, add a point, or use a joint move.",
    )
    ARC_UNDETERMINED = (
        "arc-undetermined",
        WARNING,
        "The points of the arc do not determine its circle, or the end of the arc is "
        "not known.",
        "Move the middle point of the arc, or use lines.",
    )
    ORIENTATION_LAW = (
        "orientation-law",
        WARNING,
        "The orientation of the tool along the path is not planned for this setting, "
        "so that joints may arrive in another direction.",
        "Use the default orientation setting of the language, or nearer points.",
    )
    UNKNOWN_POSITION_BEFORE = (
        "unknown-position-before",
        WARNING,
        "The start of the move is uncertain: a target out of reach, or with uncertain "
        "configuration flags.",
        "Correct the move before, or add a joint target between.",
    )

    # Why a target keeps its values: what the correction would do.

    OUTSIDE_SURVEY = (
        "outside-survey",
        WARNING,
        "The target lies outside of the range of the survey, or the model is too "
        "uncertain there.",
        "Survey the range of the program.",
    )
    CORRECTION_UNREACHABLE = (
        "correction-unreachable",
        WARNING,
        "The corrected target would be out of reach on its branch, or the search for "
        "the correction does not converge.",
        "Move the target away from the border of the reach.",
    )
    CORRECTION_BEYOND_LIMIT = (
        "correction-beyond-limit",
        WARNING,
        "After the correction a joint would be beyond its limit.",
        "Move the target away from the limit.",
    )
    CORRECTION_TOO_LARGE = (
        "correction-too-large",
        WARNING,
        "The correction is larger than correction_mm or correction_deg of the cell.",
        "Check tool, base and model, then raise the limit.",
    )
    ARM_SWINGS = (
        "arm-swings",
        WARNING,
        "With the correction a joint, the elbow or the wrist would move farther than "
        "the cell's limits, at the target or on the path to it.",
        "Near a singularity, turn the tool; otherwise check the target.",
    )
    DIRECTION_CHANGES = (
        "direction-changes",
        WARNING,
        "With the correction a joint would arrive in the other direction.",
        "Start the approach farther away.",
    )
    CORRECTION_STEP = (
        "correction-step",
        WARNING,
        "The correction changes too fast along the path.",
        "Stop between the points, or raise correction_step_mm of the cell.",
    )
    PATH_BENT = (
        "path-bent",
        WARNING,
        "A neighbour on the path, or on the same arc or curve, cannot be corrected: "
        "correcting this point alone would bend the path.",
        "Check the neighbour.",
    )
    ARC_DISTORTED = (
        "arc-distorted",
        WARNING,
        "The corrected points of the arc would make a very different circle.",
        "Put the middle point halfway along the arc, or divide the arc.",
    )
    ARRIVALS_DIFFER = (
        "arrivals-differ",
        WARNING,
        "Arrivals at one point need different corrections.",
        "Give each move a point of its own.",
    )
    ARRIVALS_AVERAGED = (
        "arrivals-averaged",
        NOTE,
        "Arrivals at one point need different corrections. The point has one that "
        "leaves each of them less than without; half of what they differ by is in the "
        "standard error.",
        'Give each move a point of its own: shared_points = "clone".',
    )
    ARRIVALS_FAR_APART = (
        "arrivals-far-apart",
        WARNING,
        "As arrivals-averaged, and half of what the arrivals differ by exceeds "
        "averaged_mm.",
        'Give each move a point of its own: shared_points = "clone".',
    )
    SHARED_POINT = (
        "shared-point",
        WARNING,
        "Several moves go to one point, and the cell does not let such points change.",
        'Set shared_points = "mean" or "clone" under [compensation].',
    )
    DEPENDANT_WORSE = (
        "dependant-worse",
        WARNING,
        "A correction would increase the error of a target that is computed from this "
        "one, or another arrival at the point cannot be corrected.",
        "Give the moves points of their own.",
    )

    # Trees of compensated programs (check).

    UNCOMPENSATED = (
        "uncompensated",
        ERROR,
        "The file carries no stamp and no record: it is not compensated.",
        "Compensate it.",
    )
    ABSENT = (
        "absent",
        ERROR,
        "A program of the source tree is not in the compensated one.",
        "Compensate it.",
    )
    UNFINISHED = (
        "unfinished",
        ERROR,
        "The file is a temporary file of a run that was killed.",
        "Delete it, and run batch --resume.",
    )
    CHANGED = (
        "changed",
        ERROR,
        "The file, or one that its job reads, was changed after it was compensated.",
        "Make the change in the source, and compensate that again.",
    )
    NO_RECORD = (
        "no-record",
        ERROR,
        "The record of the file is missing, damaged, or of another file: it cannot be "
        "checked or restored.",
        "Compensate it again.",
    )
    OLDER_MODEL = (
        "older-model",
        ERROR,
        "The file was written with another model than the current one.",
        "Compensate it again.",
    )
    TOLERANCE_MISSED = (
        "tolerance-missed",
        ERROR,
        "Targets of the program do not pass the tolerance of the job.",
        "Look at each in the report; correct the cause, or widen the tolerance.",
    )
    MIXED_MODELS = (
        "mixed-models",
        ERROR,
        "Files of one job were written with different models.",
        "Compensate the job again.",
    )
    SOURCE_CHANGED = (
        "source-changed",
        ERROR,
        "The source, or another file that it was compensated with, was changed since.",
        "Compensate it again.",
    )
    NO_SOURCE = (
        "no-source",
        ERROR,
        "The file has no source in the source tree.",
        "Delete it, or give the tree it was made from.",
    )
    LEFT_ALONE = (
        "left-alone",
        ERROR,
        "Targets that could have been compensated keep their values.",
        "Check them, then pass --allow-uncorrected.",
    )


@dataclass(frozen=True, order=True, slots=True)
class Reason:
    """Why a target keeps its values; `NO_REASON`, which is false, where it need not.

    Programs decide by the code, and by what it is about: the text is for people.

    Attributes:
        code: What kind of reason it is, None for no reason, and in records of version
            0.1.0, which had no codes.
        text: What was found, and what the user can do.
        about: Which of several things of one kind it is about, "" where there is one.

    >>> reason = NO_REASON or Reason(Code.TAUGHT_POINT, "it was taught")
    >>> bool(NO_REASON), str(reason)
    (False, 'it was taught')
    """

    code: Code | None
    text: str
    about: str = ""

    def __bool__(self) -> bool:
        """Return True if there is a reason."""
        return self.code is not None

    def __str__(self) -> str:
        """Return the text."""
        return self.text

    @property
    def name(self) -> str:
        """Return the code as JSON has it, "" for none."""
        return "" if self.code is None else str(self.code)

    @classmethod
    def named(cls, name: str, text: str) -> Self:
        """Take a reason from JSON; a code of another version is none."""
        known = {str(code): code for code in Code}
        return cls(known.get(name), text)

    def within(self, text: str) -> Reason:
        """Return the reason in a longer text, in which {} stands for it."""
        return replace(self, text=text.format(self.text))


NO_REASON = Reason(None, "")
