"""What a check will be able to tell, before it is read."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from postproc.calibration.check_design import CheckDesign
from postproc.calibration.measurements import Measurements
from postproc.calibration.monuments import ReferenceRows
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.record.causes import Power
from postproc.record.check_rows import CheckRows, place_check
from postproc.record.control import Watch
from postproc.record.knowledge import Knowledge
from postproc.robot.cell import Cell
from postproc.robot.state import make_states

_PLACE = Path("check")  # that was not read yet


def foresee(cell: Cell, model: Model, design: CheckDesign) -> Power:
    """Say what a check can tell of an arm whose survey is all that is known.

    Args:
        cell: The cell.
        model: The model of the survey.
        design: The check.
    """
    rows = _readings(cell, model, design)
    return Watch(Knowledge.of(model, cell.arm)).foresee(rows)


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
