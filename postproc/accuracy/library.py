"""Effects by name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from postproc.accuracy.backlash import Backlash
from postproc.accuracy.backlash_profile import BacklashProfile
from postproc.accuracy.catalogue import FURTHER
from postproc.accuracy.effect import Effect
from postproc.accuracy.elm import Elm
from postproc.accuracy.elm_map import ElmMap
from postproc.accuracy.geometry import Geometry
from postproc.accuracy.interpolation import Interpolation
from postproc.accuracy.joint_spline import JointSpline
from postproc.accuracy.kriging import Kriging
from postproc.accuracy.probe import Probe
from postproc.accuracy.probe_turn import ProbeTurn
from postproc.accuracy.registration import Placement
from postproc.exceptions import PostprocError
from postproc.robot.arm import Arm
from postproc.robot.state import States

KINDS: tuple[type[Effect], ...] = (
    Geometry,
    Backlash,
    BacklashProfile,
    *FURTHER,
    Probe,
    ProbeTurn,
    Placement,
    JointSpline,
    Elm,
)
OTHERS: tuple[type[Effect], ...] = (ElmMap, Interpolation, Kriging)
EFFECTS: dict[str, type[Effect]] = {kind.name: kind for kind in KINDS}
MAPS: dict[str, type[Effect]] = {kind.name: kind for kind in OTHERS}

BASE_EFFECTS = ("geometry", "backlash", "backlash_profile")


def propose(names: Iterable[str], arm: Arm, states: States) -> tuple[Effect, ...]:
    """Make effects by name, with the settings that fit an arm and a survey.

    Raises:
        PostprocError: There is no effect of that name, or the survey does not record
            what it needs.
    """
    chosen = tuple(dict.fromkeys(name.strip() for name in names))
    for name in chosen:
        if name not in EFFECTS:
            known = ", ".join(EFFECTS)
            raise PostprocError(f"there is no effect {name!r}. Known effects: {known}")
    effects = tuple(EFFECTS[name].propose(arm, states) for name in chosen)
    for effect in effects:
        _check_needs(effect, states)
    if Placement.name not in chosen:
        return effects
    return tuple(
        replace(e, base=False) if isinstance(e, Geometry) else e for e in effects
    )


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


def restore(name: str, settings: Mapping[str, Any]) -> Effect:
    """Make an effect from the settings of a model file.

    Raises:
        ValueError: Unknown effect or settings that do not fit it.
    """
    kind = {**EFFECTS, **MAPS}.get(name)
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
