"""Every command: exit codes, what goes to which stream, which files appear."""

from __future__ import annotations

import json
import re

import pytest

from postproc import __version__
from postproc.cli.commands import app
from postproc.language.text.source import source_from_bytes
from postproc.model.model import load_model
from tests.written import FIRST, LISTED, NEXT, POSE, cli, entry, program

COMMANDS = (
    "compensate", "diff", "restore", "explain", "survey", "simulate", "fit", "predict",
    "diagnose", "read", "init", "compare", "iso9283", "batch", "check", "report",
    "history", "arm list", "arm from-urdf", "arm from-machine-dat", "robot add",
    "robot list", "robot show", "robot check", "robot event", "robot refresh",
    "robot replace", "robot page", "robot backup",
)  # fmt: skip
UNREACHED = "MOVE LINEAR TO POS(9000.0, 0.0, 0.0, 0.0, 175.0, 0.0, '')"
STAMP = rb"-- postproc \S+ model=[0-9a-f]{16} source=[0-9a-f]{64}"


def test_every_command_of_the_interface_is_there():
    names = {c.name or c.callback.__name__ for c in app.registered_commands}
    for group in app.registered_groups:
        inside = group.typer_instance.registered_commands
        names |= {f"{group.name} {c.name or c.callback.__name__}" for c in inside}
    assert set(COMMANDS) <= names


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command):
    found = cli(*command.split(), "--help")
    assert found.exit_code == 0 and "Usage:" in found.stdout


def test_version():
    assert cli("--version").stdout == f"postproc {__version__}\n"


def test_unknown_command_and_missing_option_end_with_2():
    assert cli("compensat").exit_code == 2
    found = cli("compensate", "job.pdl")
    assert found.exit_code == 2 and "--cell" in found.stderr


def test_default_output_lies_beside_the_program_and_is_restorable(desk):
    source = desk.put("job.pdl", program(FIRST, POSE, NEXT))
    found = desk.compensate(source)
    assert found.exit_code == 0 and found.stdout == ""
    out = desk.folder / "job.compensated.pdl"
    assert desk.names() == {"job.pdl", out.name, out.name + ".postproc.json"}
    assert source.read_bytes() == program(FIRST, POSE, NEXT)
    assert cli("restore", out).exit_code == 0
    assert out.read_bytes() == source.read_bytes()


def test_an_edited_output_is_overwritten_with_a_word(desk):
    source = desk.put("job.pdl", program(FIRST, POSE, NEXT))
    out = desk.folder / "out.pdl"
    assert "was edited" not in desk.compensate(source, "-o", out).stderr
    assert "was edited" not in desk.compensate(source, "-o", out).stderr
    out.write_bytes(out.read_bytes() + b"-- taught again\r\n")
    found = desk.compensate(source, "-o", out)
    assert found.exit_code == 0 and found.stderr.count("out.pdl: was edited after") == 1
    assert cli("restore", out).exit_code == 0
    assert "was edited" not in desk.compensate(source, "-o", out).stderr


def test_stamp_is_one_line_in_the_files_own_ending(desk):
    for name, ending in (("crlf.pdl", b"\r\n"), ("lf.pdl", b"\n")):
        source = desk.put(name, program(FIRST, POSE).replace(b"\r\n", ending))
        out = desk.folder / "out.pdl"
        desk.compensate(source, "-o", out)
        first, rest = out.read_bytes().split(ending, 1)
        assert re.fullmatch(STAMP, first)
        assert rest.count(b"\n") == source.read_bytes().count(b"\n")
        assert rest.split(ending)[:4] == source.read_bytes().split(ending)[:4]


def test_stdin_to_stdout_is_byte_clean_and_equals_the_file_form(desk):
    source = desk.put("job.pdl", program(FIRST, POSE, NEXT))
    desk.compensate(source, "-o", desk.folder / "out.pdl")
    found = desk.compensate("-", stdin=source.read_bytes())
    assert found.exit_code == 0
    assert found.stdout_bytes == (desk.folder / "out.pdl").read_bytes()
    assert "stdin.pdl: 3 visits" in found.stderr
    assert desk.names() == {"job.pdl", "out.pdl", "out.pdl.postproc.json"}


