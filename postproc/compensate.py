"""The first sentence: a program goes in, the same program lands where it says."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from itertools import count
from time import perf_counter
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.model import Model
from postproc.exceptions import CellError, ProgramError
from postproc.language.source import Source
from postproc.language.stamp import is_stamped
from postproc.language.visits import Visits
from postproc.motion.planner import directions
from postproc.notes import (
    assumed_off,
    overruled_strings,
    unsure_sides,
    untimed_runs,
)
from postproc.output import Output, write_numbers
from postproc.planning import Planned, Reading, plan_visits, read_program, states_of
from postproc.proposal import Proposal, propose
from postproc.report import ErrorStatistics, Outcome
from postproc.resolve import targets_from_visits
from postproc.robot.cell import Cell
from postproc.robot.state import States
from postproc.solved import solve_again, solve_visits
from postproc.verify import check_output

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

Progress = Callable[[str], None]

NO_PAGES: Mapping[str, bytes] = MappingProxyType({})
FREE_ROUNDS = 2  # of correcting for changed directions, before targets are held


def silent(stage: str) -> None:
    """Tell nobody."""


@dataclass(frozen=True)
class Options:
    """What the user asked for.

    Attributes:
        clone: Give variables whose arrivals disagree a value for each.
        shared: Edit variables that other programs may read too.
        temperature: Arm temperature [deg C]; default: the cell's.
    """

    clone: bool = False
    shared: bool = False
    temperature: float | None = None


class Clock:
    """Seconds spent in every stage; tells the stages to whom it may concern."""

    def __init__(self, progress: Progress) -> None:
        """Start with no stage."""
        self.stages: dict[str, float] = {}
        self._progress = progress

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Add the time of a block to a stage."""
        self._progress(stage)
        start = perf_counter()
        yield
        self.stages[stage] = self.stages.get(stage, 0.0) + perf_counter() - start


@dataclass(frozen=True)
class Corrected:
    """A proposal, the files that hold it, and the plan of those files."""

    proposal: Proposal
    output: Output
    planned: Planned


def compensate(
    source: bytes,
    cell: Cell,
    model: Model,
    *,
    name: str = "program.pdl",
    variables: bytes | None = None,
    pages: Mapping[str, bytes] = NO_PAGES,
    options: Options = Options(),
    progress: Progress = silent,
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

    Raises:
        ProgramError: The source is no program text, or is compensated already.
        CellError: The controller compensates on its own.
        ModelError: The model was made for another arm.
    """
    clock = Clock(progress)
    files = name_files(name, source, variables, pages)
    refuse(files, cell, model)
    with clock("parse"):
        reading = read_program(files, cell)
    with clock("plan"):
        planned = plan_visits(reading.visits, cell)
    states = states_of(planned.plan, cell, _temperature(cell, options))
    corrected = settle(reading, planned, states, cell, model, options, clock)
    with clock("report"):
        return report(
            name, reading, planned, states, corrected, cell, model, options, clock
        )


def name_files(
    name: str,
    source: bytes,
    variables: bytes | None,
    pages: Mapping[str, bytes] = NO_PAGES,
) -> dict[str, bytes]:
    """Name a program, its pages and its variable file, the program first."""
    files = {name: source, **pages}
    if variables is not None:
        files[name.rpartition(".")[0] + ".lsv"] = variables
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


def settle(
    reading: Reading,
    planned: Planned,
    states: States,
    cell: Cell,
    model: Model,
    options: Options,
    clock: Clock,
) -> Corrected:
    """Correct, write and plan again, until the directions are those corrected for.

    The corrected program makes slightly other moves than the original. Where one of
    them turns a joint the other way, the correction is computed anew for that side;
    where that flips it back, the target is left alone.
    """
    held = np.zeros(len(states), dtype=bool)
    with clock("solve"):
        solved = solve_visits(model, cell, planned, states)
    for number in count():  # ends: from the third round on `held` grows
        with clock("decide"):
            proposal = propose(reading, planned, solved, held, cell, options)
        with clock("plan again"):
            found = directions_after(reading.visits, proposal, cell)
        changed = proposal.corrected & (found != solved.direction).any(axis=1)
        flipped = proposal.corrected & (found * solved.direction < 0).any(axis=1)
        if not (changed if number < FREE_ROUNDS else flipped).any():
            done = write_and_verify(reading, proposal, cell, model, clock)
            found = done.planned.plan.direction
            flipped = proposal.corrected & (found * solved.direction < 0).any(axis=1)
            if not flipped.any():
                return done
            held = held | flipped
            continue
        held = held | flipped if number >= FREE_ROUNDS else held
        with clock("solve"):
            aimed = states.with_(direction=found)
            solved = solve_again(solved, changed, model, cell, planned, aimed)
    raise AssertionError("unreachable")


def directions_after(visits: Visits, proposal: Proposal, cell: Cell) -> Array:
    """Find the arrival directions of a program whose targets have moved, (n, 6)."""
    moved = replace(visits, values=proposal.decisions.corrected)
    targets, _ = targets_from_visits(moved, cell)
    return np.array(directions(cell.arm, targets)[1])


def write_and_verify(
    reading: Reading, proposal: Proposal, cell: Cell, model: Model, clock: Clock
) -> Corrected:
    """Write the numbers, and read and plan what was written.

    Raises:
        VerificationError: The output is not what was meant.
    """
    with clock("rewrite"):
        output = write_numbers(reading, proposal.edited, proposal.values, model.id)
    with clock("verify"):
        again = read_program(output.files, cell)
        check_output(reading, again, output, proposal.edited)
        replanned = plan_visits(again.visits, cell)
    decisions = replace(proposal.decisions, corrected=np.array(again.visits.values))
    return Corrected(replace(proposal, decisions=decisions), output, replanned)


def report(
    name: str,
    reading: Reading,
    planned: Planned,
    states: States,
    corrected: Corrected,
    cell: Cell,
    model: Model,
    options: Options,
    clock: Clock,
) -> Outcome:
    """Say what came of every visit, and what error the model expects now."""
    proposal, done = corrected.proposal, corrected.planned.plan
    d, rows, visits = proposal.decisions, proposal.corrected, reading.visits
    wanted = planned.plan.tcp[rows, :3, 3]
    new = states.with_(q=np.array(done.q), direction=np.array(done.direction))[rows]
    before = model.error(cell.arm, states[rows])
    after = done.tcp[rows, :3, 3] + model.error(cell.arm, new) - wanted
    return Outcome(
        program=name,
        model=model.id,
        outputs=corrected.output.changed,
        sidecar=corrected.output.sidecar(model.id, asdict(options)),
        visits=visits,
        decisions=d,
        before=ErrorStatistics.of(before),
        after=ErrorStatistics.of(after),
        diagnostics=(
            *reading.diagnostics,
            *overruled_strings(visits, planned.plan),
            *untimed_runs(visits, planned.plan),
            *unsure_sides(visits, rows, d.direction, d.std_error),
            assumed_off(name, cell),
        ),
        stages=clock.stages,
        position=planned.plan.tcp[:, :3, 3],
        sources={source.name: source.data for source in reading.sources},
    )


def _temperature(cell: Cell, options: Options) -> float:
    """Choose the temperature to compensate for [deg C]."""
    return cell.temperature if options.temperature is None else options.temperature
