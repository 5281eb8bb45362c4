"""From program text to planned states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.compensation.eligibility.arcs import mark_arcs
from postproc.compensation.eligibility.configuration_flags import (
    CONTRADICTED,
    find_stops,
    mark_configuration_flags,
    mark_stranded,
)
from postproc.compensation.eligibility.orientation import mark_orientation_interpolation
from postproc.compensation.eligibility.reasons import Reasons
from postproc.compensation.options import Options
from postproc.compensation.solver.payload import payload_of
from postproc.compensation.solver.targets import targets_from_visits, with_tracks
from postproc.language.language import Start
from postproc.language.languages import language_of
from postproc.language.text.number_edits import Skeleton
from postproc.language.text.source import (
    Edit,
    ParsedFiles,
    Source,
    source_from_bytes,
)
from postproc.language.visits import Diagnostic, Visits
from postproc.model.backlash_width import play_of_model
from postproc.model.model import Model
from postproc.motion.joint_path import NOWHERE, StartState
from postproc.motion.planner import Plan, plan
from postproc.motion.targets import Targets
from postproc.robot.arm import Arm
from postproc.robot.cell import Cell
from postproc.robot.direction import UNLED, Arrivals
from postproc.robot.pose import MM
from postproc.robot.state import States, make_states


@dataclass(frozen=True)
class ParsedProgram:
    """A program as the language understands it, or several side by side.

    Attributes:
        texts: Its files as they were read, in the order of `Visits.files`.
        visits: Every arrival at a target.
        diagnostics: What else was found.
        cloned: Edits, file by file, that gave `sources` clones of variables; empty
            where there are none. Lines of visits are those before these edits.
        given: The files as they were before that; empty where nothing was cloned.
        missed: Lines of moves that are never reached, by file.
        untouched: Names of files that are read, and never rewritten.
        begins: The first visit of every program.
        parsed: What was parsed of files that hold no target to correct.
        aims: Sides of the joints that visits are meant to be reached from, (n, 6),
            where the search for them is to begin; NaN: as planned, as all where empty.
    """

    texts: tuple[Skeleton, ...]
    visits: Visits
    diagnostics: tuple[Diagnostic, ...]
    cloned: tuple[tuple[Edit, ...], ...] = ()
    given: tuple[Source, ...] = ()
    begins: tuple[int, ...] = (0,)
    parsed: ParsedFiles = field(default_factory=dict)
    missed: Mapping[str, Ints] = field(default_factory=dict)
    aims: Floats = field(default_factory=lambda: np.empty((0, 6)))
    untouched: frozenset[str] = frozenset()

    @property
    def sources(self) -> tuple[Source, ...]:
        """Return its files."""
        return tuple(text.source for text in self.texts)

    @property
    def originals(self) -> tuple[tuple[Source, tuple[Edit, ...]], ...]:
        """Return every file as it was given, with the edits that led to `sources`."""
        if not self.given:
            return tuple((source, ()) for source in self.sources)
        return tuple(zip(self.given, self.cloned, strict=True))

    def with_values(self, values: Floats) -> ParsedProgram:
        """Return it as if its targets had other numbers, (n, w)."""
        return replace(self, visits=self.visits.with_columns(values=values))


@dataclass(frozen=True)
class PlannedProgram:
    """A program as the controller would run it.

    Attributes:
        targets: Where every move goes, in the arm's base frame.
        plan: The state of the arm at every arrival.
        reasons: Why visits must not be compensated.
        shift: From where the controller takes every target to be to where it is, as
            far as a frame was taught with the arm's error in it, (n, 3) [m].
        shift_variance: Of it, (n, 3) [m^2].
        doubtful: Why what comes from these targets is doubtful, (n,); 0 where it is
            not (see `configuration_flags`).
    """

    targets: Targets
    plan: Plan
    reasons: Reasons
    shift: Floats
    shift_variance: Floats
    doubtful: Ints

    def reference_poses(self, rows: Ints) -> Floats:
        """Return the TCP poses that should be reached at visits, (k, 4, 4) [m]."""
        poses = self.plan.tcp[rows]
        poses[:, :3, 3] += self.shift[rows]
        return poses

    def with_frame(self, std_error: Floats) -> Floats:
        """Add how unsure taught frames are to standard errors, (n, 3) [m]."""
        if not self.shift_variance.any():
            return std_error
        return np.asarray(np.sqrt(np.square(std_error) + self.shift_variance))


def start_of(cell: Cell) -> Start:
    """Tell the language what holds at program start."""
    speed = cell.file.motion.linear_mm_s
    tables = {
        routine: {
            arguments: {
                name: section.record()
                for name in ("tool", "base", "uframe")
                if (section := getattr(entry, name)) is not None
            }
            for arguments, entry in table.items()
        }
        for routine, table in cell.frame_tables.items()
    }
    return Start(
        tool=cell.tool.record,
        base=cell.base.record,
        uframe=cell.uframe.record,
        routines=dict(cell.routines),
        motionless=cell.motionless,
        constant=cell.constant,
        assume_motion=cell.compensation.assume_motion,
        frame_tables=tables,
        aux=dict(cell.aux),
        taught=cell.taught,
        taught_records=frozenset(cell.taught_frames),
        arm=cell.arm_number,
        linear_speed=None if speed is None else speed * MM,
        override=cell.file.motion.override,
        source=str(cell.path),
    )


def with_measured_play(cell: Cell, model: Model) -> Cell:
    """Let directions be told by the gaps that the model found, not by a guess."""

    def with_play(arm: Arm) -> Arm:
        return replace(arm, play=play_of_model(model, arm))

    return replace(cell, arm=model.arms.of(cell.arm, with_play))


def prepare_cell(cell: Cell, model: Model, options: Options) -> Cell:
    """Let a cell know the model's play, and whether routines are assumed to move."""
    return with_measured_play(assuming(cell, options), model)