def test_stdin_that_fails_writes_nothing_to_stdout(desk):
    for data, options in ((b"", ()), (program(FIRST, UNREACHED), ("--strict",))):
        found = desk.compensate("-", *options, stdin=data)
        assert found.exit_code == 2
        assert found.stdout_bytes == b"" and found.stderr


def test_stdin_to_a_named_output(desk):
    out = desk.folder / "out.pdl"
    found = desk.compensate("-", "-o", out, stdin=program(FIRST, POSE))
    assert found.exit_code == 0 and found.stdout_bytes == b""
    assert cli("restore", out).exit_code == 0
    assert out.read_bytes() == program(FIRST, POSE)


def test_a_target_left_alone_is_exit_1_and_listed(desk):
    source = desk.put("job.pdl", program(FIRST, UNREACHED, POSE))
    found = desk.compensate(source, "-o", desk.folder / "out.pdl")
    assert found.exit_code == 1
    assert re.search(r"job\.pdl:6: rejected: out of reach: check", found.stderr)
    assert UNREACHED.encode() in (desk.folder / "out.pdl").read_bytes()


def test_strict_turns_1_into_2_and_writes_nothing(desk):
    source = desk.put("job.pdl", program(FIRST, UNREACHED))
    out = desk.folder / "out.pdl"
    found = desk.compensate(
        source, "-o", out, "--strict", "--report", desk.folder / "r.json"
    )
    assert found.exit_code == 2
    assert "job.pdl:6" in found.stderr and "--strict" in found.stderr
    assert desk.names() == {"job.pdl"}
    done = desk.put("fine.pdl", program(FIRST, POSE))
    assert desk.compensate(done, "-o", out, "--strict").exit_code == 0
    out.unlink()
    found = desk.compensate(done, "-o", out, "--strict", "--tolerance", "0.0001")
    assert found.exit_code == 2 and "do not pass the tolerance" in found.stderr
    assert not out.exists()


def test_report_has_one_row_a_visit_in_program_order(desk):
    lines = (
        FIRST,
        "p := POS(120.0, 200.0, 150.0, 0.0, 175.0, 0.0, '')",
        "MOVE LINEAR TO p",
        "MOVE CIRCULAR TO POS(200.0, 200.0, 150.0, 0.0, 175.0, 0.0, '') "
        "VIA POS(160.0, 240.0, 150.0, 0.0, 175.0, 0.0, '')",
        "MOVE TO $HOME",
        "MOVE LINEAR TO p",
    )
    report = desk.report(desk.put("job.pdl", program(*lines)))
    rows = report["targets"]
    assert [r["line"] for r in rows] == [5, 7, 8, 8, 9, 10]
    assert [r["move"] for r in rows] == [
        "JOINT", "LINEAR", "VIA", "CIRCULAR", "JOINT", "LINEAR",
    ]  # fmt: skip
    assert rows[1]["literal"] == {"file": "job.pdl", "line": 6}
    assert rows[1]["name"].lower() == "p" and rows[0]["name"] is None
    assert rows[4]["status"] == "unchanged" and rows[4]["literal"] is None
    assert {r["status"] for r in rows} <= {
        "corrected", "conflict", "runtime", "rejected", "unchanged",
    }  # fmt: skip
    for row in rows:
        assert len(row["q_deg"]) == len(row["lambda"]) == 6
        assert set(row["lambda"]) <= {-1, 0, 1}
        assert len(row["correction_mm"]) == len(row["std_error_mm"]) == 3


