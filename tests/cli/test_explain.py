"""Why a target moves: from where it is reached, each joint's side, the correction."""

from __future__ import annotations

import json

import numpy as np
import pytest

from postproc.compensation import program as planning
from postproc.diagnostics import Code
from postproc.model.effect_sum import INTERACTION
from tests.written import FIRST, NEXT, POSE, cli, program

LOOPED = (
    FIRST,
    "p := POS(120.0, 200.0, 150.0, 0.0, 175.0, 0.0, '')",
    "IF n = 1 THEN",
    POSE,
    "ENDIF",
    "MOVE LINEAR TO p",
    "MOVE TO $HOME",
)


def visits(found):
    assert found.exit_code == 0, found.stderr
    return json.loads(found.stdout)["visits"]


def explained(desk, *options):
    source = desk.put("job.pdl", program(*LOOPED))
    given = ("--cell", desk.cell, "--model", desk.model, "--report", "-")
    return cli("explain", source, *given, *options)


def test_tells_from_where_every_target_is_reached(desk):
    rows = visits(explained(desk))
    assert [r["line"] for r in rows] == [5, 8, 10, 11]
    assert rows[0]["from"] == "start" and rows[1]["from"] == "line 5"
    assert set(rows[2]["from"].split(", ")) == {"line 5", "line 8"}


def test_agrees_with_the_report_of_compensate(desk):
    rows = visits(explained(desk))
    report = desk.report(desk.folder / "job.pdl")["targets"]
    for row, told in zip(rows, report, strict=True):
        assert {k: row[k] for k in told} == told
        assert len(row["travel_deg"]) == 6


def test_a_line_of_numbers_finds_the_visits_that_use_them(desk):
    by_literal, by_move = (visits(explained(desk, "--line", n)) for n in (6, 10))
    assert by_literal == by_move and len(by_move) == 1
    assert by_move[0]["name"].lower() == "p"


def test_a_line_without_target_is_told(desk):
    found = explained(desk, "--line", 7)
    assert found.exit_code == 2 and "job.pdl:7: no target" in found.stderr


def test_the_table(desk):
    source = desk.put("job.pdl", program(FIRST, POSE, NEXT))
    cell = ("--cell", desk.cell)
    plain = cli("explain", source, *cell)
    assert plain.exit_code == 0
    assert "q [deg]" in plain.stdout and "corrected" not in plain.stdout
    full = cli("explain", source, *cell, "--model", desk.model, "--line", 6)
    assert "correction x, y, z [mm]" in full.stdout
    assert full.stdout.splitlines()[1].split()[:4] == ["6", "inline", "line", "5"]
    assert full.stdout.splitlines()[1].endswith("corrected")


def test_the_shares_of_a_line(desk):
    found = explained(desk, "--line", 8)
    (row,) = visits(found)
    shares = row["share_mm"]
    assert {"geometry", "backlash", INTERACTION} <= set(shares)
    source = desk.folder / "job.pdl"
    given = ("--cell", desk.cell, "--model", desk.model, "--line", 8)
    lines = cli("explain", source, *given).stdout.splitlines()
    assert lines[3] == "line 8 from line 5:"
    assert lines[4].split() == ["effect", "share", "mm", "x", "y", "z"]
    table = [line.rsplit(None, 4) for line in lines[5:]]
    numbers = {name: np.array(cells, dtype=float) for name, *cells in table}
    whole = numbers.pop("predicted error")
    assert numbers.keys() == shares.keys()
    sizes = [cells[0] for cells in numbers.values()]
    assert sizes == sorted(sizes, reverse=True)
    for name, (size, *vector) in numbers.items():
        assert shares[name] == pytest.approx(size, abs=1e-4)
        assert size == pytest.approx(np.linalg.norm(vector), abs=2e-4)
    total = sum(cells[1:] for cells in numbers.values())
    np.testing.assert_allclose(total, whole[1:], atol=5e-4)
    np.testing.assert_allclose(whole[1:], -np.array(row["correction_mm"]), atol=0.05)


