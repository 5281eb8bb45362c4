"""Settings under which the arm does not do what targets say: sensors, payload, .."""

from __future__ import annotations

import math

from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language.pdl2.abstract_state import Settings
from postproc.language.pdl2.values import Nothing

# Unset, or FALSE, they let the arm go where the program says.
_FALSE = "it is not known to be FALSE here"
LEADING = {
    "sensor_enbl": Reason(
        Code.SENSOR_GUIDED, f"a sensor may correct the path ($SENSOR_ENBL): {_FALSE}"
    ),
    "sensor_trk": Reason(
        Code.SENSOR_GUIDED, f"a sensor may lead the arm (SENSOR_TRK): {_FALSE}"
    ),
    "conv_enbl": Reason(
        Code.CONVEYOR, f"the arm may follow a conveyor ($CONV_ENBL): {_FALSE}"
    ),
}
RECALIBRATED = Reason(
    Code.SETTING_UNTRACKED,
    "$CAL_SYS is assigned: the model was made for another calibration",
)
CALIBRATION, PAYLOAD = "cal_sys", "tool_mass"
WEAVING = ("weave_num", "weave_type")
DISTURBING = frozenset({*LEADING, *WEAVING, CALIBRATION, PAYLOAD})


def disturbance(settings: Settings) -> Reason:
    """Say why a target is not reached as it is written.

    Args:
        settings: What holds at a move.
    """
    for name, reason in LEADING.items():
        if settings.get(name, False) is not False:
            return reason
    if CALIBRATION in settings:
        return RECALIBRATED
    mass = settings.get(PAYLOAD)
    if mass is None or isinstance(mass, float):
        return NO_REASON
    why = mass.why if isinstance(mass, Nothing) else "it is no number"
    text = f"$TOOL_MASS is not known here: {why}; how far the arm sags hangs on it"
    return Reason(Code.LOAD_UNKNOWN, text)


def load_of_settings(settings: Settings) -> tuple[float, ...]:
    """Return mass [kg] and centre [m] of the load that settings state, NaN for none."""
    mass = settings.get(PAYLOAD)
    stated = mass if isinstance(mass, float) and mass >= 0.0 else math.nan
    return (stated, *(math.nan,) * 3)


def weaves(settings: Settings) -> bool:
    """Return True if the tool weaves on the way, or may: ``$WEAVE_NUM`` is not 0."""
    return any(settings.get(name, 0.0) != 0.0 for name in WEAVING)
