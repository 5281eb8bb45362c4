"""What differs between two programs, told target by target."""

from __future__ import annotations

import json

import pytest

from postproc.diff import diff
from tests.written import FIRST, LISTED, NEXT, POSE, cli, entry, program


@pytest.fixture
def pair(tmp_path):
    def write(before: bytes, after: bytes):
        paths = tmp_path / "a.pdl", tmp_path / "b.pdl"
        for path, data in zip(paths, (before, after), strict=True):
            path.write_bytes(data)
        return paths

    return write


def test_same_files_are_exit_0(pair):
    found = cli("diff", *pair(program(FIRST), program(FIRST)))
    assert found.exit_code == 0 and found.stdout == "the targets are the same\n"


def test_a_compensated_program_is_exit_1_with_a_row_a_target(desk):
    source = desk.put("job.pdl", program(FIRST, "x := 1.5", POSE, NEXT))
    out = desk.folder / "out.pdl"
    report = desk.report(source, "-o", out)
    found = cli("diff", source, out, "--json", "-")
    data = json.loads(found.stdout)
    assert found.exit_code == 1 and data["stamped"]
    assert [row["line"] for row in data["rows"]] == [5, 7, 8]
    for row, told in zip(data["rows"], report["targets"], strict=True):
        assert row["original"][:6] == told["original"]
        assert row["compensated"][:6] == pytest.approx(told["corrected"], abs=1e-9)
    poses = data["rows"][1:], report["targets"][1:]
    for row, told in zip(*poses, strict=True):
        size = sum(c * c for c in told["correction_mm"]) ** 0.5
        assert row["change_mm"] == pytest.approx(size, abs=2e-3)
    assert data["rows"][0]["change_mm"] is None  # of joint angles


def test_the_table_shows_units_lines_and_a_summary(desk):
    source = desk.put("job.pdl", program(FIRST, POSE))
    out = desk.folder / "out.pdl"
    desk.compensate(source, "-o", out)
    found = cli("diff", source, out)
    assert "change [mm]" in found.stdout and "\x1b" not in found.stdout
    assert "2 lines with other numbers, change mean" in found.stdout


def test_variable_files_beside_are_compared_by_entry(desk):
    source = desk.put("job.pdl", program(FIRST, "MOVE LINEAR TO Q",
                                         declared="q : XTNDPOS"))  # fmt: skip
    desk.put("job.lsv", LISTED + entry("q"))
    desk.compensate(source, "-o", desk.folder / "out.pdl")
    rows = diff(source, desk.folder / "out.pdl").rows
    assert [(r.file, r.line, r.target) for r in rows] == [
        ("job.pdl", 5, "MOVE JOINT"), ("job.lsv", 3, "q"),
    ]  # fmt: skip
    assert rows[1].change_mm > 0.1


def test_other_text_is_told_as_text(pair):
    before = program(FIRST, POSE)
    found = diff(*pair(before, before.replace(b"LINEAR", b"JOINT")))
    assert len(found.rows) == 1
    assert found.rows[0].text.startswith("  MOVE LINEAR") and found.rows[0].line == 6


def test_lines_that_came_and_went(pair):
    found = diff(*pair(program(FIRST, POSE), program(FIRST, "y := 2", POSE)))
    assert [(r.line, r.text) for r in found.rows] == [(0, "+   y := 2")]


def test_a_changed_comment_is_no_change_of_numbers(pair):
    found = diff(*pair(program(FIRST + " -- 1.0"), program(FIRST + " -- 2.0")))
    assert len(found.rows) == 1 and found.rows[0].text


def test_trouble_is_exit_2(desk):
    source = desk.put("job.pdl", program(FIRST))
    found = cli("diff", source, desk.folder / "none.pdl")
    assert found.exit_code == 2 and "none.pdl: cannot be read" in found.stderr
