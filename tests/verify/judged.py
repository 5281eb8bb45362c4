"""Programs that were compensated, for the second opinion, with faults on demand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from postproc.cli.jobs import read_files
from postproc.compensation.compensate import compensate
from postproc.compensation.options import AS_USUAL, Options
from postproc.compensation.outcome import Outcome
from postproc.compensation.program import prepared
from postproc.compensation.second_opinion import second_opinion
from postproc.files import variables_of
from postproc.model.model import Model
from postproc.robot.cell import Cell, load_cell
from postproc.verify.opinion import Opinion, OpinionRow

PROGRAMS = Path(__file__).parents[2] / "programs"
SHIPPED = {
    "drilling.pdl": "cell.toml",
    "handling.pdl": "cell.toml",
    "milling.pdl": "cell.toml",
    "spot.pdl": "cell.toml",
    "welding/Welding.mod": "welding/cell.toml",
    "facing/Milling.src": "facing/cell.toml",
}


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
    files: Mapping[str, bytes], cell: Cell, model: Model, options: Options = AS_USUAL
) -> Compensated:
    """Compensate a program, the files of which begin with the program itself."""
    name, source = next(iter(files.items()))
    rest = {k: v for k, v in files.items() if k not in (name, variables_of(name))}
    values = files.get(variables_of(name))
    outcome = compensate(
        source, cell, model, name=name, variables=values, pages=rest, options=options
    )
    own = prepared(cell, model, options)
    return Compensated(own, files, {**files, **outcome.outputs}, outcome)


def shipped(name: str, model: Model, options: Options = AS_USUAL) -> Compensated:
    """Compensate one of `programs/`."""
    cell = load_cell(PROGRAMS / SHIPPED[name])
    files = read_files(PROGRAMS / name)
    return compensated(files, cell, model_of(cell, model), options)


def row(opinion: Opinion, what: str) -> OpinionRow:
    """Find a row of the table."""
    (found,) = (r for r in opinion.rows if r.what == what)
    return found
