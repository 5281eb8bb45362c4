"""How virtual arms keep to their paths with points on them, in every language.

python -m tests.language.true_paths --arms 62 63 64 --lines 8 --arcs 4

Each arm is surveyed with reversals, a model is fitted, the same lines, arcs and chains
(`--chains`, lines that turn at fly points) are compensated in every language, at their
targets and with points on their ways, and the arm, which shares no code with the
prediction, runs what was written.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

from postproc.arrays import Floats
from postproc.report.simulation import simulate_file
from postproc.robot.cell import load_cell
from tests.any_controller import EVERY
from tests.conftest import ROOT
from tests.language.neutral_job import LANGUAGES
from tests.language.neutral_ways import ZONE as CORNER
from tests.language.neutral_ways import ways
from tests.language.true_error import NAMES
from tests.written import cli

TOLERANCE = 0.1  # [mm]
POINTS = (
    "--path-tolerance", TOLERANCE, "--set", "compensation.preload_backlash=true",
)  # fmt: skip
ZONE = b"    $FLY_TYPE := FLY_CART"
REVERSALS = 4  # of every joint


def surveyed(folder: Path, arm: int, poses: int = 200) -> Path:
    """Survey a virtual arm with reversals, fit its model; return the cell."""
    text = (ROOT / "programs" / "cell.toml").read_text(encoding="utf-8")
    cell, at = folder / "cell.toml", ("--cell", folder / "cell.toml")
    cell.write_text(text.replace("[robot]", f"[robot]\n{EVERY}", 1))
    survey, rows = folder / "survey.pdl", folder / "rows.csv"
    reversals = f"survey.reversals={REVERSALS}"
    run("survey", *at, "--poses", poses, "--set", reversals, "-o", survey)
    run("simulate", survey, *at, "--set", f"simulation.seed={arm}", "-o", rows)
    run("fit", rows, *at, "-o", folder / "model.json")
    return cell


def run(*arguments: object) -> None:
    """Run a command.

    Raises:
        RuntimeError: It failed.
    """
    found = cli(*arguments)
    if found.exit_code not in (0, 1):
        raise RuntimeError(found.stderr)


def compensated(
    folder: Path, cell: Path, name: str, lines: int, arcs: int, chains: int = 0
) -> Path:
    """Compensate a job in one language, with points and without; return its folder."""
    place = folder / name
    place.mkdir(parents=True)
    job = ways(load_cell(cell), 1, lines, arcs, chains)
    for part, data in LANGUAGES[name](job).items():
        zone = b"    $FLY_DIST := 0.3\n" + ZONE  # as the other languages pass points
        (place / part).write_bytes(corners_once(data).replace(ZONE, zone))
    at = ("--cell", cell, "--model", cell.parent / "model.json")
    for kind, more in (("plain", ()), ("points", POINTS)):
        (place / kind).mkdir()
        run("compensate", place / name, *at, "-o", place / kind / name, *more)
    return place


def corners_once(data: bytes) -> bytes:
    """Set the zone of corners once: a statement between fly moves keeps them whole."""
    line = f"    $FLY_DIST := {CORNER:g}\n".encode()
    first, *rest = data.split(line)
    return first + line + b"".join(rest) if rest else first


def deviations(place: Path, cell: Path, name: str, kind: str, arm: int) -> Floats:
    """Return how far the arm leaves each path at the most, (m,) [mm]."""
    job = place / name
    ran = job if kind == "written" else place / kind / name
    found = simulate_file(ran, cell, arm, reference=job, path=True).paths
    assert found is not None
    return 1e3 * np.maximum.reduceat(found.across, found.first[:-1])


def table(arm: int, lines: int, arcs: int, chains: int) -> list[str]:
    """Write the rows of one arm."""
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        cell = surveyed(folder, arm)
        for name in LANGUAGES:
            place = compensated(folder, cell, name, lines, arcs, chains)
            count = (place / "points" / name).read_bytes().count(b"postproc: inserted")
            language = NAMES[Path(name).suffix]
            for kind in ("written", "plain", "points"):
                off = deviations(place, cell, name, kind, arm)
                figures = (off.mean(), np.percentile(off, 95), off.max())
                points = str(count if kind == "points" else 0)
                told = (
                    str(arm),
                    language,
                    kind,
                    points,
                    *map("{:.3f}".format, figures),
                )
                rows.append(f"| {' | '.join(told)} |")
    return rows


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, nargs="+", default=[62, 63, 64])
    parser.add_argument("--lines", type=int, default=8)
    parser.add_argument("--arcs", type=int, default=4)
    parser.add_argument("--chains", type=int, default=0)
    given = parser.parse_args()
    print("| arm | language | program | points | mean mm | 95 % | max mm |")
    print("|---|---|---|---|---|---|---|", flush=True)
    for arm in given.arms:
        print("\n".join(table(arm, given.lines, given.arcs, given.chains)), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
