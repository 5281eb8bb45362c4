"""Write real-arms.md: what a fit leaves of real arms, on rows it has not seen.

PYTHONPATH=. python docs/studies/real_arms.py DATA [--jobs 2] [--quick]
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from data_sets import SHIPPED, DataSet, Rows, Split, descriptions, read_set
from real_files import fit_of, predict_of, write_fit, write_test

from postproc import __version__
from postproc.arrays import Floats
from postproc.calibration.diagnosis.diagnose import Extension, extend_model
from postproc.calibration.diagnosis.result import Diagnosis, Finding
from postproc.calibration.fit import Calibration, fit_measurements
from postproc.calibration.measurements import Measurements
from postproc.calibration.registration import predict_registered
from postproc.exceptions import PostprocError
from postproc.model.effect_sum import Combination
from postproc.model.effects.maps import MOST_CENTRES
from postproc.model.effects.placement import Placement
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.model.model_file import Method
from postproc.model.statistics import ErrorStatistics
from postproc.robot.pose import MM

OUT = Path(__file__).parent / "real-arms.md"
ACCOUNT = SHIPPED / "account.md"  # what was tried, and what came of it
WITHIN = 1.96
QUICK = 150  # rows that are fitted in a quick run
NOMINAL, GEOMETRY, DEFAULT = "registered only", "geometry alone", "fit"
TRACED = "fit, then diagnose"
PUBLISHED: tuple[Method, ...] = (
    "eja-elm",
    "elm",
    "interpolation",
    "kinematic-elm",
    "kriging",
)
ORDER = (NOMINAL, GEOMETRY, *PUBLISHED, DEFAULT, TRACED)
MOST_FINDINGS = 20  # told of one series


@dataclass(frozen=True)
class Outcome:
    """Residuals of tested rows [m], and their stated deviations (NaN: not stated)."""

    left: Floats
    std: Floats

    def row(self, name: str) -> str:
        """Write a row of a table."""
        e = ErrorStatistics.of(self.left)
        held = "-"
        if not np.isnan(self.std).any():
            held = f"{100 * (np.abs(self.left) < WITHIN * self.std).mean():.1f} %"
        return (
            f"| {name} | {e.mean_mm:.3f} | {e.p95_mm:.3f} | {e.max_mm:.3f} | {held} "
            f"| {e.n} |"
        )

    @property
    def mean_mm(self) -> float:
        """Mean length of the residuals [mm]."""
        return ErrorStatistics.of(self.left).mean_mm


@dataclass(frozen=True)
class Trial:
    """Rows of one set that are fitted, and all splits that do so.

    Attributes:
        path, base: Of the set, see `read_set`.
        draws: Numbers of the splits and of their draws, all of which fit the same rows.
        quick: Whether few rows are fitted.
        traced: Whether what is left of the fitted rows is diagnosed.
    """

    path: Path
    base: Path
    draws: tuple[tuple[int, int], ...]
    quick: bool
    traced: bool


@dataclass(frozen=True)
class Tried:
    """What a trial came to.

    Attributes:
        trial: The trial.
        outcomes: By split, draw and method.
        diagnosis: Of the fitted rows, or None.
        fitted: How many rows were fitted.
        seconds: Processor time.
    """

    trial: Trial
    outcomes: dict[tuple[int, int], dict[str, Outcome]]
    diagnosis: Diagnosis | None
    fitted: int
    seconds: float


read_once = cache(read_set)


def trials_of(path: Path, base: Path, quick: bool, traced: bool) -> list[Trial]:
    """List what is fitted for a set, every choice of rows once."""
    data = read_once(path, base)
    fits: dict[tuple[str, bytes], list[tuple[int, int]]] = {}
    for k, split in enumerate(() if data is None else data.splits):
        for number, (rows, _) in enumerate(split.draws):
            fits.setdefault((split.fit, rows.tobytes()), []).append((k, number))
    return [Trial(path, base, tuple(d), quick, traced) for d in fits.values()]


def run(trial: Trial) -> Tried:
    """Fit rows with every method, and judge the rows that are tested."""
    began = spent()
    data = read_once(trial.path, trial.base)
    assert data is not None
    number, draw = trial.draws[0]
    split = data.splits[number]
    inside = split.draws[draw][0]
    rows = data.series[split.fit][thinned(inside, QUICK) if trial.quick else inside]
    fits = {name: fitted(data, rows, name) for name in ORDER[1:-2]}
    models = {NOMINAL: without_effects(fits[GEOMETRY].model)}
    models |= {name: found.model for name, found in fits.items()}
    found = traced(data, fitted(data, rows, DEFAULT)) if trial.traced else None
    if found is not None:
        models[TRACED] = found.model
    outcomes = {
        (k, n): {name: judged(m, data, data.splits[k], n) for name, m in models.items()}
        for k, n in trial.draws
    }
    for at, outcome in by_command_line(trial, data, rows):
        outcomes[at][DEFAULT] = outcome
    seconds = spent() - began
    told = None if found is None else found.diagnosis
    return Tried(trial, outcomes, told, len(rows), seconds)


def spent() -> float:
    """Return the processor time of this process and of those it has called [s]."""
    return sum(os.times()[:4])


def by_command_line(
    trial: Trial, data: DataSet, rows: Measurements
) -> Iterator[tuple[tuple[int, int], Outcome]]:
    """Fit and predict as a user does, with files and commands."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        write_fit(data, trial.path, rows, place)
        call(fit_of(data, place))
        for k, n in trial.draws:
            write_test(data, data.splits[k], n, place)
            call(predict_of(data, data.splits[k], place))
            yield (k, n), predicted(place / "predicted.csv")


