"""The effects that an arm may have beyond geometry and backlash."""

from __future__ import annotations

from postproc.accuracy.base_shift import BaseShift
from postproc.accuracy.compliance import Compliance
from postproc.accuracy.counterbalance import Counterbalance
from postproc.accuracy.coupling import Coupling
from postproc.accuracy.curve import Curve
from postproc.accuracy.effect import Effect
from postproc.accuracy.joint_map import JointMap
from postproc.accuracy.lag import Lag
from postproc.accuracy.load_backlash import LoadBacklash
from postproc.accuracy.payload import Payload
from postproc.accuracy.scale import Scale
from postproc.accuracy.thermal import Thermal
from postproc.accuracy.tool_shift import ToolShift
from postproc.accuracy.tracker_drift import TrackerDrift
from postproc.accuracy.transmission import Transmission
from postproc.accuracy.windup import Windup

FURTHER: tuple[type[Effect], ...] = (
    Compliance,
    Payload,
    Counterbalance,
    Transmission,
    Scale,
    Coupling,
    LoadBacklash,
    Thermal,
    Windup,
    Lag,
    BaseShift,
    ToolShift,
    TrackerDrift,
    JointMap,
    Curve,
)
