"""Programs for the virtual arm, built without any parser."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from postproc.language.pdl2.pose_encoding import PDL2_DIALECT
from postproc.language.visits import Literals, Meaning, NumberPlaces, Visits
from postproc.robot.trajectory import Motion
from postproc.simulation.kinematics import pose_of_record
from tests.made_visits import assemble


@dataclass
class Program:
    """Collects moves; `visits()` gives what a parser would give."""

    frames: list[list[float]] = field(default_factory=lambda: [[0.0] * 6])
    rows: list[dict] = field(default_factory=list)

    def add(self, values, motion=Motion.JOINT, target=Meaning.POSE, **more) -> Program:
        row = {
            "values": [*values, *[np.nan] * (6 - len(values))],
            "motion": motion,
            "target": target,
            "via": False,
            "config": None,
            "tool": 0,
            "uframe": 0,
            "base": 0,
            "id": "",
            "pred": None,
            "speed": 0.1,
            "nearest": False,
            "distance": np.nan,
            "wrist": False,
            "fly": False,
            "fly_dist": np.nan,
            "overlap_percent": np.nan,
            "blend": 0,
            "zone_rule": 0,
        }
        assert set(more) <= set(row)
        self.rows.append({**row, **more})
        return self

    def joints(self, *values, **more) -> Program:
        return self.add(values, target=Meaning.JOINTS, **more)

    def visits(self) -> Visits:
        n = len(self.rows)
        column = lambda key, dtype: np.array([r[key] for r in self.rows], dtype=dtype)  # noqa: E731
        preds = [
            [i - 1] if r["pred"] is None else list(r["pred"])
            for i, r in enumerate(self.rows)
        ]
        configs = sorted({r["config"] or "" for r in self.rows} | {""})
        nothing = np.zeros(n, dtype=np.int64)
        no = np.zeros(n, dtype=bool)
        nan = np.full(n, np.nan)
        return assemble(
            files=("test.pdl",), file=nothing.copy(), line=np.arange(n) + 1,
            kind=column("motion", np.int64), meaning=column("target", np.int64),
            via=column("via", bool), values=column("values", float).reshape(n, 6),
            distance_mm=column("distance", float), aux=np.zeros((n, 0)),
            config=np.array([configs.index(r["config"] or "") for r in self.rows]),
            configs=tuple(configs),
            config_given=np.array([r["config"] is not None for r in self.rows]),
            literal=nothing - 1, follows=nothing - 1, name=nothing.copy(), names=("",),
            tool=column("tool", np.int64), base=column("base", np.int64),
            uframe=column("uframe", np.int64),
            poses=pose_of_record(np.array(self.frames, float).reshape(-1, 6)),
            taught=np.zeros(len(self.frames), dtype=bool),
            tool_remote=no.copy(), nearest_turn=column("nearest", bool),
            care=np.zeros((n, 3), dtype=np.int64),
            fly=column("fly", bool), size_mm=column("fly_dist", float),
            overlap_percent=column("overlap_percent", float),
            blend=column("blend", np.int64),
            rule=column("zone_rule", np.int64), linear=column("speed", float),
            turning=nan.copy(),
            override=np.ones(n), wrist_joint=column("wrist", bool),
            orientation_law=nothing.copy(), arc_angle=nan.copy(),
            block=nothing - 1, curved=no.copy(),
            reason=nothing.copy(), reasons=("",),
            pred_start=np.cumsum([0] + [len(p) for p in preds]),
            pred=np.array([p for each in preds for p in each], dtype=np.int64),
            measure_id=tuple(r["id"] for r in self.rows),
            literals=_no_literals(), dialect=PDL2_DIALECT,
        )  # fmt: skip


def _no_literals() -> Literals:
    ints, bools = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=bool)
    places = NumberPlaces.of(*np.zeros((2, 0, 6), dtype=np.int64))
    return Literals(ints, ints, places, bools, (), bools, bools, ())
