"""Visits made by hand, for tests that need no program text."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from postproc.language.pdl2.pose_encoding import PDL2_DIALECT
from postproc.language.visits import (
    FrameColumns,
    Graph,
    Literals,
    MotionColumns,
    NumberPlaces,
    PlaceColumns,
    SpeedColumns,
    TargetColumns,
    Visits,
    ZoneColumns,
)
from postproc.robot.pose import pose_from_record

FRAMES = np.array(
    [
        [10.0, 20.0, 250.0, 30.0, 40.0, 50.0],
        [100.0, -50.0, 500.0, 90.0, 0.0, 0.0],
        [1200.0, 300.0, 700.0, 10.0, 20.0, 30.0],
    ]
)
NO_INTS, NO_BOOLS = np.empty(0, dtype=np.int64), np.empty(0, dtype=bool)
NO_LITERALS = Literals(
    NO_INTS, NO_INTS, NumberPlaces.of(*np.empty((2, 0, 6), np.int64)), NO_BOOLS,
    (), NO_BOOLS, NO_BOOLS, (),
)  # fmt: skip


PARTS = {
    "place": PlaceColumns, "target": TargetColumns, "frame": FrameColumns,
    "motion": MotionColumns, "zone": ZoneColumns, "speed": SpeedColumns, "graph": Graph,
}  # fmt: skip


def assemble(**given: Any) -> Visits:
    """Make visits of columns and tables, whichever part they belong to."""
    n = len(given["line"])
    unset = {"shift": np.full(n, -1), "shifts": (), "weaves": np.zeros(n, bool),
             "load": np.zeros(n, int), "loads": np.full((1, 4), np.nan)}  # fmt: skip
    given = unset | given
    parts: dict[str, Any] = {
        name: part(**{f.name: given.pop(f.name) for f in fields(part)})
        for name, part in PARTS.items()
    }
    return Visits(**parts, **given)


def visits(meaning: list[int], values: list[list[float]], **more: object) -> Visits:
    """One visit after the other, tool 0, base 1, user frame 2."""
    n = len(meaning)
    zeros, no = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=bool)
    nan = np.full(n, np.nan)
    given: dict[str, Any] = {
        "files": ("job.pdl",), "file": zeros, "line": np.arange(n) + 1,
        "kind": zeros, "meaning": np.array(meaning), "via": no,
        "values": np.array(values, dtype=float), "distance_mm": nan,
        "aux": np.empty((n, 0)), "config": zeros, "configs": ("S T1:1",),
        "config_given": ~no, "literal": zeros - 1,
        "follows": zeros - 1, "name": zeros, "names": ("",),
        "tool": zeros, "base": zeros + 1, "uframe": zeros + 2,
        "poses": pose_from_record(FRAMES),
        "taught": np.zeros(3, dtype=bool), "tool_remote": no,
        "nearest_turn": no, "care": np.zeros((n, 3), dtype=np.int64), "fly": no,
        "size_mm": nan, "overlap_percent": nan,
        "blend": zeros, "rule": zeros, "linear": nan, "turning": nan,
        "override": np.ones(n),
        "wrist_joint": no, "orientation_law": zeros, "arc_angle": nan,
        "block": zeros - 1, "curved": no, "reason": zeros, "reasons": ("",),
        "pred_start": np.arange(n + 1), "pred": np.arange(n) - 1,
        "measure_id": ("",) * n, "literals": NO_LITERALS, "dialect": PDL2_DIALECT,
    }  # fmt: skip
    return assemble(**(given | more))
