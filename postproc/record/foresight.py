"""What a check will be able to tell, before it is read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from postproc.calibration.check_design import CheckDesign
from postproc.calibration.measurements import Measurements
from postproc.calibration.monuments import ReferenceRows
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.record.check_rows import CheckRows, place_check
from postproc.record.control import CheckVerdict, Watch
from postproc.record.knowledge import Knowledge
from postproc.robot.cell import Cell
from postproc.robot.state import make_states

_PLACE = Path("check")  # that was not read yet


@dataclass(frozen=True)
class Foreseen:
    """What a check finds and what it cannot see.

    Attributes:
        found: Least change of every cause that is found in 95 %, in sizes of its kind.
        blind: Causes that it cannot see.
        alike: Pairs of causes that it hardly tells apart.
    """

    found: dict[str, float]
    blind: tuple[str, ...]
    alike: tuple[tuple[str, str], ...]


def foresee(cell: Cell, model: Model, design: CheckDesign) -> Foreseen:
    """Say what a check will tell of an arm whose survey is all that is known.

    Args:
        cell: The cell.
        model: The model of the survey.
        design: The check.
    """
    verdict = _judge(cell, model, _readings(cell, model, design))
    return Foreseen(verdict.found, verdict.blind, verdict.alike)


def _judge(cell: Cell, model: Model, rows: CheckRows) -> CheckVerdict:
    return Watch(Knowledge.of(model, cell.arm)).judge(rows)[0]


def _readings(cell: Cell, model: Model, design: CheckDesign) -> CheckRows:
    """Make readings of an arm that is as its model says, with the survey's points."""
    tool, n = cell.probes[design.probe], len(design.q)
    states = make_states(design.q, design.side, tool, tool_id=design.probe)
    if model.registration is not None:
        states = model.registration.on_probes(states)
    batch = ArmStates(cell.arm, states)
    position = batch.walk.tcp + model.effects.error(batch, model.values)
    points = model.monuments
    fixed = None
    if points:
        m = len(points)
        fixed = ReferenceRows(
            _PLACE, tuple(name for name, _ in points),
            np.array([xyz for _, xyz in points]), np.full(m, np.nan),
            np.full(m, -0.5), np.arange(m),
        )  # fmt: skip
    rows = Measurements(
        _PLACE, states, position, design.names, np.arange(n) + 1,
        np.zeros(n, dtype=bool), "", references=fixed,
    )  # fmt: skip
    frame = cell.measurements.frame or "base"
    return place_check(rows, cell.arm, model, frame)