def test_report_numbers_are_those_in_the_files(desk):
    source = desk.put("job.pdl", program(FIRST, POSE, NEXT))
    out = desk.folder / "out.pdl"
    report = desk.report(source, "-o", out)
    lines = out.read_bytes().decode("latin-1").split("\r\n")
    for row in report["targets"]:
        written = lines[row["literal"]["line"]].split("--")[0]  # the stamp comes first
        numbers = [float(n) for n in re.findall(r"-?\d+\.\d+", written)]
        assert numbers[:6] == pytest.approx(row["corrected"], abs=1e-9)
        moved = [b - a for a, b in zip(row["original"], row["corrected"], strict=True)]
        if row["move"] == "LINEAR":  # the user frame of this cell is not turned
            assert moved[:3] == pytest.approx(row["correction_mm"], abs=6e-4)
            assert moved[3:] == [0.0, 0.0, 0.0]


def test_report_to_stdout_only_where_the_program_is_not(desk):
    source = desk.put("job.pdl", program(FIRST, POSE))
    found = desk.compensate(source, "--report", "-")
    assert json.loads(found.stdout)["program"] == "job.pdl"
    piped = desk.compensate("-", "--report", "-", stdin=source.read_bytes())
    assert piped.exit_code == 2 and "stdout holds the program" in piped.stderr


def test_same_input_same_bytes(desk):
    source = desk.put("job.pdl", program(FIRST, POSE, NEXT))
    for name in ("a", "b"):
        (desk.folder / name).mkdir()
        desk.compensate(source, "-o", desk.folder / name / "job.pdl")
    for name in ("job.pdl", "job.pdl.postproc.json"):
        a, b = (desk.folder / x / name for x in "ab")
        assert a.read_bytes() == b.read_bytes()


def test_values_are_written_and_the_program_stays_byte_identical(desk):
    source = desk.put(
        "job.pdl",
        program("MOVE JOINT TO $HOME", "MOVE JOINT TO A_1", "MOVE LINEAR TO b",
                declared="a_1, b : XTNDPOS"),
    )  # fmt: skip
    values = desk.put("JOB.LSV", LISTED + entry("a_1") + entry("B", 130.0))
    (desk.folder / "out").mkdir()
    out = desk.folder / "out" / "job.pdl"
    found = desk.compensate(source, "-o", out)
    assert found.exit_code == 0, found.stderr
    assert out.read_bytes() == source.read_bytes()
    assert re.match(STAMP + b"\r\n", out.with_suffix(".lsv").read_bytes())
    assert "2 decimals" in found.stderr
    again = cli("restore", out, "-o", desk.folder / "back.pdl")
    assert again.exit_code == 0, again.stderr
    assert (desk.folder / "back.pdl").read_bytes() == source.read_bytes()
    assert (desk.folder / "back.lsv").read_bytes() == values.read_bytes()
    assert desk.compensate(out, "-o", desk.folder / "again.pdl").exit_code == 2


VALUED = program(FIRST, "MOVE LINEAR TO a", declared="a : XTNDPOS")


def test_values_of_a_piped_program_go_where_they_are_told_to(desk):
    values = desk.put("job.lsv", LISTED + entry("a"))
    out = desk.folder / "out.lsv"
    found = desk.compensate(
        "-", "--variables", values, "--variables-out", out, stdin=VALUED
    )
    assert found.exit_code == 0
    assert found.stdout_bytes.startswith(b"-- postproc")
    assert out.read_bytes().startswith(b"-- postproc")
    assert desk.names() == {"job.lsv", "out.lsv", "out.lsv.postproc.json"}
    assert cli("restore", out).exit_code == 0
    assert out.read_bytes() == values.read_bytes()


def test_a_piped_program_writes_nothing_beside_its_sources(desk):
    values = desk.put("job.lsv", LISTED + entry("a"))
    found = desk.compensate("-", "--variables", values, stdin=VALUED)
    assert found.exit_code == 2 and found.stdout_bytes == b""
    assert "job.lsv: changes too" in found.stderr and "--variables-out" in found.stderr
    assert desk.names() == {"job.lsv"}


