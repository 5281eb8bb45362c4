"""Visits made by hand, for tests that need no program text."""

from __future__ import annotations

import numpy as np

from postproc.language.pdl2.pose_encoding import PDL2_DIALECT
from postproc.language.visits import Literals, NumberPlaces, Visits
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


def visits(target: list[int], values: list[list[float]], **more: object) -> Visits:
    """One visit after the other, tool 0, base 1, user frame 2."""
    n = len(target)
    zeros, no = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=bool)
    nan = np.full(n, np.nan)
    given: dict[str, object] = {
        "files": ("job.pdl",), "file": zeros, "line": np.arange(n) + 1,
        "motion": zeros, "target": np.array(target), "via": no,
        "values": np.array(values, dtype=float), "distance_mm": nan,
        "aux": np.empty((n, 0)), "config": zeros, "configs": ("S T1:1",),
        "config_given": ~no, "literal": zeros - 1,
        "follows": zeros - 1, "name": zeros, "names": ("",),
        "tool": zeros, "base": zeros + 1, "uframe": zeros + 2,
        "frames": pose_from_record(FRAMES),
        "frame_taught": np.zeros(3, dtype=bool), "tool_remote": no,
        "nearest_turn": no, "care": np.zeros((n, 3), dtype=np.int64), "fly": no,
        "zone_mm": nan, "overlap_percent": nan,
        "blend": zeros, "zone_rule": zeros, "lin_spd": nan, "rot_spd": nan,
        "override": np.ones(n),
        "wrist_joint": no, "orientation_law": zeros, "arc_angle": nan,
        "block": zeros - 1, "curved": no, "reason": zeros, "reasons": ("",),
        "pred_start": np.arange(n + 1), "pred": np.arange(n) - 1,
        "measure_id": ("",) * n, "literals": NO_LITERALS, "dialect": PDL2_DIALECT,
    }  # fmt: skip
    return Visits(**(given | more))  # type: ignore[arg-type]
