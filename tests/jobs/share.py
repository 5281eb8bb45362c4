"""Count the motion lines of the frozen jobs that are corrected.

python -m tests.jobs.share [--language rapid|krl] [--jobs 01 02 ..] [--clone] [--pasted]

Every job is compensated as a folder, as `batch` does, with a model of its arm: a
virtual arm of the same dimensions is surveyed once, over its whole range and all loads
that it may carry, and the model is kept in build/jobs. With `--pasted` every cell also
holds the lines that the messages about its job ask for.
"""

from __future__ import annotations

import argparse
import csv
import re
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from postproc.arrays import Floats
from postproc.batch.archive import missing_in_cell
from postproc.batch.plan import Task, Unit, make_plan
from postproc.batch.tree import scan
from postproc.batch.workers import outcomes_of
from postproc.calibration.fit import fit
from postproc.compensation.eligibility.unchanged import HOLDS_NONE
from postproc.compensation.options import DEFAULT_OPTIONS, Options
from postproc.compensation.outcome import Outcome, Status
from postproc.compensation.program import read_program
from postproc.diagnostics import Code
from postproc.exceptions import PostprocError
from postproc.language.languages import languages
from postproc.language.visits import NOT_FOLLOWED
from postproc.model.effects import BASE_EFFECTS
from postproc.report.simulation import chain_of, setup_of
from postproc.robot.arm_file import arm_path, read_arm_file
from postproc.robot.cell import Cell, load_cell
from postproc.simulation import (
    Campaign,
    VirtualArm,
    follow_rows,
    land,
    stream,
    virtual_arm,
    write_measurements,
)
from postproc.simulation.reference import MEASURED_EVERY, working_angles

HERE = Path(__file__).parent
CACHE = HERE.parents[1] / "build" / "jobs"
LANGUAGES = ("rapid", "krl")
POSES, SEED = 400, 47
MARGIN = np.radians(2.0)  # from the ends of the joints
TURNING = np.radians(230.0)  # axes 4 and 6 are surveyed so far
MOST_KG, WARM = 350.0, (5.0, 40.0)  # [deg C]
PROBES = np.array([[80, -40, 150], [-120, 60, 180], [30, 130, 320]]) * 1e-3  # [m]

OLD_WORD = re.compile(r'(?m)^still(?= *=)|(?<= ")still(?=")')  # in cells

NOT_SEEN = "it is in no program that is compensated"

Place = tuple[str, int]


# A virtual arm of a shipped arm's dimensions, surveyed once.


def arm_of(arm: str) -> VirtualArm:
    """Return the virtual arm that stands for a shipped one."""
    return virtual_arm(SEED, chain=chain_of(read_arm_file(arm_path(arm))))


def cell_of(folder: Path) -> Path:
    """Return the cell of a job in today's words.

    The jobs are frozen, and so are the words of their cells.
    """
    text = (folder / "cell.toml").read_text(encoding="utf-8")
    place = CACHE / f"{folder.parent.name}-{folder.name}.toml"
    CACHE.mkdir(parents=True, exist_ok=True)
    place.write_text(OLD_WORD.sub("motionless", text), encoding="utf-8")
    return place


def model_of(arm: str, cell: Path) -> Path:
    """Return the model of an arm; survey and fit it where the cache has none.

    Args:
        arm: Name of a shipped arm.
        cell: A cell file that has it.
    """
    place = CACHE / f"{arm}-{SEED}.json"
    if not place.is_file():
        CACHE.mkdir(parents=True, exist_ok=True)
        survey = CACHE / f"{arm}-{SEED}.csv"
        write_measurements(_campaign(arm, cell), survey)
        found = fit(survey, cell=load_cell(cell), effects=BASE_EFFECTS)
        found.model.save(place)
    return place


def _campaign(arm: str, cell: Path) -> Campaign:
    """Measure a virtual arm all over its range, with every load, warm and cold."""
    body, rng = arm_of(arm), stream(SEED, "loads")
    low, high = body.nominal.lower + MARGIN, body.nominal.upper - MARGIN
    ends = np.stack([np.maximum(low, -TURNING), np.minimum(high, TURNING)], axis=1)
    tools = np.arange(POSES) % len(PROBES)
    arrivals = follow_rows(
        body,
        working_angles(rng, POSES, ends),
        rng.choice([-1.0, 1.0], (POSES, 6)),
        tool=PROBES[tools],
        payload=rng.uniform(0.0, MOST_KG, POSES),
        payload_com=np.zeros(3),
        temperature=rng.uniform(*WARM, POSES),
        speed=0.15,
        time=MEASURED_EVERY * np.arange(POSES, dtype=float),
    )
    measured = body.measure(arrivals, setup_of(load_cell(cell)).tracker, rng)
    ids = tuple(map(str, range(1, POSES + 1)))
    return Campaign(ids, arrivals, tools, measured, body.tcp(arrivals))


