"""Programs with pages on the command line: one flow, as in a batch."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.pages import is_output
from postproc.compensation.program import read_program
from postproc.compensation.program_files import find_pages
from postproc.exceptions import ProgramError
from postproc.files import FolderListing
from postproc.language.languages import file_named
from tests.plant import contents, pages
from tests.written import cli


def names(program: Path) -> list[str]:
    return [path.name for path in find_pages(program).paths]


def test_pages_are_compensated_as_in_a_batch(desk):
    source = pages(desk.folder / "src", 2, 3)
    out = desk.folder / "one"
    out.mkdir()
    found = desk.compensate(source / "main.pdl", "-o", out / "main.pdl")
    assert found.exit_code == 0, found.stderr
    assert "page1.pdl is a part of this program" in found.stderr
    many = desk.folder / "many"
    given = ("--cell", desk.cell, "--model", desk.model)
    assert cli("batch", source, many, *given, "--jobs", 1).exit_code == 0
    one, all_ = contents(out), contents(many)
    assert {k: v for k, v in one.items() if k.endswith(".pdl")} == {
        k: v for k, v in all_.items() if k.endswith(".pdl")
    }
    assert cli("check", out, "--source", source).exit_code == 0
    for name in ("main", "page1", "page2"):
        assert cli("restore", out / f"{name}.pdl").exit_code == 0
        restored = (out / f"{name}.pdl").read_bytes()
        assert restored == (source / f"{name}.pdl").read_bytes()


def test_pages_beside_their_sources_get_names_of_their_own(desk):
    source = pages(desk.folder / "src", 2, 3)
    for _ in range(2):  # what the first run has written does not count
        before = (source / "page1.pdl").read_bytes()
        assert desk.compensate(source / "main.pdl").exit_code == 0
        assert (source / "page1.pdl").read_bytes() == before
    assert (source / "page1.compensated.pdl").exists()
    assert names(source / "main.pdl") == ["page1.pdl", "page2.pdl"]


def test_explain_and_simulate_follow_pages(desk):
    source = pages(desk.folder / "src", 2, 3)
    found = cli("explain", source / "main.pdl", "--cell", desk.cell, "--model",
                desk.model, "--report", "-")  # fmt: skip
    rows = json.loads(found.stdout)["visits"]
    assert len(rows) == 7 and rows[4]["from"] == "page1.pdl:7"
    measured = desk.folder / "m.csv"
    given = ("--cell", desk.cell, "-o", measured)
    assert cli("simulate", source / "main.pdl", *given).exit_code == 0
    assert len(measured.read_text().splitlines()) == 8


def test_what_is_not_followed_is_said(tmp_path):
    def put(name: str, *lines: str) -> Path:
        path = tmp_path / f"{name}.pdl"
        path.write_text("\n".join([f"PROGRAM {name}", *lines, "BEGIN", f"END {name}"]))
        return path

    main = put("main", "IMPORT 'own'", "IMPORT 'shared'", "IMPORT '../far'",
               "IMPORT 'valued'", "IMPORT 'gone'")  # fmt: skip
    put("own", "IMPORT 'inner'", "IMPORT 'main'")
    put("inner", "IMPORT 'apart'")
    put("apart, PROG_ARM = 2").rename(tmp_path / "apart.pdl")
    put("shared")
    put("other", "IMPORT 'shared'")
    put("valued")
    (tmp_path / "valued.lsv").write_text("p POS Priv\n X: 1 Y: 2 Z: 3\n")
    (tmp_path.parent / "far.pdl").write_text("PROGRAM far\nBEGIN\nEND far")
    (tmp_path / "linked.pdl").symlink_to(tmp_path.parent / "far.pdl")
    found = find_pages(main)
    assert [path.name for path in found.paths] == ["own.pdl", "inner.pdl"]
    assert [(note.file, note.line, note.message) for note in found.notes] == [
        ("main.pdl", 4, "'../far' leads out of the folder: not followed"),
        ("main.pdl", 3, "shared.pdl is not followed: main.pdl and other.pdl name it"),
        ("main.pdl", 5, "valued.pdl is not followed: it has a variable file of its "
         "own"),
        ("inner.pdl", 2, "apart.pdl is not followed: it is a program of arm 2 "
         "(PROG_ARM)"),
    ]  # fmt: skip
    assert names(put("plain")) == []


def test_programs_under_the_names_of_other_files_are_refused(desk):
    main = desk.put("main.pdl", "PROGRAM main\nIMPORT 'a'\nIMPORT 'b'\nBEGIN\nEND main")
    desk.put("a.pdl", "PROGRAM b\nBEGIN\nEND b")
    desk.put("b.pdl", "PROGRAM a\nBEGIN\nEND a")
    found = desk.compensate(main)
    assert found.exit_code == 2 and "a.pdl: its program has the name" in found.stderr


PAGE = "PROGRAM {0}\nROUTINE r_{1}\nBEGIN\nMOVE JOINT TO {{{2}, 0, -90, 0, 60, 0}}\n"
PAGE += "END r_{1}\nBEGIN\nEND {0}"


@pytest.mark.parametrize("names", [("x", "x"), ("job", "b"), ("a", "a")])
def test_two_programs_of_one_name_are_refused(job_cell, names):
    files = {"job.pdl": b"PROGRAM job\nIMPORT 'a'\nIMPORT 'b'\nBEGIN\nEND job"}
    for name, said in zip("ab", names, strict=True):
        files[f"{name}.pdl"] = PAGE.format(said, name, 1).encode()
    with pytest.raises(ProgramError, match="its program has the name of another file"):
        read_program(files, job_cell)


def test_pages_without_a_name_keep_their_numbers(job_cell):
    files = {
        "job.pdl": b"PROGRAM job\nIMPORT 'a'\nIMPORT 'b'\nBEGIN\nr_a\nr_b\nEND job"
    }
    for number, name in enumerate("ab", start=1):
        files[f"{name}.pdl"] = PAGE.format("7", name, number).encode()
    reading = read_program(files, job_cell)
    assert [source.name for source in reading.sources] == list(reading.visits.files)
    assert reading.visits.target.values[:, 0].tolist() == [1.0, 2.0]
    assert reading.visits.literals.file.tolist() == [1, 2]


def test_pages_that_are_named_far_behind_the_declarations_are_followed(tmp_path):
    moves = "  MOVE JOINT TO {1, 2, 3, 4, 5, 6}\n" * 20_000
    main = tmp_path / "main.pdl"
    text = f"PROGRAM main\nBEGIN\n{moves}  Call Late\nEND main\n"
    main.write_text(text)
    (tmp_path / "late.pdl").write_text("PROGRAM late\nBEGIN\nEND late\n")
    other = tmp_path / "other.pdl"
    other.write_text(text.replace("main", "other").replace("Call Late", ""))
    assert names(main) == ["late.pdl"]
    other.write_text(text.replace("main", "other"))  # as far behind, it names it too
    assert names(main) == []


def test_the_programs_that_a_text_names():
    text = b"IMPORT 'a'\rIMPORT 'x'\r\nCALL b\ncall b -- call c\nMOVE recall\n CALL d"
    found = file_named("m.pdl").find_named(text, is_output, FolderListing())
    assert found == ({"a": 1, "b": 2, "d": 5}, {})


def test_a_variable_file_among_the_pages_counts_as_the_last_file(job_cell, job_model):
    line = "  MOVE JOINT TO {{{}, 5, -90, 10, 50, 10}}\n"
    a, b = line.format(5).encode(), line.format(9).encode()
    main = b"PROGRAM job\nIMPORT 'part'\nVAR p : POSITION\nBEGIN\n" + a
    main += b"  CALL part\n  MOVE LINEAR TO p\nEND job\n"
    part = b"PROGRAM part\nBEGIN\n" + b + b"END part\n"
    values = b"p POS Priv\n X: 150.0 Y: 200.0 Z: 250.0 A: 0.0 E: 168.0 R: 0.0\n"
    values += b" CNFG: ''\n"
    first = {"job.lsv": values, "part.pdl": part}
    last = {name: first[name] for name in reversed(first)}
    found = [
        compensate(main, job_cell, job_model, name="job.pdl", pages=pages)
        for pages in (first, last)
    ]
    assert found[0].outputs == found[1].outputs and set(found[0].outputs) >= set(first)
    with pytest.raises(ProgramError, match="one variable file"):
        compensate(
            main, job_cell, job_model, name="job.pdl",
            pages={**first, "part.lsv": values},
        )  # fmt: skip
