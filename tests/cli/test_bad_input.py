"""Bad input: exit 2 or a listed target; file, line, cure; nothing half written."""

from __future__ import annotations

import csv
import errno
import json
import os
import re
import resource
import subprocess
import sys
from resource import setrlimit

import pytest

from postproc.files import TEMPORARY
from tests.written import FIRST, LISTED, NEXT, POSE, cli, entry, program

LOOSE = "MOVE JOINT TO POS(100.0, 200.0, 150.0, 0.0, 175.0, 0.0, 'S E W')"


def refused(found, said):
    """Check that a command ended with 2 and one message, and printed no result."""
    assert found.exit_code == 2, found.stderr
    assert re.search(said, found.stderr), found.stderr
    assert "Traceback" not in found.stderr and found.stdout == ""


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", r"job\.pdl: the file is empty\. Give"),
        (b" \r\n\r\n", r"job\.pdl: the file is empty"),
        (b"id;x_mm;y_mm\n1;2;3\n", r"job\.pdl: the file holds no BEGIN .* Give"),
        (bytes(range(256)) * 9, r"job\.pdl:1: the file is binary .*compiled"),
        ("PROGRAM x\nBEGIN\nEND x".encode("utf-16"), r"job\.pdl:1: .*8-bit"),
        (
            program(FIRST, "s := 'abc", POSE),
            r"job\.pdl:6: a string is not .*Close",
        ),
        (program("MOVE LINEAR TO POS(1, 2, 3, 4, 5, 6, '"), r"job\.pdl:5: a string"),
    ],
    ids=["empty", "blank", "table", "binary", "utf-16", "string", "configuration"],
)
def test_a_file_that_is_no_program_text(desk, data, said):
    refused(desk.compensate(desk.put("job.pdl", data)), said)
    assert desk.names() == {"job.pdl"}
    refused(desk.compensate("-", stdin=data), said.replace("job", "stdin"))


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("none.pdl", r"none\.pdl: cannot be read \(No such file.* Check"),
        (".", "direct"),
    ],
)
def test_a_program_that_cannot_be_read(desk, place, said):
    refused(desk.compensate(desk.folder / place), said)


def test_an_unknown_statement_is_kept_and_reported(desk):
    source = desk.put("job.pdl", program(FIRST, "frobnicate  the 3,gripper ;", POSE))
    out = desk.folder / "out.pdl"
    found = desk.compensate(source, "-o", out)
    assert re.search(r"job\.pdl:6: unknown-statement: .*frobnicate", found.stderr)
    assert b"  frobnicate  the 3,gripper ;\r\n" in out.read_bytes()
    assert found.exit_code == 1 and "job.pdl:6: motion-unknown" in found.stderr
    assert POSE.encode() in out.read_bytes()  # it may stand in another frame


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            "MOVE LINEAR TO POS(9000.0, 0.0, 0.0, 0.0, 175.0, 0.0, '')",
            "out of reach: ",
        ),
        (
            "MOVE JOINT TO {5.0, 10.0, -95.0, 20.0, 125.5, 30.0}",
            "axis 5 would be beyond its l",
        ),
        (
            "MOVE JOINT TO {5.0, 10.0, -95.0, 20.0, 0.5, 30.0}",
            "wrist singularity",
        ),
        (LOOSE, "axis [23] would be beyond its limit|no solution for the config"),
    ],
    ids=["reach", "limit", "wrist", "configuration"],
)
def test_a_target_that_must_not_move_keeps_its_value_and_is_listed(desk, line, said):
    out = desk.folder / "out.pdl"
    found = desk.compensate(desk.put("job.pdl", program(FIRST, line, POSE)), "-o", out)
    assert found.exit_code == 1
    assert re.search(rf"job\.pdl:6: rejected: .*({said})", found.stderr), found.stderr
    assert line.encode() in out.read_bytes()


