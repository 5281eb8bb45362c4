"""Rows that `predict` reads: their moment, their frame, and what they cannot be."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.calibration.simulator import NJ, TOOL, random_arm, random_states
from tests.written import cli

N, LATER = 160, 60
AT, TURN = np.array([4.0, -3.0, 1.5]), Rotation.from_euler("ZYX", [2.0, 0.02, 0.01])
AWAY, TURNED = np.array([-2.0, 3.5, 1.2]), Rotation.from_euler("ZYX", [-1.0, 0.0, 0.03])
PILLARS = np.array([[2.0, 2.0, 0.5], [-1.5, 2.5, 1.5], [1.0, -2.5, 1.0]])
EFFECTS = ("--effects", "geometry,backlash,tracker_drift")
_fitted: dict[tuple[bytes, tuple[str, ...]], bytes] = {}  # models by their surveys
RESIDUAL = re.compile(r"residual mean ([\d.]+) mm")


class Campaign:
    """A survey of an arm and a later file, with a drift of the tracker in time."""

    def __init__(self, folder: Path, drift: float = 0.0) -> None:
        rng = np.random.default_rng(4)
        arm = random_arm(rng)
        self.arm = replace(arm, backlash=arm.backlash * [1, 0, 0])
        self.folder, self.rng = folder, rng
        states = random_states(N + LATER, rng)
        seen, _ = self.arm.measure(states, rng)
        self.states, self.time = states, np.arange(N + LATER) * 60.0
        share = np.minimum(np.arange(N + LATER) / N, 1.0)[:, None]
        self.seen = seen + share * np.array([drift, -drift, 0.0])
        self.cell = folder / "cell.toml"
        xyz = (TOOL * 1e3).tolist()
        self.cell.write_text(
            f'[robot]\narm = "{NJ.name}"\n[survey]\npoints_mm = [{xyz}]\n'
        )

    def write(
        self,
        name: str,
        rows: slice,
        clock: str = "",
        at: np.ndarray | None = None,
        turn: Rotation | None = None,
        pillars: int = 0,
        shift: float = 0.0,
    ) -> Path:
        """Write rows, in the frame of a tracker, with readings of fixed points."""
        joints = [f"q{j}_deg" for j in range(1, 7)] + [
            f"lambda{j}" for j in range(1, 7)
        ]
        names = ["id", *joints, "x_mm", "y_mm", "z_mm", "reference"]
        lines = [",".join([*names, *([clock] if clock else [])])]

        def place(xyz: np.ndarray) -> str:
            xyz = xyz + shift
            if at is not None and turn is not None:
                xyz = turn.inv().apply(xyz - at)
            return ",".join(f"{v * 1e3:.5f}" for v in xyz)

        span = range(*rows.indices(N + LATER))
        for i, k in enumerate(span):
            moment = {"time_s": self.time[k], "order": float(k)}
            last = f",{moment[clock]:g}" if clock else ""
            if pillars and i in (0, len(span) // 2, len(span) - 1):
                for p in range(pillars):
                    xyz = PILLARS[p] + 1e-5 * self.rng.standard_normal(3)
                    later = f",{moment[clock] + 0.1 + p / 10:g}" if clock else ""
                    lines.append(f"p{p}{k},{',' * 11},{place(xyz)},P{p}{later}")
            angles = ",".join(f"{v:.6f}" for v in np.rad2deg(self.states.q[k]))
            sides = ",".join(f"{v:g}" for v in self.states.direction[k])
            lines.append(f"M{k},{angles},{sides},{place(self.seen[k])},0{last}")
        path = self.folder / name
        path.write_text("\n".join(lines) + "\n")
        return path

    def fit(self, data: Path, *options: str) -> Path:
        model = self.folder / "m.json"
        key = data.read_bytes(), options
        if key not in _fitted:
            found = cli(
                "fit", data, "--cell", self.cell, "-o", model, *EFFECTS, *options
            )
            assert found.exit_code == 0, found.stderr
            _fitted[key] = model.read_bytes()
        model.write_bytes(_fitted[key])
        return model

    def predict(self, data: Path, *options: str):  # type: ignore[no-untyped-def]
        model = self.folder / "m.json"
        return cli("predict", data, "--cell", self.cell, "--model", model, *options)


def left(found) -> float:  # type: ignore[no-untyped-def]
    assert found.exit_code == 0, found.stderr
    return float(RESIDUAL.search(found.stderr)[1])


SURVEY, AFTER = slice(0, N), slice(N, None)


@pytest.mark.parametrize("clock", ["time_s", "order"])
def test_rows_without_a_clock_have_an_unknown_moment(tmp_path, clock) -> None:  # type: ignore[no-untyped-def]
    c = Campaign(tmp_path, drift=2e-4)
    c.fit(c.write("s.csv", SURVEY, clock))
    bare, timed = c.write("bare.csv", AFTER), c.write("timed.csv", AFTER, clock)
    mean, end = (
        c.predict(bare, "--set", "measurements.frame=base", *o)
        for o in ((), ("--set", "measurements.after_survey=true"))
    )
    assert f"no {clock} in the file: tracker_drift at the mean" in mean.stderr
    assert "after_survey of [measurements]" in mean.stderr
    alone = "residuals are those of the arm alone and hold tracker_drift"
    assert alone in c.predict(timed).stderr and alone not in mean.stderr
    assert "after_survey" not in end.stderr
    assert 0.10 < left(mean) < 0.18  # half of the drift
    assert left(end) < 0.07
    assert (
        abs(left(c.predict(timed, "--set", "measurements.frame=base")) - left(end))
        < 1e-3
    )
    held = float(re.search(r"hold ([\d.]+)%", mean.stderr)[1])
    assert held > 75.0  # all of them at the end of the drift


def test_the_survey_itself_has_its_moments(tmp_path) -> None:  # type: ignore[no-untyped-def]
    c = Campaign(tmp_path, drift=2e-4)
    own = c.write("s.csv", SURVEY)
    c.fit(own)
    found = c.predict(own, "--set", "measurements.frame=base")
    assert left(found) < 0.05 and "no order" not in found.stderr


@pytest.mark.parametrize("pillars", [0, 1, 2, 3])
def test_a_file_of_another_station_is_placed(tmp_path, pillars: int) -> None:  # type: ignore[no-untyped-def]
    c = Campaign(tmp_path)
    c.fit(
        c.write("s.csv", SURVEY, "", AT, TURN, pillars),
        "--set",
        "measurements.frame=tracker",
    )
    later = c.write("later.csv", AFTER, "", AWAY, TURNED, pillars)
    found = c.predict(later, "--set", "measurements.frame=tracker")
    assert left(found) < 0.1
    if pillars == 3:
        assert "registered by 3 monuments" in found.stderr
        assert "registered from its own rows the file would leave" in found.stderr
    else:
        assert "read from another station" in found.stderr


def test_fixed_points_show_a_shift_of_the_base(tmp_path) -> None:  # type: ignore[no-untyped-def]
    c = Campaign(tmp_path)
    c.fit(c.write("s.csv", SURVEY, "", None, None, 1))
    bare = c.write("bare.csv", AFTER, shift=5e-4)
    assert left(c.predict(bare, "--set", "measurements.frame=base")) > 0.8
    watched = c.write("watched.csv", AFTER, "", None, None, 1, shift=5e-4)
    found = c.predict(watched, "--set", "measurements.frame=base")
    assert left(found) < 0.06 and "registered by a monument of" in found.stderr


def test_one_file_in_the_set_up_of_the_survey_says_both_errors(tmp_path) -> None:  # type: ignore[no-untyped-def]
    c = Campaign(tmp_path)
    c.fit(c.write("s.csv", SURVEY, "", AT, TURN), "--set", "measurements.frame=tracker")
    found = c.predict(
        c.write("l.csv", AFTER, "", AT, TURN), "--set", "measurements.frame=tracker"
    )
    assert left(found) < 0.06
    assert "in the set-up of the model's survey" in found.stderr
    assert re.search(r"would leave 0\.0\d+ mm .*9 numbers of 180", found.stderr)


@pytest.mark.parametrize("rows", [1, 3, 5])
def test_few_rows_of_another_station_are_refused(tmp_path, rows: int) -> None:  # type: ignore[no-untyped-def]
    c = Campaign(tmp_path)
    c.fit(c.write("s.csv", SURVEY, "", AT, TURN), "--set", "measurements.frame=tracker")
    few = c.write("few.csv", slice(N, N + rows), "", AWAY, TURNED)
    found = c.predict(few, "--set", "measurements.frame=tracker")
    assert found.exit_code == 2 and "Measure 6 poses or more" in found.stderr
    same = c.write("same.csv", slice(N, N + rows), "", AT, TURN)
    assert left(c.predict(same, "--set", "measurements.frame=tracker")) < 0.1


@pytest.mark.parametrize("options", [(), ("--set", "measurements.frame=base")])
def test_rows_in_another_frame_are_refused(tmp_path, options) -> None:  # type: ignore[no-untyped-def]
    c = Campaign(tmp_path)
    c.fit(c.write("s.csv", SURVEY))
    found = c.predict(c.write("l.csv", AFTER, "", AT, TURN), *options)
    assert (
        found.exit_code == 2 and "use --set measurements.frame=tracker" in found.stderr
    )
    assert found.stdout == ""