# Every motion line of a job, and why it is not corrected.


@dataclass(frozen=True)
class JobCount:
    """What became of the motion lines of a job.

    Attributes:
        job: Language and number, as `rapid/job01`.
        reasons: Of every counted line, "" where it is corrected.
        exit_codes: Of the programs of the job.
        messages: Findings of its programs, by code.
        seconds: It took.
    """

    job: str
    reasons: Mapping[Place, str]
    exit_codes: tuple[int, ...]
    messages: tuple[str, ...]
    seconds: float

    @property
    def corrected(self) -> int:
        """Return how many lines are corrected."""
        return sum(not reason for reason in self.reasons.values())


def counted(folder: Path) -> list[Place]:
    """Return the lines of a job that count: file and line."""
    with (folder / "motions.csv").open(encoding="utf-8") as text:
        rows = list(csv.DictReader(text))
    return [(r["file"], int(r["line"])) for r in rows if r["kind"] == "counted"]


def count(
    folder: Path, cell: Path | None = None, options: Options = DEFAULT_OPTIONS
) -> JobCount:
    """Compensate a job, and say of every counted line why it is not corrected.

    Args:
        folder: The job.
        cell: Its cell; default: the one in the folder, see `cell_of`.
        options: Of the compensation.
    """
    start = perf_counter()
    places = counted(folder)
    found: dict[Place, str] = {}
    codes, messages = [], []
    for unit, outcome in compensated(folder, cell or cell_of(folder), options):
        if isinstance(outcome, Exception):
            if not isinstance(outcome, PostprocError):
                raise outcome
            found |= {p: f"refused: {outcome}" for p in places if p[0] in unit.files}
            codes.append(2)
            messages.append(str(outcome))
        else:
            found |= reasons_of(unit, outcome)
            codes.append(outcome.exit_code)
            messages += [f"{d.code}: {d.message}" for d in outcome.diagnostics]
    reasons = {place: found.get(place, NOT_SEEN) for place in places}
    name = f"{folder.parent.name}/{folder.name}"
    seconds = perf_counter() - start
    return JobCount(name, reasons, tuple(codes), tuple(messages), seconds)


def compensated(
    folder: Path, cell: Path, options: Options = DEFAULT_OPTIONS
) -> Iterator[tuple[Unit, Outcome | Exception]]:
    """Yield the programs of a job, grouped as `batch` does, and what came of each."""
    arm = load_cell(cell).arm.name
    plan = make_plan(None, cell, model_of(arm, cell), options)
    for unit in scan(folder, plan).units:
        task = Task(unit, tuple((folder / f).read_bytes() for f in unit.files))
        yield unit, outcomes_of([task], plan.setups[unit.setup])[0]


ASKED = re.compile(r"auxiliary axis (\d) is not declared")


def pasted(folder: Path, place: Path) -> Path:
    """Write the cell of a job with the lines that the messages about the job ask for.

    Args:
        folder: The job.
        place: The new cell file.
    """
    cell = cell_of(folder)
    asked = {axis for reason in count(folder).reasons.values()
             for axis in ASKED.findall(reason)}  # fmt: skip
    archives = (language.read_archive(folder) for language in languages())
    lines = [line for archive in archives if archive is not None
             for line in missing_in_cell(archive, load_cell(cell))[2:]]  # fmt: skip
    if asked and not any("[aux]" in line for line in lines):
        lines += ["[aux]", *(f'{axis} = "track"' for axis in sorted(asked))]
    text = cell.read_text(encoding="utf-8")
    text += "".join(f"\n{line.strip()}" for line in lines) + "\n"
    place.write_text(text, encoding="utf-8")
    return place


def reasons_of(unit: Unit, outcome: Outcome) -> dict[Place, str]:
    """Return why each motion line of a program is not corrected, "" where it is.

    A target that is shifted from a corrected point (`Offs`) is corrected with it.
    """
    places = {file.rpartition("/")[2]: file for file in unit.files}
    v, d = outcome.visits, outcome.decisions
    found: dict[Place, str] = {}
    written = set(
        v.target.literal[
            (d.status == Status.CORRECTED) & (v.target.literal >= 0)
        ].tolist()
    )
    for finding in outcome.diagnostics:
        if finding.code in NOT_FOLLOWED and finding.file in places:
            found[places[finding.file], finding.line] = finding.message
    for k in range(len(v)):
        place = places.get(v.files[v.place.file[k]], ""), int(v.place.line[k])
        safe = d.status[k] == Status.CORRECTED or v.target.follows[k] in written
        reason = "" if safe else d.reasons[d.why[k]].text or Status(d.status[k]).name
        found[place] = found.get(place) or reason
    return found


