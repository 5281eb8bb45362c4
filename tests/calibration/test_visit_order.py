"""The order of visits: from column order, from time_s, or that of the rows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.calibration.measurements import (
    Measurements,
    concatenate,
    read_survey_file,
)
from postproc.exceptions import MeasurementError
from postproc.model.effects.thermal import Thermal
from postproc.model.effects.tracker_drift import TrackerDrift
from postproc.model.kinematics import ArmStates
from tests.calibration.simulator import NJ, TOOL, random_states

N = 40
RNG = np.random.default_rng(3)
Q = np.rad2deg(random_states(N, RNG).q)
TIME = np.cumsum(RNG.uniform(5.0, 20.0, N))
SHUFFLED = RNG.permutation(N)


def written(path: Path, rows: np.ndarray, **columns: np.ndarray) -> Path:
    """Write rows of the survey, in some order, with some columns of numbers."""
    names = ["id", *(f"q{j}_deg" for j in range(1, 7)), "x_mm", "y_mm", "z_mm"]
    lines = [",".join([*names, *columns])]
    for k in rows:
        cells = [f"M{k}", *(f"{v:.6f}" for v in Q[k]), "1", "2", f"{k % 7}"]
        lines.append(",".join([*cells, *(f"{c[k]:g}" for c in columns.values())]))
    path.write_text("\n".join(lines) + "\n")
    return path


def read(path: Path) -> Measurements:
    return read_survey_file(path, NJ, TOOL[None])


@pytest.fixture
def right(tmp_path: Path) -> Measurements:
    return read(written(tmp_path / "right.csv", np.arange(N)))


ROWS = {
    "newest first": np.arange(N)[::-1],
    "by chance": SHUFFLED,
    "by the first joint": np.argsort(Q[:, 0]),
    "two blocks swapped": np.r_[N // 2 : N, 0 : N // 2],
    "as measured": np.arange(N),
}
CLOCKS = {
    "time": {"time_s": TIME},
    "order": {"order": np.arange(N) * 1.0},
    "order with gaps": {"order": np.arange(N) * 3.0 + 7},
    "both": {"time_s": TIME, "order": np.arange(N) + 1.0},
    "both, times of stops": {"time_s": TIME // 60 * 60, "order": np.arange(N) + 1.0},
}


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("rows", ROWS)
def test_directions_follow_the_clock(
    tmp_path: Path, right: Measurements, rows: str, clock: str
) -> None:
    found = read(written(tmp_path / "s.csv", ROWS[rows], **CLOCKS[clock]))
    assert found.ids == right.ids
    np.testing.assert_array_equal(found.states.direction, right.states.direction)
    name = "order" if "order" in CLOCKS[clock] else "time_s"
    assert f"directions inferred from {name}" in found.warnings[0]
    assert "sorted" not in found.warnings[0]
    assert sorted(found.line) == list(range(2, N + 2))


def test_order_becomes_the_place_in_the_visit_order(tmp_path: Path) -> None:
    order = np.arange(N) * 3.0 + 7
    found = read(written(tmp_path / "s.csv", SHUFFLED, order=order))
    np.testing.assert_array_equal(found.states.order, order)
    assert found.line[int(SHUFFLED[0])] == 2


NO_CLOCK = {
    "times all the same": {"time_s": np.zeros(N)},
    "none": {},
}


@pytest.mark.parametrize("clock", NO_CLOCK)
def test_without_a_clock_the_rows_count(
    tmp_path: Path, right: Measurements, clock: str
) -> None:
    found = read(written(tmp_path / "s.csv", np.arange(N), **NO_CLOCK[clock]))
    assert found.ids == right.ids
    assert "the order of the rows" in found.warnings[0]
    assert "add a column time_s or order" in found.warnings[0]


REFUSED = {
    "a clash": ({"time_s": TIME, "order": N - np.arange(N)}, "order and time_s disag"),
    "a clash at one row": (
        {"time_s": TIME, "order": np.where(np.arange(N) == 9, 55.0, np.arange(N))},
        "order and time_s disagree",
    ),
    "a place twice": ({"order": np.maximum(np.arange(N) - 1.0, 0)}, "also in line 2"),
    "a clock that began again": (
        {"time_s": np.r_[TIME[: N // 2], TIME[: N - N // 2]]}, "Did the clock begin",
    ),
    "a clock that began again, newest first": (
        {"time_s": np.r_[TIME[: N // 2], TIME[: N - N // 2]][::-1]}, "Did the clock",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_a_clash_of_clocks_is_asked_about(tmp_path: Path, name: str) -> None:
    columns, problem = REFUSED[name]
    path = written(tmp_path / "s.csv", np.arange(N), **columns)
    with pytest.raises(MeasurementError, match=problem) as refused:
        read(path)
    assert str(path) in str(refused.value)


def test_an_order_through_several_files_is_kept(
    tmp_path: Path, right: Measurements
) -> None:
    order = {"order": np.arange(N) * 1.0}
    a = read(written(tmp_path / "a.csv", np.arange(0, N, 2), **order))
    b = read(written(tmp_path / "b.csv", np.arange(1, N, 2), **order))
    joint = concatenate([a, b])
    assert joint.ids == right.ids
    np.testing.assert_array_equal(joint.states.order, np.arange(N))


def test_an_order_of_each_file_counts_file_by_file(tmp_path: Path) -> None:
    half = {"order": np.arange(N) % (N // 2) + 1.0}
    a = read(written(tmp_path / "a.csv", np.arange(N // 2), **half))
    b = read(written(tmp_path / "b.csv", np.arange(N // 2, N), **half))
    np.testing.assert_array_equal(concatenate([a, b]).states.order, np.arange(N) + 1.0)


@pytest.mark.parametrize(("sign", "asked"), [(1.0, False), (-1.0, True)])
def test_directions_against_all_ways_are_asked_about(
    tmp_path: Path, right: Measurements, sign: float, asked: bool
) -> None:
    side = {
        f"lambda{j + 1}": sign * right.states.direction[:, j] + 0.0 for j in range(6)
    }
    found = read(written(tmp_path / "s.csv", np.arange(N), **side))
    assert any("opposite to the motion" in w for w in found.warnings) == asked


# Rows whose moment is unknown.


def test_a_drift_without_a_clock_is_its_mean_with_its_spread() -> None:
    rng = np.random.default_rng(0)
    states = random_states(5, rng).with_(time=np.full(5, 100.0))
    drift = TrackerDrift(0.0, 1000.0, "time")
    p = np.array([q.scale for q in drift.parameters()]) * rng.standard_normal(18)
    lost = drift.without_clock(["order"])
    at = ArmStates(NJ, states)
    moments = [
        drift.displacement(ArmStates(NJ, states.with_(time=np.full(5, t))), p)
        for t in np.linspace(0.0, 1000.0, 101)
    ]
    np.testing.assert_allclose(lost.displacement(at, p), np.mean(moments, axis=0))
    spread = lost.moment_variance(at, p)
    assert spread is not None
    np.testing.assert_allclose(spread, np.var(moments, axis=0))
    assert drift.without_clock(["time"]) is drift
    assert drift.moment_variance(at, p) is None
    unknown = ArmStates(NJ, states.with_(time=np.full(5, np.nan)))
    np.testing.assert_allclose(drift.displacement(unknown, p), np.mean(moments, axis=0))


def test_a_drift_after_the_survey_is_that_of_its_end() -> None:
    drift = TrackerDrift(0.0, 100.0, "order")
    states = random_states(3, np.random.default_rng(0))
    p = np.array([q.scale for q in drift.parameters()])
    late = [states.with_(order=np.full(3, o)) for o in (100.0, 1e9)]
    moved = [drift.displacement(ArmStates(NJ, s), p) for s in late]
    np.testing.assert_allclose(*moved)


def test_a_warm_up_of_the_survey_is_its_mean_and_the_arms_stays() -> None:
    warming = Thermal(form="time", clock="order", time_constant=10.0, level=0.3)
    lost = warming.without_clock(["time"])
    at = ArmStates(NJ, random_states(4, np.random.default_rng(0)))
    p = np.full(len(warming.parameters()), 1e-4)
    assert np.abs(lost.displacement(at, p)).max() == 0.0
    spread = lost.moment_variance(at, p)
    assert spread is not None and spread.max() > 0
    arms = replace(warming, clock="time", told=True)
    assert arms.without_clock([]) is arms


def test_an_empty_cell_is_no_visit(tmp_path: Path) -> None:
    path = written(tmp_path / "some.csv", np.arange(3), visit=np.array([4, 5, 4]))
    assert read(path).visit.tolist() == [0, 1, 0]  # type: ignore[union-attr]
    path.write_text(path.read_text().replace(",5\n", ",\n"))
    visit = read(path).visit
    assert visit is not None and visit[1] == -1 and visit[0] == visit[2] >= 0