def test_a_target_so_near_its_limit_that_the_correction_passes_it(desk, job_cell):
    top = float(job_cell.arm.upper[4] * 57.29577951308232)
    edge = "MOVE JOINT TO {5.0, 10.0, -95.0, 20.0, %.5f, 30.0}"
    lines = [edge % (top - 1e-5), edge % -(top - 1e-5)]
    report = desk.report(desk.put("job.pdl", program(FIRST, *lines)))
    for row in report["targets"][1:]:
        assert abs(row["corrected"][4]) <= top
        if row["status"] != "corrected":
            assert row["corrected"] == row["original"]
            assert "axis 5" in row["reason"] or "survey" in row["reason"]


def test_an_unknown_frame_at_a_move_is_named_with_the_cure(desk):
    lines = (
        FIRST,
        "$UFRAME := vision(3)",
        POSE,
        "$UFRAME := POS(1600,-300,900,0,0,0,'')",
        "$BASE := POS(0,0,0,0,0,0,'')",
        "$TOOL := POS(80,-40,150,0,0,0,'')",
    )
    found = desk.compensate(desk.put("job.pdl", program(*lines, NEXT)))
    assert found.exit_code == 1
    assert re.search(
        r"job\.pdl:7: (runtime|rejected): \$UFRAME is not known", found.stderr
    )
    assert "[frames.routines.vision]" in found.stderr
    assert not re.search(r"job\.pdl:11: (runtime|rejected)", found.stderr)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("xyz_mm = [80", "xyz_m = [80", r"unknown key @ \$\.tool\.xyz_m\. .*xyz_mm"),
        ("joints_deg", "joints_rad", r"unknown key @ \$\.home\.joints_rad\. .*_deg"),
        (
            "[80.0, -40.0, 150.0]\n[u",
            "[80.0, -40.0]\n[u",
            r"3 items.* @ \$\.tool\.x",
        ),
        ("[home]", "[hone]", r"unknown key @ \$\.hone"),
        ('"gun"', '"pistol"', r"'gun', 'track' or 'positioner'.* @ \$\.aux\.1"),
        ("150.0]\n[u", "nan]\n[u", r"finite number @ \$\.tool\.xyz_mm\[3\]"),
        ('"nj220-2.7"', '"nj999"', r"no such arm. Shipped arms: .*nj220-2\.7,"),
        ("[robot]", "[robot", r"cell\.toml:2: is not valid TOML"),
        ("[tool]", "absolute_accuracy = true\n[tool]", r"twice @ .*Switch"),
    ],
    ids=["unit", "unit2", "short", "key", "aux", "nan", "arm", "syntax", "twice"],
)
def test_a_wrong_cell_file(desk, old, new, said):
    text = desk.cell.read_text()
    assert old in text
    cell = desk.put("cell.toml", text.replace(old, new, 1))
    source = desk.put("job.pdl", program(FIRST))
    found = cli("compensate", source, "--cell", cell, "--model", desk.model)
    refused(found, said)
    assert "cell.toml" in found.stderr or "nj999" in found.stderr
    assert desk.names() == {"job.pdl", "cell.toml"}


def test_a_model_of_another_arm(desk):
    other = desk.put("ur10.toml", '[robot]\narm = "ur10"\n')
    source = desk.put("job.pdl", program(FIRST))
    found = cli("compensate", source, "--cell", other, "--model", desk.model)
    refused(found, r"model\.json: was made for arm nj220-2\.7 .*not for ur10.* fit one")


@pytest.mark.parametrize("data", [b"", b"{}", b"[1]", b"\x00\x01", b'{"format": 1'])
def test_a_model_file_that_is_none(desk, data):
    source, model = desk.put("job.pdl", program(FIRST)), desk.put("m.json", data)
    found = cli("compensate", source, "--cell", desk.cell, "--model", model)
    refused(found, r"m\.json: .*postproc fit")


