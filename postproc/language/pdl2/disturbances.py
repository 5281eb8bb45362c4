"""Settings under which the arm does not do what targets say: sensors, payload, .."""

from __future__ import annotations

from postproc.language.pdl2.store import Settings
from postproc.language.pdl2.values import Nothing

# Unset, or FALSE, they let the arm go where the program says.
LEADING = {
    "sensor_enbl": "a sensor may correct the path ($SENSOR_ENBL)",
    "sensor_trk": "a sensor may lead the arm (SENSOR_TRK)",
    "conv_enbl": "the arm may follow a conveyor ($CONV_ENBL)",
}
CALIBRATION, PAYLOAD = "cal_sys", "tool_mass"
DISTURBING = frozenset({*LEADING, CALIBRATION, PAYLOAD})
SAME_KG = 0.05  # masses that differ less are one, as they are written


def disturbance(settings: Settings, payload_kg: float) -> str:
    """Say why a target is not reached as it is written, "" where it is.

    Args:
        settings: What holds at a move.
        payload_kg: What the cell says that the arm carries, NaN where it does not.
    """
    for name, what in LEADING.items():
        if settings.get(name, False) is not False:
            return f"{what}: it is not known to be FALSE here"
    if CALIBRATION in settings:
        return "$CAL_SYS is assigned: the model was made for another calibration"
    mass = settings.get(PAYLOAD)
    if mass is None or (isinstance(mass, float) and abs(mass - payload_kg) <= SAME_KG):
        return ""
    cure = "the model's sag holds for that of the cell file ([payload] mass_kg)"
    if not isinstance(mass, float):
        why = mass.why if isinstance(mass, Nothing) else "it is no number"
        return f"$TOOL_MASS is not known here: {why}; {cure}"
    given = "gives none" if payload_kg != payload_kg else f"gives {payload_kg:g} kg"
    return f"$TOOL_MASS is {mass:g} kg and the cell file {given}: {cure}"
