"""Where virtual arms land that run the neutral job, in every language.

python -m tests.language.true_error --arms 56 57 58 --jobs 8    (or: make languages)

Each arm is surveyed, a model is fitted, the same jobs are compensated in every
language, and the arm runs what was written. The arm and its controller share no code
with the model; what may differ in the text is told by patterns of this file alone.
"""

from __future__ import annotations

import argparse
import itertools
import re
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from postproc.compensation.outcome import Status
from postproc.compensation.program import read_program
from postproc.model.model import Model, load_model
from postproc.report.simulation import setup_of
from postproc.robot.cell import Cell, load_cell
from postproc.simulation import land, run_program, virtual_arm
from tests.any_controller import any_controller
from tests.conftest import ROOT, make_job
from tests.language.neutral_job import LANGUAGES, NeutralJob, compensated, drawn

ARMS = (56, 57, 58, 59, 60, 61)
MEAN_MM, MAX_MM = 0.02, 0.1  # at corrected stops

_NUMBER = r"[-+]?[0-9.]+(?:E[-+]?\d+)?"
_SIX = rf"{_NUMBER}(?:,\s*{_NUMBER}){{5}}"
_PLACE = rf"\[{_NUMBER}(?:,{_NUMBER}){{2}}\],\[{_NUMBER}(?:,{_NUMBER}){{3}}\]"
_ABC = ",".join(f"{name} {_NUMBER}" for name in "XYZABC")
_ANGLES = ",".join(f"A{k} {_NUMBER}" for k in range(1, 7))
_KRL = (
    rf"(?P<numbers>(?<=[ ,=]{{){_ABC}(?=,S )|(?<=SPTP {{){_ANGLES}(?=}}))"
    r"(?:,(?P<flags>S \d+,T \d+))?"
)
# The numbers of a target, and its flags where a language may write them anew.
STAMP = re.compile(r"(--|!|;) postproc\b")
TARGETS = {
    ".pdl": rf"(?P<numbers>(?<=TO POS\(){_SIX}|(?<=VIA POS\(){_SIX}"
    rf"|(?<=p\d := POS\(){_SIX}|(?<=p\d\d := POS\(){_SIX}|(?<=TO \{{){_SIX})",
    ".mod": rf"(?P<numbers>(?<=\[){_PLACE}(?=,\[-?\d,-?\d,-?\d,\d\],\[9E9)"
    rf"|(?<=\[)\[{_SIX}\](?=,\[9E9))(?:,\[(?P<flags>-?\d,-?\d,-?\d),\d\])?",
    ".src": _KRL,
    ".dat": _KRL,
}
NAMES = {".pdl": "PDL2", ".mod": "RAPID", ".src": "KRL"}


@dataclass(frozen=True)
class Landed:
    """One job on one arm.

    Attributes:
        arm, job: Their seeds.
        file: The text's name; its suffix tells the language.
        before, after: Misses at the corrected stops [mm], (n,).
        sure: The program's report knows from which side every joint arrives, (n,).
        left: Stops that were not corrected.
        other: First line whose text differs in more than numbers of targets, or None.
        flags: Lines whose flags were written anew, with both flags.
    """

    arm: int
    job: int
    file: str
    before: np.ndarray
    after: np.ndarray
    sure: np.ndarray
    left: int
    other: int | None
    flags: tuple[tuple[int, str, str], ...]

    @property
    def holds(self) -> bool:
        """Tell whether errors and text are what they are to be."""
        after = self.after[self.sure]
        small = after.mean() <= MEAN_MM and after.max() <= MAX_MM
        return bool(small) and self.other is None


def fitted(arm: int, folder: Path, **survey: Any) -> tuple[Cell, Model]:
    """Survey a virtual arm in the cell of the shipped programs, and fit a model.

    Args:
        arm: Its seed.
        folder: Where cell, survey and model go.
        **survey: As `make_job` has it.
    """
    text = (ROOT / "programs" / "cell.toml").read_text(encoding="utf-8")
    make_job(folder, text, arm, **survey)
    cell = any_controller(load_cell(folder / "cell.toml"))
    return cell, load_model(folder / "model.json")


def driven(arm: int, cell: Cell) -> Iterator[tuple[int, NeutralJob]]:
    """Draw jobs; yield those whose every move the controller can drive, numbered.

    Where it cannot follow an arc it stays, and all that comes behind is not the job.
    """
    setup = setup_of(cell)
    for number in itertools.count():
        job = drawn(cell, number)
        text = LANGUAGES["job.pdl"](job)
        body = virtual_arm(arm, tool=setup.tool)
        if not any(run_program(body, setup, read_program(text, cell).visits).why):
            yield number, job