def rows_of(folder):
    with (folder / "survey.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def written(path, rows):
    with path.open("w", newline="") as file:
        out = csv.DictWriter(file, list(rows[0]))
        out.writeheader()
        out.writerows(rows)
    return path


def test_a_model_for_one_point_is_not_used_for_another_tool(desk, job_folder):
    rows = [r for r in rows_of(job_folder) if r["tool_id"] == "1"]
    data, model = written(desk.folder / "one.csv", rows), desk.folder / "one.json"
    cell = ("--cell", desk.cell)
    assert cli("fit", data, *cell, "-o", model, "--effects", "geometry").exit_code == 0
    found = cli("compensate", desk.put("job.pdl", program(FIRST, POSE)), *cell,
                "--model", model)  # fmt: skip
    assert found.exit_code == 1
    assert (
        len(
            re.findall(
                r"job\.pdl:\d: rejected: the tool was not surveyed", found.stderr
            )
        )
        == 2
    )


def spoilt(rows, name):
    """Spoil a survey in one way."""
    first = rows[0]
    match name:
        case "few":
            return rows[:5]
        case "one pose":
            return [dict(first, id=str(i)) for i in range(60)]
        case "one joint":
            still = {f"q{j}_deg": first[f"q{j}_deg"] for j in range(2, 7)}
            return [{**row, **still} for row in rows]
        case "all zero":
            return [dict(r, x_mm="0", y_mm="0", z_mm="0") for r in rows]
        case "nan":
            return [*rows[:3], dict(rows[3], y_mm="NaN"), *rows[4:]]
        case "empty cell":
            return [*rows[:3], dict(rows[3], q2_deg=""), *rows[4:]]
        case "metres":
            mm = ("x_mm", "y_mm", "z_mm")
            return [{**r, **{k: str(float(r[k]) / 1e3) for k in mm}} for r in rows]
        case "no column":
            return [{k: v for k, v in r.items() if k != "q4_deg"} for r in rows]
    raise AssertionError(name)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("few", r"5 rows, .* determine .* of .* parameters.* Measure more"),
        ("one pose", r" 1 poses, .*determine .*Measure more poses"),
        ("one joint", r"determine .* geometric parameters.*all joints moving"),
        ("all zero", r"0 rows, .*determine"),
        ("nan", r"bad\.csv:5: 'NaN' in column y_mm is not a number\. Correct"),
        ("empty cell", r"bad\.csv:5: .*q2_deg"),
        ("metres", r"bad\.csv: .*look like metres: write millimetres"),
        ("no column", r"bad\.csv:1: column q4_deg is missing\. The header has"),
    ],
)
def test_a_survey_that_cannot_be_used(desk, job_folder, name, said):
    data = written(desk.folder / "bad.csv", spoilt(rows_of(job_folder), name))
    found = cli("fit", data, "--cell", desk.cell, "-o", desk.folder / "m.json")
    refused(found, said)
    assert desk.names() == {"bad.csv"}


@pytest.mark.parametrize("data", [b"", b"id,q1_deg\n", bytes(range(256)) * 9])
def test_a_survey_file_that_is_none(desk, data):
    survey = desk.put("bad.csv", data)
    found = cli("fit", survey, "--cell", desk.cell, "-o", desk.folder / "m.json")
    refused(found, r"bad\.csv(:1)?: .*[.] [A-Z]")
    assert desk.names() == {"bad.csv"}


def test_broken_beams_are_left_out_and_listed(desk, job_folder):
    rows = rows_of(job_folder)
    for k in (4, 70):
        rows[k].update(x_mm="0", y_mm="0", z_mm="0")
    data = written(desk.folder / "zeros.csv", rows)
    found = cli("fit", data, "--cell", desk.cell, "-o", desk.folder / "m.json",
                "--effects", "geometry,backlash")  # fmt: skip
    assert found.exit_code == 0, found.stderr
    for k in (4, 70):
        assert re.search(rf"row {rows[k]['id']} \(line {k + 2}\): ", found.stdout)
    left = json.loads((desk.folder / "m.json").read_bytes())
    assert left["rows"] == len(rows) - 2


