"""A tree like the archive of a KUKA controller."""

from __future__ import annotations

import json

import pytest

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
    run = batch(archive, job_folder, "--log", archive / "log.jsonl")
    assert run.exit_code in (0, 1), run.output
    for name, data in SYSTEM.items():
        assert (archive / "out" / "R1" / "System" / name).read_bytes() == data
        assert name.removesuffix(".src") not in run.output.replace("$config.dat", "")
    lines = map(json.loads, (archive / "log.jsonl").read_text().splitlines())
    programs = {line["program"] for line in lines if "program" in line}
    assert programs <= {"R1/Program/weld/job.src"}
    assert b"postproc" in (archive / "out/R1/Program/weld/job.src").read_bytes()


def test_a_job_knows_what_runs_beside_it(archive, job_folder):
    sub = archive / "KRC/R1/System/sps.sub"
    sub.write_bytes(sub.read_bytes().replace(b"LOOP\r\n", b"XP1.X=3\r\nLOOP\r\n", 1))
    job = archive / "KRC/R1/Program/weld/job.src"
    run = cli("compensate", job, "--cell", archive / "cell.toml", "--model",
              job_folder / "model.json", "-o", archive / "job.src")  # fmt: skip
    assert "sps.sub is read, and not rewritten" in run.output
    alone = cli("compensate", sub, "--cell", archive / "cell.toml", "--model",
                job_folder / "model.json")  # fmt: skip
    assert alone.exit_code == 2 and "is a submit program" in alone.output
