"""What differs between two programs, told target by target."""

from __future__ import annotations

import json

import pytest

from postproc.report.diff import TextLines, describe_changes, diff, target_name
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
    found = cli("diff", source, out, "--report", "-")
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
    assert "|c| mm" in found.stdout and "\x1b" not in found.stdout
    assert "2 lines with other numbers, change mean" in found.stdout
    assert found.stdout.rstrip().endswith("visits: 2 corrected")
    (desk.folder / "out.pdl.postproc.json").unlink()
    bare = cli("diff", source, out).stdout  # nobody tells what came of the targets
    assert "change mm" in bare and "corrected" not in bare and "J1-6" not in bare


FAR = "MOVE LINEAR TO POS(9000.0, 0.0, 0.0, 0.0, 175.0, 0.0, '')"


def test_directions_and_statuses_are_those_of_the_report(desk):
    source = desk.put("job.pdl", program(FIRST, POSE, FAR, NEXT))
    out = desk.folder / "out.pdl"
    report = desk.report(source, "-o", out)["targets"]
    found = json.loads(cli("diff", source, out, "--report", "-").stdout)
    told = {row["line"]: row for row in (*found["rows"], *found["uncorrected"])}
    assert sorted(told) == [5, 6, 7, 8] and [
        r["line"] for r in found["uncorrected"]
    ] == [7, 8]
    for row in report:
        mine = told[row["line"]]
        assert mine["direction"] == row["lambda"]
        assert (mine["status"], mine["reason"]) == (row["status"], row["reason"])
        size = sum(c * c for c in row["correction_mm"]) ** 0.5
        assert mine["correction_mm"] == pytest.approx(size, abs=1e-4)
    assert found["counts"]["corrected"] == found["counts"]["rejected"] == 2


def test_a_line_with_several_statuses_counts_its_visits(desk):
    begin = "p := POS(320.0, 120.0, 190.0, 0.0, 175.0, 0.0, '')"
    via = "VIA POS_SHIFT(p, VEC(0, 0, 10))"  # it moves along with p
    arc = f"MOVE CIRCULAR TO POS(300.0, 200.0, 200.0, 0.0, 175.0, 0.0, '') {via}"
    source = desk.put("job.pdl", program(begin, FIRST, "MOVE LINEAR TO p", POSE, arc))
    out = desk.folder / "out.pdl"
    report = desk.report(source, "-o", out)["targets"]
    found = [row["status"] for row in report]
    assert found == ["corrected", "corrected", "corrected", "runtime", "corrected"]
    *others, row = json.loads(cli("diff", source, out, "--report", "-").stdout)["rows"]
    assert not any(other["visits"] for other in others)
    assert row["visits"] == {"runtime": 1, "corrected": 1}
    assert (row["status"], row["reason"]) == ("runtime", report[3]["reason"])
    assert row["correction_mm"] > 0.5 and row["original"] != row["compensated"]
    listed = cli("diff", source, out).stdout
    assert f"runtime: {row['reason']} (1 runtime, 1 corrected)\n" in listed


def test_what_was_left_alone_is_listed_with_its_reason(desk):
    source = desk.put("job.pdl", program(FIRST, FAR))
    out = desk.folder / "out.pdl"
    desk.compensate(source, "-o", out)
    listed = cli("diff", source, out).stdout.partition("\nnot corrected:")[2]
    assert "6  MOVE LINEAR" in listed and "rejected: out of reach" in listed


def test_a_record_of_other_bytes_is_not_believed(desk):
    source = desk.put("job.pdl", program(FIRST, POSE))
    out = desk.folder / "out.pdl"
    desk.compensate(source, "-o", out)
    out.write_bytes(out.read_bytes().replace(b"END job", b"END job --"))
    assert not diff(source, out).counts


def test_a_damaged_record_is_not_believed(desk):
    source = desk.put("job.pdl", program(FIRST, POSE))
    out = desk.folder / "out.pdl"
    desk.compensate(source, "-o", out)
    record = desk.folder / "out.pdl.postproc.json"
    data = json.loads(record.read_text())
    data["files"]["job.pdl" if "job.pdl" in data["files"] else "out.pdl"]["targets"] = {
        "line": "x"
    }
    record.write_text(json.dumps(data))
    assert not diff(source, out).counts and diff(source, out).rows


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


def test_a_file_longer_than_any_program_is_exit_2(pair, monkeypatch):
    monkeypatch.setattr("postproc.files.LARGEST", 20)
    done = cli("diff", *pair(program(FIRST, POSE), program(FIRST, POSE)))
    assert done.exit_code == 2
    assert "is longer than 20 bytes" in done.stderr