def test_no_output_is_an_input(desk):
    source = desk.put("job.pdl", program(FIRST))
    own = desk.folder / "own.json"
    own.write_bytes(desk.model.read_bytes())
    before = source.read_bytes(), own.read_bytes(), desk.cell.read_bytes()
    for place in (source, desk.folder / ".." / desk.folder.name / "job.pdl", own,
                  desk.cell):  # fmt: skip
        for option in ("-o", "--report"):
            found = cli("compensate", source, "--cell", desk.cell, "--model", own,
                        option, place)  # fmt: skip
            json = option == "-o" or place == own
            said = "is an input. Give another output" if json else "no kind of report"
            refused(found, said)
    assert (source.read_bytes(), own.read_bytes(), desk.cell.read_bytes()) == before
    assert desk.names() == {"job.pdl", "own.json"}


@pytest.mark.parametrize("command", ["survey", "simulate", "fit", "predict"])
def test_no_other_command_overwrites_its_input(desk, job_folder, command):
    data = desk.put("s.csv", (job_folder / "survey.csv").read_bytes())
    cell = desk.put("cell.toml", desk.cell.read_bytes())
    given = {
        "survey": (cell, ()), "simulate": (data, (data,)), "fit": (data, (data,)),
        "predict": (data, (data, "--model", desk.model)),
    }  # fmt: skip
    place, arguments = given[command]
    kept = place.read_bytes()
    refused(cli(command, *arguments, "--cell", cell, "-o", place), "is an input")
    assert place.read_bytes() == kept


def test_output_places_that_cannot_be(desk):
    source = desk.put("job.pdl", program(FIRST))
    (desk.folder / "made.json").mkdir()
    for place, said in (
        ("none/out.json", "the folder does not exist. Make the folder"),
        ("job.pdl/out.json", "job.pdl is a file: give a folder"),
        ("made.json", "is a folder. Name the file"),
    ):
        refused(desk.compensate(source, "-o", desk.folder / place), said)
        found = desk.compensate(source, "--report", desk.folder / place)
        refused(found, said)
    twice = desk.folder / "x.json"
    refused(desk.compensate(source, "-o", twice, "--report", twice), "named twice")
    assert desk.names() == {"job.pdl", "made.json"}


def test_the_ending_of_a_report_decides_its_kind(desk):
    source = desk.put("job.pdl", program(FIRST))
    json, page = desk.folder / "r.JSON", desk.folder / "r.html"
    assert desk.compensate(source, "--report", json, "--report", page).exit_code == 0
    assert json.read_bytes().startswith(b"{") and b"<!DOCTYPE" in page.read_bytes()
    for name in ("r.txt", "r", "r.svg"):
        found = desk.compensate(source, "--report", desk.folder / name)
        refused(found, r"no kind of report. Write FILE\.json, FILE\.html, or - for")
    refused(cli("diff", source, source, "--report", page), r"Write FILE\.json, or -")


@pytest.mark.parametrize(
    ("code", "said"),
    [
        (errno.EACCES, r"out\.pdl.*: the folder is read-only\. Give"),
        (errno.EROFS, r"out\.pdl.*: the folder is read-only\. Give"),
        (errno.ENOSPC, r"out\.pdl.*: the disk is full\. Free some space"),
    ],
)
def test_a_folder_that_refuses_leaves_nothing(desk, monkeypatch, code, said):
    source = desk.put("job.pdl", program(FIRST))

    opened = os.open

    def refuse(path, *given, **named):
        if str(path).endswith(TEMPORARY):
            raise OSError(code, os.strerror(code), "somewhere")
        return opened(path, *given, **named)

    monkeypatch.setattr("os.open", refuse)
    refused(desk.compensate(source, "-o", desk.folder / "out.pdl"), said)
    assert desk.names() == {"job.pdl"}


def test_a_stamped_program(desk):
    out = desk.folder / "out.pdl"
    desk.compensate(desk.put("job.pdl", program(FIRST)), "-o", out)
    again = desk.folder / "again.pdl"
    said = r":1: is compensated already\. .*postproc restore"
    refused(desk.compensate(out, "-o", again), "out.pdl" + said)
    refused(desk.compensate("-", stdin=out.read_bytes()), "stdin.pdl" + said)
    assert not again.exists()


