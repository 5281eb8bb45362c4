"""Settings under which the arm does not do what targets say: sensors, payload, .."""

from __future__ import annotations

import math

from postproc.language.pdl2.store import Settings
from postproc.language.pdl2.values import Nothing

# Unset, or FALSE, they let the arm go where the program says.
LEADING = {
    "sensor_enbl": "a sensor may correct the path ($SENSOR_ENBL)",
    "sensor_trk": "a sensor may lead the arm (SENSOR_TRK)",
    "conv_enbl": "the arm may follow a conveyor ($CONV_ENBL)",
}
CALIBRATION, PAYLOAD = "cal_sys", "tool_mass"
WEAVING = ("weave_num", "weave_type")
DISTURBING = frozenset({*LEADING, *WEAVING, CALIBRATION, PAYLOAD})


def disturbance(settings: Settings) -> str:
    """Say why a target is not reached as it is written, "" where it is.

    Args:
        settings: What holds at a move.
    """
    for name, what in LEADING.items():
        if settings.get(name, False) is not False:
            return f"{what}: it is not known to be FALSE here"
    if CALIBRATION in settings:
        return "$CAL_SYS is assigned: the model was made for another calibration"
    mass = settings.get(PAYLOAD)
    if mass is None or isinstance(mass, float):
        return ""
    why = mass.why if isinstance(mass, Nothing) else "it is no number"
    return f"$TOOL_MASS is not known here: {why}; how far the arm sags hangs on it"


def stated_load(settings: Settings) -> tuple[float, ...]:
    """Return mass [kg] and centre [m] of the load that settings state, NaN for none."""
    mass = settings.get(PAYLOAD)
    stated = mass if isinstance(mass, float) and mass >= 0.0 else math.nan
    return (stated, *(math.nan,) * 3)


def weaves(settings: Settings) -> bool:
    """Return True if the tool weaves on the way, or may: ``$WEAVE_NUM`` is not 0."""
    return any(settings.get(name, 0.0) != 0.0 for name in WEAVING)
