"""A simulated arm to test against, with its own kinematics and its own errors.

It imports nothing of `robot`, `motion` or `accuracy`: a wrong effect or a wrong
kinematic chain there cannot hide behind the same mistake here.
"""

from postproc.virtual.arm import VirtualArm
from postproc.virtual.arrivals import Arrivals, arrivals_of_states, make_arrivals
from postproc.virtual.catalogue import DEFAULT, NAMES, Planted, parse_effects
from postproc.virtual.drawing import stream, virtual_arm
from postproc.virtual.kinematics import NJ220, Chain
from postproc.virtual.landing import Landing, land
from postproc.virtual.measure import (
    Campaign,
    campaign_length,
    in_tracker_frame,
    measure_program,
    measure_rows,
)
from postproc.virtual.program import Run, run_program
from postproc.virtual.rows import Rows, read_rows
from postproc.virtual.setup import Setup
from postproc.virtual.survey import follow_rows, sample_survey
from postproc.virtual.writing import write_measurements

__all__ = [
    "DEFAULT",
    "NAMES",
    "NJ220",
    "Arrivals",
    "Campaign",
    "Chain",
    "Landing",
    "Planted",
    "Rows",
    "Run",
    "Setup",
    "VirtualArm",
    "arrivals_of_states",
    "campaign_length",
    "follow_rows",
    "in_tracker_frame",
    "land",
    "make_arrivals",
    "measure_program",
    "measure_rows",
    "parse_effects",
    "read_rows",
    "run_program",
    "sample_survey",
    "stream",
    "virtual_arm",
    "write_measurements",
]