def test_values_that_stay_come_out_of_the_filter_too(desk):
    values, out = desk.put("job.lsv", LISTED + entry("b")), desk.folder / "out.lsv"
    source = program(FIRST, POSE)
    found = desk.compensate(
        "-", "--variables", values, "--variables-out", out, stdin=source
    )
    assert found.exit_code == 0
    assert out.read_bytes() == values.read_bytes()
    assert desk.names() == {"job.lsv", "out.lsv"}


def test_values_in_a_folder_of_their_own_have_a_record_of_their_own(desk):
    source = desk.put("job.pdl", VALUED)
    values = desk.put("job.lsv", LISTED + entry("a"))
    far = desk.folder / "far"
    far.mkdir()
    found = desk.compensate(source, "--variables-out", far / "v.lsv")
    assert found.exit_code == 0
    assert {p.name for p in far.iterdir()} == {"v.lsv", "v.lsv.postproc.json"}
    assert cli("restore", far / "v.lsv").exit_code == 0
    assert (far / "v.lsv").read_bytes() == values.read_bytes()


def test_a_place_for_values_needs_values(desk):
    for place, why in ((desk.folder / "out.lsv", "no variable file"), ("-", "stdout")):
        found = desk.compensate(
            "-", "--variables-out", place, stdin=program(FIRST, POSE)
        )
        assert found.exit_code == 2 and why in found.stderr
        assert desk.names() == set()


def test_restore_refuses_what_was_edited_since_and_says_where(desk):
    source = desk.put("job.pdl", program(FIRST, POSE))
    out = desk.folder / "out.pdl"
    desk.compensate(source, "-o", out)
    edited = out.read_bytes().replace(b"VAR", b"VAr")
    out.write_bytes(edited)
    found = cli("restore", out)
    assert found.exit_code == 2 and "out.pdl:1: was changed" in found.stderr
    assert out.read_bytes() == edited


def test_restore_without_a_record(desk):
    found = cli("restore", desk.put("job.pdl", program(FIRST)))
    assert found.exit_code == 2 and "record" in found.stderr


def test_clones_are_written_checked_compared_and_restored(desk):
    to_p = "MOVE JOINT TO p"
    low = "MOVE JOINT TO {-12.0, -8.0, -140.0, -40.0, 20.0, -60.0}"
    lines = ("p := POS(100.0, 200.0, 150.0, 0.0, 175.0, 0.0, '')", FIRST, to_p)
    source = program(*lines, low, to_p)
    given = desk.put("job.pdl", source)
    (desk.folder / "new").mkdir()
    out = desk.folder / "new" / "job.pdl"
    found = desk.compensate(given, "--shared-points", "clone", "-o", out)
    assert found.exit_code == 0 and "job.pdl:3: cloned: p:" in found.stderr
    assert b"  p__2 : POSITION\r\n" in out.read_bytes()
    report = desk.folder / "r.json"
    desk.compensate(given, "--shared-points", "clone", "-o", out, "--report", report)
    row = json.loads(report.read_bytes())["targets"][3]
    assert row["name"] == "p__2" and row["status"] == "corrected"
    assert (row["line"], row["literal"]["line"]) == (9, 5)
    checked = cli("check", desk.folder / "new")
    assert checked.exit_code == 0, checked.stdout
    compared = cli("diff", given, out)
    assert compared.exit_code == 1 and "p__2" in compared.stdout
    again = desk.compensate(out, "--shared-points", "clone")
    assert again.exit_code == 2 and "compensated already" in again.stderr
    assert cli("restore", out).exit_code == 0
    assert out.read_bytes() == source


def test_temperature_outside_the_survey_is_guarded(desk):
    found = desk.compensate(
        desk.put("job.pdl", program(FIRST)), "-o", desk.folder / "o.pdl",
        "--set", "environment.temperature_c=75",
    )  # fmt: skip
    assert found.exit_code == 1
    assert re.search(r"job\.pdl:5: rejected: .*temperature", found.stderr)


