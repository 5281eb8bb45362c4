"""A tree like the archive of a KUKA controller."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

from postproc.batch.archive import missing_in_cell
from postproc.language.krl.archive import read_archive
from postproc.robot.cell import load_cell
from tests.language.krl.test_submits import BAS
from tests.language.neutral_job import LANGUAGES, drawn
from tests.written import cli

SYSTEM = {
    "bas.src": BAS,
    "ir_stopm.src": b"&ACCESS R1\r\nDEF  IR_STOPM ( )\r\nBRAKE\r\nEND\r\n",
    "sps.sub": b"&ACCESS RVP\r\nDEF  SPS ( )\r\nLOOP\r\nENDLOOP\r\nEND\r\n",
    "$config.dat": b"DEFDAT $CONFIG\r\nENDDAT\r\n",
}


@pytest.fixture
def archive(job_folder, job_cell, tmp_path):
    """A cell, a model, and an archive with one job."""
    text = (job_folder / "cell.toml").read_text()
    text = text.replace("[tool]", "absolute_accuracy = false\n[tool]")
    (tmp_path / "cell.toml").write_text(text)
    folder = tmp_path / "KRC" / "R1"
    files = {f"System/{name}": data for name, data in SYSTEM.items()}
    files |= {
        f"Program/weld/{n}": d
        for n, d in LANGUAGES["job.src"](drawn(job_cell, 5, 8)).items()
    }
    files["Mada/$machine.dat"] = b"DEFDAT $MACHINE\r\nENDDAT\r\n"
    files["System/bas.dat"] = b"DEFDAT bas\r\nENDDAT\r\n"
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    return tmp_path


def batch(folder, job_folder, *more):
    given = ["--cell", folder / "cell.toml", "--model", job_folder / "model.json"]
    return cli("batch", folder / "KRC", folder / "out", *given, "--jobs", "1", *more)


def test_files_of_the_controller_are_copied_without_a_word(archive, job_folder):
    run = batch(archive, job_folder)
    assert run.exit_code in (0, 1), run.output
    for name, data in SYSTEM.items():
        assert (archive / "out" / "R1" / "System" / name).read_bytes() == data
        assert name.removesuffix(".src") not in run.output.replace("$config.dat", "")
    lines = map(json.loads, (archive / "out.batch.jsonl").read_text().splitlines())
    programs = {line["program"] for line in lines if "program" in line}
    assert programs <= {"R1/Program/weld/job.src"}
    assert b"postproc" in (archive / "out/R1/Program/weld/job.src").read_bytes()


def test_a_job_knows_what_runs_beside_it(archive, job_folder):
    sub = archive / "KRC/R1/System/sps.sub"
    sub.write_bytes(sub.read_bytes().replace(b"LOOP\r\n", b"XP1.X=3\r\nLOOP\r\n", 1))
    job = archive / "KRC/R1/Program/weld/job.src"
    run = cli("compensate", job, "--cell", archive / "cell.toml", "--model",
              job_folder / "model.json", "-o", archive / "job.src")  # fmt: skip
    assert "sps.sub is read, but not written" in run.output
    alone = cli("compensate", sub, "--cell", archive / "cell.toml", "--model",
                job_folder / "model.json")  # fmt: skip
    assert alone.exit_code == 2 and "is a submit program" in alone.output


def test_what_people_write_in_a_package_counts(archive, job_folder):
    job, own = archive / "KRC/R1/Program/weld/job.src", b"LIN {X 1,Y 2,Z 3}\r\n"
    job.write_bytes(job.read_bytes().replace(b"\nEND", b"\nUSERSPOT(1)\r\nEND", 1))
    source = b"DEF USERSPOT(A :IN)\r\nINT A\r\n%bEND\r\n"
    place = archive / "KRC/R1/System/USERSPOT.SRC"
    for text, acts in ((source % own, True), (source % b"", False)):
        place.write_bytes(text)
        run = batch(archive, job_folder, "--report", archive / "report.json")
        assert (archive / "out/R1/System/USERSPOT.SRC").read_bytes() == text
        report = (archive / "report.json").read_text()
        assert ("routine-assumed-motionless" in report) is not acts, run.output


CONFIG = """DEFDAT $CONFIG
DECL FRAME TOOL_DATA[16]
TOOL_DATA[1]={X 10.0,Y 20.0,Z 300.0,A 0.0,B 0.0,C 0.0}
TOOL_DATA[2]={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}
BASE_DATA[4]={X 1000.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}
LOAD_DATA[1]={M -1.0,CM {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0},J {X 0.0,Y 0.0,Z 0.0}}
LOAD_DATA[3]={M 46.0,CM {X 62.0,Y 0.5,Z 214.0,A 0.0,B 0.0,C 0.0},J {X 1,Y 1,Z 1}}
DECL E6AXIS XHOME={A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 45.0,A6 0.0,E1 0.0}
ENDDAT
"""
MACHINE = """DEFDAT $MACHINE PUBLIC
INT $EX_AX_NUM=1
FRAME $ROBROOT={X 0.0,Y 100.0,Z 500.0,A 90.0,B 0.0,C 0.0} ;base of the arm
ENDDAT
"""


@pytest.fixture
def lists(archive):
    """Write lists of a controller; return the folder, and a cell that says little."""
    (archive / "KRC/R1/System/$config.dat").write_text(CONFIG)
    (archive / "KRC/R1/Mada/$machine.dat").write_text(MACHINE)
    (archive / "own.toml").write_text('[robot]\narm = "kr210-r2700-extra"\n')
    return archive


def test_an_archive_tells_what_the_cell_lacks(lists):
    found = read_archive(lists / "KRC")
    assert found.entries == {"tools": (1,), "bases": (4,), "loads": (3,)}
    assert found.load == (46.0, 62.0, 0.5, 214.0) and found.external == {1: ""}
    assert found.home == (0.0, -90.0, 90.0, 0.0, 45.0, 0.0)
    told = missing_in_cell(found, load_cell(lists / "own.toml"))
    assert told[0].endswith("gives tools 1; bases 4; loads 3")
    pasted = "\n".join(line.strip() for line in told[2:])
    head = '[robot]\narm = "kr210-r2700-extra"\n'
    (lists / "new.toml").write_text(head + pasted + "\n")
    cell = load_cell(lists / "new.toml")
    assert cell.payload_mass == 46.0 and cell.aux == {1: "track"}
    np.testing.assert_allclose(cell.base.pose[:3, 3], [0.0, 0.1, 0.5])
    np.testing.assert_allclose(cell.base.pose[:3, 0], [0.0, 1.0, 0.0], atol=1e-9)
    assert len(missing_in_cell(found, cell)) == 1


def test_a_batch_lists_it_before_any_file(lists, job_folder):
    run = batch(lists, job_folder)
    told = run.output.index("R1/System/$config.dat gives tools 1")
    assert told < run.output.index("programs and files")
    assert "[payload]" in run.output and "absolute_accuracy" not in run.output


def test_a_folder_without_lists_is_no_archive(tmp_path):
    assert read_archive(tmp_path) is None


def test_a_list_without_a_source_belongs_to_the_program_that_goes_there(
    archive, job_folder
):
    weld = archive / "KRC/R1/Program/weld"
    text = (weld / "job.dat").read_text()
    (weld / "job.dat").unlink()
    text = text.replace("DEFDAT job", "DEFDAT points PUBLIC").replace("DECL", "GLOBAL")
    (weld / "points.dat").write_text(text)
    run = batch(archive, job_folder, "--set", "compensation.edit_exported=true")
    assert run.exit_code in (0, 1), run.output
    out = archive / "out/R1/Program/weld"
    assert (out / "points.dat.postproc.json").is_file()
    (weld / "other.src").write_text("DEF other( )\nPTP XP0\nEND\n")
    shutil.rmtree(archive / "out")
    run = batch(archive, job_folder)
    assert run.exit_code == 1, run.output
    assert (out / "points.dat").read_bytes() == (weld / "points.dat").read_bytes()