def assuming(cell: Cell, options: Options) -> Cell:
    """Let a cell know whether routines that it does not name are assumed to move."""
    assume = options.within(cell).assume_motion
    own = cell.compensation.model_copy(update={"assume_motion": assume})
    return replace(cell, compensation=own)


def read_program(
    files: Mapping[str, bytes], cell: Cell, known: ParsedFiles | None = None
) -> ParsedProgram:
    """Parse a program and resolve its visits.

    Args:
        files: Bytes by name: first the program itself, then the programs that it
            imports, last, where there is one, its variable file.
        cell: What holds at program start.
        known: Files that were parsed before, see `Language.read`.

    Raises:
        ProgramError: A file is no program text, or the program is another arm's.
    """
    sources = [source_from_bytes(name, data) for name, data in files.items()]
    language = language_of(sources[0].name)
    parsed = {} if known is None else dict(known)
    found = language.read(sources, start_of(cell), parsed)
    for file in np.unique(found.visits.literals.file).tolist():
        parsed.pop(found.visits.files[file])  # it is about to change
    return ParsedProgram(
        found.texts,
        with_tracks(found.visits, cell),
        found.diagnostics,
        missed=found.missed,
        untouched=found.untouched,
        parsed=parsed,
    )


def plan_visits(
    visits: Visits,
    cell: Cell,
    timed: bool = True,
    begin: StartState = NOWHERE,
    lead: Arrivals = UNLED,
    doubtful: int = 0,
) -> PlannedProgram:
    """Plan every move of a program, with the time that it takes or without.

    Args:
        visits: What the program says.
        cell: The arm and its surroundings.
        timed: As in `plan`.
        begin: Where the arm stands at the first visit, if that is known beforehand.
        lead: What is known of the first arrivals, see `direction.arrivals`.
        doubtful: Why what comes from there is doubtful (see `configuration_flags`).
    """
    targets, reasons = targets_from_visits(visits, cell)
    wrist = np.deg2rad(cell.limits.wrist_deg)
    planned = plan(cell.arm, targets, wrist, timed, begin, lead)
    stops = find_stops(visits, targets, planned)
    if stops.any():  # the same ways, but that nobody knows how they go on from there
        targets = replace(targets, stops=stops)
        planned = plan(cell.arm, targets, wrist, timed, begin, lead)
    reasons.adopt(planned.reason, planned.reasons)
    begun = bool(doubtful & CONTRADICTED)
    seeded = len(begin) > 0
    on = mark_configuration_flags(
        visits, targets, planned, cell.arm, reasons, begun, seeded
    )
    behind = mark_stranded(visits, targets, planned, reasons, doubtful)
    mark_orientation_interpolation(visits, targets, planned, reasons)
    mark_arcs(targets, planned, reasons)
    none = np.zeros((len(visits), 3))
    return PlannedProgram(
        targets, planned, reasons, none, none, behind | (CONTRADICTED * on)
    )


def states_of(
    planned: Plan, cell: Cell, temperature: float, visits: Visits | None = None
) -> States:
    """Describe the planned arrivals in the terms of the accuracy model.

    The time within a program says nothing about how warm the arm is, so it stays
    unknown; the temperature that is declared does.

    Args:
        planned: The plan of n arrivals.
        cell: Payload.
        temperature: [deg C], NaN where not known.
        visits: The arrivals, with the loads that the program states.
    """
    given = (cell.payload_mass, cell.payload_com)
    mass, centre = given if visits is None else payload_of(visits, cell)
    return make_states(
        planned.q,
        planned.side,
        planned.tool[:, :3, 3],
        travel=planned.travel,
        speed=planned.speed,
        temperature=temperature,
        payload=mass,
        payload_com=centre,
    )
