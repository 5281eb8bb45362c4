"""The steps in which a model came about, as rows of a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any


def name_of(effect: Mapping[str, Any]) -> str:
    """Name an effect with its joint and what drives it.

    >>> name_of({"effect": "coupling", "joint": 6, "source": "joint 5"})
    'coupling of joint 6 by joint 5'
    """
    joint, source = effect.get("joint"), effect.get("source")
    name = str(effect["effect"])
    name += "" if joint is None else f" of joint {joint}"
    own = source is None or source == f"joint {joint}"
    return name if own else f"{name} by {source}"


def steps(history: Sequence[Mapping[str, Any]] | None) -> list[dict[str, Any]]:
    """Take what the table of steps shows; what a step does not tell stays empty."""
    return [_step(entry) for entry in history or ()]


def _step(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Take one step."""
    added = entry.get("added") or ([entry] if "effect" in entry else [])
    means = {
        when: (entry.get(when) or {}).get("mean_mm") for when in ("before", "after")
    }
    return {
        "parent": str(entry.get("parent") or ""),
        "verdict": str(entry.get("verdict") or ""),
        "added": [name_of(effect) for effect in added],
        "rows": entry.get("n_held_out", ""),
        **means,
    }
