"""The verdict on a program: the worst target first, and what was not corrected."""

from __future__ import annotations

import json

import numpy as np
import pytest

from postproc.compensation.findings.headline import (
    ProgramErrors,
    headline,
    list_exceptions,
)
from postproc.compensation.findings.tolerance import check_tolerance
from postproc.compensation.solver.expected_error import ErrorLaws, expect_errors
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language.text.stamp import read_stamp
from postproc.language.visits import Meaning
from postproc.model.model import Prediction
from tests.made_visits import visits as made_visits
from tests.written import FIRST, NEXT, POSE, cli, program

N = 40
LIMIT = Reason(Code.JOINT_LIMIT_EXCEEDED, "joint 2 would leave its range")


def errors_of(kept=(), unknown=(), tolerance=None, side=()):
    """A program whose targets are 1.7 mm off, all but some corrected."""
    error = np.tile([1.7e-3, 0.0, 0.0], (N, 1))
    error[list(unknown)] = np.nan
    left = np.isin(np.arange(N), kept)
    covariance = np.hstack([np.full((N, 3), 1e-10), np.zeros((N, 3))])
    told = Prediction(error, np.full((N, 3), 1e-5), covariance, {})
    correction = np.where(left[:, None], 0.0, -np.nan_to_num(error))
    every = np.ones(N, dtype=bool)
    expected = expect_errors(ErrorLaws.of(told, 1.0, correction, every), every)
    check = None
    if tolerance is not None:
        check = check_tolerance(expected, np.full(N, tolerance * 1e-3))
    resting = np.ones((N, 6))
    resting[list(side), 4] = 0.2
    visits = made_visits(
        [Meaning.POSE] * N, [[0.0] * 6] * N, line=np.arange(N) + 10,
        names=("", "p_3"), name=left.astype(int),
    )  # fmt: skip
    return ProgramErrors(
        visits, ~left, left, left.astype(int), (NO_REASON, LIMIT), resting, expected,
        check,
    )  # fmt: skip


def test_the_headline_is_the_expected_true_error():
    found = headline(errors_of())
    assert found.before_mm == pytest.approx(1.7, rel=0.01) and found.first == ""
    assert 0.005 < found.after_mm < 0.03 < 0.05 > found.below_mm > found.after_mm
    # Mean, 95 % of all arrivals, 95 % bound of the worst target: each is larger.
    assert found.below_mm <= found.bound_mm and found.largest_mm < found.bound_mm
    assert str(found) == (
        f"expected true error mean 1.700 -> {found.after_mm:.3f} mm, 95 % of arrivals "
        f"within {found.below_mm:.3f} mm, worst target within {found.bound_mm:.3f} mm "
        "(its 95 % bound)"
    )


def test_a_target_that_was_not_corrected_comes_first_with_line_and_reason():
    program_errors = errors_of(kept=[7])
    found = headline(program_errors)
    assert found.first.startswith("worst target job.pdl:17 p_3: 1.700 mm expected")
    assert found.first.endswith(f"not corrected, {LIMIT}")
    assert found.verdict().startswith("Worst target job.pdl:17")
    assert [one.row for one in list_exceptions(program_errors)] == [7]


def test_exceptions_are_those_that_do_not_pass_where_there_is_a_tolerance():
    program_errors = errors_of(kept=[3], unknown=[5], tolerance=0.1, side=[6])
    found = list_exceptions(program_errors)
    assert [one.row for one in found] == [5, 3]  # what is not known comes first
    assert found[0].size() == "error not known"
    told = headline(program_errors).verdict(program_errors.tolerance)
    assert told.startswith(
        "2 of 40 targets do not pass the tolerance of 0.1 mm: 1 fail"
    )
    tight = errors_of(tolerance=0.001, side=[6])
    reasons = {one.row: one.reason.code for one in list_exceptions(tight)}
    assert reasons[6] is Code.DIRECTION_UNCERTAIN and reasons[0] is None


def test_nothing_corrected_is_said():
    found = headline(errors_of(kept=range(N)))
    assert str(found).startswith("nothing was corrected; expected true error mean 1.7")
    assert found.verdict().startswith("Nothing was corrected.")
    assert "->" not in str(found)


def test_nothing_is_stamped_where_nothing_was_corrected(desk):
    place, out = desk.folder / "job.pdl", desk.folder / "o.pdl"
    place.write_bytes(program(FIRST, POSE, NEXT))
    given = ("--cell", desk.cell, "--model", desk.model, "-o", out)
    text = desk.cell.read_text()
    assert "[limits]" not in text
    tight = desk.cell.with_name("tight.toml")
    tight.write_text(text + "\n[limits]\ncorrection_mm = 0.0001\n")
    done = cli("compensate", place, "--cell", tight, *given[2:])
    assert done.exit_code == 1 and "nothing was corrected" in done.stderr
    assert out.read_bytes() == place.read_bytes()
    assert cli("restore", out, "-o", desk.folder / "back.pdl").exit_code == 0
    assert (desk.folder / "back.pdl").read_bytes() == place.read_bytes()
    assert cli("compensate", place, *given).exit_code == 0
    assert read_stamp(out.read_bytes()) is not None


def test_the_cell_has_a_tolerance_that_records_and_checks_pass_on(desk):
    place, tree = desk.folder / "job.pdl", desk.folder / "tree"
    tree.mkdir()
    place.write_bytes(program(FIRST, POSE, NEXT))
    given = ("--cell", desk.cell, "--model", desk.model, "-o", tree / "job.pdl")
    report = desk.folder / "r.json"
    tight = ("--set", "job.tolerance_mm=0.0001", "--report", report)
    done = cli("compensate", place, *given, *tight)
    assert done.exit_code == 1
    data = json.loads(report.read_bytes())
    assert data["tolerance"]["tolerance_mm"] == 0.0001
    assert data["expected"]["exceptions_count"] >= 1
    assert {"expected_mm", "bound_95_mm"} <= data["targets"][0].keys()
    checked = cli("check", tree)
    assert checked.exit_code == 1 and "tolerance-missed" in checked.stderr
    assert cli("compensate", place, *given).exit_code == 0
    assert cli("check", tree).exit_code == 0