MOVES = ("MOVE LINEAR TO a", "MOVE LINEAR TO b")


@pytest.fixture
def listed(desk):
    """Compensate a program of two listed targets with a variable file."""

    def run(values, *lines):
        made = program(FIRST, *(lines or MOVES), declared="a, b : XTNDPOS")
        source = desk.put("job.pdl", made)
        if values is not None:
            desk.put("job.lsv", values)
        report = desk.folder / "r.json"
        found = desk.compensate(source, "--report", report)
        rows = json.loads(report.read_bytes())["targets"] if report.exists() else []
        return found, [row["status"] for row in rows][1:]

    return run


BOTH = LISTED + entry("a") + entry("b", 130.0)


@pytest.mark.parametrize(
    ("values", "status", "said"),
    [
        (None, ["runtime"] * 2, r"job\.pdl:6: no-variable-file: .*no job\.lsv\. Put"),
        (
            LISTED + entry("y") + entry("z"),
            ["runtime"] * 2,
            "of another program",
        ),
        (
            BOTH[:-70],
            ["corrected", "runtime"],
            r"job\.lsv:5: lsv-incomplete: b has . of 6",
        ),
        (
            BOTH + entry("A", 110.0),
            ["runtime", "corrected"],
            "job.lsv:8: .*A has two ",
        ),
        (
            LISTED + entry("a", arm=2) + entry("b"),
            ["runtime", "corrected"],
            "a point of arm 2",
        ),
        (
            BOTH.replace("130.00", "*******"),
            ["corrected", "runtime"],
            "b is not init",
        ),
        (
            BOTH.replace("1: 90", "1: 90 2: 5", 1),
            ["runtime", "corrected"],
            r"axis 2 .*\[aux",
        ),
        (LISTED + entry("c") + BOTH, ["corrected"] * 2, "job.lsv:1: .*never used: c"),
    ],
    ids=["missing", "other", "cut", "twice", "arm", "uninitialised", "aux", "unused"],
)
def test_a_variable_file_that_does_not_fit(listed, values, status, said):
    found, statuses = listed(values)
    assert statuses == status
    assert found.exit_code == (0 if set(status) == {"corrected"} else 1)
    assert re.search(said, found.stderr), found.stderr


@pytest.mark.parametrize(("data", "said"), [(b"", "empty"), (b"\0\1" * 50, "binary")])
def test_a_variable_file_that_is_none(listed, data, said):
    refused(listed(data)[0], rf"job\.lsv(:1)?: the file is {said}")


def test_a_stamped_variable_file(listed, desk):
    listed(BOTH)
    stamped = (desk.folder / "job.compensated.lsv").read_bytes()
    refused(listed(stamped)[0], r"job\.lsv:1: is compensated already")


def test_undeclared_variables_are_reported_and_corrected(desk):
    source = desk.put("job.pdl", program(FIRST, *MOVES))
    desk.put("job.lsv", BOTH)
    found = desk.compensate(source)
    assert found.exit_code == 0
    assert "not declared" in found.stderr


def pos(x, y, e=175.0):
    return f"POS({x:.1f}, {y:.1f}, 150.0, 0.0, {e:.1f}, 0.0, '')"


def test_an_arc_through_three_points_on_a_line(desk):
    arcs = (
        f"MOVE LINEAR TO {pos(100, 200)}",
        f"MOVE CIRCULAR TO {pos(200, 200)} VIA {pos(150, 200)}",
        f"MOVE CIRCULAR TO {pos(300, 200)} VIA {pos(250, 250)}",
    )
    report = desk.report(desk.put("job.pdl", program(FIRST, *arcs)))
    status = [row["status"] for row in report["targets"]]
    assert status == ["corrected"] + 5 * [
        "rejected"
    ]  # where the last begins is not known
    assert all("on one line" in row["reason"] for row in report["targets"][1:4])


