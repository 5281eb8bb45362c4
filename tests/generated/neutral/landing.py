"""Drawn programs, compensated, and run on the virtual arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from postproc.compensation.compensate import compensate
from postproc.compensation.findings.findings import SURE
from postproc.compensation.options import Options
from postproc.compensation.outcome import DONE, NOT_ALL, Outcome, Status
from postproc.compensation.output.sidecar import restore
from postproc.exceptions import PostprocError
from postproc.language.visits import Blend, Meaning, Visits, ZoneRule
from postproc.model.model import Model
from postproc.report.simulation import setup_of
from postproc.robot.cell import Cell
from postproc.robot.pose import record_from_pose
from postproc.robot.trajectory import Motion
from postproc.simulation import virtual_arm
from postproc.simulation.program import ProgramRun, run_program
from tests.conftest import SEED
from tests.fuzz.case import check_bytes, records_of, unstamped
from tests.generated.found import (
    ALONG,
    AVERAGED,
    FIRST,
    KNOWN,
    LOADED,
    ROUNDED,
    UNSURE,
    Found,
    is_averaged,
)
from tests.generated.landing import WORSE
from tests.generated.neutral.draw import Draw
from tests.generated.neutral.follow import follow
from tests.generated.neutral.languages import LANGUAGES, Language
from tests.generated.neutral.run import Run, Step
from tests.generated.neutral.text import SHIFTS, Printed
from tests.generated.neutral.tree import Program
from tests.language.one_by_one import differing, read
from tests.made_visits import visits as made_visits

RUNS = 3  # of a program that asks for inputs
MOST_MM = 0.1  # from where a target that is sure is wanted
MANY = 4.0  # standard errors within which a target of another load lands
MM = 1e-3
OVERLAP = 40.0  # percent
KINDS = {
    "joint": Motion.JOINT, "axes": Motion.JOINT, "line": Motion.LINEAR,
    "step": Motion.LINEAR, "arc": Motion.CIRCULAR,
}  # fmt: skip
arm = cache(virtual_arm)


@dataclass(frozen=True)
class Case:
    """A drawn program, and its text in a language."""

    made: Program
    text: Printed
    language: Language

    def steps(self, outputs: Mapping[str, bytes], seed: int) -> list[Step]:
        """Run it with the numbers that stand in a text of it."""
        numbers = self.text.numbers(outputs)
        shifts = {k: own[:3] for k, own in numbers.items() if k > SHIFTS}
        points = {k: own for k, own in numbers.items() if k <= SHIFTS}
        literals = self.language.poses(points, self.made)
        traits = self.language.traits
        return Run(self.made, literals, shifts, seed, traits).run()


def case(seed: int, language: str, cell: Cell) -> Case:
    """Draw a program and write it."""
    own = LANGUAGES[language]
    made = Draw(seed, own.traits).program()
    return Case(made, own.write(made, cell), own)


def lands(seed: int, language: str, cell: Cell, model: Model) -> Found:
    """Compensate a program, and run it before and after, on the arm of the model.

    Raises:
        AssertionError: A byte outside of the targets changed, the source is not given
            back, other moves are made, or one that the tool did not predict; or blocks
            of moves are not read as their moves one by one.
    """
    one, found = case(seed, language, cell), Found()
    assert_read_alike(one.text.files, cell)
    try:
        done = compensated(one.text.files, cell, model, seed % 4 < 2)
    except PostprocError as refused:
        found.refused[str(refused)] += 1
        return found
    assert done.exit_code in (DONE, NOT_ALL)
    outputs = given_back(one.text.files, done)
    found.visits += len(done.visits)
    found.corrected += done.decisions.count(Status.CORRECTED)
    found.reasons.update(reasons(done))
    for run in range(RUNS if seed % 2 else 1):
        asked, ran = (one.steps(files, run) for files in (one.text.files, outputs))
        assert [step.move.mark for step in asked] == [step.move.mark for step in ran]
        rows = follow(done.visits, asked, one.text, one.language)
        count(found, seed, one, done, (asked, ran), rows, cell)
    return found


def assert_read_alike(files: Mapping[str, bytes], cell: Cell) -> None:
    """Read a program with blocks of moves, and without."""
    try:
        found = read(files, cell, least=2)
    except PostprocError:
        return
    assert [*differing(found, read(files, cell))] == []


def compensated(
    files: Mapping[str, bytes], cell: Cell, model: Model, shared: bool = False
) -> Outcome:
    """Compensate a program with its pages."""
    main, *others = files
    pages = {name: files[name] for name in others}
    options = Options(edit_exported=shared)
    return compensate(files[main], cell, model, name=main, pages=pages, options=options)


def given_back(files: Mapping[str, bytes], done: Outcome) -> dict[str, bytes]:
    """Return all files without stamps, after a look at their bytes.

    Raises:
        AssertionError: Other bytes changed, or the source is not given back.
    """
    records = records_of(done.sidecar)
    check_bytes(files, {**files, **done.outputs}, records, done.visits)
    for name, record in records.items():
        assert restore(done.outputs[name], record, name) == files[name], name
    new = {n: unstamped(n, files[n], done.outputs[n]) for n in records}
    return {**files, **new}


def reasons(done: Outcome) -> list[str]:
    """Return why visits are not corrected."""
    d = done.decisions
    return [d.reasons[w].text for w in d.why[d.status != Status.CORRECTED].tolist()]


def count(
    found: Found, seed: int, one: Case, done: Outcome,
    steps: tuple[list[Step], list[Step]], rows: Sequence[set[int]], cell: Cell,
) -> None:  # fmt: skip
    """Sort the true errors of steps whose target changed, by what the tool says."""
    asked, ran = steps
    d, visits = done.decisions, done.visits
    before, now = errors(asked, ran, cell)
    for k, (old, new) in enumerate(zip(asked, ran, strict=True)):
        if np.array_equal(old.target.value, new.target.value):
            continue
        line = one.text.moves[old.move.mark][1]
        mine = sorted(rows[k])
        if not mine:
            found.wrong.append((seed, line, "is corrected, but not followed"))
            continue
        if k not in now:
            if k in before:
                found.wrong.append((seed, line, "the arm cannot reach it any more"))
            break
        pair = before[k], now[k]
        safe = bool((d.status[mine] == Status.CORRECTED).all())
        unsure = bool((np.abs(d.side[mine]) < SURE).any())
        size = np.linalg.norm(d.std_error[mine], axis=1).max() / MM
        if not safe:
            found.error_mm[ALONG].append(pair)
            parted = old.target.parted and not one.language.traits.parts_move
            if parted:
                text = "moves along, though a number of it is set by itself"
                found.wrong.append((seed, line, text))
            elif not old.target.computed:
                why = {d.reasons[d.why[row]].text for row in mine}
                text = f"went to new numbers, though: {' / '.join(why)}"
                found.wrong.append((seed, line, text))
            elif not unsure and now[k] > before[k] + MOST_MM:
                found.wrong.append((seed, line, WORSE))
        elif (visits.frame.tool[mine] < 0).any() or (
            not old.in_joints and (visits.frame.uframe[mine] < 0).any()
        ):
            found.wrong.append(
                (seed, line, "is corrected in frames that are not known")
            )
        elif (visits.motion.fly & ~visits.motion.via)[mine].any() or old.fly:
            found.error_mm[ROUNDED].append(pair)
        elif is_averaged(d, mine):
            found.error_mm[AVERAGED].append(pair)
            if not unsure and now[k] > before[k] + MOST_MM:
                found.wrong.append((seed, line, WORSE))
        elif unsure:
            found.error_mm[UNSURE].append(pair)
            found.z.append(now[k] / size)
            if k == 0:
                found.error_mm[FIRST].append(pair)
        elif not np.isnan(old.load[0]):
            found.error_mm[LOADED].append(pair)
            if now[k] > max(MOST_MM, MANY * size):
                found.wrong.append((seed, line, f"lands {now[k]:.3f} mm off, loaded"))
        else:
            found.error_mm[KNOWN].append(pair)
            if now[k] > MOST_MM:
                found.wrong.append((seed, line, f"lands {now[k]:.3f} mm off"))


def errors(
    asked: Sequence[Step], ran: Sequence[Step], cell: Cell
) -> tuple[dict[int, float], dict[int, float]]:
    """Return how far steps land from where they are wanted, before and after [mm]."""
    first, second = (on_arm(steps, cell) for steps in (asked, ran))
    wanted = dict(
        zip(first.visit.tolist(), arm(SEED).nominal_tcp(first.arrivals), strict=True)
    )
    both = []
    for run, steps in ((first, asked), (second, ran)):
        landed = arm(SEED).tcp(loaded(run, steps))
        both.append({
            k: float(np.linalg.norm(at - wanted[k]) / MM)
            for k, at in zip(run.visit.tolist(), landed, strict=True) if k in wanted
        })  # fmt: skip
    return both[0], both[1]


def loaded(run: ProgramRun, steps: Sequence[Step]):  # type: ignore[no-untyped-def]
    """Give arrivals the loads that the program states."""
    arrivals = run.arrivals
    mass, centre = arrivals.payload.copy(), arrivals.payload_com.copy()
    for row, k in enumerate(run.visit.tolist()):
        own, at = steps[k].load
        if not np.isnan(own):
            mass[row], centre[row] = own, np.array(at) * MM
    return replace(arrivals, payload=mass, payload_com=centre)


def on_arm(steps: Sequence[Step], cell: Cell) -> ProgramRun:
    """Let the virtual arm make the steps."""
    return run_program(arm(SEED), setup_of(cell), straight(steps))


def straight(steps: Sequence[Step]) -> Visits:
    """Write steps as visits one after the other, in the frame of the arm."""
    poses = [np.eye(4)]
    numbers, tools = [], []
    for step in steps:
        if step.in_joints:
            numbers.append(np.rad2deg(step.target.value).tolist())
        else:
            numbers.append(record_from_pose(step.world[None])[0].tolist())
        poses.append(step.tool)
        tools.append(len(poses) - 1)
    n = len(steps)
    zeros = np.zeros(n, dtype=np.int64)
    meanings = [Meaning.JOINTS if s.in_joints else Meaning.POSE for s in steps]
    return made_visits(
        [int(m) for m in meanings], numbers,
        kind=np.array([KINDS[s.move.kind] for s in steps]),
        via=np.array([s.via for s in steps]),
        fly=np.array([s.fly for s in steps]),
        size_mm=np.array([s.zone or np.nan for s in steps]),
        blend=np.array([Blend.OVERLAP if s.by_joints else Blend.ZONE for s in steps]),
        overlap_percent=zeros + OVERLAP, rule=zeros + ZoneRule.FROM,
        linear=np.array([s.speed * MM for s in steps]),
        config_given=np.zeros(n, dtype=bool), configs=("",),
        tool=np.array(tools), base=zeros, uframe=zeros, poses=np.array(poses),
        taught=np.zeros(len(poses), dtype=bool),
    )  # fmt: skip


__all__ = ["Case", "case", "lands"]