# Where the independent arm lands.


@dataclass(frozen=True)
class Misses:
    """How far an arm lands from where a job asks it to be, at corrected stops.

    Attributes:
        sure: Where the sides of all joints are known, and the correction is that of
            the arrival alone, (n,) [mm].
        other: At the other stops, (m,) [mm].
        before: At all of them without a correction, (n + m,) [mm].
    """

    sure: Floats
    other: Floats
    before: Floats


def landed(folder: Path, options: Options = DEFAULT_OPTIONS) -> Misses:
    """Let the virtual arm that was surveyed run what is written for a job."""
    found = Misses(*(np.empty(0),) * 3)
    cell_file = cell_of(folder)
    for _, outcome in compensated(folder, cell_file, options):
        if isinstance(outcome, Outcome):
            one = _landed(outcome, load_cell(cell_file))
            found = Misses(
                np.concatenate([found.sure, one.sure]),
                np.concatenate([found.other, one.other]),
                np.concatenate([found.before, one.before]),
            )
    return found


def _landed(outcome: Outcome, cell: Cell) -> Misses:
    arm, setup = arm_of(cell.arm.name), setup_of(cell)
    given, made = (
        read_program(files, cell).visits
        for files in (outcome.sources, {**outcome.sources, **outcome.outputs})
    )
    before, after = land(arm, setup, given), land(arm, setup, given, made)
    v, d, rows = outcome.visits, outcome.decisions, after.visit
    stops = (d.status == Status.CORRECTED) & ~v.motion.fly & ~v.motion.via
    stops[:1] = False  # how the gears lie at first is not known
    averaged = [one.code is Code.ARRIVALS_AVERAGED for one in d.reasons]
    sure = stops & (d.direction != 0).all(axis=1) & ~np.array(averaged)[d.why]
    was, miss = (1e3 * np.linalg.norm(x.error, axis=1) for x in (before, after))
    return Misses(
        miss[sure[rows]], miss[(stops & ~sure)[rows]], was[stops[before.visit]]
    )


# The table.


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the share of every language, and the reasons for the rest."""
    given = _arguments(arguments)
    options = Options(shared_points="clone" if given.clone else "mean")
    for language in given.language or LANGUAGES:
        folders = sorted((HERE / language).glob("job*"))
        folders = [f for f in folders if not given.jobs or f.name[3:] in given.jobs]
        with tempfile.TemporaryDirectory() as name:
            place = Path(name) / "cell.toml"
            found = [
                count(f, pasted(f, place) if given.pasted else None, options)
                for f in folders
            ]
        if given.lines:
            _print_lines(found)
        _print_share(language, found)
        if given.land:
            _print_misses([landed(folder, options) for folder in folders])


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--language", nargs="+", choices=LANGUAGES)
    parser.add_argument("--jobs", nargs="+", help="Numbers, as 01.")
    parser.add_argument("--clone", action="store_true", help="Clone shared points.")
    parser.add_argument(
        "--pasted", action="store_true", help="Add what messages ask for to the cells."
    )
    parser.add_argument(
        "--land", action="store_true", help="Let the arm run what is written."
    )
    parser.add_argument("--lines", action="store_true", help="List every other line.")
    return parser.parse_args(arguments)


def _print_lines(found: Iterable[JobCount]) -> None:
    for job in found:
        for (file, line), reason in job.reasons.items():
            if reason:
                print(f"{job.job}/{file}:{line}: {reason}")


def _print_misses(found: Iterable[Misses]) -> None:
    for name in ("before", "sure", "other"):
        some = np.concatenate([getattr(one, name) for one in found])
        if len(some):
            print(
                f"  {name}: {len(some)} corrected stops, the arm misses by "
                f"{some.mean():.4f} mm on average, {some.max():.4f} at most"
            )


def _print_share(language: str, found: list[JobCount]) -> None:
    reasons = Counter(r for job in found for r in job.reasons.values())
    total, done = reasons.total(), reasons.pop("", 0)
    seconds = sum(job.seconds for job in found)
    share = 100.0 * done / max(total, 1)
    print(f"{language}: {done} of {total} motion lines ({share:.1f} %) are corrected")
    elsewhere = total - reasons[HOLDS_NONE.text]
    share = 100.0 * done / max(elsewhere, 1)
    print(f"  {done} of the {elsewhere} ({share:.1f} %) that go to no home position")
    print(f"  in {seconds:.1f} s")
    for reason, times in reasons.most_common():
        print(f"{times:6d} {reason}")


if __name__ == "__main__":
    main()
