"""What moves are carried out with under some settings, and why they must stay."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

from postproc.arrays import Interned
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language.analysis.conditions import NO_LOAD, Conditions, Zone, cell_pose
from postproc.language.pdl2.abstract_state import FRAMES, Settings
from postproc.language.pdl2.values import Nothing, Position, Value
from postproc.language.shifts import Pose
from postproc.language.visits import Blend, Meaning, OrientationLaw, Switch, ZoneRule

_OVERRIDES = ("arm_spd_ovr", "prog_spd_ovr", "gen_ovr")
_BLENDS = {"FLY_NORM": Blend.OVERLAP, "FLY_CART": Blend.ZONE}
_ZONE_RULES = {
    "FLY_AUTO": ZoneRule.AUTO,
    "FLY_PASS": ZoneRule.PASS,
    "FLY_TOL": ZoneRule.WITHIN,
    "FLY_FROM": ZoneRule.FROM,
}
_LAWS = {
    "RS_WORLD": OrientationLaw.ONE_AXIS,
    "RS_TRAJ": OrientationLaw.ALONG_PATH,
    "EUL_WORLD": OrientationLaw.EULER_ANGLES,
    "RPY_WORLD": OrientationLaw.ROLL_PITCH_YAW,
    "WRIST_JNT": OrientationLaw.WRIST_JOINTS,
}
_WITHOUT_UFRAME = (Meaning.JOINTS, Meaning.HOME, Meaning.CALIBRATION, Meaning.BY)


# Settings under which the arm does not do what targets say: sensors, payload, ..

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


class SettingTable:
    """Each distinct state of the settings is read off once."""

    def __init__(self) -> None:
        """Begin without any."""
        self._rows = Interned[int]()
        self.settings: list[Settings] = []  # keeps an id from being used again
        self.conditions: list[Conditions] = []
        self._problems: list[tuple[Reason, Reason]] = []

    def index(self, settings: Settings) -> int:
        """Return the row of a state of the settings."""
        row = self._rows[id(settings)]
        if row == len(self.settings):
            self.settings.append(settings)
            self.conditions.append(_conditions(settings))
            found = disturbance(settings)
            tool = ("tool", "tool_rmt")
            pose = found or _unknown(settings, ("uframe", "base", *tool))
            self._problems.append((pose, found or _unknown(settings, tool)))
        return row

    def problem(self, row: int, target: Meaning) -> Reason:
        """Return why a visit cannot be compensated under these settings."""
        pose, joints = self._problems[row]
        return joints if target in _WITHOUT_UFRAME else pose


def _conditions(settings: Settings) -> Conditions:
    """Say what moves are carried out with under some settings."""
    tool, base, uframe = (settings.get(name) for name in FRAMES)
    mass = _number(settings, PAYLOAD)
    return Conditions(
        tool=_pose(tool),
        base=_pose(base),
        uframe=_pose(uframe),
        taught=(_is_taught(tool), _is_taught(base), _is_taught(uframe)),
        tool_remote=settings.get("tool_rmt") is True,
        care=(
            _switch(settings.get("cnfg_care")),
            _switch(settings.get("turn_care")),
            _switch(settings.get("jnt_mturn")),
        ),
        nearest_turn=settings.get("jnt_mturn") is False,
        orientation_law=_orientation_law(settings),
        wrist_joint=settings.get("ornt_type") == "wrist_jnt",
        zone=Zone(
            size_mm=_number(settings, "fly_dist"),
            overlap_percent=_number(settings, "fly_per"),
            blend=_word(settings, "fly_type", _BLENDS),
            rule=_word(settings, "fly_traj", _ZONE_RULES),
        ),
        linear=_number(settings, "lin_spd"),
        turning=_number(settings, "rot_spd"),
        override=_override(settings),
        load=(mass if mass >= 0.0 else math.nan, *NO_LOAD[1:]),
        weaves=any(settings.get(name, 0.0) != 0.0 for name in WEAVING),
    )


def _pose(value: Value | None) -> Pose:
    """Return a frame, () where it is not known."""
    if not isinstance(value, Position) or value.joints or not value.complete:
        return ()
    return _pose_of(value.numbers)


@lru_cache(maxsize=256)  # frames come back with every other setting
def _pose_of(record: tuple[float, ...]) -> Pose:
    return cell_pose(record)


def _is_taught(value: Value | None) -> bool:
    """Tell whether a frame was taught with the arm."""
    return isinstance(value, Position) and value.taught


def _number(settings: Settings, name: str) -> float:
    value = settings.get(name)
    return value if isinstance(value, float) else math.nan


def _word(settings: Settings, name: str, words: Mapping[str, int]) -> int:
    """Return what a predefined word means, 0 where it is not set or not known."""
    return words.get(str(settings.get(name)).upper(), 0)


def _orientation_law(settings: Settings) -> OrientationLaw:
    if "ornt_type" not in settings:
        return OrientationLaw.UNSET
    said = _word(settings, "ornt_type", _LAWS)
    return OrientationLaw(said or OrientationLaw.UNKNOWN)


def _switch(value: Value | None) -> Switch:
    if value is None:
        return Switch.UNSET
    if isinstance(value, bool):
        return Switch.ON if value else Switch.OFF
    return Switch.UNKNOWN


def _override(settings: Settings) -> float:
    product = 1.0
    for name in _OVERRIDES:
        value = _number(settings, name)
        if value > 0:
            product *= min(value, 100.0) / 100.0
    return product


def _unknown(settings: Settings, names: tuple[str, ...]) -> Reason:
    """Say which of some settings are not known, and why."""
    alike: dict[str, list[str]] = {}
    missing = False
    for name in names:
        if unknown := _why_not_known(settings, name):
            alike.setdefault(unknown.why, []).append(f"${name.upper()}")
            missing |= unknown.code is Code.NO_VALUE
    if not alike:
        return NO_REASON
    text = "; ".join(
        f"{', '.join(some)} {'is' if len(some) == 1 else 'are'} not known here: {why}"
        for why, some in alike.items()
    )
    return Reason(Code.NO_VALUE if missing else Code.FRAME_UNKNOWN, text)


def _why_not_known(settings: Settings, name: str) -> Nothing | None:
    """Say why a setting is not known, None where it is."""
    value = settings.get(name)
    if isinstance(value, Nothing):
        return value
    if name not in FRAMES or (
        isinstance(value, Position) and value.complete and not value.joints
    ):
        return None
    partly = isinstance(value, Position) and not value.joints
    return Nothing("a part of it is not known" if partly else "it is no known position")
