"""Where a survey has been, and which states lie outside."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import overload

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.robot.pose import MM
from postproc.robot.state import States

Interval = tuple[float, float]

MARGIN = 0.05  # of a joint's surveyed range: random poses do not reach its ends
SAME_TOOL = 1e-3  # [m] tools closer than this count as one
REACH_OF_PLATE = 0.5  # [m] how far from three or more probe points a tool may be
PAYLOAD_MARGIN = 0.5  # [kg]
TEMPERATURE_MARGIN = 1.0  # [K] steel of 2.5 m grows by 0.03 mm
BENT_MARGIN = 0.05  # of the surveyed range, where a law is no straight line
WARM = "survey at this temperature too, or correct [environment] of the cell"


@dataclass(frozen=True)
class Ranges:
    """What a survey covered.

    Attributes:
        lower, upper: Joint angles, (6,) [rad].
        tools: Surveyed probe points in the flange frame, (k, 3) [m].
        payload: [kg], or None where it was not recorded.
        temperature: [deg C], or None.
        speed: [m/s], or None.
        oriented: Whether orientations were measured with a probe of known mounting.
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    tools: tuple[tuple[float, ...], ...]
    payload: Interval | None
    temperature: Interval | None
    speed: Interval | None
    oriented: bool = False

    @classmethod
    def of(cls, states: States, oriented: bool = False) -> Ranges:
        """Take the ranges of a survey."""
        tools = np.unique(np.round(states.tool, 9), axis=0)
        return cls(
            lower=tuple(map(float, states.q.min(axis=0))),
            upper=tuple(map(float, states.q.max(axis=0))),
            tools=tuple(tuple(map(float, t)) for t in tools),
            payload=_interval(states.payload),
            temperature=_interval(states.temperature),
            speed=_interval(states.speed),
            oriented=oriented,
        )

    def join(self, fresh: Ranges, only: Collection[str] = ()) -> Ranges:
        """Return what both cover: what a model knew, and rows that revised it.

        Where their ranges lie apart those of the rows count: nobody has been between.

        Args:
            fresh: What the rows cover.
            only: Of which nothing but the rows counts: joints "1" to "6", "payload",
                "temperature", "tool".
        """
        ends = [
            _join_intervals(old, new, str(j + 1) in only)
            for j, (old, new) in enumerate(zip(self._ends, fresh._ends, strict=True))
        ]
        states = {
            name: _join_intervals(
                getattr(self, name), getattr(fresh, name), name in only
            )
            for name in ("payload", "temperature", "speed")
        }
        tools = () if "tool" in only else self.tools
        return Ranges(
            lower=tuple(low for low, _ in ends),
            upper=tuple(high for _, high in ends),
            tools=tuple(sorted({*tools, *fresh.tools})),
            oriented=fresh.oriented or (self.oriented and bool(tools)),
            **states,
        )

    @property
    def _ends(self) -> list[Interval]:
        return list(zip(self.lower, self.upper, strict=True))

    def outside(
        self,
        states: States,
        needs: frozenset[str],
        bent: frozenset[str] = frozenset(),
    ) -> dict[str, Bools]:
        """Say which states lie outside, by reason; reasons without states are left out.

        Args:
            states: n states.
            needs: Covariates that the model cannot do without.
            bent: Covariates of laws that are no straight lines: nobody knows how they
                go on where no survey has been.
        """
        found = {**self._joints(states.q), **self._tools(states.tool)}
        for name, unit, margin, cure in (
            ("payload", "kg", PAYLOAD_MARGIN, "survey with this load too"),
            ("temperature", "deg C", TEMPERATURE_MARGIN, WARM),
        ):
            value, span = getattr(states, name), getattr(self, name)
            if span is not None:
                if name in bent:
                    margin = min(margin, BENT_MARGIN * (span[1] - span[0]))
                low, high = span[0] - margin, span[1] + margin
                text = f"{name} is outside the surveyed {name_range(*span)} {unit}"
                found[f"{text}: {cure}"] = (value < low) | (value > high)
        for name in sorted(needs):
            value = getattr(states, name)
            unknown = np.isnan(value) if value.ndim == 1 else np.isnan(value).any(1)
            found[f"{name} is not known, and the model needs it"] = unknown
        return {reason: rows for reason, rows in found.items() if rows.any()}

    def _joints(self, q: Floats) -> dict[str, Bools]:
        """Compare joint angles; an axis surveyed all around has no outside."""
        low, high = np.array(self.lower), np.array(self.upper)
        middle, margin = (low + high) / 2, MARGIN * (high - low) + 1e-6
        near = middle + np.mod(q - middle + np.pi, 2 * np.pi) - np.pi
        whole = (high - low) * (1 + MARGIN) >= 2 * np.pi * 0.95
        out = ~whole & ((near < low - margin) | (near > high + margin))
        ends = np.rad2deg(np.stack([low, high], axis=1))
        return {
            f"axis {j + 1} is outside the surveyed {ends[j, 0]:.1f} to "
            f"{ends[j, 1]:.1f} deg: survey the range of the program": out[:, j]
            for j in range(6)
        }

    def _tools(self, tool: Floats) -> dict[str, Bools]:
        """Compare the tool with the probe points."""
        points = np.array(self.tools).reshape(-1, 3)
        gap = np.linalg.norm(tool[:, None] - points, axis=2).min(axis=1, initial=np.inf)
        if self.see_all_rotations:
            text = (
                f"the tool is more than {REACH_OF_PLATE / MM:.0f} mm from the probe "
                "points: survey with a probe point nearer to it"
            )
            return {text: gap > REACH_OF_PLATE}
        text = (
            "the tool was not surveyed, and a survey with fewer than three probe "
            "points does not hold for another tool: survey with three"
        )
        return {text: gap > SAME_TOOL}

    @property
    def see_all_rotations(self) -> bool:
        """Whether flange rotations show: points that span a plane, or orientations."""
        if self.oriented:
            return True
        points = np.array(self.tools).reshape(-1, 3)
        spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        return len(spread) > 1 and bool(spread[1] > 0.02)  # [m]


def name_range(low: float, high: float) -> str:
    """Write a range as text; one number where it has no width.

    >>> name_range(10.0, 118.0), name_range(118.0, 118.0)
    ('10 to 118', '118')
    """
    ends = f"{low:g}", f"{high:g}"
    return ends[0] if ends[0] == ends[1] else " to ".join(ends)


@overload
def _join_intervals(old: Interval, new: Interval, only: bool) -> Interval: ...
@overload
def _join_intervals(
    old: Interval | None, new: Interval | None, only: bool
) -> Interval | None: ...
def _join_intervals(
    old: Interval | None, new: Interval | None, only: bool
) -> Interval | None:
    """Join two ranges that touch; else the second counts, where it is known.

    >>> _join_intervals((0.0, 2.0), (1.0, 3.0), False)
    (0.0, 3.0)
    >>> _join_intervals((0.0, 1.0), (2.0, 3.0), False)
    (2.0, 3.0)
    >>> _join_intervals((0.0, 2.0), None, False)
    (0.0, 2.0)
    >>> _join_intervals((0.0, 2.0), (1.0, 3.0), True)
    (1.0, 3.0)
    """
    if old is None or new is None:
        return old if new is None else new
    if only or new[0] > old[1] or new[1] < old[0]:
        return new
    return min(old[0], new[0]), max(old[1], new[1])


def _interval(values: Floats) -> Interval | None:
    """Return the least and the largest of the known values."""
    known = values[~np.isnan(values)]
    return (float(known.min()), float(known.max())) if len(known) else None
