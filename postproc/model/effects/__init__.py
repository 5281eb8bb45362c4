"""The effects that a model may hold: one list, one file each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from postproc.exceptions import PostprocError
from postproc.model.effects.azimuth import Azimuth
from postproc.model.effects.backlash import Backlash
from postproc.model.effects.backlash_profile import BacklashProfile
from postproc.model.effects.base_shift import BaseShift
from postproc.model.effects.base_tilt import BaseTilt
from postproc.model.effects.compliance import Compliance
from postproc.model.effects.counterbalance import Counterbalance
from postproc.model.effects.coupling import Coupling
from postproc.model.effects.curve import Curve
from postproc.model.effects.drive import (
    DriveBacklash,
    DriveEffect,
    DriveLoad,
    DriveTransmission,
)
from postproc.model.effects.effect import Effect
from postproc.model.effects.elm import Elm, ElmMap
from postproc.model.effects.geometry import Geometry
from postproc.model.effects.joint_map import JointMap
from postproc.model.effects.joint_spline import JointSpline
from postproc.model.effects.joint_step import JointStep
from postproc.model.effects.lag import Lag
from postproc.model.effects.load_backlash import LoadBacklash
from postproc.model.effects.maps import Interpolation, Kriging
from postproc.model.effects.payload import Payload
from postproc.model.effects.placement import Placement
from postproc.model.effects.probe import Probe
from postproc.model.effects.probe_turn import ProbeTurn
from postproc.model.effects.refraction import Refraction
from postproc.model.effects.scale import Scale
from postproc.model.effects.thermal import Thermal
from postproc.model.effects.tool_shift import ToolShift
from postproc.model.effects.tracker_drift import TrackerDrift
from postproc.model.effects.transmission import Transmission
from postproc.model.effects.windup import Windup
from postproc.robot.arm import Arm
from postproc.robot.state import States

# Every effect, one line each. Where order matters (messages, the order in which a fit
# and a search try them), it is this one.

EFFECTS: tuple[type[Effect], ...] = (
    Geometry,
    Backlash,
    BacklashProfile,
    Compliance,
    Payload,
    Counterbalance,
    BaseTilt,
    Transmission,
    Scale,
    Coupling,
    LoadBacklash,
    DriveBacklash,
    DriveTransmission,
    DriveLoad,
    Thermal,
    Windup,
    Lag,
    BaseShift,
    ToolShift,
    JointStep,
    TrackerDrift,
    Azimuth,
    Refraction,
    JointMap,
    Curve,
    Probe,
    ProbeTurn,
    Placement,
    JointSpline,
    Elm,
    ElmMap,
    Interpolation,
    Kriging,
)

BY_NAME: dict[str, type[Effect]] = {kind.name: kind for kind in EFFECTS}
KNOWN = tuple(kind.name for kind in EFFECTS if not kind.published)
BASE_EFFECTS = tuple(kind.name for kind in EFFECTS if kind.unasked == "always")


def propose(names: Iterable[str], arm: Arm, states: States) -> tuple[Effect, ...]:
    """Make effects by name, with the settings that fit an arm and a survey.

    Raises:
        PostprocError: There is no effect of that name, or the survey does not record
            what it needs.
    """
    chosen = tuple(dict.fromkeys(name.strip() for name in names))
    for name in chosen:
        if name not in KNOWN:
            known = ", ".join(KNOWN)
            raise PostprocError(f"there is no effect {name!r}. Known effects: {known}")
    effects = tuple(BY_NAME[name].propose(arm, states) for name in chosen)
    for effect in effects:
        _check_needs(effect, states)
    return tuple(effect.beside(effects) for effect in effects)


def _check_needs(kind: Effect, states: States) -> None:
    """Refuse an effect whose covariate was not recorded.

    Raises:
        PostprocError: Naming the effect and the column.
    """
    for need in kind.requires():
        if len(states) and np.isnan(getattr(states, need)).all():
            raise PostprocError(
                f"effect {kind.name} needs the {need} of every row, which the file "
                f"does not have. Add the column or leave the effect out"
            )
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
    kind = BY_NAME.get(name)
    if kind is None:
        raise ValueError(f"unknown effect {name!r}")
    try:
        return kind(**{k: _frozen(v) for k, v in settings.items()})
    except TypeError:
        raise ValueError(f"settings do not fit effect {name!r}") from None


def _frozen(value: Any) -> Any:
    """Turn lists into tuples, at all depths."""
    if isinstance(value, Mapping):
        return {k: _frozen(v) for k, v in value.items()}
    if isinstance(value, list):
        return tuple(_frozen(v) for v in value)
    return value
