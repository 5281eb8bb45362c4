"""A simulated arm to test against, with its own kinematics and its own errors.

It imports nothing of `robot`, `motion` or `model`: a wrong effect or a wrong
kinematic chain there cannot hide behind the same mistake here.
"""

from __future__ import annotations

from postproc.simulation.arm import GearKind, VirtualArm
from postproc.simulation.controller import VirtualCell
from postproc.simulation.draw import stream, virtual_arm
from postproc.simulation.kinematics import NJ220, Chain, gravity_of
from postproc.simulation.laws import DEFAULT, NAMES, Planted, parse_effects
from postproc.simulation.program import (
    Landing,
    ProgramRun,
    land,
    land_runs,
    run_program,
)
from postproc.simulation.state import VirtualArrivals, arrivals_of_states, make_arrivals
from postproc.simulation.tracker import (
    Campaign,
    JointTargets,
    campaign_length,
    follow_rows,
    in_tracker_frame,
    measure_program,
    measure_rows,
    measure_run,
    read_rows,
    sample_survey,
    write_measurements,
)

__all__ = [
    "DEFAULT",
    "NAMES",
    "NJ220",
    "Campaign",
    "Chain",
    "GearKind",
    "JointTargets",
    "Landing",
    "Planted",
    "ProgramRun",
    "VirtualArm",
    "VirtualArrivals",
    "VirtualCell",
    "arrivals_of_states",
    "campaign_length",
    "follow_rows",
    "gravity_of",
    "in_tracker_frame",
    "land",
    "land_runs",
    "make_arrivals",
    "measure_program",
    "measure_rows",
    "measure_run",
    "parse_effects",
    "read_rows",
    "run_program",
    "sample_survey",
    "stream",
    "virtual_arm",
    "write_measurements",
]
