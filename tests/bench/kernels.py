"""toppra and ruckig by themselves, on the joint angles of a planned program."""

from __future__ import annotations

import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import toppra
from numpy.typing import NDArray
from toppra.algorithm import TOPPRA
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

from postproc.compensation.program import plan_visits, read_program
from postproc.compensation.program_files import name_files
from postproc.motion.ruckig import JointMoves
from postproc.robot.arm import Arm
from postproc.robot.cell import load_cell
from tests.bench.made import Made

Array = NDArray[np.float64]

POINTS = 5_000  # of a path given to toppra
MOVES = 2_000  # given to ruckig
APART = 1e-7  # [rad] targets closer than this are one


def planned(made: Made, cell_path: Path) -> tuple[Arm, Array]:
    """Plan a program: the arm, and where its targets lead, (n, 6) [rad]."""
    cell = load_cell(cell_path)
    files = name_files(made.name, made.source, made.variables)
    plan = plan_visits(read_program(files, cell).visits, cell, timed=False).plan
    q = plan.q[~np.isnan(plan.q).any(axis=1)]
    apart = np.abs(np.diff(q, axis=0, prepend=q[:1] - 1)).max(axis=1) > APART
    return cell.arm, q[apart]


def toppra_alone(arm: Arm, q: Array) -> float:
    """Time one solve with a gridpoint a waypoint; seconds a waypoint."""
    q = q[:POINTS]
    step = np.linalg.norm(np.diff(q, axis=0) / arm.velocity, axis=1)
    s = np.append(0.0, np.cumsum(step))
    path = toppra.SplineInterpolator(s, q)
    limits = [
        JointVelocityConstraint(np.column_stack([-arm.velocity, arm.velocity])),
        JointAccelerationConstraint(
            np.column_stack([-arm.acceleration, arm.acceleration])
        ),
    ]
    start = time.perf_counter()
    solver = TOPPRA(limits, path, gridpoints=s, solver_wrapper="seidel")
    solver.compute_parameterization(0.0, 0.0)
    return (time.perf_counter() - start) / len(q)


def ruckig_alone(arm: Arm, q: Array) -> float:
    """Time moves from stop to stop; seconds a move."""
    q, moves = q[:MOVES], JointMoves(arm)
    start = time.perf_counter()
    for begin, end in pairwise(q):
        moves.move(begin, end)
    return (time.perf_counter() - start) / max(len(q) - 1, 1)
