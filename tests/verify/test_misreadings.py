"""Misreadings are found, or change nothing that is compared."""

from __future__ import annotations

import pytest

from tests.verify.faults import FOUND, MISSED, Case
from tests.verify.generated import files_of
from tests.verify.judged import compensated
from tests.verify.misreadings import KINDS, NOTHING, misread

# What a job of lines, arcs and JOINT moves always shows.
PLAIN = {
    "tool_too_long", "tool_left_out", "tool_inverse", "frame_order", "base_left_out",
    "angles_in_other_order", "inches", "speed_unit", "override_left_out",
    "arcs_as_lines", "lines_as_joint_moves", "home_elsewhere", "coupling_made_up",
    "a_link_too_long", "limits_too_narrow", "payload_doubled", "gravity_upward",
    "payload_at_the_flange", "lambda_behind_fly", "lambda_behind_stop",
    "lambda_of_arcs", "all_lambda_turned", "a_joint_off", "swing_too_large",
}  # fmt: skip


@pytest.fixture(scope="module", params=[0, 1, 3, 11])
def one(request, bench_cell, bench_model) -> tuple[int, Case]:
    """A program of a seed; one in four is odd: steps, loops, pages."""
    files = files_of(request.param, bench_cell)
    return request.param, Case.of(compensated(files, bench_cell, bench_model))


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_a_misreading_is_found_or_not_reached(kind, one) -> None:
    seed, case = one
    found = misread(kind, case, seed)
    assert found.came != MISSED, found
    if kind.__name__ in PLAIN and seed % 4 < 3:
        assert found.came == FOUND, found


def test_the_right_reading_agrees(one) -> None:
    _, case = one
    assert case.weigh_rows(case.right).agrees
    assert misread(lambda case, rng: case.right, case, 0).came == NOTHING
