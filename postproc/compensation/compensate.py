"""The first sentence: a program goes in, the same program lands where it says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from types import MappingProxyType

import numpy as np

from postproc.arrays import Bools, Floats, Interned, Ints
from postproc.compensation import windows as cuts
from postproc.compensation.arrivals import ArrivalStates
from postproc.compensation.base import contradicted_base
from postproc.compensation.clones import give_own_points
from postproc.compensation.decide import Proposal
from postproc.compensation.eligibility import overruled
from postproc.compensation.frames import correct_taught
from postproc.compensation.iterate import AT_START, Converged, EndState, iterate
from postproc.compensation.notes import (
    assumed_off,
    flank_steps,
    followed_pages,
    listing_cost,
    missing_file,
    overruled_strings,
    tool_in_metres,
    unsure_sides,
    untimed_runs,
)
from postproc.compensation.options import (
    AS_USUAL,
    Clock,
    Options,
    Progress,
    Setting,
    silent,
)
from postproc.compensation.outcome import (
    Decisions,
    Outcome,
    largest_motion,
    left_elsewhere,
    tell_arrivals,
)
from postproc.compensation.parallel import in_processes, rounded
from postproc.compensation.program import (
    Planned,
    Reading,
    plan_visits,
    prepared,
    read_program,
    states_of,
)
from postproc.compensation.rewrite import (
    Output,
    check_motion,
    check_output,
    write_edits,
)
from postproc.compensation.targets import rounded_points
from postproc.compensation.windows import Window, lead_in, windows
from postproc.exceptions import CellError, ProgramError
from postproc.files import variables_of
from postproc.language.pdl2.routines import ASSUMED_STILL
from postproc.language.source import Replacements, Source
from postproc.language.stamp import is_stamped
from postproc.language.visits import Visits, told_once
from postproc.model.model import Model
from postproc.model.statistics import ErrorStatistics
from postproc.motion.trace import NOWHERE, StartState
from postproc.robot.cell import Cell
from postproc.robot.pose import MM
from postproc.robot.state import States

# What is kept of a program, or of a window of it, once its targets are corrected.


@dataclass(frozen=True)
class Correction:
    """A corrected program without poses, paths and plans (structure of arrays).

    Attributes:
        edited: Literals that get new numbers, (m,).
        edits: The edits of these, file by file.
        decisions: What was decided for n visits.
        corrected: Visits whose target moves, (n,).
        before, after: Size of the predicted error of the k visits that move, (k,) [m].
        position: Where the program wants the TCP, (n, 3) [m], base frame.
        away: How far the path passes it, (n,) [mm].
        overruled: The path does not follow the configuration string, and nobody said
            that it must, (n,).
        untimed: No time law was found, (n,).
        travel: Of every joint since its last reversal, (n, 6) [rad].
        speed: Of the TCP, (n,) [m/s], NaN where nobody asked.
        departure: Largest change on the way to every visit of a joint [rad], elbow,
            wrist centre and TCP [m], (n, 4), NaN where not known.
    """

    edited: Ints
    edits: tuple[Replacements, ...]
    decisions: Decisions
    corrected: Bools
    before: Floats
    after: Floats
    position: Floats
    away: Floats
    overruled: Bools
    untimed: Bools
    travel: Floats
    speed: Floats
    departure: Floats


def correction_of(
    visits: Visits,
    planned: Planned,
    states: States,
    found: Converged,
    cell: Cell,
    model: Model,
    seeds: int = 0,
) -> Correction:
    """Keep what a report says of corrected visits, but for the first `seeds`."""
    proposal, done, plan = found.proposal, found.reached, planned.plan
    moved = proposal.corrected
    new = states.with_(q=np.array(done.q), direction=np.array(done.side))[moved]
    wanted = plan.tcp[:, :3, 3] + planned.shift
    before = model.error(cell.arm, states[moved]) - planned.shift[moved]
    after = done.tcp[moved, :3, 3] + model.error(cell.arm, new) - wanted[moved]
    return Correction(
        edited=proposal.edited,
        edits=found.edits,
        decisions=proposal.decisions.part(slice(seeds, None)),
        corrected=moved[seeds:],
        before=np.linalg.norm(before, axis=1),
        after=np.linalg.norm(after, axis=1),
        position=(wanted - plan.aside)[seeds:],
        away=np.linalg.norm(np.nan_to_num(plan.aside), axis=1)[seeds:] / MM,
        overruled=overruled(planned.targets, plan).unchecked(visits)[seeds:],
        untimed=plan.untimed[seeds:],
        travel=plan.travel[seeds:],
        speed=plan.speed[seeds:],
        departure=found.moved.sizes[seeds:],
    )


def joined(parts: Sequence[Correction]) -> Correction:
    """Put the windows of a program one after the other."""
    if len(parts) == 1:
        return parts[0]
    arrays = {
        f.name: np.concatenate([getattr(part, f.name) for part in parts])
        for f in fields(Correction)
        if f.name not in ("edits", "decisions")
    }
    edits = zip(*(part.edits for part in parts), strict=True)
    return Correction(
        edits=tuple(Replacements.merged(own) for own in edits),
        decisions=_one_after_another([part.decisions for part in parts]),
        **arrays,
    )


def _one_after_another(parts: Sequence[Decisions]) -> Decisions:
    """Join decisions, and their reasons."""
    arrays = {
        f.name: np.concatenate([getattr(part, f.name) for part in parts])
        for f in fields(Decisions)
        if f.name not in ("why", "reasons")
    }
    codes = Interned([""])
    why = []
    for part in parts:
        new = np.zeros(len(part.reasons), dtype=np.int64)
        for k in np.unique(part.why).tolist():
            new[k] = codes[part.reasons[k]]
        why.append(new[part.why])
    return Decisions(why=np.concatenate(why), reasons=tuple(codes), **arrays)


# A program corrected window by window, so that only one is in memory at a time.


@dataclass(frozen=True)
class WindowState:
    """How a window leaves the program as it was, and as it is corrected."""

    planned: StartState = NOWHERE
    doubtful: bool = False
    corrected: EndState = AT_START


def correct(reading: Reading, setting: Setting) -> tuple[Reading, Correction]:
    """Plan a program, and correct it until its sides are those corrected for.

    Moves can only be given points of their own when all arrivals are at hand: with
    --clone a program is one window, however long; so is one fly run.

    A window is settled before the next one begins, while a whole program settles at
    once: fly points may differ by what `CLOSE` allows, and the first targets behind a
    cut within the play of joints that hardly move there.

    Args:
        reading: The program.
        setting: What it is compensated with.

    Returns:
        The program, with clones where they were asked for, and what came of it.
    """
    work, clock = _WindowWork(reading, setting), setting.clock
    if not setting.options.clone:
        cut = windows(reading.visits, cuts.LEAST)
        parts = in_processes(work, cut, WindowState(), clock, setting.processes)
        return reading, joined(list(parts))
    kept, proposal = work.whole(clock)
    with clock("clone"):
        reading = give_own_points(reading, proposal, setting.cell)
    if reading.cloned:
        kept, _ = replace(work, reading=reading).whole(clock)
    return reading, kept


@dataclass(frozen=True)
class _WindowWork:
    """What it takes to correct any window of a program."""

    reading: Reading
    setting: Setting

    def whole(self, clock: Clock) -> tuple[Correction, Proposal]:
        """Correct the program as one window; return all of its proposal."""
        kept, proposal, _ = self._correct(self.reading.visits, 0, WindowState(), clock)
        return kept, proposal

    def correct(
        self, window: Window, begin: WindowState, clock: Clock
    ) -> tuple[Correction, WindowState]:
        """Correct a window; return what is kept of it, and how it ends."""
        visits = window.of(self.reading.visits)
        kept, _, end = self._correct(visits, window.seeds, begin, clock)
        return kept, end

    def foretell(self, window: Window) -> WindowState | None:
        """Tell how the windows before will end, by the last targets there alone.

        Right where the joints have lost their memory of what was before these. That the
        program begins there is an invention: what fails of it tells nothing.
        """
        visits = lead_in(self.reading.visits, window)
        if visits is None:
            return None
        try:
            _, _, end = self._correct(visits, 1, WindowState(), Clock(silent))
        except Exception:
            return None
        return end

    def _correct(
        self, visits: Visits, seeds: int, begin: WindowState, clock: Clock
    ) -> tuple[Correction, Proposal, WindowState]:
        """Correct some visits, the first `seeds` of which are only where they begin."""
        setting, begun = self.setting.timed_by(clock), begin.planned
        cell, model = setting.cell, setting.model
        part, timed = replace(self.reading, visits=visits), "speed" in model.needs
        with clock("plan"):
            planned = plan_visits(visits, cell, timed, begun, begin.doubtful)
            planned = correct_taught(planned, visits, cell, model)
        states = states_of(planned.plan, cell, setting.temperature)
        found = iterate(part, planned, states, setting, begin.corrected)
        check_motion(visits, found.moved, cell.limits)
        with clock("report"):
            kept = correction_of(visits, planned, states, found, cell, model, seeds)
        end = rounded(WindowState(planned.plan.end, planned.doubtful, found.left))
        return kept, found.proposal, end


# All of it: what is given, checked, corrected, written and told.

NO_PAGES: Mapping[str, bytes] = MappingProxyType({})


def compensate(
    source: bytes,
    cell: Cell,
    model: Model,
    *,
    name: str = "program.pdl",
    variables: bytes | None = None,
    pages: Mapping[str, bytes] = NO_PAGES,
    options: Options = AS_USUAL,
    progress: Progress = silent,
    processes: int = 1,
) -> Outcome:
    """Move every target of a program against the error the arm would make there.

    Args:
        source: The program.
        cell: The robot's surroundings.
        model: The arm's error.
        name: File name of the program; its variable file is ``name.lsv``.
        variables: The variable file, where there is one.
        pages: Programs that it imports and that nobody else uses, by file name; they
            are followed and rewritten with it.
        options: What the user asked for.
        progress: Told the name of every stage as it begins.
        processes: How many may work at once on a long program; the result is the same.

    Raises:
        ProgramError: The source is no program text, or is compensated already.
        CellError: The controller compensates on its own.
        ModelError: The model was made for another arm.
    """
    files = name_files(name, source, variables, pages)
    refuse(files, cell, model)
    cell = prepared(cell, model, options)
    setting = Setting(cell, model, options, Clock(progress), processes)
    with setting.clock("parse"):
        reading = read_program(files, cell)
    reading, kept = correct(reading, setting)
    return finish(name, reading, kept, setting)


def name_files(
    name: str,
    source: bytes,
    variables: bytes | None,
    pages: Mapping[str, bytes] = NO_PAGES,
) -> dict[str, bytes]:
    """Name a program, its pages and its variable file, the program first."""
    files = {name: source, **pages}
    if variables is not None:
        files[variables_of(name)] = variables
    return files


def refuse(files: Mapping[str, bytes], cell: Cell, model: Model) -> None:
    """Refuse what must not be compensated at all.

    Raises:
        ProgramError: A file is stamped.
        CellError: The controller's absolute accuracy is on.
        ModelError: The model was made for another arm.
    """
    for name, data in files.items():
        if is_stamped(Source(name, data)):
            raise ProgramError(
                name,
                "is compensated already",
                "Take the source, or give it back with postproc restore",
                line=1,
            )
    if cell.file.robot.absolute_accuracy:
        raise CellError(
            cell.path,
            "the controller compensates on its own: this would do it twice",
            "Switch that option off on the controller, then here",
            place="$.robot.absolute_accuracy",
        )
    model.check_arm(cell.arm)


def finish(name: str, reading: Reading, kept: Correction, setting: Setting) -> Outcome:
    """Write what was corrected, verify it, and say what came of it.

    Raises:
        VerificationError: The output is not what was meant.
    """
    output = write_and_verify(reading, kept, setting)
    with setting.clock("report"):
        return report(name, reading, kept, output, setting)


def write_and_verify(reading: Reading, kept: Correction, setting: Setting) -> Output:
    """Write the numbers, and read what was written.

    Raises:
        VerificationError: The output is not what was meant.
    """
    clock, processes = setting.clock, setting.processes
    with clock("rewrite"):
        output = write_edits(reading, kept.edits, setting.model.id)
    with clock("verify"):
        again = read_program(output.files, setting.cell, reading.programs)
        values = kept.decisions.corrected
        check_output(reading, again, output, kept.edited, values, processes)
    return output


def report(
    name: str, reading: Reading, kept: Correction, output: Output, setting: Setting
) -> Outcome:
    """Say what came of every visit, and what error the model expects now."""
    cell, model, options = setting.cell, setting.model, setting.options
    d, rows, visits = kept.decisions, kept.corrected, reading.visits
    files = tuple(output.records)
    return Outcome(
        program=name,
        model=model.id,
        outputs=output.changed,
        record=replace(
            output.sidecar(model.id, options.told(), tell_arrivals(visits, d, files)),
            assumed=tuple(
                (x.file, x.line, x.message)
                for x in reading.diagnostics
                if x.code == ASSUMED_STILL
            ),
            left=left_elsewhere(visits, d, files, reading.missed, reading.diagnostics),
        ),
        visits=visits,
        decisions=d,
        before=ErrorStatistics.of_sizes(kept.before),
        after=ErrorStatistics.of_sizes(kept.after),
        diagnostics=told_once(
            (
                *reading.diagnostics,
                *followed_pages(visits),
                *missing_file(visits),
                *contradicted_base(visits, cell),
                *tool_in_metres(visits),
                *overruled_strings(visits, kept.overruled),
                *untimed_runs(visits, kept.untimed),
                *rounded_points(visits, kept.away),
                *unsure_sides(visits, rows, d.side, d.std_error),
                *flank_steps(
                    visits, rows, kept.position, d.side, setting.gap, cell.arm
                ),
                *listing_cost(visits, rows, d.q, cell.arm),
                assumed_off(name, cell),
            )
        ),
        stages=setting.clock.stages,
        motion=largest_motion(kept.departure),
        position=kept.position,
        sources={source.name: source.data for source, _ in reading.originals},
        arrivals=ArrivalStates(
            visits,
            q=d.q,
            side=d.side,
            travel=kept.travel,
            speed=kept.speed,
            temperature=setting.temperature,
            cell=cell,
            model=model,
        ),
    )
