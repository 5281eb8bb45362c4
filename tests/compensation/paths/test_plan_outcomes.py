"""Plans of a move under hypotheses: by place, by length, by joints that matter."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from postproc.arrays import Floats, Ints
from postproc.compensation.paths.flank_cases import OF_ALL, FlankCase, FlankCases
from postproc.compensation.paths.plan_outcomes import (
    BEGINS,
    UNDESCRIBED,
    MoveOutcomes,
    Objection,
    Predicted,
    expect_better,
    find_largest,
)
from postproc.compensation.paths.plan_outcomes import compare as compare_moves
from postproc.compensation.solver.expected_error import SIDED
from postproc.model.flank_hypotheses import OPEN, FlankKind, FlankOfJoint
from postproc.model.variance import covariance_of
from postproc.robot.pose import MM

TOLERANCE = 0.1 * MM
WAY = np.linspace(0.0, 0.1, 101)  # [m], a sample a millimetre


class _Known(FlankCases):
    """Cases of one move that were not predicted."""

    def __init__(self, cases: tuple[FlankCase, ...], errs: tuple[float, ...]) -> None:
        vars(self).update(cases=cases, first=np.array([0, len(WAY)]), errs=errs)

    def spread(self, rows: Ints) -> Floats:
        """Let joints move the TCP across the path by what they err by [mm]."""
        columns = np.zeros((len(rows), 3, len(self.errs)))
        columns[:, 1] = np.array(self.errs) * MM
        return covariance_of(columns)

    @property
    def usually(self) -> Floats:
        return np.full(6, 0.55)


def program(off: float, *cases: FlankCase, errs: tuple[float, ...] = ()) -> Any:
    """A program of one move, as far off everywhere."""
    far, ahead = np.full(len(WAY), off * MM), np.tile((1.0, 0.0, 0.0), (len(WAY), 1))
    return SimpleNamespace(
        way=WAY, cases=_Known(cases, errs), tangent=ahead,
        spans_to=lambda v: (np.zeros(len(v), int), np.full(len(v), len(WAY))),
        after=SimpleNamespace(across=far, off=np.outer(far, (0.0, 1.0, 0.0))),
    )  # fmt: skip


def largest(plan: Any, found: MoveOutcomes) -> float:
    """Say how far the move leaves its path at the most."""
    told = Predicted([plan], np.zeros(8, dtype=np.int64))
    return find_largest(told, {(7,): found})[7,]


def compare(plans: tuple[Any, ...], rows: tuple[int], most: float) -> MoveOutcomes:
    """Compare the plans of one move."""
    told = [Predicted([plan], np.zeros(8, dtype=np.int64)) for plan in plans]
    return compare_moves(told, [rows], most)[rows]


def case(joint: int, first: int, last: int, off: float, moved: float) -> FlankCase:
    rows = np.arange(first, last)
    far = np.full(len(rows), off * MM)
    by = np.tile((0.0, moved * MM, 0.0), (len(rows), 1))
    return FlankCase((joint, FlankKind.ELASTIC, 0), 0.25, rows, far, by)


def test_harm_is_counted_place_by_place_and_named() -> None:
    points = program(0.02, case(3, 60, 63, 0.2, 0.2))
    found = compare((program(0.1), points), (7,), TOLERANCE)
    objection = found.objection(1)
    assert objection is not None and objection.place == pytest.approx(0.6)
    assert str(objection) == (
        "it would be worse by 0.10 mm if joint 3 gives way elastically"
    )
    assert "how joint 3 changes its flank" in objection.cure
    assert found.choice == (0, pytest.approx(0.1 * MM))
    assert largest(points, found) == pytest.approx(0.2 * MM)
    assert found.objection(0) is None


@pytest.mark.parametrize(
    ("kind", "cure"),
    [
        (FlankKind.HELD, "where joint 3 carries as much weight"),
        (FlankKind.RAN_ON, "20 % of the speed"),
        (FlankKind.LATER, "survey.reversals"),
    ],
)
def test_an_objection_names_what_would_tell(kind: FlankKind, cure: str) -> None:
    assert cure in Objection(1e-4, 0.5, (3, kind, 0)).cure


@pytest.mark.parametrize(
    ("errs", "choice"), [((0.03,), (1, 0.05)), ((0.03, 0.03), (0, 0.15))]
)
def test_joints_that_err_together_do_what_none_does_alone(
    errs: tuple[float, ...], choice: tuple[int, float]
) -> None:
    """Of each alone 5 % of poses err by more than 0.049 mm, of both by 0.070 mm."""
    plans = program(0.06, errs=errs), program(0.0, errs=errs)
    found = compare(plans, (7,), TOLERANCE)
    assert found.keys == (UNDESCRIBED,)
    assert found.choice == (choice[0], pytest.approx(choice[1] * MM))
    together = SIDED * float(np.hypot.reduce(errs)) * MM
    assert found.plans[1].off[1] == pytest.approx(together)
    assert largest(plans[1], found) == pytest.approx(together)
    usually = abs(0.06 * MM - together)
    assert found.plans[1].worse[1] == pytest.approx(together - usually)
    objection = found.objection(1)
    assert (objection is None) == (len(errs) == 1)
    if objection is not None:
        assert "if the arm errs as no effect of the model describes" in str(objection)
        assert "diagnose" in objection.cure


def test_the_arm_may_err_along_the_longest_axis_across_the_path() -> None:
    columns = np.random.default_rng(1).normal(0.0, 2e-5, (1, 3, 6))
    spread = np.tile(covariance_of(columns), (len(WAY), 1))
    plan = program(0.02)
    vars(plan.cases).update(spread=lambda rows: spread[rows])
    found = compare((program(0.02), plan), (7,), TOLERANCE)
    across = (columns[0] @ columns[0].T)[1:, 1:]
    longest = np.sqrt(np.linalg.eigvalsh(across)[-1])
    assert largest(plan, found) == pytest.approx(0.02 * MM + SIDED * longest)


def test_any_links_may_run_on_together_and_others_not() -> None:
    """Joints 1 and 2 move the TCP the same way, joint 3 back."""
    cases = [case(j, 0, 3, abs(0.02 + by), by)
             for j, by in ((1, 0.1), (2, 0.15), (3, -0.2))]  # fmt: skip
    cases.append(replace(case(1, 0, 3, 0.07, 0.05), key=(1, FlankKind.RAN_ON, OF_ALL)))
    ran_on = [replace(one, key=(one.key[0], FlankKind.RAN_ON, one.key[2]), weight=0.06)
              for one in cases]  # fmt: skip
    for own, most in ((ran_on, 0.27), (ran_on[:3], 0.18)):
        plan = program(0.02, *own)
        found = compare((program(0.02), plan), (7,), TOLERANCE)
        assert largest(plan, found) == pytest.approx(most * MM)


def test_what_the_arm_errs_by_counts_from_a_fifth_of_the_tolerance() -> None:
    for err, counts in ((0.011, False), (0.013, True)):
        plans = program(0.1, errs=(err,)), program(0.02, errs=(err,))
        assert bool(compare(plans, (7,), TOLERANCE).keys) == counts


def test_the_deviation_is_that_of_95_percent_of_the_way() -> None:
    for samples, off in ((3, 0.02), (9, 0.12)):
        points = program(0.02, case(3, 60, 60 + samples, 0.12, 0.2))
        found = compare((program(0.1), points), (7,), TOLERANCE)
        assert found.plans[1].off[1] == pytest.approx(off * MM)
        assert found.objection(1) is None


@pytest.mark.parametrize(
    ("usual_at", "points_at", "harm"),
    [(4, 2, False), (2, 3, False), (80, 2, True), (4, 2 + round(BEGINS / MM), True)],
)
def test_where_a_move_begins_the_largest_deviation_there_counts(
    usual_at: int, points_at: int, harm: bool
) -> None:
    usual = program(0.0)
    usual.after.across[usual_at] = 0.2 * MM
    points = program(0.0, case(1, points_at, points_at + 2, 0.19, 0.2))
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


def test_friction_may_hold_a_gear_against_other_weights() -> None:
    moved = {1.2: np.zeros((5, 3)), 1 / 1.2: np.zeros((5, 3))}
    moved[1.2][1:3, 1], moved[1 / 1.2][3:, 1] = 3e-5, -4e-5

    def hold(factor: float) -> list[tuple[int, Any]]:
        return [(2, lambda _, rows, side: moved[factor][rows])]

    error: Any = lambda _, rows, side: np.zeros((len(rows), 3))  # noqa: E731
    cases = FlankCases(
        SimpleNamespace(side=np.zeros((5, 6))), _Holds(error, hold), np.zeros((5, 3)),
        np.tile([1.0, 0.0, 0.0], (5, 1)), np.linspace(0.0, 0.1, 5), np.array([0, 5]),
    )  # fmt: skip
    held, weighed = cases._of_friction()
    assert held.key == (2, FlankKind.HELD, 0)
    assert weighed.key == (2, FlankKind.WEIGHED, 0)
    assert held.weight > OPEN and weighed.weight > OPEN
    np.testing.assert_array_equal(held.rows, [1, 2])
    np.testing.assert_array_equal(weighed.rows, [3, 4])
    np.testing.assert_allclose(weighed.across, 4e-5)


class _Holds:
    """An error, and others if friction holds other weights."""

    def __init__(self, error: Any, hold: Any) -> None:
        self.hold, self._error = hold, error

    def __call__(self, *given: Any) -> Floats:
        return np.array(self._error(*given))


def test_links_that_run_on_at_stops_are_pushed_together_on_the_way() -> None:
    side = np.tile([1.0, -1.0, 1.0, 0.0, 0.0, 0.0], (5, 1))
    by_joint = np.zeros((6, 3))
    by_joint[:3, 1] = 1e-5, 2e-5, 4e-5
    run: Any = SimpleNamespace(side=side, least=side, most=side)
    error: Any = lambda _, rows, there: there @ by_joint  # noqa: E731
    cases = FlankCases(
        run, _Holds(error, lambda _: []), np.zeros((5, 3)),
        np.tile([1.0, 0.0, 0.0], (5, 1)), np.linspace(0.0, 0.1, 5), np.array([0, 5]),
    )  # fmt: skip
    kinds = [kind for kind in FlankKind if kind is not FlankKind.START]
    pushed, still = (
        FlankOfJoint(dict.fromkeys(kinds, 0.0) | own, 1.0, (1.0, 4.0))
        for own in ({FlankKind.PUSHED: 0.24}, {})
    )
    vars(cases).update(_flanks=(pushed, still, pushed, *[still] * 3))
    assert {kind for _, kind, _ in cases.by_key} == {FlankKind.PUSHED}
    assert [(joint, k) for joint, _, k in cases.by_key] == [(1, 0), (3, 0), (1, -1)]
    far = [case.across.max() for case in cases.cases]
    assert far == pytest.approx([2e-5, 8e-5, 1e-4])


def test_a_case_keeps_its_key_where_others_make_no_difference() -> None:
    """One joint rests in the middle, where it is pushed to neither flank."""
    side = np.tile([0.0, -1.0, 1.0, 0.0, 0.0, 0.0], (5, 1))
    run: Any = SimpleNamespace(side=side, least=side, most=side)
    error: Any = lambda _, rows, there: there[:, :3] * 1e-5  # noqa: E731
    cases = FlankCases(
        run, _Holds(error, lambda _: []), np.zeros((5, 3)),
        np.tile([1.0, 0.0, 0.0], (5, 1)), np.linspace(0.0, 0.1, 5), np.array([0, 5]),
    )  # fmt: skip
    kinds = [kind for kind in FlankKind if kind is not FlankKind.START]
    weight = dict.fromkeys(kinds, 0.0) | {FlankKind.PUSHED: 0.24}
    vars(cases).update(_flanks=(FlankOfJoint(weight, 1.0, (1.0, 4.0)),) * 6)
    together = (1, FlankKind.PUSHED, OF_ALL)
    assert list(cases.by_key) == [
        (2, FlankKind.PUSHED, 0), (3, FlankKind.PUSHED, 0), together,
    ]  # fmt: skip
