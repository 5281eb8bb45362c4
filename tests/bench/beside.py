"""What a user would write today, beside ours: the same lines, the same targets."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from postproc.compensation.compensate import compensate
from postproc.compensation.program import plan_visits, read_program, states_of
from postproc.compensation.solver.inverse_model import solve
from postproc.language.pdl2.program import parse
from postproc.language.text.grammars import line_parser
from postproc.language.text.source import source_from_bytes
from postproc.language.text.statement_table import read_lines
from postproc.model.model import Model, load_model
from postproc.robot.arm import Arm
from postproc.robot.cell import load_cell
from postproc.robot.state import States
from tests.bench.made import milling
from tests.reference.text import masks_of

Array = NDArray[np.float64]

TARGETS = 2_000
LINES = 3_000
CLOSE = 2e-7  # [m] where a correction has settled
SCALE = 0.5  # [m] by which an angle counts as a distance


@dataclass(frozen=True)
class Beside:
    """Rates side by side.

    Attributes:
        lark: Lines a second through the parser, one by one.
        shapes: Lines a second by their shapes.
        loop: Targets a second of a loop with a numeric inverse kinematics.
        ours: Targets a second of the pipeline, reading and verifying included.
        solved: Targets a second of its part that does what the loop does.
        apart: Largest distance between the commands of loop and pipeline [m].
    """

    lark: float
    shapes: float
    loop: float
    ours: float
    solved: float
    apart: float


def side_by_side(cell_path: Path, model_path: Path) -> Beside:
    """Measure all of it in this process."""
    cell, model = load_cell(cell_path), load_model(model_path)
    made = milling(TARGETS)
    reading = read_program({made.name: made.source}, cell)
    plan = plan_visits(reading.visits, cell, timed=False).plan
    states = states_of(plan, cell, cell.temperature)
    start = time.perf_counter()
    ours = solve(model, cell.arm, plan.tcp, plan.tool, states)
    solved = time.perf_counter() - start
    start = time.perf_counter()
    theirs = [
        _one(model, cell.arm, plan.tcp[i], plan.tool[i], states[i : i + 1])
        for i in range(len(states))
    ]
    loop = time.perf_counter() - start
    gap = np.linalg.norm(np.array(theirs) - ours.command[:, :3, 3], axis=1)
    start = time.perf_counter()
    compensate(made.source, cell, model, name=made.name)
    whole = time.perf_counter() - start
    n = len(states)
    return Beside(*_parsing(), n / loop, n / whole, n / solved, float(gap.max()))


def _parsing() -> tuple[float, float]:
    """Lines a second with lark for every line, and by shapes."""
    few, many = milling(LINES), milling(100_000)
    read = read_lines(source_from_bytes("a", few.source))
    texts = masks_of(read.shapes)
    masks = [texts[k] for k in read.shape.tolist()]
    parser = line_parser("pdl2", "line")
    start = time.perf_counter()
    for mask in masks:
        parser.parse(mask)
    lark = len(masks) / (time.perf_counter() - start)
    source = source_from_bytes("a", many.source)
    start = time.perf_counter()
    parse(source)
    return lark, many.source.count(b"\n") / (time.perf_counter() - start)


def _one(model: Model, arm: Arm, wanted: Array, tool: Array, state: States) -> Array:
    """Correct one target: the command that lands on it, (3,) [m]."""
    command, q = wanted.copy(), state.q[0]
    for _ in range(6):
        q = _numeric_inverse(arm, command @ np.linalg.inv(tool), q)
        error = model.error(arm, state.with_(q=q[None]))[0]
        missed = command[:3, 3] + error - wanted[:3, 3]
        if np.linalg.norm(missed) < CLOSE:
            break
        command[:3, 3] -= missed
    return command[:3, 3]


def _numeric_inverse(arm: Arm, flange: Array, near: Array) -> Array:
    """Find joint angles by least squares on the pose, from those next to it."""

    def gap(q: Array) -> Array:
        at = _forward(arm, q)
        turned = np.cross(at[:3, :3].T, flange[:3, :3].T).sum(axis=0) / 2
        return np.concatenate([flange[:3, 3] - at[:3, 3], SCALE * turned])

    return np.asarray(least_squares(gap, near, xtol=1e-14, ftol=1e-14, gtol=1e-14).x)


def _forward(arm: Arm, q: Array) -> Array:
    """Multiply the six link matrices."""
    T, theta = np.eye(4), arm.dh.angles(q[None])[0]
    for i in range(6):
        c, s = np.cos(theta[i]), np.sin(theta[i])
        ca, sa = np.cos(arm.dh.alpha[i]), np.sin(arm.dh.alpha[i])
        a, d = arm.dh.a[i], arm.dh.d[i]
        T = T @ np.array(
            [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s],
             [0, sa, ca, d], [0, 0, 0, 1]]
        )  # fmt: skip
    return T