def landed(
    arm: int, cell: Cell, model: Model, job: NeutralJob, number: int, file: str
) -> Landed:
    """Compensate a job in one language, and let the arm run both texts."""
    source = LANGUAGES[file](job)
    found = compensated(file, source, cell, model)
    output = {**source, **found.outputs}
    given, made = (read_program(files, cell).visits for files in (source, output))
    setup = setup_of(cell)
    body = virtual_arm(arm, tool=setup.tool)
    misses = []
    for executed in (given, made):
        landing = land(body, setup, given, executed)
        misses.append(1000.0 * np.linalg.norm(landing.error, axis=1))
    rows = landing.visit
    stops = ~given.motion.fly[rows] & ~given.motion.via[rows]
    stops &= rows > 0  # where the arm begins, its joints lie nobody knows how
    mended = stops & (found.decisions.status[rows] == Status.CORRECTED)
    before, after = (miss[mended] for miss in misses)
    sure = found.decisions.direction[rows[mended]].all(axis=1)
    left = int(stops.sum() - mended.sum())
    found_in = [differing(name, source[name], output[name]) for name in source]
    text = next((line for line, _ in found_in if line is not None), None)
    flags = tuple(one for _, some in found_in for one in some)
    return Landed(arm, number, file, before, after, sure, left, text, flags)


def differing(
    file: str, source: bytes, output: bytes
) -> tuple[int | None, tuple[tuple[int, str, str], ...]]:
    """Compare two texts but for the numbers of targets.

    Returns:
        The first line of the source that differs elsewhere, or None; and the lines
        whose flags differ, with what they were and are.
    """
    target = re.compile(TARGETS[Path(file).suffix])
    old, stamped = source.decode().splitlines(), output.decode().splitlines()
    if Path(file).suffix == ".dat" and stamped == old:  # it holds no corrected point
        return None, ()
    header = next((k for k, line in enumerate(stamped) if STAMP.match(line)), -1)
    if header < 0 or len(stamped) != len(old) + 1:
        return 1, ()
    flags: list[tuple[int, str, str]] = []
    del stamped[header]
    for line, (a, b) in enumerate(zip(old, stamped, strict=True), start=1):
        if target.sub("#", a) != target.sub("#", b):
            return line, tuple(flags)
        for one, two in zip(target.finditer(a), target.finditer(b), strict=True):
            said = one.groupdict().get("flags"), two.groupdict().get("flags")
            if said[0] != said[1]:
                flags.append((line, str(said[0]), str(said[1])))
    return None, tuple(flags)


def table(found: Sequence[Landed]) -> list[str]:
    """Write a table, a row for an arm and a language."""
    lines = [
        "| arm | language | corrected stops | mean mm | max mm | "
        "direction uncertain | max mm there | not corrected | before, mean | "
        "new flags |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for arm, file in sorted({(one.arm, one.file) for one in found}):
        some = [one for one in found if (one.arm, one.file) == (arm, file)]
        after = np.concatenate([one.after for one in some])
        before = np.concatenate([one.before for one in some])
        sure = np.concatenate([one.sure for one in some])
        rest = f"{after[~sure].max():.4f}" if not sure.all() else "-"
        language = NAMES[Path(file).suffix]
        lines.append(
            f"| {arm} | {language} | {sure.sum()} | {after[sure].mean():.4f} | "
            f"{after[sure].max():.4f} | {(~sure).sum()} | {rest} | "
            f"{sum(one.left for one in some)} | {before.mean():.3f} | "
            f"{sum(len(one.flags) for one in some)} |"
        )
    return lines


def main() -> int:
    """Print the table; exit 1 where an arm misses by more, or another text differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, nargs="+", default=list(ARMS))
    parser.add_argument("--jobs", type=int, default=8)
    given = parser.parse_args()
    found = []
    for arm in given.arms:
        with tempfile.TemporaryDirectory() as name:
            cell, model = fitted(arm, Path(name))
        for number, job in itertools.islice(driven(arm, cell), given.jobs):
            found += [landed(arm, cell, model, job, number, f) for f in LANGUAGES]
    print("\n".join(table(found)))
    for one in found:
        place = f"arm {one.arm}, job {one.job}, {one.file}"
        for line, old, new in one.flags:
            print(f"{place}:{line}: flags {old} are now {new}")
        if not one.holds:
            most = one.after[one.sure].max()
            print(f"{place}: misses by {most:.4f} mm, text {one.other}")
    return 0 if all(one.holds for one in found) else 1


if __name__ == "__main__":
    sys.exit(main())
