"""Public measurements of real arms: what a description says, read and split.

A description is one TOML file: the arm, where the files lie and what their columns
are, licence and source, and which rows are tested by a fit of which others.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from postproc.calibration.measurements import Measurements, read_survey_file
from postproc.calibration.tables import TableFormat, column_map
from postproc.exceptions import MeasurementError
from postproc.robot.arm_file import Strict, read_toml
from postproc.robot.cell import Cell, load_cell

Rows = NDArray[np.int64]

SHIPPED = Path(__file__).parent / "real"
HERE = "dataset*.toml"  # names of descriptions that lie with their data
BLOCKS = 30


class SeriesSection(Strict):
    """A file of measurements, one set-up and one order of visits."""

    name: str
    file: str
    sha256: str | None = None


class SplitSection(Strict):
    """Which rows are tested; all others of the series are fitted.

    Attributes:
        fit: Name of the series that is fitted.
        test: Name of another series, all of which is tested, or None.
        draw: How rows of the same series are drawn.
        share: Share of the rows that are tested.
        seeds: One draw each.
        rows: First eight digits of the hash of the tested rows, for every draw: others
            than these are refused.
        registered: Whether another series is in the set-up of the fitted one, or its
            tracker and probe are found anew from its own rows.
    """

    fit: str
    test: str | None = None
    registered: Literal["again", "as fitted"] = "again"
    rows: tuple[str, ...] = ()
    draw: Literal["random", "blocks", "last"] | None = None
    share: float = Field(0.3, gt=0.0, lt=1.0)
    seeds: tuple[int, ...] = (0,)


class PublishedSection(Strict):
    """A figure of the source."""

    what: str
    rows: str
    mean_mm: float
    p95_mm: float | None = None
    max_mm: float | None = None


class Description(Strict):
    """One set of measurements of one arm."""

    name: str
    arm: str
    frame: Literal["base", "tracker"]
    folder: str = "."
    tool_mm: tuple[float, float, float] | None = None
    licence: str
    source: str
    get: str | None = None
    notes: tuple[str, ...] = ()
    columns: dict[str, Any] = Field(default_factory=dict)
    file: dict[str, str] = Field(default_factory=dict)
    series: tuple[SeriesSection, ...]
    split: tuple[SplitSection, ...]
    published: tuple[PublishedSection, ...] = ()


@dataclass(frozen=True)
class Split:
    """Rows that are fitted and rows that are tested.

    Attributes:
        title: In words.
        fit, test: Names of the series.
        same: Whether the tested rows were measured in the set-up of the fitted ones.
        draws: Rows to fit and rows to test, once for every seed.
    """

    title: str
    fit: str
    test: str
    same: bool
    draws: tuple[tuple[Rows, Rows], ...]


@dataclass(frozen=True)
class DataSet:
    """A described set, read.

    Attributes:
        about: The description.
        cell: Its arm and probe.
        series: Measurements by the name of the series.
        splits: As described.
    """

    about: Description
    cell: Cell
    series: dict[str, Measurements]
    splits: tuple[Split, ...]


def descriptions(data: Path, shipped: Path = SHIPPED) -> Iterator[tuple[Path, Path]]:
    """List descriptions, and the folder that each one's files lie in.

    Those of the project name folders in the folder of the data; further ones,
    ``dataset*.toml``, lie there beside their files.
    """
    for path in sorted(shipped.glob("*.toml")):
        yield path, data
    for path in sorted(data.rglob(HERE)):
        yield path, path.parent


def read_set(path: Path, base: Path) -> DataSet | None:
    """Read a set, or None where its folder is not there.

    Raises:
        MeasurementError: The description or a file cannot be used, or is another one.
    """
    about = read_toml(path, Description, MeasurementError)
    folder = base / about.folder
    if not folder.is_dir():
        return None
    cell = _cell(about, path)
    reading = _reading(about, path)
    series = {}
    for one in about.series:
        file = folder / one.file
        series[one.name] = read_survey_file(
            file, cell.arm, cell.probes, reading=reading
        )
        _check_same(one, file)
    return DataSet(about, cell, series, _splits(about, series, path))


def _cell(about: Description, path: Path) -> Cell:
    """Make the cell of a set: its arm, and the probe."""
    beside = (path.parent / about.arm).resolve()
    arm = str(beside) if beside.suffix == ".toml" else about.arm
    if about.frame == "base" and about.tool_mm is None:
        problem = "does not say where the reflector sits on the flange"
        raise MeasurementError(path, problem, "Write tool_mm = [x, y, z]")
    tool = ", ".join(map(repr, about.tool_mm or (0.0, 0.0, 0.0)))
    with tempfile.TemporaryDirectory() as name:
        cell = Path(name) / "cell.toml"
        cell.write_text(f'[robot]\narm = "{arm}"\n[tool]\nxyz_mm = [{tool}]\n')
        return load_cell(cell)


def _reading(about: Description, path: Path) -> TableFormat:
    """Say how the files are read."""
    if not about.columns:
        return TableFormat()
    said = {"columns": about.columns, "file": about.file}
    return TableFormat(columns=column_map(path, said))


def _check_same(one: SeriesSection, file: Path) -> None:
    """Refuse a file that is not the one that the splits were made for."""
    found = hashlib.sha256(file.read_bytes()).hexdigest()
    if one.sha256 not in (None, found):
        cure = "Get the described one, or describe this one"
        raise MeasurementError(file, "is another file than the described one", cure)


def _splits(
    about: Description, series: dict[str, Measurements], path: Path
) -> tuple[Split, ...]:
    """Draw the rows of all splits."""
    found = []
    for k, said in enumerate(about.split):
        place, test = f"$.split[{k + 1}]", said.test or said.fit
        if said.test == said.fit:
            cure = "Leave test out, and say how its rows are drawn"
            raise MeasurementError(path, f"{test!r} tests itself", cure, place=place)
        for name in (said.fit, test):
            if name not in series:
                cure = f"Series here: {', '.join(series)}"
                raise MeasurementError(path, f"no series {name!r}", cure, place=place)
        draws = tuple(_drawn(said, len(series[test]), seed) for seed in said.seeds)
        if test != said.fit:
            draws = ((np.arange(len(series[said.fit])), np.arange(len(series[test]))),)
        hashes = [hashlib.sha256(rows.tobytes()).hexdigest() for _, rows in draws]
        if said.rows and tuple(h[:8] for h in hashes) != said.rows:
            cure = "Use the numpy that the rows were drawn with"
            raise MeasurementError(path, "other rows are drawn", cure, place=place)
        same = test == said.fit or said.registered == "as fitted"
        found.append(Split(_title(said), said.fit, test, same, draws))
    return tuple(found)


def _title(said: SplitSection) -> str:
    """Describe a draw."""
    if said.test not in (None, said.fit):
        where = "registered again" if said.registered == "again" else "same set-up"
        return f"{said.test}, by a fit of {said.fit}, {where}"
    share = f"{said.share * 100:g} %"
    many = f", {len(said.seeds)} draws" if len(said.seeds) > 1 else ""
    if said.draw == "random":
        return f"{said.fit}, random {share}{many}"
    if said.draw == "last":
        return f"{said.fit}, last {share}"
    return f"{said.fit}, {round(BLOCKS * said.share)} of {BLOCKS} blocks{many}"


def _drawn(said: SplitSection, n: int, seed: int) -> tuple[Rows, Rows]:
    """Draw the rows to fit and those to test."""
    rng = np.random.default_rng(seed)
    rows = np.arange(n)
    if said.draw == "random":
        test = np.sort(rng.permutation(n)[round((1.0 - said.share) * n) :])
    elif said.draw == "blocks":
        chosen = rng.permutation(BLOCKS)[: round(BLOCKS * said.share)]
        test = np.flatnonzero(np.isin(rows * BLOCKS // n, chosen))
    else:
        test = rows[round((1.0 - said.share) * n) :]
    return np.setdiff1d(rows, test), test