def call(arguments: Sequence[str]) -> None:
    """Run postproc; what it says is shown where it fails."""
    done = subprocess.run(
        [Path(sys.executable).with_name("postproc"), *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode not in (0, 1):
        raise PostprocError(done.stderr)


def predicted(path: Path) -> Outcome:
    """Read residuals and their stated deviations from what `predict` wrote."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = [*csv.DictReader(file)]
    columns = [np.array([[float(row[f"{name}{a}_mm"]) for a in "xyz"] for row in rows])
               for name in ("r", "reading_s")]  # fmt: skip
    return Outcome(columns[0] * MM, columns[1] * MM)


def thinned(rows: Rows, most: int) -> Rows:
    """Take at most so many rows, evenly."""
    some = np.linspace(0, len(rows) - 1, min(len(rows), most))
    thin: Rows = rows[np.unique(some.astype(np.int64))]
    return thin


def fitted(data: DataSet, rows: Measurements, name: str) -> Calibration:
    """Fit rows with a method, as `postproc fit` does."""
    frame = data.about.frame
    if name == "kriging":  # the work grows with the cube of the rows
        rows = rows[thinned(np.arange(len(rows)), MOST_CENTRES)]
    for method in PUBLISHED:
        if name == method:
            return fit_measurements(rows, data.cell, method=method, frame=frame)
    effects = ("geometry",) if name == GEOMETRY else None
    return fit_measurements(rows, data.cell, effects=effects, frame=frame)


def without_effects(model: Model) -> Model:
    """Leave nothing of a model but where the tracker stood."""
    return replace(
        model,
        effects=Combination(()),
        values=np.zeros(0),
        covariance=np.zeros((0, 0)),
        prior_std=np.zeros(0),
        spread=(np.nan,) * 3,
    )


def traced(data: DataSet, found: Calibration) -> Extension:
    """Diagnose the rows that were fitted, as `postproc diagnose` does."""
    placed = found.model.registration
    tracker = data.cell.tracker if placed is None else placed.tracker
    setup = () if placed is None else (Placement.name,)
    more = extend_model(
        found.survey, data.cell.arm, found.model, tracker=tracker, setup=setup
    )
    model = replace(more.model, registration=placed)
    return replace(more, model=model)


def judged(model: Model, data: DataSet, split: Split, draw: int) -> Outcome:
    """Compare tested readings with what a model says of them."""
    rows = data.series[split.test][split.draws[draw][1]]
    return judge(model, data, rows, split.same)


def judge(model: Model, data: DataSet, rows: Measurements, same: bool) -> Outcome:
    """Compare readings with what a model says of them.

    In the set-up of the fitted rows the registration is theirs; in another one it is
    found from the tested rows themselves, with the arm as the model knows it.
    """
    arm, placed = data.cell.arm, model.registration
    states, position = rows.states, rows.position
    if not same:
        placed, read = predict_registered(model, arm, states, position)
        states = placed.on_probes(states)
    else:
        states = states if placed is None else placed.on_probes(states)
        read = model.reading(arm, states)
    position = position if placed is None else placed.to_base(position)
    return Outcome(position - ArmStates(arm, states).walk.tcp - read.error, read.std)


def pooled(draws: list[dict[str, Outcome]]) -> dict[str, Outcome]:
    """Put the tested rows of several draws together, method by method."""
    out = {}
    for name in draws[0]:
        left, std = (
            np.concatenate([getattr(found[name], k) for found in draws])
            for k in ("left", "std")
        )
        out[name] = Outcome(left, std)
    return out


# The page.

TEXT = """# Real arms

Written by `make real DATA=folder`{how} with postproc {version} and numpy {numpy}, in
{minutes:.0f} minutes of processor time, from public measurements of real arms. The data
are not part of the project; every set below says where they come from.

- **No tested row was seen before the test**: not by the fit, not by
  the diagnosis, not by the registration. Only where another series is *registered
  again*, its tracker and its probe (nine numbers) are found from the tested rows, with
  the arm as the model knows it; this flatters all methods alike, small series more.
- **Nothing is tuned**: every method runs with its defaults. The splits stand in the
  descriptions; those of the project (`docs/studies/real/*.toml`), with a hash of the
  rows that they draw, were committed before the first fit.
- **Every tested row counts**, also those that are no measurements.

*{nominal}* is the arm as its maker gives it; *{geometry}* has its
lengths and angles fitted; the next five are [published methods](reproduction.md)
(40 neurons, seed 0; kriging of {centres} rows at the most, evenly chosen);
*{default}* is `postproc fit` and `postproc predict`, on files{after}.
Errors are distances in mm. *Intervals hold* is the share of coordinates in the 95 %
interval that is stated for them (of a published method: by ten folds of
cross-validation). Published maps of the position error hold for the probe that they
were fitted with, at its place; another series may have another.

## In short: mean error of the tested rows, mm

{short}

{account}
## Another arm

A set is one TOML file, and its data. Put both in a folder as
`FOLDER/dataset-NAME.toml`, and run `make real DATA=FOLDER`; a set whose data are public
is welcome in `docs/studies/real`, where its `folder` names the data's place in
`DATA`. What a description says:

```toml
name = "UR5"
arm = "ur5.toml"              # a shipped arm, or an arm file beside this one
frame = "tracker"             # or "base", with tool_mm = [..] of the reflector
licence = "MIT"
source = "who measured it, and where it was published"
get = "where others get it"   # optional, as are notes = [..]
[columns]                     # as measurements.columns; not needed for known headers
q1_deg = "joint_1"            # .. q6_deg
x_mm = ["x_t", {{ column = "x_dif", factor = -1.0 }}]   # y_mm, z_mm; a list is a sum
[[series]]                    # a file: one set-up, rows in the order of visits
name = "grid"
file = "grid.csv"
sha256 = "3de6.."             # optional: another file is refused
[[split]]                     # random, blocks (of 30) or last rows of a series
fit = "grid"
draw = "random"
share = 0.3
seeds = [0, 1, 2]
[[split]]                     # all of another series, registered "again" or "as fitted"
fit = "grid"
test = "random"
registered = "as fitted"
[[published]]                 # figures of the source, optional
what = "their hybrid method"
rows = "20 poses"
mean_mm = 0.155
```
"""
DIAGNOSED = (
    f"; *{TRACED}* is what `postproc diagnose` makes of the fitted rows afterwards"
)
HEAD = [
    "| method | mean | 95 % | max | intervals hold | rows |",
    "|---|---|---|---|---|---|",
]


def page(sets: list[tuple[DataSet, list[Tried]]], given: argparse.Namespace) -> str:
    """Write the page."""
    seconds = sum(t.seconds for _, tries in sets for t in tries)
    traced = any(t.diagnosis is not None for _, tries in sets for t in tries)
    text = TEXT.format(
        how="".join(
            f" with `{option}`"
            for option, on in (
                ("--quick", given.quick),
                ("--no-diagnosis", given.no_diagnosis),
            )
            if on
        ),
        version=__version__,
        numpy=np.__version__,
        minutes=seconds / 60,
        nominal=NOMINAL,
        geometry=GEOMETRY,
        default=DEFAULT,
        after=DIAGNOSED if traced else "; nothing was diagnosed",
        centres=MOST_CENTRES,
        short="\n".join(short(sets)),
        account=ACCOUNT.read_text(encoding="utf-8") if shipped(sets) else "",
    )
    return "\n".join([text, *(line for s in sets for line in section(*s)), ""])


def shipped(sets: list[tuple[DataSet, list[Tried]]]) -> bool:
    """Tell whether a page is the project's own: all its sets are there."""
    read = {tried.trial.path for _, tries in sets for tried in tries}
    return read.issuperset(SHIPPED.glob("*.toml"))


def short(sets: list[tuple[DataSet, list[Tried]]]) -> Iterator[str]:
    """Write the first table: a row a split, a column a method."""
    names = [n for n in ORDER if any(n in by_split(t)[0] for _, t in sets)]
    yield f"| rows tested | {' | '.join(names)} |"
    yield "|---" * (len(names) + 1) + "|"
    for data, tries in sets:
        found = by_split(tries)
        for k, split in enumerate(data.splits):
            means = " | ".join(f"{found[k][name].mean_mm:.3f}" for name in names)
            yield f"| {data.about.name} {split.title} | {means} |"


def by_split(tries: list[Tried]) -> dict[int, dict[str, Outcome]]:
    """Put the draws of every split together."""
    found: dict[int, list[dict[str, Outcome]]] = {}
    for tried in tries:
        for (k, _), outcomes in sorted(tried.outcomes.items()):
            found.setdefault(k, []).append(outcomes)
    return {k: pooled(draws) for k, draws in sorted(found.items())}


def section(data: DataSet, tries: list[Tried]) -> Iterator[str]:
    """Write what is told of one set."""
    about = data.about
    yield f"## {about.name}"
    yield ""
    yield f"{about.source}. Licence: {about.licence}."
    yield f"To be had from {about.get}." if about.get else "To be had from the author."
    yield ""
    yield from (f"- {note}" for note in about.notes)
    series = ", ".join(f"{name} {len(rows)}" for name, rows in data.series.items())
    yield f"- Rows: {series}."
    yield ""
    if about.published:
        yield "What the source says of its own rows and methods:"
        yield ""
        for f in about.published:
            yield f"- {f.what}: mean {f.mean_mm} mm ({f.rows})"
        yield ""
    for k, outcomes in by_split(tries).items():
        yield f"### {about.name}: {data.splits[k].title}"
        yield ""
        yield from HEAD
        yield from (outcomes[n].row(n) for n in ORDER if n in outcomes)
        yield ""
    yield from found_in(data, tries)


def found_in(data: DataSet, tries: list[Tried]) -> Iterator[str]:
    """Write what the diagnosis found: of every series in the fit of most rows."""
    most: dict[str, Tried] = {}
    for tried in tries:
        series = data.splits[tried.trial.draws[0][0]].fit
        before = most.get(series)
        if before is None or tried.fitted > before.fitted:
            most[series] = tried
    for series, tried in most.items():
        found = tried.diagnosis
        if found is None:
            continue
        yield f"### {data.about.name}: what is found in {tried.fitted} rows of {series}"
        yield ""
        yield f"Beyond what `fit` takes by itself; verdict: {found.verdict}."
        yield ""
        yield from (f"- {told(f)}" for f in found.findings[:MOST_FINDINGS])
        yield "" if found.findings else "- nothing\n"


def told(f: Finding) -> str:
    """Write a finding in a few words."""
    where = "" if f.joint is None else f" of joint {f.joint}"
    settings = "".join(
        f", {name} {value[0]:.4g} {value[2]}"
        for name, value in f.parameters.items()
        if name in ("row", "order", "amplitude", "centre", "t0")
    )
    others = [e + (f" {j}" if j else "") for e, j in f.confusable_with]
    either = f"; or as well {', '.join(others)}" if others else ""
    return (
        f"**{f.effect}**{where}{settings} (p = {f.p_value:.0e}, share {f.share:.0%}, "
        f"peak {f.peak_mm:.2f} mm{either})"
    )


def main() -> None:
    """Run all sets that are there, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder of the data")
    parser.add_argument("--described", type=Path, default=SHIPPED)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--quick", action="store_true", help="few rows, no diagnosis")
    parser.add_argument("-o", "--output", type=Path, help="default: beside the data")
    parser.add_argument("--no-diagnosis", action="store_true", help="fits only")
    given = parser.parse_args()
    traced = not (given.quick or given.no_diagnosis)
    try:
        found = list(descriptions(given.data, given.described))
        trials = {at: trials_of(*at, given.quick, traced) for at in found}
    except PostprocError as exc:
        parser.exit(2, f"not run: {exc}\n")
    work = [t for some in trials.values() for t in some]
    if not work:
        parser.exit(2, f"not run: no described data in {given.data}\n")
    tried = list(tried_by(work, given.jobs))
    sets = []
    for at in found:
        data, mine = (
            read_once(*at),
            [t for t in tried if (t.trial.path, t.trial.base) == at],
        )
        sets += [(data, mine)] if data is not None else []
    beside = OUT if shipped(sets) else given.data / OUT.name
    output = given.output or beside
    output.write_text(page(sets, given), encoding="utf-8")
    print(f"{output}")


def tried_by(work: list[Trial], jobs: int) -> Iterator[Tried]:
    """Run trials, several at a time, and tell of each."""
    with ProcessPoolExecutor(jobs) as pool:
        for tried in pool.map(run, work):
            trial = tried.trial
            name = f"{trial.path.stem} {trial.draws}: {tried.fitted} rows"
            print(f"{name} in {tried.seconds:.0f} s", flush=True)
            yield tried


if __name__ == "__main__":
    main()
