"""A simulated arm to test against, with its own kinematics and its own errors.

It imports nothing of `robot`, `motion` or `accuracy`: a wrong effect or a wrong
kinematic chain there cannot hide behind the same mistake here.
"""

from postproc.virtual.arm import VirtualArm
from postproc.virtual.arrivals import Arrivals, arrivals_of_states, make_arrivals
from postproc.virtual.catalogue import DEFAULT, NAMES, Planted, parse_effects
from postproc.virtual.drawing import stream, virtual_arm
from postproc.virtual.kinematics import NJ220, Chain
from postproc.virtual.survey import follow_rows, sample_survey

__all__ = [
    "DEFAULT",
    "NAMES",
    "NJ220",
    "Arrivals",
    "Chain",
    "Planted",
    "VirtualArm",
    "arrivals_of_states",
    "follow_rows",
    "make_arrivals",
    "parse_effects",
    "sample_survey",
    "stream",
    "virtual_arm",
]
