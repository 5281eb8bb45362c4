"""Only windows that a plan changes are predicted, and as the whole program is."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.compensation.paths import (
    changed_windows,
    insertion_loop,
    insertion_prediction,
)
from postproc.compensation.paths.changed_windows import Windows, _find_run_ups
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.compensation.paths.insertion_prediction import PathPrediction
from postproc.robot.pose import MM
from tests.compensation.paths.test_insertion_loop import (
    STOPS,
    TOLERANCE,
    compensated,
    shop,
)

__all__ = ["shop"]
ALONE = 1e-3 * MM  # by how much a window may differ that is predicted alone
NUMBER = re.compile(r"-?\d+\.\d+")
HIT = 5e-3  # [mm] as near as rounded points are hit, by the rounds that others take too


@pytest.fixture
def in_windows(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Predict in windows whatever changes, two at once; count what is."""
    counted: list[int] = []
    taken = changed_windows.take_windows

    def count(reading, own, inside, seeds, q):  # type: ignore[no-untyped-def]
        counted.append(int(inside.sum()))
        return taken(reading, own, inside, seeds, q)

    name = "postproc.compensation.paths.insertion_prediction.take_windows"
    monkeypatch.setattr(name, count)
    monkeypatch.setattr(changed_windows, "MOST", 1.0)
    monkeypatch.setattr(insertion_prediction, "AT_ONCE", 2)
    return counted


@pytest.mark.parametrize("name", ["points", "stops"])
def test_the_output_is_that_of_whole_predictions(
    shop: Path, in_windows: list[int], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    more = ("--set", STOPS) if name == "stops" else ()
    asked = ("--path-tolerance", TOLERANCE, *more)
    compensated(shop, "job.pdl", f"windows-{name}", *asked)
    assert in_windows, "nothing was predicted in windows"
    monkeypatch.setattr(changed_windows, "MOST", -1.0)
    count = len(in_windows)
    compensated(shop, "job.pdl", f"whole-{name}", *asked)
    assert len(in_windows) == count
    own, other = (
        (shop / f"{kind}-{name}.pdl").read_text() for kind in ("windows", "whole")
    )
    assert NUMBER.sub("", own) == NUMBER.sub("", other)
    numbers = [np.array(NUMBER.findall(text), dtype=float) for text in (own, other)]
    np.testing.assert_allclose(*numbers, rtol=0.0, atol=HIT)


def test_windows_come_out_as_in_the_whole_program(
    shop: Path, in_windows: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[PathPrediction] = []

    def look(now: PathPrediction) -> PathPrediction:
        if now.plan.points:
            found.append(now)
        return now.whole()

    monkeypatch.setattr(insertion_loop, "judge", look)
    compensated(shop, "job.pdl", "looked", "--path-tolerance", TOLERANCE)
    (now,) = found
    assert now.written is None and len(now.parts) > 1
    whole = now.task.predict_whole(now.plan)
    assert now.sizes.keys() == whole.sizes.keys()
    for v, size in now.sizes.items():
        assert size == pytest.approx(whole.sizes[v], abs=ALONE)
    assert now.refusals == whole.refusals and now.flat.keys() == whole.flat.keys()


@pytest.fixture
def predicted(
    shop: Path, in_windows: list[int], monkeypatch: pytest.MonkeyPatch
) -> PathPrediction:
    """Predict the job in windows, and do not write it yet."""
    found: list[PathPrediction] = []

    def look(now: PathPrediction) -> PathPrediction:
        found.append(now)
        return now

    monkeypatch.setattr(insertion_loop, "judge", look)
    compensated(shop, "job.pdl", "looked", "--path-tolerance", TOLERANCE)
    return found[-1]


def test_what_is_written_is_what_the_windows_told(predicted: PathPrediction) -> None:
    whole = predicted.whole()
    assert whole.parts is predicted.parts and whole.sizes == predicted.sizes
    paths = whole.in_time.paths
    assert dict(zip(paths.visit, paths.after.sizes, strict=True)) == predicted.sizes
    assert paths.unknown == predicted.task.first.paths.unknown
    moved = whole.program.kept.corrected
    assert moved.sum() == len(whole.program.kept.after) > len(predicted.task.visits) / 2


@pytest.mark.parametrize("shift", [0.0, 1e-4])
def test_all_of_it_is_corrected_where_joints_arrive_otherwise(
    predicted: PathPrediction, shift: float
) -> None:
    last = predicted.parts[-1]
    cycle = last.in_time.after
    path = replace(cycle.path, q=cycle.path.q + shift)
    in_time = replace(last.in_time, after=replace(cycle, path=path))
    parts = (*predicted.parts[:-1], replace(last, in_time=in_time))
    whole = replace(predicted, parts=parts).whole()
    assert (whole.parts is parts) == (shift == 0.0)


def test_all_of_it_is_corrected_where_windows_want_other_numbers(
    predicted: PathPrediction,
) -> None:
    last = predicted.parts[-1]
    row = int(np.flatnonzero(last.kept.corrected)[-1])
    values = np.array(last.decisions.corrected)
    literal = np.array(last.visits.target.literal)
    literal[row] = -1  # what it wants is not written
    visits = last.visits.with_columns(literal=literal)
    assert (values[row] != visits.target.values[row]).any()
    parts = (*predicted.parts[:-1], replace(last, visits=visits))
    whole = replace(predicted, parts=parts).whole()
    assert whole.parts is not parts


def test_a_run_up_lets_every_joint_turn_by_its_gap() -> None:
    q = np.zeros((6, 6))
    q[:, :] = np.array([0.0, 1.0, 1.0, 1.05, 1.05, 2.0])[:, None]
    q[:, 5] = 0.0  # a joint that never turns tells nothing
    need = np.array([0.1] * 5 + [-1.0])
    np.testing.assert_array_equal(_find_run_ups(q, need, None), [0, 1, 2, 3, 4, 1])
    assert not _find_run_ups(q, np.full(6, 0.1), None).any()
    long = np.full(q.shape, 1.5)
    assert _find_run_ups(q[:, :5], need[:5], long[:, :5]).tolist() == [0, 0, 0, 0, 0, 5]


def windows(end: list[int], lead: list[int]) -> Windows:
    """Make windows of a program whose arm stands still."""
    column = [np.array(one, dtype=np.int64) for one in (end, lead)]
    return Windows(column[0], column[1], np.zeros((end[-1] + 1, 6)))


def test_a_window_is_predicted_again_if_its_run_up_changes() -> None:
    cut = windows([1, 3, 5, 8], [-1, -1, 1, 5])
    plan = InsertionPlan(points={3: (0.5,)})
    assert cut.list_keys(plan).keys() == {1, 2}
    other = cut.list_keys(InsertionPlan(points={3: (0.5,)}, stops=frozenset({3})))
    assert other.keys() == {1, 2} and other[1] != cut.list_keys(plan)[1]


def test_run_ups_are_taken_with_their_windows() -> None:
    cut = windows([1, 3, 5, 8, 9], [-1, -1, 1, 3, 8])
    inside, seeds = cut.cover([2])
    assert np.flatnonzero(inside).tolist() == [2, 3, 4, 5] and seeds.tolist() == [1]
    inside, seeds = cut.cover([0, 4])
    assert np.flatnonzero(inside).tolist() == [0, 1, 9] and seeds.tolist() == [8]