def test_a_fly_run_through_the_wrist_singularity(desk):
    flown = [
        f"MOVEFLY JOINT TO {{5.0, 10.0, -95.0, 20.0, {e:.1f}, 30.0}} ADVANCE"
        for e in (30.0, 1.0, -30.0)
    ]
    report = desk.report(desk.put("job.pdl", program(FIRST, *flown, POSE)))
    rows = report["targets"]
    assert [r["status"] for r in rows[1:4]] == ["corrected", "rejected", "corrected"]
    assert "wrist" in rows[2]["reason"] and rows[2]["corrected"] == rows[2]["original"]


@pytest.mark.parametrize("distance", ["-1.0", "0.0", "5.0"])
def test_fly_distances_are_legal_whatever_their_sign(desk, distance):
    flown = [f"MOVEFLY LINEAR TO {pos(100 + 20 * k, 200)} ADVANCE" for k in range(6)]
    setting = ("$FLY_TYPE := FLY_CART", f"$FLY_DIST := {distance}")
    report = desk.report(desk.put("job.pdl", program(FIRST, *setting, *flown, POSE)))
    assert {row["status"] for row in report["targets"]} == {"corrected"}


def test_a_straight_line_to_the_joints_where_the_arm_already_is(desk):
    again = FIRST.replace("MOVE JOINT", "MOVEFLY LINEAR") + " ADVANCE"
    source = desk.put("job.pdl", program("REPEAT", again, "UNTIL $DIN[1]"))
    found = desk.compensate(source)
    assert found.exit_code in (0, 1), found.stderr


def model_with(desk, old, new):
    """Write the model with another text in it."""
    text = desk.model.read_text()
    assert old in text
    return desk.put("odd.json", text.replace(old, new, 1))


@pytest.mark.parametrize(
    "text", ["9" * 5000, "[" * 100_000 + "]" * 100_000, '{"a":' * 50_000 + "1"]
)
def test_a_model_that_json_cannot_hold_is_refused_in_words(desk, text):
    odd = model_with(desk, '"rows": ', f'"rows": {text}')
    source = desk.put("job.pdl", program(FIRST, POSE))
    found = cli("compensate", source, "--cell", desk.cell, "--model", odd)
    refused(found, r"odd\.json: is not valid JSON\. Give the model")
    refused(cli("report", odd, "-o", desk.folder / "o.html"), "is not valid JSON")


DEEP = {
    "arrays": ("x = " + "[" * 5000 + "]" * 5000, "nested too deeply"),
    "tables": ("x = " + "{a = " * 3000 + "1" + "}" * 3000, "nested too deeply"),
    "digits": ("x = " + "9" * 5000, "more digits than any number needs"),
}


@pytest.mark.parametrize(("text", "said"), DEEP.values(), ids=DEEP)
def test_toml_beyond_all_measure_is_refused_in_words(desk, text, said):
    source = desk.put("job.pdl", program(FIRST, POSE))
    cell = desk.put("odd.toml", desk.cell.read_text() + "\n" + text)
    refused(cli("explain", source, "--cell", cell), rf"odd\.toml: .*{said}")
    plan = ["--plan", cell]
    found = cli("batch", desk.folder, desk.folder / "dst", *plan)
    refused(found, rf"odd\.toml: .*{said}")
    columns = ["--cell", desk.cell, "--set", f"measurements.columns={cell}"]
    found = cli("compare", desk.put("d.csv", "id,q1_deg\n1,2\n"), *columns)
    refused(found, r"odd\.toml: ")


TORN = ["10\x1a0.00", "10 0.00", "10\x010.00", "100.00 \x1a7"]


