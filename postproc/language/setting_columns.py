"""Frames and motion variables of visits as columns."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np

from postproc.arrays import Ints
from postproc.language.store import Settings
from postproc.language.values import Nothing, Position, Value
from postproc.language.visits import (
    FlyTrajectory,
    FlyType,
    OrntType,
    Switch,
    Target,
    slim,
)

_FRAMES = ("tool", "base", "uframe")
_CARE = ("cnfg_care", "turn_care", "jnt_mturn")
_OVERRIDES = ("arm_spd_ovr", "prog_spd_ovr", "gen_ovr")
_WITHOUT_UFRAME = (Target.JOINTS, Target.HOME, Target.CALIBRATION, Target.BY)


class SettingColumns:
    """Each distinct state of the settings becomes one row, read off once."""

    def __init__(self) -> None:
        self._kept: list[Settings] = []
        self._rows: dict[int, int] = {}
        self._problems: list[tuple[str, str]] = []
        self._frames: dict[tuple[tuple[float, ...], bool], int] = {}
        self._table: dict[str, list[Any]] = {}

    def index(self, settings: Settings) -> int:
        """Return the row of a state of the settings."""
        row = self._rows.get(id(settings))
        if row is None:
            row = self._rows[id(settings)] = len(self._kept)
            self._kept.append(settings)  # keeps its id from being used again
            for name, value in _row(settings, self._frame).items():
                self._table.setdefault(name, []).append(value)
            tool = _unknown(settings, ("tool", "tool_rmt"))
            self._problems.append(
                (tool or _unknown(settings, ("base", "uframe")), tool)
            )
        return row

    def kept(self, row: int) -> Settings:
        """Return the state of the settings of a row."""
        return self._kept[row]

    def problem(self, row: int, target: Target) -> str:
        """Return why a visit cannot be compensated under these settings, or ""."""
        pose, joints = self._problems[row]
        return joints if target in _WITHOUT_UFRAME else pose

    def _frame(self, value: object) -> int:
        if not isinstance(value, Position) or value.joints or not value.complete:
            return -1
        numbers = tuple(float(n) for n in value.numbers if n is not None)
        return self._frames.setdefault((numbers, value.taught), len(self._frames))

    def columns(self, rows: Ints) -> dict[str, Any]:
        """Return the columns of `Visits` that come from settings."""
        frames = list(self._frames)
        columns: dict[str, Any] = {
            name: slim(np.array(values)[rows]) for name, values in self._table.items()
        }
        if not columns:
            empty = _row({}, lambda value: -1)
            columns = {name: np.array([value])[:0] for name, value in empty.items()}
        columns["frames"] = np.array([f for f, _ in frames], float).reshape(-1, 6)
        columns["frame_taught"] = np.array([taught for _, taught in frames], bool)
        return columns


def _row(settings: Settings, frame: Any) -> dict[str, Any]:
    return {
        **{name: frame(settings.get(name)) for name in _FRAMES},
        "tool_remote": settings.get("tool_rmt") is True,
        "nearest_turn": settings.get("jnt_mturn") is False,
        "care": [_switch(settings.get(name)) for name in _CARE],
        "fly_dist_mm": _number(settings, "fly_dist"),
        "fly_per": _number(settings, "fly_per"),
        "fly_type": _word(settings, "fly_type", FlyType),
        "fly_traj": _word(settings, "fly_traj", FlyTrajectory),
        "lin_spd": _number(settings, "lin_spd"),
        "rot_spd": _number(settings, "rot_spd"),
        "override": _override(settings),
        "wrist_joint": settings.get("ornt_type") == "wrist_jnt",
        "ornt_type": _ornt_type(settings),
    }


def _number(settings: Settings, name: str) -> float:
    value = settings.get(name)
    return value if isinstance(value, float) else np.nan


def _word(settings: Settings, name: str, words: type[IntEnum]) -> int:
    """Return the number of a predefined word, 0 where it is not set or not known."""
    said = str(settings.get(name)).upper()
    return int(words[said]) if said in words.__members__ else 0


def _ornt_type(settings: Settings) -> OrntType:
    if "ornt_type" not in settings:
        return OrntType.UNSET
    return OrntType(_word(settings, "ornt_type", OrntType) or OrntType.UNKNOWN)


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


def _unknown(settings: Settings, names: tuple[str, ...]) -> str:
    """Say which of some settings is not known, and why."""
    for name in names:
        value = settings.get(name)
        if isinstance(value, Nothing):
            return f"${name.upper()} is not known here: {value.why}"
        if name in _FRAMES and not (
            isinstance(value, Position) and value.complete and not value.joints
        ):
            partly = isinstance(value, Position) and not value.joints
            why = "a part of it is not known" if partly else "it is no known position"
            return f"${name.upper()} is not known here: {why}"
    return ""