def test_survey_simulate_fit_predict(desk, tmp_path):
    survey, rows = tmp_path / "s.pdl", tmp_path / "s.csv"
    cell = ("--cell", desk.cell)
    assert cli("survey", *cell, "--poses", "40", "-o", survey).exit_code == 0
    source_from_bytes("s.pdl", survey.read_bytes())
    assert (
        cli(
            "simulate", survey, *cell, "--set", "simulation.seed=2", "-o", rows
        ).exit_code
        == 0
    )
    assert len(rows.read_text().splitlines()) == 1 + 2 * 40
    found = cli("fit", rows, *cell, "-o", tmp_path / "m.json", "--effects",
                "geometry,backlash")  # fmt: skip
    assert found.exit_code == 0 and "\nbacklash " in found.stdout
    whole = cli("fit", rows, *cell, "-o", tmp_path / "n.json", "--effects",
                "geometry,backlash", "--report", "-")  # fmt: skip
    told = json.loads(whole.stdout)
    model = load_model(tmp_path / "n.json")
    assert told["model"] == model.id and model.id in found.stdout
    assert [one["name"] for one in told["parameters"]] == list(model.effects.names)
    assert {"geometry", "backlash"} <= {one["effect"] for one in told["found"]}
    predicted = cli("predict", rows, *cell, "--model", tmp_path / "m.json")
    assert predicted.exit_code == 0
    header, first = predicted.stdout.splitlines()[:2]
    assert {"dx_mm", "sy_mm", "rz_mm"} <= set(header.split(","))
    assert first.split(",")[0] == rows.read_text().splitlines()[1].split(",")[0]
    assert "residual mean" in predicted.stderr


def test_simulate_tells_the_true_error_as_json(desk):
    source = desk.put("job.pdl", program(FIRST, POSE))
    found = cli("simulate", source, "--cell", desk.cell, "--reference", source,
                "--report", "-")  # fmt: skip
    error = json.loads(found.stdout)["true_error"]
    assert found.exit_code == 0 and error["n"] == 2 and error["mean_mm"] > 0.2


def test_messages_show_control_characters_escaped(desk):
    source = program("glob \x1b[31m red", POSE)
    found = desk.compensate(desk.put("job.pdl", source), "-o", desk.folder / "o.pdl")
    assert "\x1b" not in found.stderr and "\\x1b" in found.stderr


def test_what_is_said_of_a_line_is_said_once_with_a_count(desk):
    # A routine that is called twice: each of its lines is reached twice.
    moves = "".join(f"  {line}\r\n" for line in (FIRST, POSE, UNREACHED, NEXT))
    text = (
        f"PROGRAM job\r\nROUTINE r\r\nBEGIN\r\n{moves}END r\r\n"
        "BEGIN\r\n  r\r\n  r\r\n  r\r\nEND job\r\n"
    )
    source = desk.put("job.pdl", text)
    found = desk.compensate(source, "-o", desk.folder / "out.pdl")
    said = [line for line in found.stderr.splitlines() if line.startswith("job.pdl:")]
    assert len(said) == len(set(said)), found.stderr
    assert [line for line in said if line.endswith(" (3 times)")]
    told = desk.report(source, "-o", desk.folder / "more.pdl")["diagnostics"]
    assert len(told) == len({json.dumps(d) for d in told})


def test_a_variable_file_keeps_the_case_of_its_name(desk):
    source = desk.put("JOB.PDL", VALUED)
    values = desk.put("JOB.LSV", LISTED + entry("a"))
    assert desk.compensate(source).exit_code == 0
    out = desk.folder / "JOB.compensated.PDL"
    assert out.with_suffix(".LSV").exists() and not out.with_suffix(".lsv").exists()
    found = cli("diff", source, out)
    assert found.exit_code == 1 and "JOB.LSV" in found.stdout
    back = desk.folder / "back"
    back.mkdir()
    assert cli("restore", out, "-o", back / "JOB.PDL").exit_code == 0
    assert {p.name for p in back.iterdir()} == {"JOB.PDL", "JOB.LSV"}
    assert (back / "JOB.LSV").read_bytes() == values.read_bytes()
