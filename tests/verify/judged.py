"""Programs that were compensated, for the second opinion, with faults on demand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from postproc.compensation.compensate import compensate
from postproc.compensation.findings.second_opinion import second_opinion
from postproc.compensation.options import DEFAULT_OPTIONS, Options
from postproc.compensation.outcome import Outcome
from postproc.compensation.program import prepare_cell
from postproc.compensation.program_files import read_files
from postproc.language.languages import file_named
from postproc.model.model import Model, load_model
from postproc.report.simulation import chain_of
from postproc.robot.cell import Cell, load_cell
from postproc.verify.opinion import Opinion, OpinionRow
from tests.conftest import make_job

PROGRAMS = Path(__file__).parents[2] / "programs"
SHIPPED = {
    "drilling.pdl": "cell.toml",
    "handling.pdl": "cell.toml",
    "milling.pdl": "cell.toml",
    "spot.pdl": "cell.toml",
    "welding/Welding.mod": "welding/cell.toml",
    "facing/Milling.src": "facing/cell.toml",
}
PROBES = """
[tracker]
xyz_mm = [3150.0, -2480.0, 1120.0]

[survey]
points_mm = [[-212.5, 96.0, 331.0], [148.0, -121.5, 268.0], [-58.0, 42.5, 514.0]]
"""


@dataclass(frozen=True)
class Compensated:
    """A compensated program: its cell, its files, and what came of it."""

    cell: Cell
    source: Mapping[str, bytes]
    output: Mapping[str, bytes]
    outcome: Outcome

    def opinion(self) -> Opinion:
        """Let it be judged."""
        return second_opinion(self.source, self.output, self.cell, self.outcome.record)


def model_of(cell: Cell, model: Model) -> Model:
    """Let a model hold for another arm: what it corrects is no matter here."""
    arm = cell.arm
    lower, upper = tuple(arm.lower.tolist()), tuple(arm.upper.tolist())
    ranges = replace(model.ranges, lower=lower, upper=upper, payload=(0.0, 200.0))
    weight = tuple(map(float, arm.weight))
    return replace(
        model, arm_name=arm.name, arm_id=arm.id, ranges=ranges, weight=weight
    )


def compensated(
    files: Mapping[str, bytes],
    cell: Cell,
    model: Model,
    options: Options = DEFAULT_OPTIONS,
) -> Compensated:
    """Compensate a program, the files of which begin with the program itself."""
    name, source = next(iter(files.items()))
    own = file_named(name).variables
    rest = {k: v for k, v in files.items() if k not in (name, own)}
    values = files.get(own)
    outcome = compensate(
        source, cell, model, name=name, variables=values, pages=rest, options=options
    )
    own = prepare_cell(cell, model, options)
    return Compensated(own, files, {**files, **outcome.outputs}, outcome)


def shipped(
    name: str, models: Mapping[str, Model], options: Options = DEFAULT_OPTIONS
) -> Compensated:
    """Compensate one of `programs/` with the model of its own arm."""
    model = models[SHIPPED[name]]
    key = name, model.id, options
    if key not in _shipped:
        cell = load_cell(PROGRAMS / SHIPPED[name])
        files = read_files(PROGRAMS / name)
        _shipped[key] = compensated(files, cell, model, options)
    return _shipped[key]


_shipped: dict[tuple[str, str, Options], Compensated] = {}


def own_models(folder: Path) -> dict[str, Model]:
    """Survey the arm of every cell of `programs/` and fit its model, by cell file."""
    return {
        name: load_model(surveyed(folder / str(k), PROGRAMS / name) / "model.json")
        for k, name in enumerate(dict.fromkeys(SHIPPED.values()))
    }


def surveyed(folder: Path, cell: Path) -> Path:
    """Survey a virtual arm of the kind that a cell names, and fit its model."""
    folder.mkdir()
    text = cell.read_text()
    text += "" if "[survey]" in text else PROBES
    return make_job(folder, text, chain=chain_of(load_cell(cell).arm.file))


def row(opinion: Opinion, what: str) -> OpinionRow:
    """Find a row of the table."""
    (found,) = (r for r in opinion.rows if r.what == what)
    return found
