"""Plans of a move under hypotheses: by place, by length, by joints that matter."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from postproc.arrays import Floats
from postproc.compensation.paths.flank_cases import FlankCase, FlankCases
from postproc.compensation.paths.plan_outcomes import (
    BEGINS,
    MoveOutcomes,
    Predicted,
    expect_better,
)
from postproc.compensation.paths.plan_outcomes import compare as compare_moves
from postproc.model.flank_hypotheses import FlankKind, FlankOfJoint
from postproc.robot.pose import MM

TOLERANCE = 0.1 * MM
WAY = np.linspace(0.0, 0.1, 101)  # [m], a sample a millimetre


class _Known(FlankCases):
    """Cases of one move that were not predicted."""

    def __init__(self, cases: tuple[FlankCase, ...]) -> None:
        vars(self).update(cases=cases, first=np.array([0, len(WAY)]))

    @property
    def usually(self) -> Floats:
        return np.full(6, 0.55)


def program(off: float, *cases: FlankCase) -> Any:
    """A program of one move, as far off everywhere."""
    far = np.full(len(WAY), off * MM)
    return SimpleNamespace(
        way=WAY, cases=_Known(cases), tangent=np.tile((1.0, 0.0, 0.0), (len(WAY), 1)),
        spans_to=lambda v: (np.zeros(len(v), int), np.full(len(v), len(WAY))),
        after=SimpleNamespace(across=far, off=np.outer(far, (0.0, 1.0, 0.0))),
    )  # fmt: skip


def compare(plans: tuple[Any, ...], rows: tuple[int], most: float) -> MoveOutcomes:
    """Compare the plans of one move."""
    told = [Predicted([plan], np.zeros(8, dtype=np.int64)) for plan in plans]
    return compare_moves(told, [rows], most)[rows]


def case(joint: int, first: int, last: int, off: float, moved: float) -> FlankCase:
    rows = np.arange(first, last)
    far = np.full(len(rows), off * MM)
    by = np.tile((0.0, moved * MM, 0.0), (len(rows), 1))
    return FlankCase(joint, FlankKind.ELASTIC, 0.25, rows, far, by)


def test_harm_is_counted_place_by_place_and_named() -> None:
    found = compare(
        (program(0.1), program(0.02, case(3, 60, 63, 0.2, 0.2))), (7,), TOLERANCE
    )
    objection = found.objection(1)
    assert objection is not None and objection.place == pytest.approx(0.6)
    assert str(objection) == (
        "it would be worse by 0.10 mm if joint 3 gives way elastically"
    )
    assert "how joint 3 changes its flank" in objection.cure
    assert found.choice == (0, pytest.approx(0.1 * MM))
    assert found.worst == pytest.approx(0.2 * MM)
    assert found.objection(0) is None


def test_the_deviation_is_that_of_95_percent_of_the_way() -> None:
    for samples, off in ((3, 0.02), (9, 0.12)):
        points = program(0.02, case(3, 60, 60 + samples, 0.12, 0.2))
        found = compare((program(0.1), points), (7,), TOLERANCE)
        assert found.plans[1].off[1] == pytest.approx(off * MM)
        assert found.objection(1) is None


def test_where_a_move_begins_its_largest_deviation_counts() -> None:
    usual = program(0.0)
    usual.after.across[80] = 0.2 * MM
    for first, harm in ((2, False), (2 + round(BEGINS / MM), True)):
        points = program(0.0, case(1, first, first + 2, 0.19, 0.2))
        found = compare((usual, points), (7,), TOLERANCE).objection(1)
        assert (found is not None) == harm


def test_joints_with_small_steps_never_speak_against_a_plan() -> None:
    for moved, counts in ((0.014, False), (0.03, True)):
        points = program(0.02, case(5, 60, 63, 0.2, moved))
        found = compare((program(0.1), points), (7,), TOLERANCE)
        assert bool(found.keys) == counts


def test_points_elsewhere_are_expected_to_move_the_path_evenly() -> None:
    plans = program(0.16), program(0.12)
    told = Predicted([plans[1]], np.zeros(8, dtype=np.int64))
    known = {(7,): compare(plans, (7,), TOLERANCE)}
    for moved, better in ((-0.1, [(7,)]), (-0.01, [(7,)]), (0.1, [])):
        by = np.outer((moved, moved, moved), (0.0, 1.0, 0.0)) * MM
        found = expect_better(told, [(np.array([0.0, 0.4, 1.0]), by)], known)
        assert found == better
    by[1] *= 3.0  # at one point only: 95 % of the way are off as before
    assert not expect_better(told, [(np.array([0.0, 0.4, 1.0]), by)], known)


def test_links_that_run_on_at_stops_are_pushed_together_on_the_way() -> None:
    side = np.tile([1.0, -1.0, 1.0, 0.0, 0.0, 0.0], (5, 1))
    by_joint = np.zeros((6, 3))
    by_joint[:3, 1] = 1e-5, 2e-5, 4e-5
    run: Any = SimpleNamespace(side=side, least=side, most=side)
    error: Any = lambda _, rows, there: there @ by_joint  # noqa: E731
    cases = FlankCases(
        run, error, np.zeros((5, 3)),
        np.tile([1.0, 0.0, 0.0], (5, 1)), np.linspace(0.0, 0.1, 5), np.array([0, 5]),
    )  # fmt: skip
    kinds = [kind for kind in FlankKind if kind is not FlankKind.START]
    pushed, still = (
        FlankOfJoint(dict.fromkeys(kinds, 0.0) | own, 1.0, (1.0, 4.0))
        for own in ({FlankKind.PUSHED: 0.24}, {})
    )
    vars(cases).update(_flanks=(pushed, still, pushed, *[still] * 3))
    assert {case.kind for case in cases.cases} == {FlankKind.PUSHED}
    assert [case.joint for case in cases.cases] == [1, 3, 1]
    far = [case.across.max() for case in cases.cases]
    assert far == pytest.approx([2e-5, 8e-5, 1e-4])
    assert cases._keys[-1] == (1, FlankKind.PUSHED, 1)