@pytest.mark.parametrize("number", TORN)
def test_a_number_that_is_torn_is_no_shorter_one(desk, number):
    source = desk.put(
        "job.pdl", program(FIRST, "MOVE LINEAR TO a", declared="a : XTNDPOS")
    )
    text = (LISTED + entry("a")).replace("X: 100.00", f"X: {number}")
    desk.put("job.lsv", text)
    out = desk.folder / "out.pdl"
    found = desk.compensate(source, "-o", out)
    assert found.exit_code == 1
    assert "job.lsv:3: lsv-line: not understood" in found.stderr
    assert re.search(r"job\.pdl:6: \w+: .*a", found.stderr)
    assert not out.with_suffix(".lsv").exists()


@pytest.mark.parametrize("end", ["\x1a", "\r\n\x1a"])
def test_the_mark_at_the_end_of_old_files_is_kept(desk, end):
    source = desk.put(
        "job.pdl", program(FIRST, "MOVE LINEAR TO a", declared="a : XTNDPOS")
    )
    desk.put("job.lsv", LISTED + entry("a").rstrip() + end)
    out = desk.folder / "out.pdl"
    assert desk.compensate(source, "-o", out).exit_code == 0
    assert out.with_suffix(".lsv").read_bytes().endswith(end.encode())


@pytest.mark.parametrize(
    ("tool", "told"),
    [("0.08, -0.04, 0.318", True), ("80, -40, 318", False), ("0, 0, 0", False)],
)
def test_a_tool_in_metres_is_asked_about(desk, tool, told):
    frame = f"$TOOL := POS({tool}, 0, 0, 0, '')"
    source = desk.put("job.pdl", program(FIRST, frame, FIRST, POSE))
    found = desk.compensate(source, "-o", desk.folder / "out.pdl")
    assert ("are these metres?" in found.stderr) == told
    assert not told or "job.pdl:7: tool-length: the tool here is 0.318" in found.stderr


def test_a_tool_of_the_cell_in_metres_is_asked_about(desk):
    text = desk.cell.read_text().replace(
        "[80.0, -40.0, 150.0]", "[0.08, -0.04, 0.15]", 1
    )
    source = desk.put("job.pdl", program(FIRST))
    cell = desk.put("odd.toml", text)
    found = cli("compensate", source, "--cell", cell, "--model", desk.model)
    assert "tool-length: the tool here is 0.15 mm long" in found.stderr


GIVEN = ("--cell", "CELL", "--model", "MODEL")
COMMANDS = {
    "diff": ("diff", "job.pdl", "job.pdl"),
    "explain": ("explain", "job.pdl", "--cell", "CELL"),
    "json": ("explain", "job.pdl", "--cell", "CELL", "--report", "-"),
    "filter": ("compensate", "-", *GIVEN),
    "help": ("--help",),
}


def run_with(desk, name, **how):
    """Run a command as a shell does."""
    source = desk.put("job.pdl", program(FIRST, POSE))
    places = {"CELL": str(desk.cell), "MODEL": str(desk.model)}
    words = [places.get(word, word) for word in COMMANDS[name]]
    code = "from postproc.cli import main; main()"
    with source.open("rb") as given:
        return subprocess.run(
            [sys.executable, "-c", code, *words],
            cwd=desk.folder,
            stdin=given,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
            **how,
        )


@pytest.mark.parametrize("name", COMMANDS)
def test_a_full_disk_behind_stdout_is_told_as_that(desk, name):
    with (desk.folder / "out").open("wb") as out:
        limits = resource.RLIMIT_FSIZE, (0, 0)
        done = run_with(desk, name, stdout=out, preexec_fn=lambda: setrlimit(*limits))
    assert done.returncode == 2
    assert "standard output: the disk is full. Free some space" in done.stderr
    assert "internal error" not in done.stderr and "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr


@pytest.mark.parametrize("name", ["json", "filter"])
def test_a_closed_stdout_is_told_as_that(desk, name):
    done = run_with(desk, name, preexec_fn=lambda: os.close(1))
    assert done.returncode == 2
    assert "standard output: is closed" in done.stderr


def test_a_code_that_is_none_is_answered_with_those_like_it():
    found = cli("explain", "--code", "direction-unsure")
    refused(found, "no such code. Is it direction-")