def test_trouble_is_exit_2(desk):
    source = desk.put("job.pdl", program(FIRST))
    found = cli("diff", source, desk.folder / "none.pdl")
    assert found.exit_code == 2 and "none.pdl: cannot be read" in found.stderr


LINES = (
    "MOVE LINEAR TO POS({0}, 2.0, 3.0, 4.0, 5.0, 6.0, '') -- to {{3}}",
    "  WP_1:={{{0}, 2, 3, 4, 5, 6}}", "tab[3].x := {0}", "rec.p[{0}] := 4",
    "p1 : POSITION ({0})", "x1 := {0} -- y2 := 3", "WAIT FOR {0}", "  f({0})",
    "MOVEFLY TO p3 WITH $LIN_SPD = {0}", " X: {0} Y: 2 Z: 3", "{0}", "'a b' {0}",
)  # fmt: skip


def lines_of(text: str) -> TextLines:
    return TextLines.of(text.encode("latin-1"))


@pytest.mark.parametrize("line", LINES)
def test_a_line_is_named_as_it_is_by_itself(line) -> None:
    before, after = [line.format(text) for text in ("1.5", "2.25")]
    texts = [lines_of("\n".join([text] * 2)) for text in (before, after)]
    rows = list(describe_changes("a.pdl", *texts, 6))
    assert [row.line for row in rows] == [7, 8]
    assert [row.target for row in rows] == [target_name(before)] * 2
    assert all(row.original != row.compensated for row in rows)


POS = "POS({0}, 2, 3, 4, 5, 6, '')"


@pytest.mark.parametrize(
    ("line", "name"),
    [
        (f"  ELSE: MOVE LINEAR TO {POS}", "MOVE LINEAR"),
        (f"else :MOVE CIRCULAR TO {POS} VIA {POS}", "MOVE CIRCULAR"),
        (f"CASE (1): MOVE LINEAR TO {POS}", "MOVE LINEAR"),
        (f"CASE (1..3, 5) : p1 := {POS}", "p1"),
        (f"CASE('M'):  tab[2].p:={POS}", "tab[2].p"),
        (f"again:: MOVEFLY LINEAR TO {POS} ADVANCE", "MOVEFLY LINEAR"),
        (f"WHEN $DIN[1]+ DO MOVE JOINT TO {POS}", "MOVE JOINT"),
        (f"again:: ELSE: MOVE LINEAR TO {POS}", "MOVE LINEAR"),
        ("CASE ({0}):", "CASE"),
        ("WHEN $DIN[{0}]+ DO", "WHEN DIN"),
        (f"elsewhere := {POS}", "elsewhere"),
        (f"  WP_1 : POSITION ({POS})", "WP_1"),
    ],
)
def test_a_target_is_named_by_its_own_statement(line, name) -> None:
    before, after = [line.format(text) for text in ("1.5", "2.25")]
    (row,) = describe_changes("a.pdl", *map(lines_of, (before, after)), 6)
    assert row.target == target_name(before) == name


def test_numbers_of_krl_have_their_signs(tmp_path):
    one = "DECL E6POS XP1={X 1.0,Y -2.0,Z -0.1,A 0,B 0,C 0,S 2,T 35} ; -1\n"
    two = "XS[1]={X 1,Y 2,Z 3,A 0,B 0,C 0}\nXS[2]={X 1,Y 2,Z 3,A 0,B 0,C 0}\n"
    joints = "PTP {A1 1,A2 -2,A3 3,A4 4,A5 5,A6 6}\n"
    new = one.replace("Z -0.1", "Z 0.2").replace("T 35", "T 34")
    moved = two.replace("Z 3", "Z 7").replace("XS[2]", "XS[3]")
    turned = joints.replace("-2", "-2.5")
    for name, text in (("a.dat", one + two + joints), ("b.dat", new + moved + turned)):
        (tmp_path / name).write_text(text)
    rows = diff(tmp_path / "a.dat", tmp_path / "b.dat").rows
    assert [row.line for row in rows] == [1, 2, 3, 4]
    assert rows[0].original == (1.0, -2.0, -0.1, 0.0, 0.0, 0.0, 2.0, 35.0)
    assert rows[0].compensated[2] == 0.2 and rows[0].target == "XP1"
    assert rows[0].change_mm == pytest.approx(0.3)
    assert rows[1].original[:3] == (1.0, 2.0, 3.0)
    assert rows[1].change_mm == pytest.approx(4.0) and rows[1].target == "XS[1]"
    assert rows[2].text and not rows[2].original  # another element
    assert rows[3].original[1] == -2.0 and rows[3].change_mm is None
