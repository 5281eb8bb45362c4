"""Write the rows of docs/studies/real-arms.md as files, for the command line.

PYTHONPATH=. python docs/studies/real_files.py DATA FOLDER

Every draw of every split gets a folder with fit.csv, test.csv and cell.toml; column
`order` is the row's number in its file. The commands that repeat the study's *fit* are
printed: `postproc fit` and `postproc predict`.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import numpy as np
from data_sets import SHIPPED, DataSet, Split, descriptions, read_set

from postproc.calibration.measurements import Measurements
from postproc.robot.pose import MM

JOINTS = range(1, 7)


def write_rows(rows: Measurements, path: Path) -> None:
    """Write measurements in the columns of the documentation, with their order."""
    states = rows.states
    columns = {
        "id": list(rows.ids),
        "order": [f"{o:g}" for o in states.order],
        **{f"q{j}_deg": _numbers(np.rad2deg(states.q[:, j - 1])) for j in JOINTS},
        **{
            f"lambda{j}": [f"{s:g}" for s in states.direction[:, j - 1]] for j in JOINTS
        },
        **{f"{a}_mm": _numbers(rows.position[:, k] / MM) for k, a in enumerate("xyz")},
    }
    if np.isfinite(states.travel).all():
        travel = np.rad2deg(states.travel)
        columns |= {f"travel{j}_deg": _numbers(travel[:, j - 1]) for j in JOINTS}
    for column, values in (
        ("time_s", states.time),
        ("temperature_c", states.temperature),
    ):
        if np.isfinite(values).all():
            columns[column] = _numbers(values)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))


def _numbers(values: np.ndarray) -> list[str]:
    """Write numbers with all their digits."""
    return [repr(float(v)) for v in values]


def write_set(data: DataSet, path: Path, folder: Path) -> list[str]:
    """Write the files of a set, and return its commands."""
    commands = []
    for k, split in enumerate(data.splits):
        for n, (inside, _) in enumerate(split.draws):
            place = folder / f"{path.stem}-{k + 1}-{n + 1}"
            write_fit(data, path, data.series[split.fit][inside], place)
            write_test(data, split, n, place)
            commands.append(f"# {data.about.name}: {split.title}")
            for one in (fit_of(data, place), predict_of(data, split, place)):
                commands.append(" ".join(("postproc", *one)))
    return commands


def write_fit(data: DataSet, path: Path, rows: Measurements, place: Path) -> None:
    """Write rows that are fitted, and the cell."""
    about = data.about
    arm = (path.parent / about.arm).resolve()
    name = str(arm) if arm.suffix == ".toml" else about.arm
    tool = list(about.tool_mm or (0.0, 0.0, 0.0))
    place.mkdir(parents=True, exist_ok=True)
    write_rows(rows, place / "fit.csv")
    (place / "cell.toml").write_text(
        f'[robot]\narm = "{name}"\n[tool]\nxyz_mm = {tool}\n', encoding="utf-8"
    )


def write_test(data: DataSet, split: Split, draw: int, place: Path) -> None:
    """Write rows that are tested."""
    write_rows(data.series[split.test][split.draws[draw][1]], place / "test.csv")


def fit_of(data: DataSet, place: Path) -> tuple[str, ...]:
    """Return what `postproc` is given to fit a folder."""
    given = (
        "--cell",
        f"{place}/cell.toml",
        "--set",
        f"measurements.frame={data.about.frame}",
    )
    return ("fit", f"{place}/fit.csv", *given, "-o", f"{place}/model.json")


def predict_of(data: DataSet, split: Split, place: Path) -> tuple[str, ...]:
    """Return what `postproc` is given to predict the tested rows of a folder.

    In another set-up the registration is found from the tested rows themselves.
    """
    frame = ("--set", f"measurements.frame={data.about.frame}")
    how = frame if split.same else ("--set", "measurements.refit_registration=true")
    given = ("--cell", f"{place}/cell.toml", "--model", f"{place}/model.json")
    out = ("-o", f"{place}/predicted.csv")
    return ("predict", f"{place}/test.csv", *given, *how, *out)


def main() -> None:
    """Write the files of all sets that are there."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder of the data")
    parser.add_argument("folder", type=Path, help="where the files go")
    parser.add_argument("--described", type=Path, default=SHIPPED)
    given = parser.parse_args()
    for path, base in descriptions(given.data, given.described):
        data = read_set(path, base)
        if data is not None:
            print("\n".join(write_set(data, path, given.folder)))


if __name__ == "__main__":
    main()
