"""Why a target moves: from where it is reached, each joint's side, the correction."""

from __future__ import annotations

import json

import numpy as np

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
    given = ("--cell", desk.cell, "--model", desk.model, "--json", "-")
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
    assert "q [deg]" in plain.stdout and "safe" not in plain.stdout
    full = cli("explain", source, *cell, "--model", desk.model, "--line", 6)
    assert "correction x, y, z [mm]" in full.stdout
    assert full.stdout.splitlines()[1].split()[:4] == ["6", "inline", "line", "5"]
    assert full.stdout.rstrip().endswith("safe")


def test_sides_follow_from_the_way(desk, job_cell):
    there = "MOVE JOINT TO {%s}"
    q = np.array([5.0, 10.0, -95.0, 20.0, 50.0, 30.0])
    ways = np.array([[3.0, -3, 3, -3, 3, -3], [-3.0, -3, 3, 3, -3, -3]])
    lines = [there % ", ".join(f"{v:.2f}" for v in row)
             for row in (q, q + ways[0], q + ways[0] + ways[1])]  # fmt: skip
    source = desk.put("job.pdl", program(*lines))
    rows = visits(cli("explain", source, "--cell", desk.cell, "--json", "-"))
    assert [r["lambda"] for r in rows] == [[0] * 6, *np.sign(ways).tolist()]
    turned = ways[0] * ways[1] < 0
    assert np.allclose(np.array(rows[2]["travel_deg"])[turned], 3.0)