def test_free_forms_are_told_below_the_error(desk, free_model):
    """And how surely, as the report has it."""
    model = desk.folder / "free.json"
    free_model.save(model)
    source = desk.put("job.pdl", program(FIRST, POSE))
    given = ("--cell", desk.cell, "--model", model, "--line", 6)
    lines = cli("explain", source, *given).stdout.splitlines()
    (row,) = visits(cli("explain", source, *given, "--report", "-"))
    for line, name, key in (
        (lines[-2], "of it free forms", "nonparametric_mm"),
        (lines[-1], "+- free forms", "nonparametric_std_mm"),
    ):
        told, size, *vector = line.rsplit(None, 4)
        assert told == name
        np.testing.assert_allclose(np.array(vector, float), row[key], atol=6e-5)
        assert float(size) == pytest.approx(np.linalg.norm(row[key]), abs=1e-4)
    assert lines[-3].startswith("predicted error")


def test_every_visit_of_a_line_has_its_shares(desk):
    point = "p := POS(120.0, 200.0, 150.0, 0.0, 175.0, 0.0, '')"
    lines = (FIRST, point, "MOVE LINEAR TO p", POSE, "MOVE LINEAR TO p")
    source = desk.put("job.pdl", program(*lines))
    given = ("--cell", desk.cell, "--model", desk.model, "--line", 6)
    found = cli("explain", source, *given).stdout.splitlines()
    assert [line for line in found if line.endswith(":")] == [
        "line 7 from line 5:",
        "line 9 from line 8:",
    ]


def test_without_a_model_there_are_no_shares(desk):
    source = desk.put("job.pdl", program(FIRST, POSE))
    found = cli("explain", source, "--cell", desk.cell, "--line", 6).stdout
    assert len(found.splitlines()) == 2
    rows = visits(cli("explain", source, "--cell", desk.cell, "--report", "-"))
    assert "share_mm" not in rows[0]


@pytest.mark.parametrize("with_model", [True, False])
def test_a_program_is_planned_once(desk, monkeypatch, with_model):
    planned = []

    def counted(*given, plan=planning.plan):
        planned.append(given)
        return plan(*given)

    monkeypatch.setattr(planning, "plan", counted)
    source = desk.put("job.pdl", program(*LOOPED))
    model = ("--model", desk.model) if with_model else ()
    visits(cli("explain", source, "--cell", desk.cell, *model, "--report", "-"))
    assert len(planned) == 1


def test_sides_follow_from_the_way(desk, job_cell):
    there = "MOVE JOINT TO {%s}"
    q = np.array([5.0, 10.0, -95.0, 20.0, 50.0, 30.0])
    ways = np.array([[3.0, -3, 3, -3, 3, -3], [-3.0, -3, 3, 3, -3, -3]])
    lines = [there % ", ".join(f"{v:.2f}" for v in row)
             for row in (q, q + ways[0], q + ways[0] + ways[1])]  # fmt: skip
    source = desk.put("job.pdl", program(*lines))
    rows = visits(cli("explain", source, "--cell", desk.cell, "--report", "-"))
    assert [r["lambda"] for r in rows] == [[0] * 6, *np.sign(ways).tolist()]
    turned = ways[0] * ways[1] < 0
    assert np.allclose(np.array(rows[2]["travel_deg"])[turned], 3.0)


@pytest.mark.parametrize("model", [True, False])
def test_what_was_found_is_told_too(desk, model):
    source = desk.put("job.pdl", program(FIRST, "frobnicate the 3,gripper", POSE))
    given = ["--cell", desk.cell, *(["--model", desk.model] if model else [])]
    said = cli("explain", source, *given).stderr
    assert said.count("job.pdl:6: unknown-statement: ") == 1
    of_line = cli("explain", source, *given, "--line", 7).stderr
    assert "unknown-statement" not in of_line


def test_a_code_is_explained_without_a_program():
    found = cli("explain", "--code", "tool-length")
    assert found.exit_code == 0
    assert found.stdout.splitlines()[0] == "tool-length (warning)"
    assert Code.TOOL_LENGTH.meaning in found.stdout


def test_a_code_that_is_none_is_refused():
    found = cli("explain", "--code", "tool-lenght")
    assert found.exit_code == 2 and "tool-length" in found.stderr
