"""The effects that a model may hold: one list, one file each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any

import numpy as np

from postproc.exceptions import PostprocError
from postproc.model.effects.effect import Effect
from postproc.model.effects.policies import FitPolicy
from postproc.robot.arm import Arm
from postproc.robot.state import States

# Every effect by its name, one line each. Where order matters (messages, the order in
# which a fit and a search try them), it is this one. A class is loaded where it is
# asked for: a model holds few of them.

PLACES = {
    "geometry": "geometry.Geometry",
    "backlash": "backlash.Backlash",
    "backlash_profile": "backlash_profile.BacklashProfile",
    "compliance": "compliance.Compliance",
    "bending": "bending.Bending",
    "payload": "payload.Payload",
    "counterbalance": "counterbalance.Counterbalance",
    "base_tilt": "base_tilt.BaseTilt",
    "transmission": "transmission.Transmission",
    "scale": "scale.Scale",
    "coupling": "coupling.Coupling",
    "load_backlash": "load_backlash.LoadBacklash",
    "held_backlash": "held_backlash.HeldBacklash",
    "drive_backlash": "drive.DriveBacklash",
    "drive_transmission": "drive.DriveTransmission",
    "drive_load": "drive.DriveLoad",
    "thermal": "thermal.Thermal",
    "windup": "windup.Windup",
    "lag": "lag.Lag",
    "base_shift": "base_shift.BaseShift",
    "station_shift": "station_shift.StationShift",
    "tool_shift": "tool_shift.ToolShift",
    "joint_step": "joint_step.JointStep",
    "joint_offset": "joint_offset.JointOffset",
    "tracker_drift": "tracker_drift.TrackerDrift",
    "azimuth": "azimuth.Azimuth",
    "refraction": "refraction.Refraction",
    "joint_map": "joint_map.JointMap",
    "part_motion": "part_motion.PartMotion",
    "curve": "curve.Curve",
    "probe": "probe.Probe",
    "probe_turn": "probe_turn.ProbeTurn",
    "registration": "placement.Placement",
    "joint_spline": "joint_spline.JointSpline",
    "elm": "elm.Elm",
    "elm_map": "elm.ElmMap",
    "interpolation": "maps.Interpolation",
    "kriging": "maps.Kriging",
}


def kind_of(name: str) -> type[Effect]:
    """Load the class of an effect.

    Raises:
        KeyError: There is no effect of that name.
    """
    module, _, kind = PLACES[name].partition(".")
    found: type[Effect] = getattr(import_module(f"{__name__}.{module}"), kind)
    return found


EFFECTS: tuple[type[Effect], ...]  # all of them
BY_NAME: dict[str, type[Effect]]
KNOWN: tuple[str, ...]  # those that a user may ask for
BASE_EFFECTS: tuple[str, ...]  # those that every model holds


def __getattr__(name: str) -> Any:
    """Load all effects, where one of the lists above is asked for."""
    if name not in ("EFFECTS", "BY_NAME", "KNOWN", "BASE_EFFECTS"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    every = tuple(map(kind_of, PLACES))
    globals().update(
        EFFECTS=every,
        BY_NAME={kind.name: kind for kind in every},
        KNOWN=tuple(kind.name for kind in every if not kind.published),
        BASE_EFFECTS=tuple(
            kind.name for kind in every if kind.fit_policy == FitPolicy.ALWAYS
        ),
    )
    return globals()[name]


def propose(names: Iterable[str], arm: Arm, states: States) -> tuple[Effect, ...]:
    """Make effects by name, with the settings that fit an arm and a survey.

    Raises:
        PostprocError: There is no effect of that name, or the survey does not record
            what it needs.
    """
    chosen = tuple(dict.fromkeys(name.strip() for name in names))
    for name in chosen:
        if name not in PLACES or kind_of(name).published:
            known = ", ".join(n for n in PLACES if not kind_of(n).published)
            raise PostprocError(f"there is no effect {name!r}. Known effects: {known}")
    effects = tuple(kind_of(name).propose(arm, states) for name in chosen)
    for effect in effects:
        _check_needs(effect, states)
    return tuple(effect.beside(effects) for effect in effects)


def _check_needs(kind: Effect, states: States) -> None:
    """Refuse an effect whose covariate was not recorded."""
    for need in kind.requires():
        if len(states) and np.isnan(getattr(states, need)).all():
            raise PostprocError(
                f"effect {kind.name} needs the {need} of every row, which the file "
                f"does not have. Add the column or leave the effect out"
            )
    from postproc.model.effects.drive import DriveEffect

    if isinstance(kind, DriveEffect) and not kind.parameters():
        raise PostprocError(
            f"effect {kind.name} is of coupled drives. Declare drive_coupling in the "
            f"arm file, or leave the effect out"
        )


def restore(name: str, settings: Mapping[str, Any]) -> Effect:
    """Make an effect from the settings of a model file.

    Raises:
        ValueError: Unknown effect or settings that do not fit it.
    """
    if name not in PLACES:
        raise ValueError(f"unknown effect {name!r}")
    try:
        return kind_of(name)(**{k: _freeze(v) for k, v in settings.items()})
    except TypeError:
        raise ValueError(f"settings do not fit effect {name!r}") from None


def _freeze(value: Any) -> Any:
    """Turn lists into tuples, at all depths."""
    if isinstance(value, Mapping):
        return {k: _freeze(v) for k, v in value.items()}
    if isinstance(value, list):
        return tuple(_freeze(v) for v in value)
    return value
